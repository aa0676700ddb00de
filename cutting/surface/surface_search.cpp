#include "cutting/surface/surface_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

/// Number of bits of a cell number in the grid of `hilbert_code`.
constexpr int hilbert_bits = 10;
constexpr std::uint32_t hilbert_cells = 1u << hilbert_bits;  ///< cells per side

/// Returns the position of a cell along the Hilbert curve of a grid of `hilbert_cells` per side.
/// Neighbours along the curve are neighbours in space.
/// @param x, y, z  cell numbers, below `hilbert_cells`
/// @return 3 bits for each of them
/// Source: J. Skilling, Programming the Hilbert curve, AIP Conf. Proc. 707 (2004) 381.
constexpr std::uint64_t hilbert_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  constexpr std::uint32_t top = 1u << (hilbert_bits - 1);
  std::uint32_t axis[3] = {x, y, z};
  for (std::uint32_t bit = top; bit > 1; bit >>= 1) {
    const std::uint32_t below = bit - 1;
    for (std::uint32_t& a : axis) {
      if (a & bit) {
        axis[0] ^= below;
      } else {
        const std::uint32_t swapped = (axis[0] ^ a) & below;
        axis[0] ^= swapped;
        a ^= swapped;
      }
    }
  }
  axis[1] ^= axis[0];
  axis[2] ^= axis[1];
  std::uint32_t gray = 0;
  for (std::uint32_t bit = top; bit > 1; bit >>= 1)
    if (axis[2] & bit) gray ^= bit - 1;
  std::uint64_t code = 0;
  for (int bit = hilbert_bits - 1; bit >= 0; --bit)
    for (const std::uint32_t a : axis) code = (code << 1) | (((a ^ gray) >> bit) & 1u);
  return code;
}

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
    require_milled(motion.time_s[i] >= motion.time_s[i - 1], "time" + sample(i) + " decreases");
    require_milled(
        (motion.axis.row(i) + motion.axis.row(i - 1)).norm() > 1e-6,
        "axis" + sample(i) +
            " is opposite to the previous axis, so the rotation between them is undefined");
  }
}

}  // namespace

