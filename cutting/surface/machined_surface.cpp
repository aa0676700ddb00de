#include "cutting/surface/machined_surface.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/surface/nose_cut.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/surface_search.h"

namespace abbe::cutting {

using Box = Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

/// Searches all judged vertices of a design, a block of neighbours at a time, then their gouges.
Surface search_milled(std::span<const SweepTree> trees, const CutterMotion& motion,
                      const Design& design_w, const SurfaceOptions& options) {
  const std::vector<Index> order = judged_vertices(design_w);
  Surface surface = uncut_surface(design_w, order);
  std::atomic<std::size_t> finished = 0;
  const auto whole_range = tbb::blocked_range<std::size_t>(0, order.size(), first_cut_block);
  tbb::parallel_for(whole_range, [&](const auto& range) {
    const std::span<const Index> vertices(&order[range.begin()], range.size());
    const auto cuts = first_cuts(trees, motion, design_w, vertices, options.band);
    for (std::size_t k = 0; k < vertices.size(); ++k)
      if (cuts[k]) record_first_cut(surface, vertices[k], *cuts[k], options.band);
    const std::size_t finished_count = finished += range.size();
    if (options.progress) options.progress(double(finished_count) / double(order.size()));
  });
  return complete_gouges(std::move(surface), design_w, options,
                         [&](const Ray& ray) { return first_cut(trees, motion, ray); });
}

}  // namespace

std::function<Surface(const Design& design_w)> prepare_milled_surface(
    const Cutter& cutter, const CutterMotion& motion, const SurfaceOptions& options) {
  check_milling_input(Design{}, cutter, motion, options.band);
  const auto trees = std::make_shared<const std::vector<SweepTree>>(sweep_trees(cutter, motion));
  return [trees, &motion, options](const Design& design_w) {
    check_design(design_w);
    return search_milled(*trees, motion, design_w, options);
  };
}

Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options) {
  check_milling_input(design_w, cutter, motion, options.band);
  return search_milled(sweep_trees(cutter, motion), motion, design_w, options);
}

namespace {

Surface search_turned(const NoseCutSearch& cut_search, const Design& design_w,
                      const SurfaceOptions& options) {
  const Eigen::Index n = design_w.vertices.rows();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Surface surface{Eigen::VectorXd::Constant(n, nan), Eigen::VectorXd::Constant(n, nan),
                  std::vector<int>(std::size_t(n), 0),
                  std::vector<VertexStatus>(std::size_t(n), VertexStatus::Uncut)};
  const auto search_vertex = [&](Eigen::Index v) {
    const auto k = std::size_t(v);
    if (!is_judged(design_w, v)) {
      surface.status[k] = VertexStatus::Outside;
      return;
    }
    const std::optional<NoseCut> cut =
        cut_search.first({design_w.vertices.row(v), design_w.normals.row(v), options.band});
    if (!cut) return;
    if (cut->s <= -options.band) {
      surface.status[k] = VertexStatus::Gouged;
      return;
    }
    surface.residual[v] = cut->s;
    surface.cut_time_s[v] = cut->time_s;
    surface.cut_line[k] = cut->line;
    surface.status[k] = VertexStatus::Cut;
  };
  std::atomic<Eigen::Index> finished_count = 0;
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, n, 256),
                    [&](const tbb::blocked_range<Eigen::Index>& range) {
                      for (Eigen::Index v = range.begin(); v != range.end(); ++v) search_vertex(v);
                      finished_count += range.size();
                      if (options.progress) options.progress(double(finished_count) / double(n));
                    });
  return complete_gouges(std::move(surface), design_w, options,
                         [&](const Ray& ray) -> std::optional<FirstCut> {
                           const std::optional<NoseCut> cut = cut_search.first(ray);
                           if (!cut) return std::nullopt;
                           return FirstCut{cut->s, cut->time_s, cut->line};
                         });
}

}  // namespace

std::function<Surface(const Design& design_w)> prepare_turned_surface(
    const Nose& nose, const NoseMotion& motion, const SurfaceOptions& options) {
  const auto cut_search = std::make_shared<const NoseCutSearch>(nose, motion);
  return [cut_search, options](const Design& design_w) {
    check_turning_input(design_w, options.band);
    return search_turned(*cut_search, design_w, options);
  };
}

