#include "cutting/surface_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/hilbert.h"
#include "kinematics/require.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr double unit_tolerance = 1e-9;  // 0.5 nm on a cutter of 500 mm

void require_milled(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("milled surface: " + what);
}

std::string sample(Index i) { return " of sample " + std::to_string(i); }

bool is_unit(const Vector3d& v) { return std::abs(v.norm() - 1) <= unit_tolerance; }

void check(const Cutter& cutter) {
  const auto& [radius, corner, flank, outline] = cutter;
  require_milled(std::isfinite(radius) && radius > 0,
                 "the cutter's radius is not positive and finite");
  require_milled(corner >= 0 && corner <= radius,
                 "the corner radius is not between 0 and the radius");
  require_milled(std::isfinite(flank) && flank >= corner && flank > 0,
                 "the flank length is not positive, finite and at least the corner radius");
}

void check(const CutterMotion& motion) {
  const Index n = motion.tip.rows();
  require_milled(
      motion.axis.rows() == n && motion.time_s.size() == n && Index(motion.line.size()) == n,
      "the arrays of the motion differ in size");
  for (Index i = 0; i < n; ++i) {
    require_milled(motion.tip.row(i).allFinite() && std::isfinite(motion.time_s[i]),
                   "tip or time" + sample(i) + " is not finite");
    require_milled(is_unit(motion.axis.row(i)), "axis" + sample(i) + " is not a unit vector");
    if (i == 0) continue;
    require_milled(motion.time_s[i] >= motion.time_s[i - 1], "time" + sample(i) + " goes back");
    require_milled(
        (motion.axis.row(i) + motion.axis.row(i - 1)).norm() > 1e-6,
        "axis" + sample(i) + " is opposite to the one before, so its way is not defined");
  }
}

}  // namespace

void check_design(const Design& design) {
  const Index n = design.vertices.rows();
  require_milled(design.normals.rows() == n, "the design has not one normal a vertex");
  require_milled(design.judged.empty() || Index(design.judged.size()) == n,
                 "the design has not one judgement a vertex");
  tbb::parallel_for(tbb::blocked_range<Index>(0, n, 4096), [&](const auto& range) {
    for (Index i = range.begin(); i < range.end(); ++i) {
      if (!is_judged(design, i)) continue;
      if (!design.vertices.row(i).allFinite())
        require_milled(false, "vertex " + std::to_string(i) + " is not finite");
      if (!is_unit(design.normals.row(i)))
        require_milled(false,
                       "the normal of vertex " + std::to_string(i) + " is not a unit vector");
    }
  });
}

void check_milled(const Design& design, const Cutter& cutter, const CutterMotion& motion,
                  double band) {
  require_milled(std::isfinite(band) && band > 0, "the band is not positive and finite");
  check(cutter);
  check(motion);
  check_design(design);
}

void check_turned(const Design& design, double band) {
  const Index n = design.vertices.rows();
  require(design.normals.rows() == n, "design: expected as many normals as vertices");
  require(design.judged.empty() || Index(design.judged.size()) == n,
          "design: expected as many judged flags as vertices, or none");
  require(design.vertices.allFinite() && design.normals.allFinite(),
          "design: expected finite vertices and normals");
  require(std::isfinite(band) && band > 0.0, "band: expected a positive length");
}

void check_rivals(const RivalOptions& options) {
  require(std::isfinite(options.reach) && options.reach >= 0,
          "rivals: expected a reach of 0 or more");
  require(options.most >= 1, "rivals: expected one or more of a vertex");
  require(std::isfinite(options.stencil) && options.stencil > 0,
          "rivals: expected a positive length of the stencil");
}

bool is_judged(const Design& design, Index vertex) {
  return design.judged.empty() || design.judged[vertex];
}

namespace {

/// A vertex on its curve.
struct Place {
  std::uint32_t code, vertex;
};

/// By their codes, of equal ones as they stand: a digit of as many bits as a cell number at a time.
void sort_by_code(std::vector<Place>& places) {
  std::vector<Place> sorted(places.size());
  for (int shift = 0; shift < 3 * hilbert_bits; shift += hilbert_bits) {
    std::array<std::size_t, hilbert_cells + 1> begin{};
    const auto digit = [&](const Place& one) { return (one.code >> shift) % hilbert_cells; };
    for (const Place& one : places) ++begin[digit(one) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    for (const Place& one : places) sorted[begin[digit(one)]++] = one;
    places.swap(sorted);
  }
}

}  // namespace

std::vector<Index> judged_in_order(const Design& design) {
  std::vector<Index> judged;
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;
  for (Index i = 0; i < design.vertices.rows(); ++i) {
    if (!is_judged(design, i)) continue;
    judged.push_back(i);
    low = low.cwiseMin(design.vertices.row(i).transpose());
    high = high.cwiseMax(design.vertices.row(i).transpose());
  }
  constexpr double last_cell = hilbert_cells - 1;
  const double size = judged.empty() ? 1.0 : std::max((high - low).maxCoeff(), 1e-9);
  std::vector<Place> places(judged.size());
  const auto blocks = tbb::blocked_range<std::size_t>(0, places.size(), 4096);
  tbb::parallel_for(blocks, [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Vector3d cell = (design.vertices.row(judged[k]).transpose() - low) * (last_cell / size);
      places[k] = {std::uint32_t(hilbert_code(std::uint32_t(cell.x()), std::uint32_t(cell.y()),
                                              std::uint32_t(cell.z()))),
                   std::uint32_t(judged[k])};
    }
  });
  sort_by_code(places);
  std::ranges::transform(places, judged.begin(), [](const Place& one) { return one.vertex; });
  return judged;
}

}  // namespace abbe::cutting