void check_design(const Design& design) {
  const Index n = design.vertices.rows();
  require_milled(design.normals.rows() == n, "the design does not have one normal per vertex");
  require_milled(design.judged.empty() || Index(design.judged.size()) == n,
                 "the design does not have one judged flag per vertex");
  // In parallel, because a design may have millions of vertices.
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

void check_milling_input(const Design& design, const Cutter& cutter, const CutterMotion& motion,
                         double band) {
  require_milled(std::isfinite(band) && band > 0, "the band is not positive and finite");
  check(cutter);
  check(motion);
  check_design(design);
}

void check_turning_input(const Design& design, double band) {
  const Index n = design.vertices.rows();
  require(design.normals.rows() == n, "design: expected one normal per vertex");
  require(design.judged.empty() || Index(design.judged.size()) == n,
          "design: expected one judged flag per vertex, or none");
  require(design.vertices.allFinite() && design.normals.allFinite(),
          "design: expected finite vertices and normals");
  require(std::isfinite(band) && band > 0.0, "band: expected a positive length");
}

void check_pass_options(const CompetingPassOptions& options) {
  require(std::isfinite(options.reach) && options.reach >= 0,
          "competing passes: expected a reach of at least 0");
  require(options.max_passes >= 1, "competing passes: expected at least one pass per vertex");
  require(std::isfinite(options.difference_step) && options.difference_step > 0,
          "competing passes: expected a positive stencil length");
}

bool is_judged(const Design& design, Index vertex) {
  return design.judged.empty() || design.judged[vertex];
}

namespace {

/// A vertex with its position along the Hilbert curve.
struct CodedVertex {
  std::uint32_t code, vertex;
};

/// Sorts stably by code: a radix sort whose digits have as many bits as a cell number.
void sort_by_code(std::vector<CodedVertex>& vertices) {
  std::vector<CodedVertex> sorted(vertices.size());
  for (int shift = 0; shift < 3 * hilbert_bits; shift += hilbert_bits) {
    std::array<std::size_t, hilbert_cells + 1> begin{};
    const auto digit = [&](const CodedVertex& vertex) {
      return (vertex.code >> shift) % hilbert_cells;
    };
    for (const CodedVertex& vertex : vertices) ++begin[digit(vertex) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    for (const CodedVertex& vertex : vertices) sorted[begin[digit(vertex)]++] = vertex;
    vertices.swap(sorted);
  }
}

}  // namespace

std::vector<Index> judged_vertices(const Design& design) {
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
  std::vector<CodedVertex> coded_vertices(judged.size());
  const auto blocks = tbb::blocked_range<std::size_t>(0, coded_vertices.size(), 4096);
  tbb::parallel_for(blocks, [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Vector3d cell = (design.vertices.row(judged[k]).transpose() - low) * (last_cell / size);
      coded_vertices[k] = {
          std::uint32_t(hilbert_code(std::uint32_t(cell.x()), std::uint32_t(cell.y()),
                                     std::uint32_t(cell.z()))),
          std::uint32_t(judged[k])};
    }
  });
  sort_by_code(coded_vertices);
  std::ranges::transform(coded_vertices, judged.begin(),
                         [](const CodedVertex& coded) { return coded.vertex; });
  return judged;
}

namespace {

/// Returns the segment of a vertex's normal from `from` to `to`, mm.
ShiftedRay normal_segment(const Design& design, Index vertex, double from, double to) {
  const Eigen::Vector3d normal = design.normals.row(vertex);
  const double shift = 0.5 * (from + to);
  return {{design.vertices.row(vertex).transpose() + shift * normal, normal, 0.5 * (to - from)},
          shift};
}

/// Returns true if a point removed below an intact skin is nearer, by a tenth, to another point of
/// the part, from where it was then cut.
bool is_cut_from_elsewhere(const Design& design, const WallThickness& thickness, Index vertex,
                           double s) {
  constexpr double nearer_fraction = 0.9;
  const Eigen::Vector3d point = design.vertices.row(vertex) + s * design.normals.row(vertex);
  return thickness.comes_within(point, nearer_fraction * std::abs(s));
}

/// The second search of a vertex whose ray starts in removed material or is not cut at all.
struct GougeSearch {
  int vertex = 0;
  bool starts_removed = false;  // the ray starts in removed material
  bool is_thin = false;    // the part is thinner than two bands, so the outer band is searched too
  double max_depth = 0.0;  // mm below the design, limit of the search
};

/// Returns the ray of a search.
ShiftedRay search_ray(const GougeSearch& search, const Design& design, double band) {
  return normal_segment(design, search.vertex, -search.max_depth, search.is_thin ? band : -band);
}

/// Result of the second search of a vertex.
struct SearchResult {
  VertexStatus status = VertexStatus::Uncut;
  FirstCut cut;
  Gouge gouge;
};

/// Decides the status of a vertex from the first cut along its ray.
SearchResult decide_status(const GougeSearch& search, const Design& design,
                           const WallThickness& thickness, double band,
                           std::optional<FirstCut> cut) {
  const auto& [vertex, starts_removed, is_thin, max_depth] = search;
  if (!cut && starts_removed && !is_thin)  // to rounding, the removed material begins at -band
    return {VertexStatus::Gouged, {-band, 0.0, 0}, {vertex, band, false}};
  if (!cut) return {};
  const ShiftedRay segment = search_ray(search, design, band);
  cut->s = cut->s <= -segment.ray.band ? -max_depth : cut->s + segment.shift;
  if (!starts_removed && is_cut_from_elsewhere(design, thickness, vertex, cut->s)) return {};
  if (is_thin && cut->s > -max_depth) return {VertexStatus::Cut, *cut, {}};
  return {VertexStatus::Gouged, *cut, {vertex, -cut->s, cut->s <= -max_depth}};
}

template <class Task>
void parallel_for_each(std::size_t count, const Task& task) {
  const auto whole_range = tbb::blocked_range<std::size_t>(0, count, 64);
  tbb::parallel_for(whole_range, [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) task(k);
  });
}

bool needs_second_search(VertexStatus status) {
  return status == VertexStatus::Uncut || status == VertexStatus::Gouged;
}

/// Returns the searches of all uncut or gouged vertices, in the order of the vertices. Omits an
/// uncut vertex of a thin part, which has no unsearched material behind it.
std::vector<GougeSearch> gouge_searches(const Surface& surface, const Design& design,
                                        const WallThickness& body, double band) {
  std::vector<GougeSearch> searches;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (needs_second_search(surface.status[i]))
      searches.push_back({int(i), surface.status[i] == VertexStatus::Gouged});
  const double max_depth = gouge_bands * band;
  parallel_for_each(searches.size(), [&](std::size_t k) {
    const int v = searches[k].vertex;
    const auto behind = body.behind(design.vertices.row(v), design.normals.row(v), 2.0 * max_depth);
    // Half way through the part, so that a thin wall machined on both sides is no gouge.
    searches[k].max_depth = behind ? 0.5 * *behind : max_depth;
    searches[k].is_thin = searches[k].max_depth <= band;
  });
  std::erase_if(searches,
                [](const GougeSearch& search) { return search.is_thin && !search.starts_removed; });
  return searches;
}

/// Returns the surface after the second search, which sets vertices to Gouged, Uncut or, where the
/// part is thin, Cut.
/// @param cuts  first cuts along the rays of the searches
Surface with_gouge_status(Surface surface, const Design& design, const WallThickness& body,
                          double band, const std::vector<GougeSearch>& searches,
                          const std::vector<std::optional<FirstCut>>& cuts) {
  std::vector<SearchResult> results(searches.size());
  parallel_for_each(searches.size(), [&](std::size_t k) {
    results[k] = decide_status(searches[k], design, body, band, cuts[k]);
  });
  for (std::size_t k = 0; k < searches.size(); ++k) {
    const Index v = searches[k].vertex;
    const SearchResult& result = results[k];
    surface.status[std::size_t(v)] = result.status;
    if (result.status == VertexStatus::Uncut) continue;
    surface.cut_time_s[v] = result.cut.time_s;
    surface.cut_line[std::size_t(v)] = result.cut.line;
    if (result.status == VertexStatus::Cut) surface.residual[v] = result.cut.s;
    if (result.status == VertexStatus::Gouged) surface.gouges.push_back(result.gouge);
  }
  return surface;
}

}  // namespace