Surface turned_surface(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                       const SurfaceOptions& options) {
  check_turning_input(design_w, options.band);
  return search_turned(NoseCutSearch(nose, motion), design_w, options);
}

namespace {

/// The arguments of streamed_surface that all steps need.
struct StreamArguments {
  const Design& design;
  const Cutter& cutter;
  const SurfaceOptions& options;
};

bool continues(const CutterMotion& first, const CutterMotion& second) {
  const Index end = first.tip.rows() - 1;
  return first.tip.row(end) == second.tip.row(0) && first.axis.row(end) == second.axis.row(0) &&
         first.time_s[end] == second.time_s[0];
}

/// Returns a motion that consists of the last sample.
CutterMotion last_sample(const CutterMotion& motion) {
  const Index last = motion.tip.rows() - 1;
  return {motion.tip.row(last),
          motion.axis.row(last),
          motion.time_s.tail(1),
          {motion.line[std::size_t(last)]}};
}

/// Checks a block; the error message gives the number of the block.
void check_block(const StreamArguments& arguments, const CutterMotion& motion,
                 const std::optional<CutterMotion>& previous, int block_number) {
  const auto throw_input_error = [&](const std::string& message) {
    throw std::invalid_argument(
        fmt::format("{}, in block {} of the motion", message, block_number));
  };
  try {
    check_milling_input(Design{}, arguments.cutter, motion, arguments.options.band);
  } catch (const std::invalid_argument& error) {
    throw_input_error(error.what());
  }
  if (motion.tip.rows() == 0) throw_input_error("milled surface: the motion has no samples");
  if (previous && !continues(*previous, motion))
    throw_input_error(
        "milled surface: the first sample is not the last sample of the previous block");
}

/// Calls `visit` for every block that moves. A block of a single sample, which cuts as well, is
/// visited only if the motion has no other.
template <class Visitor>
void visit_blocks(const StreamArguments& arguments, const MotionBlocks& next_block,
                  const Visitor& visit) {
  std::optional<CutterMotion> previous;
  bool has_motion = false;
  int block_number = 1;
  while (const std::optional<MotionBlock> block = next_block()) {
    check_block(arguments, block->motion, previous, block_number++);
    previous = last_sample(block->motion);
    if (block->motion.tip.rows() == 1) continue;
    has_motion = true;
    visit(*block);
  }
  if (previous && !has_motion) visit(MotionBlock{std::move(*previous), 1.0});
}

/// Returns a box that contains the cutter during a block. Between two samples the distance of a
/// point of the cutter from the line between its two positions is at most that of an arc from its
/// chord.
Box reach_box(const Cutter& cutter, const CutterMotion& motion) {
  constexpr double margin = 1e-6;  // mm, far above the rounding of coordinates of 1 m
  Box box;
  double max_squared_chord = 0.0;
  for (Index i = 0; i < motion.tip.rows(); ++i) {
    const Vector3d tip = motion.tip.row(i), axis = motion.axis.row(i);
    // Half extents, along the coordinate axes, of a disc of the cutter's radius across the tool
    // axis.
    const Vector3d half_extent =
        cutter.radius * (1.0 - axis.array().square()).max(0.0).sqrt().matrix();
    for (const Vector3d& end : {tip, Vector3d(tip + cutter.flank_length * axis)}) {
      box.extend(end - half_extent);
      box.extend(end + half_extent);
    }
    if (i > 0)
      max_squared_chord =
          std::max(max_squared_chord, (motion.axis.row(i) - motion.axis.row(i - 1)).squaredNorm());
  }
  const double max_distance = std::hypot(cutter.radius, cutter.flank_length);
  const double arc =
      max_distance * (1.0 - std::sqrt(std::max(0.0, 1.0 - 0.25 * max_squared_chord)));
  box.min().array() -= arc + margin;
  box.max().array() += arc + margin;
  return box;
}

bool can_meet(const Box& reach, const Ray& ray) {
  return reach.squaredExteriorDistance(ray.point) <= ray.band * ray.band;
}

/// A block of neighbouring vertices and the bounding box of their rays.
struct VertexBlock {
  std::span<const Index> vertices;
  Box rays;
};

std::vector<VertexBlock> vertex_blocks(const std::vector<Index>& order,
                                       const StreamArguments& arguments) {
  std::vector<VertexBlock> blocks;
  for (std::size_t begin = 0; begin < order.size(); begin += first_cut_block) {
    const std::size_t count = std::min(first_cut_block, order.size() - begin);
    VertexBlock block{{&order[begin], count}, {}};
    for (const Index v : block.vertices)
      block.rays.extend(arguments.design.vertices.row(v).transpose());
    block.rays.min().array() -= arguments.options.band;
    block.rays.max().array() += arguments.options.band;
    blocks.push_back(block);
  }
  return blocks;
}

/// Records the first cuts of a block of the motion. Skips the vertex blocks that the cutter does
/// not reach; if the motion block is short relative to the part, these are most of them.
void record_first_cuts(const StreamArguments& arguments, const CutterMotion& motion,
                       const std::vector<VertexBlock>& blocks, Surface& surface) {
  const std::vector<SweepTree> trees = sweep_trees(arguments.cutter, motion);
  const Box reach = reach_box(arguments.cutter, motion);
  const double band = arguments.options.band;
  tbb::parallel_for(std::size_t(0), blocks.size(), [&](std::size_t i) {
    if (!blocks[i].rays.intersects(reach)) return;
    std::vector<Index> open;
    for (const Index v : blocks[i].vertices)
      // No cut within the band precedes a gouge.
      if (surface.status[std::size_t(v)] != VertexStatus::Gouged) open.push_back(v);
    const auto cuts = first_cuts(trees, motion, arguments.design, open, band);
    for (std::size_t k = 0; k < open.size(); ++k)
      if (cuts[k]) record_first_cut(surface, open[k], *cuts[k], band);
  });
}

/// Returns the first cuts along rays; of equal cuts that of the earlier block.
std::vector<std::optional<FirstCut>> first_cuts_of_motion(
    const StreamArguments& arguments, const MotionBlocks& next_block, std::size_t count,
    const std::function<Ray(std::size_t)>& ray_at) {
  std::vector<std::optional<FirstCut>> cuts(count);
  visit_blocks(arguments, next_block, [&](const MotionBlock& block) {
    const std::vector<SweepTree> trees = sweep_trees(arguments.cutter, block.motion);
    const Box reach = reach_box(arguments.cutter, block.motion);
    const auto whole_range = tbb::blocked_range<std::size_t>(0, count, 64);
    tbb::parallel_for(whole_range, [&](const auto& range) {
      for (std::size_t k = range.begin(); k < range.end(); ++k) {
        const Ray ray = ray_at(k);
        if (cuts[k] && cuts[k]->s <= -ray.band) continue;
        if (!can_meet(reach, ray)) continue;
        const std::optional<FirstCut> cut = first_cut(trees, block.motion, ray);
        if (cut && (!cuts[k] || cut->s < cuts[k]->s)) cuts[k] = cut;
      }
    });
  });
  return cuts;
}

}  // namespace

