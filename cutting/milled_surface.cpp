#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "cutting/hilbert.h"
#include "cutting/surface.h"
#include "cutting/sweep_tree.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr double unit_tolerance = 1e-9;  // 0.5 nm on a cutter of 500 mm
constexpr int block_size = 512;          // vertices that share their hints

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("milled surface: " + what);
}

std::string sample(Index i) { return " of sample " + std::to_string(i); }

bool is_unit(const Vector3d& v) { return std::abs(v.norm() - 1) <= unit_tolerance; }

void check(const Cutter& cutter) {
  const auto& [radius, corner, flank] = cutter;
  require(std::isfinite(radius) && radius > 0, "the cutter's radius is not positive and finite");
  require(corner >= 0 && corner <= radius, "the corner radius is not between 0 and the radius");
  require(std::isfinite(flank) && flank >= corner && flank > 0,
          "the flank length is not positive, finite and at least the corner radius");
}

void check(const CutterMotion& motion) {
  const Index n = motion.tip.rows();
  require(motion.axis.rows() == n && motion.time_s.size() == n && Index(motion.line.size()) == n,
          "the arrays of the motion differ in size");
  for (Index i = 0; i < n; ++i) {
    require(motion.tip.row(i).allFinite() && std::isfinite(motion.time_s[i]),
            "tip or time" + sample(i) + " is not finite");
    require(is_unit(motion.axis.row(i)), "axis" + sample(i) + " is not a unit vector");
    if (i == 0) continue;
    require(motion.time_s[i] >= motion.time_s[i - 1], "time" + sample(i) + " goes back");
    require((motion.axis.row(i) + motion.axis.row(i - 1)).norm() > 1e-6,
            "axis" + sample(i) + " is opposite to the one before, so its way is not defined");
  }
}

bool is_judged(const Design& design, Index i) { return design.judged.empty() || design.judged[i]; }

void check(const Design& design) {
  const Index n = design.vertices.rows();
  require(design.normals.rows() == n, "the design has not one normal a vertex");
  require(design.judged.empty() || Index(design.judged.size()) == n,
          "the design has not one judgement a vertex");
  for (Index i = 0; i < n; ++i) {
    if (!is_judged(design, i)) continue;
    require(design.vertices.row(i).allFinite(), "vertex " + std::to_string(i) + " is not finite");
    require(is_unit(design.normals.row(i)),
            "the normal of vertex " + std::to_string(i) + " is not a unit vector");
  }
}

/// The judged vertices along a space-filling curve, so that neighbours in the order have
/// neighbouring removals.
std::vector<Index> judged_in_order(const Design& design) {
  std::vector<Index> order;
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;
  for (Index i = 0; i < design.vertices.rows(); ++i) {
    if (!is_judged(design, i)) continue;
    order.push_back(i);
    low = low.cwiseMin(design.vertices.row(i).transpose());
    high = high.cwiseMax(design.vertices.row(i).transpose());
  }
  const double size = order.empty() ? 1.0 : std::max((high - low).maxCoeff(), 1e-9);
  std::vector<std::uint64_t> code(design.vertices.rows());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), 4096), [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Vector3d cell =
          (design.vertices.row(order[k]).transpose() - low) * (65535.0 / size);
      code[order[k]] = hilbert_code(std::uint32_t(cell.x()), std::uint32_t(cell.y()),
                                    std::uint32_t(cell.z()));
    }
  });
  tbb::parallel_sort(order.begin(), order.end(), [&](Index a, Index b) {
    return code[a] != code[b] ? code[a] < code[b] : a < b;
  });
  return order;
}

void record(Surface& surface, Index i, const Removal& removal, const CutterMotion& motion) {
  const Index next = std::min<Index>(removal.move + 1, motion.tip.rows() - 1);
  const double start = motion.time_s[removal.move];
  surface.residual[i] = removal.s;
  surface.cut_time_s[i] = start + removal.t * (motion.time_s[next] - start);
  surface.cut_line[i] = motion.line[next];
  surface.status[i] = VertexStatus::Cut;
}

}  // namespace

Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options) {
  require(std::isfinite(options.band) && options.band > 0, "the band is not positive and finite");
  check(cutter);
  check(motion);
  check(design_w);

  const Index n = design_w.vertices.rows();
  const double none = std::numeric_limits<double>::quiet_NaN();
  Surface surface{.residual = Eigen::VectorXd::Constant(n, none),
                  .cut_time_s = Eigen::VectorXd::Constant(n, none),
                  .cut_line = std::vector<int>(n, 0),
                  .status = std::vector<VertexStatus>(n, VertexStatus::Outside)};
  const std::vector<Index> order = judged_in_order(design_w);
  for (const Index i : order) surface.status[i] = VertexStatus::Uncut;

  const SweepTree tree(cutter, motion);
  std::atomic<std::size_t> finished = 0;
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), block_size);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    SweepTree::Hint hint;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Index i = order[k];
      const Ray ray{design_w.vertices.row(i), design_w.normals.row(i), options.band};
      const std::optional<Removal> removal = tree.first_removal(ray, hint);
      if (removal && removal->s > -options.band) record(surface, i, *removal, motion);
    }
    const std::size_t done = finished += range.size();
    if (options.progress) options.progress(double(done) / double(order.size()));
  });
  return surface;
}

}  // namespace abbe::cutting
