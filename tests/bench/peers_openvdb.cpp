#include <algorithm>
#include <cmath>

#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "tests/bench/peers.h"

namespace abbe::bench {
namespace {

using Eigen::Vector3d;
using openvdb::FloatGrid;
using Leaves = openvdb::tree::LeafManager<openvdb::FloatTree>;

constexpr double band_voxels = 3.0;  // to either side of the design, as usual for level sets

struct Pose {
  Vector3d tip, axis;
};

/// Distance from a cutter, exact outside it: its corner circle's disc and all above, rounded.
double distance(const cutting::Cutter& cutter, const Pose& pose, const Vector3d& p) {
  const Vector3d from = p - pose.tip;
  const double z = from.dot(pose.axis);
  const double rho = (from - z * pose.axis).norm();
  const double out = std::max(0.0, rho - (cutter.radius - cutter.corner_radius));
  const double under = std::max(0.0, cutter.corner_radius - z);
  return std::hypot(out, under) - cutter.corner_radius;
}

/// A stretch of the motion that is evaluated at once: a capsule, or one pose.
struct Piece {
  Pose pose;
  Vector3d step;  // of the tip; zero for one pose
};

double distance(const cutting::Cutter& cutter, const Piece& piece, const Vector3d& p) {
  const double length = piece.step.squaredNorm();
  const Vector3d centre = piece.pose.tip + cutter.corner_radius * piece.pose.axis;
  if (length == 0.0) return distance(cutter, piece.pose, p);
  const double u = std::clamp((p - centre).dot(piece.step) / length, 0.0, 1.0);
  return (p - centre - u * piece.step).norm() - cutter.radius;
}

std::vector<Piece> pieces_of(const PeerTask& task, double voxel) {
  const auto& [tip, axis, time_s, line] = task.motion;
  const bool ball = task.cutter.corner_radius == task.cutter.radius;
  std::vector<Piece> pieces;
  for (Eigen::Index i = 0; i + 1 < tip.rows(); ++i) {
    const Vector3d from = tip.row(i), step = tip.row(i + 1) - tip.row(i);
    const Vector3d axis_from = axis.row(i), axis_to = axis.row(i + 1);
    if (ball) {
      pieces.push_back({{from, axis_from}, step});
      continue;
    }
    const int poses = int(std::ceil(step.norm() / voxel));
    for (int k = 0; k < poses; ++k) {
      const double u = (k + 0.5) / poses;
      pieces.push_back(
          {{from + u * step, ((1 - u) * axis_from + u * axis_to).normalized()}, Vector3d::Zero()});
    }
  }
  return pieces;
}

/// Pieces by the squares of 2 mm above which their tips begin.
class PieceMap {
 public:
  PieceMap(const std::vector<Piece>& pieces, const cutting::Cutter& cutter)
      : reach_(int(std::ceil((cutter.radius + 2.0) / square))) {
    for (const Piece& piece : pieces) {
      const auto [i, j] = cell(piece.pose.tip);
      wide_ = std::max(wide_, i + 1);
      high_ = std::max(high_, j + 1);
    }
    of_.resize(std::size_t(wide_) * std::size_t(high_));
    for (std::size_t k = 0; k < pieces.size(); ++k) {
      const auto [i, j] = cell(pieces[k].pose.tip);
      of_[std::size_t(j * wide_ + i)].push_back(int(k));
    }
  }

  template <class Visit>
  void near(const Vector3d& p, const Visit& visit) const {
    const auto [i, j] = cell(p);
    for (int y = std::max(0, j - reach_); y <= std::min(high_ - 1, j + reach_); ++y)
      for (int x = std::max(0, i - reach_); x <= std::min(wide_ - 1, i + reach_); ++x)
        for (const int k : of_[std::size_t(y * wide_ + x)]) visit(k);
  }

 private:
  static constexpr double square = 2.0;  // mm
  static std::pair<int, int> cell(const Vector3d& p) {
    return {int(std::max(0.0, p.x() / square + 8)), int(std::max(0.0, p.y() / square + 8))};
  }
  int reach_, wide_ = 0, high_ = 0;
  std::vector<std::vector<int>> of_;
};

/// Voxels about the design, all of them outside any tool.
FloatGrid::Ptr band_about(const cutting::Design& design, double voxel) {
  const FloatGrid::Ptr grid = FloatGrid::create(float(band_voxels * voxel));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  FloatGrid::Accessor accessor = grid->getAccessor();
  for (Eigen::Index v = 0; v < design.vertices.rows(); ++v) {
    const Vector3d p = design.vertices.row(v) / voxel;
    for (int i = -1; i <= 2; ++i)
      for (int j = -1; j <= 2; ++j)
        for (int k = -int(band_voxels); k <= int(band_voxels) + 1; ++k)
          accessor.setValueOn(
              {int(std::floor(p.x())) + i, int(std::floor(p.y())) + j, int(std::floor(p.z())) + k});
  }
  return grid;
}

void fill(FloatGrid& grid, const PeerTask& task, double voxel) {
  const std::vector<Piece> pieces = pieces_of(task, voxel);
  const PieceMap map(pieces, task.cutter);
  const double half_leaf = 0.5 * std::sqrt(3.0) * 7 * voxel;
  Leaves leaves(grid.tree());
  tbb::parallel_for(leaves.leafRange(), [&](const Leaves::LeafRange& range) {
    std::vector<int> close;
    for (auto leaf = range.begin(); leaf; ++leaf) {
      const openvdb::Coord origin = leaf->origin();
      const Vector3d middle =
          voxel * Vector3d(origin.x() + 3.5, origin.y() + 3.5, origin.z() + 3.5);
      close.clear();
      map.near(middle, [&](int k) {
        if (distance(task.cutter, pieces[std::size_t(k)], middle) < band_voxels * voxel + half_leaf)
          close.push_back(k);
      });
      for (auto value = leaf->beginValueOn(); value; ++value) {
        const openvdb::Coord at = value.getCoord();
        const Vector3d p = voxel * Vector3d(at.x(), at.y(), at.z());
        double least = band_voxels * voxel;
        for (const int k : close)
          least = std::min(least, distance(task.cutter, pieces[std::size_t(k)], p));
        value.setValue(float(least));
      }
    }
  });
}

}  // namespace

std::optional<Deviations> openvdb_deviations(const PeerTask& task, double voxel) {
  openvdb::initialize();
  const FloatGrid::Ptr grid = band_about(task.design, voxel);
  fill(*grid, task, voxel);
  Deviations found(std::size_t(task.design.vertices.rows()));
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, found.size(), 4096), [&](const auto& range) {
    const FloatGrid::ConstAccessor accessor = grid->getConstAccessor();
    const openvdb::tools::GridSampler<FloatGrid::ConstAccessor, openvdb::tools::BoxSampler> sampler(
        accessor, grid->transform());
    const auto field = [&](const Vector3d& p) {
      return double(sampler.wsSample({p.x(), p.y(), p.z()}));
    };
    for (std::size_t v = range.begin(); v < range.end(); ++v)
      found[v] = material_end(field, task.design, Eigen::Index(v), 0.5 * voxel);
  });
  return found;
}

}  // namespace abbe::bench