// Reads the motion up to twice: for the first cuts within the band, then for the depths of gouges.
Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options) {
  const StreamArguments arguments{design_w, cutter, options};
  check_milling_input(design_w, cutter, CutterMotion{}, options.band);
  const std::vector<Index> order = judged_vertices(design_w);
  const std::vector<VertexBlock> blocks = vertex_blocks(order, arguments);
  Surface surface = uncut_surface(design_w, order);
  visit_blocks(arguments, begin(), [&](const MotionBlock& block) {
    record_first_cuts(arguments, block.motion, blocks, surface);
    if (options.progress) options.progress(block.finished);
  });
  const FirstCutsFunction first_cuts = [&](std::size_t count,
                                           const std::function<Ray(std::size_t)>& ray) {
    return first_cuts_of_motion(arguments, begin(), count, ray);
  };
  return complete_gouges(std::move(surface), design_w, options, first_cuts);
}

namespace {

/// Returns 1 at those requested vertices at which the tool removes the material at -band itself,
/// and not only deeper. Another tool cuts them within the band, and this tool gouges them.
std::vector<std::uint8_t> removed_at_band(const Design& design, const SurfaceFunction& tool,
                                          const std::vector<std::uint8_t>& requested, double band) {
  constexpr double touch_band = 1e-6;  // mm, band of the search at the displaced vertices
  Design displaced = design;
  // Without triangles nothing behind the vertices limits the rays.
  displaced.triangles.resize(0, 3);
  displaced.vertices -= band * design.normals;
  displaced.judged = requested;
  const Surface surface = tool(displaced, touch_band);
  std::vector<std::uint8_t> removed(requested.size(), 0);
  for (std::size_t i = 0; i < removed.size(); ++i)
    removed[i] =
        surface.status[i] == VertexStatus::Cut || surface.status[i] == VertexStatus::Gouged;
  return removed;
}

bool is_earlier(const Surface& a, const Surface& b, Index v) {
  if (a.residual[v] != b.residual[v]) return a.residual[v] < b.residual[v];
  return a.cut_time_s[v] < b.cut_time_s[v];
}

/// Returns the deepest cuts within the band by all tools, without gouges; of equal cuts the
/// earliest.
Surface min_cuts(const std::vector<Surface>& surfaces) {
  Surface result = surfaces.front();
  result.gouges.clear();
  for (VertexStatus& status : result.status)
    if (status == VertexStatus::Gouged) status = VertexStatus::Uncut;
  for (const Surface& surface : surfaces)
    for (std::size_t i = 0; i < surface.status.size(); ++i) {
      const auto v = Index(i);
      if (surface.status[i] != VertexStatus::Cut) continue;
      if (result.status[i] == VertexStatus::Cut && !is_earlier(surface, result, v)) continue;
      result.residual[v] = surface.residual[v];
      result.cut_time_s[v] = surface.cut_time_s[v];
      result.cut_line[i] = surface.cut_line[i];
      result.status[i] = VertexStatus::Cut;
    }
  return result;
}

/// Returns 1 for each vertex that is gouged although a tool cuts it within the band.
std::vector<std::uint8_t> gouged_cuts(const Design& design,
                                      const std::vector<SurfaceFunction>& tools,
                                      const std::vector<Surface>& surfaces, const Surface& cuts,
                                      double band) {
  std::vector<std::uint8_t> is_gouged(cuts.status.size(), 0);
  for (std::size_t k = 0; k < tools.size(); ++k) {
    std::vector<std::uint8_t> requested(cuts.status.size(), 0);
    for (const Gouge& gouge : surfaces[k].gouges)
      requested[std::size_t(gouge.vertex)] =
          cuts.status[std::size_t(gouge.vertex)] == VertexStatus::Cut;
    if (std::find(requested.begin(), requested.end(), 1) == requested.end()) continue;
    const std::vector<std::uint8_t> removed = removed_at_band(design, tools[k], requested, band);
    for (std::size_t i = 0; i < is_gouged.size(); ++i) is_gouged[i] |= removed[i];
  }
  return is_gouged;
}

/// Sets a vertex to Gouged and keeps the deepest of its gouges.
void add_gouge(Surface& result, std::map<int, Gouge>& gouges, const Surface& surface,
               const Gouge& gouge) {
  const auto [entry, is_new] = gouges.emplace(gouge.vertex, gouge);
  if (!is_new && gouge.depth <= entry->second.depth) return;
  entry->second = gouge;
  result.status[std::size_t(gouge.vertex)] = VertexStatus::Gouged;
  result.residual[gouge.vertex] = std::numeric_limits<double>::quiet_NaN();
  result.cut_time_s[gouge.vertex] = surface.cut_time_s[gouge.vertex];
  result.cut_line[std::size_t(gouge.vertex)] = surface.cut_line[std::size_t(gouge.vertex)];
}

}  // namespace