// The thickness of the part is rarely needed and requires a tree, so it is computed on first use.
std::optional<ShiftedRay> ThinPartRays::of(Index vertex) const {
  std::call_once(once_, [&] { thickness_.emplace(design_); });
  const auto behind =
      thickness_->behind(design_.vertices.row(vertex), design_.normals.row(vertex), 2.0 * band_);
  if (!behind) return std::nullopt;
  return normal_segment(design_, vertex, -0.5 * *behind, band_);
}

Surface complete_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                        const FirstCutFunction& first_cut) {
  const FirstCutsFunction first_cuts = [&](std::size_t count,
                                           const std::function<Ray(std::size_t)>& ray) {
    std::vector<std::optional<FirstCut>> cuts(count);
    parallel_for_each(count, [&](std::size_t k) { cuts[k] = first_cut(ray(k)); });
    return cuts;
  };
  return complete_gouges(std::move(surface), design, options, first_cuts);
}

Surface complete_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                        const FirstCutsFunction& first_cuts) {
  if (std::ranges::none_of(surface.status, needs_second_search)) return surface;
  const auto body = options.body ? options.body : std::make_shared<const WallThickness>(design);
  const std::vector<GougeSearch> searches = gouge_searches(surface, design, *body, options.band);
  if (searches.empty()) return surface;
  const auto cuts = first_cuts(searches.size(), [&](std::size_t k) {
    return search_ray(searches[k], design, options.band).ray;
  });
  return with_gouge_status(std::move(surface), design, *body, options.band, searches, cuts);
}

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

void update_earliest(std::optional<FirstCut>& first, const FirstCut& cut) {
  if (!first || std::tuple(cut.s, cut.time_s) < std::tuple(first->s, first->time_s)) first = cut;
}

}  // namespace

FirstCut make_first_cut(const Removal& removal, const CutterMotion& motion) {
  const Index next = std::min<Index>(removal.move + 1, motion.tip.rows() - 1);
  const double start = motion.time_s[removal.move];
  return {removal.s, start + removal.t * (motion.time_s[next] - start), motion.line[next]};
}

std::vector<SweepTree> sweep_trees(const Cutter& cutter, const CutterMotion& motion) {
  std::vector<SweepTree> trees;
  for (const Cutter& part : convex_parts(cutter)) trees.emplace_back(part, motion);
  return trees;
}

std::optional<FirstCut> first_cut(std::span<const SweepTree> trees, const CutterMotion& motion,
                                  const Ray& ray) {
  std::optional<FirstCut> first;
  for (const SweepTree& tree : trees) {
    SweepTree::Hint hint;
    if (const std::optional<Removal> removal = tree.first_removal(ray, hint))
      update_earliest(first, make_first_cut(*removal, motion));
  }
  return first;
}

std::vector<std::optional<FirstCut>> first_cuts(std::span<const SweepTree> trees,
                                                const CutterMotion& motion, const Design& design,
                                                std::span<const Index> vertices, double band) {
  std::vector<Ray> rays;
  rays.reserve(vertices.size());
  for (const Index v : vertices)
    rays.push_back({design.vertices.row(v), design.normals.row(v), band});
  std::vector<std::optional<FirstCut>> cuts(rays.size());
  for (const SweepTree& tree : trees) {
    SweepTree::Hint hint;
    std::vector<std::optional<Removal>> removals(rays.size());
    tree.first_removals(rays, removals, hint);
    for (std::size_t i = 0; i < cuts.size(); ++i)
      if (removals[i]) update_earliest(cuts[i], make_first_cut(*removals[i], motion));
  }
  return cuts;
}

Surface uncut_surface(const Design& design, std::span<const Index> judged) {
  const Index n = design.vertices.rows();
  Surface surface{.residual = Eigen::VectorXd::Constant(n, nan),
                  .cut_time_s = Eigen::VectorXd::Constant(n, nan),
                  .cut_line = std::vector<int>(std::size_t(n), 0),
                  .status = std::vector<VertexStatus>(std::size_t(n), VertexStatus::Outside)};
  for (const Index v : judged) surface.status[std::size_t(v)] = VertexStatus::Uncut;
  return surface;
}

void record_first_cut(Surface& surface, Index vertex, const FirstCut& cut, double band) {
  VertexStatus& status = surface.status[std::size_t(vertex)];
  if (status == VertexStatus::Cut && surface.residual[vertex] <= cut.s) return;
  const bool gouged = !(cut.s > -band);
  status = gouged ? VertexStatus::Gouged : VertexStatus::Cut;
  surface.residual[vertex] = gouged ? nan : cut.s;
  surface.cut_time_s[vertex] = gouged ? nan : cut.time_s;
  surface.cut_line[std::size_t(vertex)] = gouged ? 0 : cut.line;
}

}  // namespace abbe::cutting
