#include "sim/study/influence.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinematics/numbers.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;

// Machines are computed in lots, the last one filled up, and rivals in tiles that do not depend on
// them, so that a machine has the same bits at every place in its lot.
constexpr int lot = machines_at_once;
constexpr Index tile = 512;  // rivals: their products stay in the cache

using Lot = Eigen::Array<double, lot, 1>;
using LotMatrix = Eigen::Matrix<double, lot, Eigen::Dynamic>;

/// Offsets from the base run of machines from .. from + lot - 1, a row each; beyond the last one
/// the base run itself.
LotMatrix offsets(const InfluenceMap& influence, const Eigen::MatrixXd& x, Index from) {
  LotMatrix offset = LotMatrix::Zero(lot, x.rows());
  const Index count = std::min<Index>(lot, x.cols() - from);
  offset.topRows(count) = (x.middleCols(from, count).colwise() - influence.centre).transpose();
  return offset;
}

/// Calls `visit(vertex, distances of the lot)` for every vertex that is cut, in order.
template <typename Visit>
void for_every_vertex(const InfluenceMap& influence, const LotMatrix& offset, const Visit& visit) {
  const Index n = Index(influence.first.size()) - 1;
  LotMatrix moved, shifted;
  for (Index v = 0; v < n;) {
    const Index begin = influence.first[std::size_t(v)];
    Index end_vertex = v + 1;
    while (end_vertex < n && influence.first[std::size_t(end_vertex) + 1] - begin <= tile)
      ++end_vertex;
    const Index count = influence.first[std::size_t(end_vertex)] - begin;
    moved.noalias() = offset * influence.slope.middleCols(begin, count);
    shifted.noalias() = offset * influence.shift.middleCols(begin, count);
    for (; v < end_vertex; ++v) {
      const Index last = influence.first[std::size_t(v) + 1];
      Lot least = Lot::Constant(std::numeric_limits<double>::infinity());
      for (Index r = influence.first[std::size_t(v)]; r < last; ++r) {
        const auto across = shifted.col(r - begin).array();
        least = least.min(influence.distance[r] + moved.col(r - begin).array() +
                          influence.half_curvature[r] * across * across);
      }
      if (last > influence.first[std::size_t(v)]) visit(v, least);
    }
  }
}

/// What sums over the vertices tell of a lot.
struct Sums {
  Lot low = Lot::Constant(std::numeric_limits<double>::infinity());
  Lot high = -low;
  Lot square = Lot::Zero();
  // of heights above the first vertex: a part that is far off as a whole loses no digits
  Lot level = Lot::Zero();
  Lot first_above = Lot::Zero();
  Lot square_above = Lot::Zero();
  double area = 0.0;

  void add(const Lot& height, double of_area) {
    if (area == 0.0) level = height;
    const Lot above = height - level;
    low = low.min(height);
    high = high.max(height);
    square += of_area * height.square();
    first_above += of_area * above;
    square_above += of_area * above.square();
    area += of_area;
  }

  Lot value(Response response) const {
    if (!(area > 0.0)) return Lot::Constant(none);
    const Lot mean_above = first_above / area;
    switch (response) {
      case Response::Pv:
        return high - low;
      case Response::Rms:
        return (square / area).sqrt();
      case Response::Mean:
        return level + mean_above;
      case Response::Std:
        return (square_above / area - mean_above.square()).max(0.0).sqrt();
      case Response::MaxAbs:
        return high.abs().max(low.abs());
      default:
        return Lot::Constant(none);
    }
  }
};

cutting::Surface surface_of(const InfluenceMap& influence, const Eigen::VectorXd& map) {
  const Index n = map.size();
  return {map, Eigen::VectorXd::Constant(n, none), std::vector<int>(std::size_t(n), 0),
          influence.status};
}

}  // namespace

std::size_t gouges_of(const InfluenceMap& influence) {
  return std::size_t(
      std::count(influence.status.begin(), influence.status.end(), cutting::VertexStatus::Gouged));
}

Eigen::MatrixXd maps(const InfluenceMap& influence, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd all =
      Eigen::MatrixXd::Constant(Index(influence.first.size()) - 1, x.cols(), none);
  for (Index from = 0; from < x.cols(); from += lot) {
    const Index count = std::min<Index>(lot, x.cols() - from);
    for_every_vertex(influence, offsets(influence, x, from), [&](Index v, const Lot& distance) {
      all.row(v).segment(from, count) = distance.head(count).transpose();
    });
  }
  return all;
}

bool is_counted(Response response) {
  return response == Response::P95Abs || response == Response::InTolerance || is_filtered(response);
}

Eigen::MatrixXd responses(const Study& study, const ReadyArm& ready, const InfluenceMap& influence,
                          const Eigen::MatrixXd& x) {
  Eigen::MatrixXd values(Index(study.responses.size()), x.cols());
  const bool summed = ready.job.scene.alignment == Alignment::None &&
                      std::none_of(study.responses.begin(), study.responses.end(), is_counted);
  if (!summed) {
    const Eigen::MatrixXd all = maps(influence, x);
    for (Index i = 0; i < x.cols(); ++i)
      values.col(i) =
          responses(study, ready.job, surface_of(influence, all.col(i)), ready.error_free);
    return values;
  }
  for (Index from = 0; from < x.cols(); from += lot) {
    const Index count = std::min<Index>(lot, x.cols() - from);
    Sums sums;
    for_every_vertex(influence, offsets(influence, x, from), [&](Index v, const Lot& distance) {
      sums.add(distance - influence.error_free[v], influence.design.area[v]);
    });
    for (std::size_t i = 0; i < study.responses.size(); ++i)
      values.row(Index(i)).segment(from, count) =
          sums.value(study.responses[i]).head(count).transpose();
  }
  return values;
}

Eigen::MatrixXd effects(const InfluenceMap& influence) {
  const Index n = Index(influence.first.size()) - 1;
  Eigen::MatrixXd all = Eigen::MatrixXd::Constant(influence.slope.rows(), n, none);
  for (Index v = 0; v < n; ++v)
    if (is_cut(influence, v)) all.col(v) = influence.slope.col(influence.first[std::size_t(v)]);
  return all;
}

}  // namespace abbe::sim::study