Surface combined_surface(const Design& design_w, const std::vector<SurfaceFunction>& tools,
                         double band) {
  std::vector<Surface> surfaces;
  for (const SurfaceFunction& tool : tools) surfaces.push_back(tool(design_w, band));
  const Surface cuts = min_cuts(surfaces);
  const std::vector<std::uint8_t> is_gouged = gouged_cuts(design_w, tools, surfaces, cuts, band);
  Surface result = cuts;
  std::map<int, Gouge> gouges;
  for (const Surface& surface : surfaces)
    for (const Gouge& gouge : surface.gouges) {
      const auto v = std::size_t(gouge.vertex);
      if (cuts.status[v] != VertexStatus::Cut || is_gouged[v])
        add_gouge(result, gouges, surface, gouge);
    }
  for (const auto& [vertex, gouge] : gouges) result.gouges.push_back(gouge);
  return result;
}

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double slack = 0.02;  // fraction of the corner's radius R
// Slope, mm per mm, of the corner's round at the distance slack R from its lowest point.
constexpr double min_rise = slack;
// Height of the round at that distance, as a fraction of R: min_rise^2 / 2.
constexpr double min_leftover = 0.5 * slack * slack;

/// The vertices that share an edge or a seam with each vertex, concatenated.
struct MeshNeighbours {
  std::vector<int> first;  // (n + 1)
  std::vector<int> vertex;
};

MeshNeighbours mesh_neighbours(const Design& design) {
  MeshNeighbours result{std::vector<int>(std::size_t(design.vertices.rows()) + 1, 0), {}};
  const auto visit_pairs = [&](const auto& visit) {
    for (const auto& triangle : design.triangles.rowwise())
      for (int k = 0; k < 3; ++k) {  // an edge of the border has one triangle, so both directions
                                     // are listed
        visit(triangle[k], triangle[(k + 1) % 3]);
        visit(triangle[(k + 1) % 3], triangle[k]);
      }
    for (const auto& [a, b] : design.seams) {
      visit(a, b);
      visit(b, a);
    }
  };
  visit_pairs([&](int from, int) { ++result.first[std::size_t(from) + 1]; });
  for (std::size_t i = 1; i < result.first.size(); ++i) result.first[i] += result.first[i - 1];
  result.vertex.resize(std::size_t(result.first.back()));
  std::vector<int> next_slot(result.first.begin(), result.first.end() - 1);
  visit_pairs(
      [&](int from, int to) { result.vertex[std::size_t(next_slot[std::size_t(from)]++)] = to; });
  return result;
}

}  // namespace

std::vector<std::uint8_t> corner_leftover(const Design& design, const Surface& surface,
                                          const WallThickness& part, double radius) {
  std::vector<std::uint8_t> is_leftover(surface.status.size(), 0);
  if (!(radius > 0.0)) return is_leftover;
  tbb::parallel_for(std::size_t(0), is_leftover.size(), [&](std::size_t i) {
    const auto v = Index(i);
    // With less than a quarter of `min_leftover` left, a query of the part is not needed.
    if (surface.status[i] != VertexStatus::Cut ||
        !(surface.residual[v] > 0.25 * min_leftover * radius))
      return;
    const Vector3d centre = design.vertices.row(v) + radius * design.normals.row(v);
    is_leftover[i] = part.comes_within(centre, (1.0 - slack) * radius);
  });
  return is_leftover;
}

std::vector<std::uint8_t> lead_out_leftover(const Design& design, const Surface& surface,
                                            double radius,
                                            const std::vector<std::uint8_t>& start_flags) {
  const std::size_t n = surface.status.size();
  if (std::size_t(design.vertices.rows()) != n || start_flags.size() != n)
    throw std::invalid_argument("lead-out: expected one status and one flag for each vertex");
  std::vector<int> stack;
  for (std::size_t i = 0; i < n; ++i)
    if (start_flags[i] || surface.status[i] == VertexStatus::Uncut) stack.push_back(int(i));
  std::vector<std::uint8_t> is_leftover(n, 0);
  if (stack.empty()) return is_leftover;
  const MeshNeighbours adjacency = mesh_neighbours(design);
  const auto height = [&](int v) {
    return surface.status[std::size_t(v)] == VertexStatus::Uncut ? infinity : surface.residual[v];
  };
  // Flood fill downhill along the edges, from the uncut vertices and the start vertices.
  while (!stack.empty()) {
    const int from = stack.back();
    stack.pop_back();
    for (int k = adjacency.first[std::size_t(from)]; k < adjacency.first[std::size_t(from) + 1];
         ++k) {
      const int to = adjacency.vertex[std::size_t(k)];
      const auto to_index = std::size_t(to);
      if (is_leftover[to_index] || start_flags[to_index] ||
          surface.status[to_index] != VertexStatus::Cut)
        continue;
      const double length = (design.vertices.row(from) - design.vertices.row(to)).norm();
      const double height_difference = height(from) - surface.residual[to];
      if (!(height_difference >= min_rise * length) ||
          !(surface.residual[to] > min_leftover * radius))
        continue;
      is_leftover[to_index] = 1;
      stack.push_back(to);
    }
  }
  return is_leftover;
}

}  // namespace abbe::cutting
