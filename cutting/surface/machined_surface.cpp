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

// Searches all judged vertices of a design, a block of neighbours at a time, then their gouges.
Surface searched(std::span<const SweepTree> trees, const CutterMotion& motion,
                 const Design& design_w, const SurfaceOptions& options) {
  const std::vector<Index> order = judged_along_curve(design_w);
  Surface surface = uncut_surface(design_w, order);
  std::atomic<std::size_t> finished = 0;
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), first_cut_block);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    const std::span<const Index> vertices(&order[range.begin()], range.size());
    const auto cuts = first_cuts(trees, motion, design_w, vertices, options.band);
    for (std::size_t k = 0; k < vertices.size(); ++k)
      if (cuts[k]) keep_first(surface, vertices[k], *cuts[k], options.band);
    const std::size_t done = finished += range.size();
    if (options.progress) options.progress(double(done) / double(order.size()));
  });
  return with_gouge_depths(std::move(surface), design_w, options,
                           [&](const Ray& ray) { return first_cut(trees, motion, ray); });
}

}  // namespace

std::function<Surface(const Design& design_w)> milled_search(const Cutter& cutter,
                                                             const CutterMotion& motion,
                                                             const SurfaceOptions& options) {
  check_milled(Design{}, cutter, motion, options.band);
  const auto trees = std::make_shared<const std::vector<SweepTree>>(sweep_trees(cutter, motion));
  return [trees, &motion, options](const Design& design_w) {
    check_design(design_w);
    return searched(*trees, motion, design_w, options);
  };
}

Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options) {
  check_milled(design_w, cutter, motion, options.band);
  return searched(sweep_trees(cutter, motion), motion, design_w, options);
}

namespace {

Surface searched_by_nose(const NoseCutSearch& swept, const Design& design_w,
                         const SurfaceOptions& options) {
  const Eigen::Index n = design_w.vertices.rows();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Surface surface{Eigen::VectorXd::Constant(n, nan), Eigen::VectorXd::Constant(n, nan),
                  std::vector<int>(std::size_t(n), 0),
                  std::vector<VertexStatus>(std::size_t(n), VertexStatus::Uncut)};
  const auto cut_vertex = [&](Eigen::Index v) {
    const auto k = std::size_t(v);
    if (!is_judged(design_w, v)) {
      surface.status[k] = VertexStatus::Outside;
      return;
    }
    const std::optional<NoseCut> cut =
        swept.first({design_w.vertices.row(v), design_w.normals.row(v), options.band});
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
  std::atomic<Eigen::Index> done = 0;
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, n, 256),
                    [&](const tbb::blocked_range<Eigen::Index>& range) {
                      for (Eigen::Index v = range.begin(); v != range.end(); ++v) cut_vertex(v);
                      done += range.size();
                      if (options.progress) options.progress(double(done) / double(n));
                    });
  return with_gouge_depths(std::move(surface), design_w, options,
                           [&](const Ray& ray) -> std::optional<FirstCut> {
                             const std::optional<NoseCut> cut = swept.first(ray);
                             if (!cut) return std::nullopt;
                             return FirstCut{cut->s, cut->time_s, cut->line};
                           });
}

}  // namespace

std::function<Surface(const Design& design_w)> turned_search(const Nose& nose,
                                                             const NoseMotion& motion,
                                                             const SurfaceOptions& options) {
  const auto swept = std::make_shared<const NoseCutSearch>(nose, motion);
  return [swept, options](const Design& design_w) {
    check_turned(design_w, options.band);
    return searched_by_nose(*swept, design_w, options);
  };
}

Surface turned_surface(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                       const SurfaceOptions& options) {
  check_turned(design_w, options.band);
  return searched_by_nose(NoseCutSearch(nose, motion), design_w, options);
}

namespace {

// The arguments of streamed_surface that all steps need.
struct StreamedVertices {
  const Design& design;
  const Cutter& cutter;
  const SurfaceOptions& options;
};

bool ends_where(const CutterMotion& first, const CutterMotion& second) {
  const Index last = first.tip.rows() - 1;
  return first.tip.row(last) == second.tip.row(0) && first.axis.row(last) == second.axis.row(0) &&
         first.time_s[last] == second.time_s[0];
}

/// Returns the last sample of a motion as a motion of its own.
CutterMotion end_of(const CutterMotion& motion) {
  const Index last = motion.tip.rows() - 1;
  return {motion.tip.row(last),
          motion.axis.row(last),
          motion.time_s.tail(1),
          {motion.line[std::size_t(last)]}};
}

// Blocks are checked one at a time, so that an error names its block.
void check_block(const StreamedVertices& with, const CutterMotion& motion,
                 const std::optional<CutterMotion>& before, int number) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument(fmt::format("{}, in block {} of the motion", what, number));
  };
  try {
    check_milled(Design{}, with.cutter, motion, with.options.band);
  } catch (const std::invalid_argument& fault) {
    refuse(fault.what());
  }
  if (motion.tip.rows() == 0) refuse("milled surface: no sample");
  if (before && !ends_where(*before, motion))
    refuse("milled surface: the first sample is not the last of the block before");
}

/// Passes every block that moves to `use`. A block of a single sample, which cuts as well, is
/// passed only if the motion has no other.
template <class Use>
void each_block(const StreamedVertices& with, const MotionBlocks& next, const Use& use) {
  std::optional<CutterMotion> before;
  bool moves = false;
  int number = 1;
  while (const std::optional<MotionBlock> block = next()) {
    check_block(with, block->motion, before, number++);
    before = end_of(block->motion);
    if (block->motion.tip.rows() == 1) continue;
    moves = true;
    use(*block);
  }
  if (before && !moves) use(MotionBlock{std::move(*before), 1.0});
}

/// Returns a box that the cutter does not leave in a block. Between two samples a point of the
/// cutter departs from the line between its two positions no farther than an arc from its chord.
Box reach_of(const Cutter& cutter, const CutterMotion& motion) {
  constexpr double against_rounding = 1e-6;  // mm, far above the rounding of coordinates of 1 m
  Box reach;
  double max_chord2 = 0.0;
  for (Index i = 0; i < motion.tip.rows(); ++i) {
    const Vector3d tip = motion.tip.row(i), axis = motion.axis.row(i);
    // half the extent along each coordinate axis of a disc of unit radius across the tool axis
    const Vector3d around = cutter.radius * (1.0 - axis.array().square()).max(0.0).sqrt().matrix();
    for (const Vector3d& end : {tip, Vector3d(tip + cutter.flank_length * axis)}) {
      reach.extend(end - around);
      reach.extend(end + around);
    }
    if (i > 0)
      max_chord2 =
          std::max(max_chord2, (motion.axis.row(i) - motion.axis.row(i - 1)).squaredNorm());
  }
  const double far = std::hypot(cutter.radius, cutter.flank_length);
  const double arc = far * (1.0 - std::sqrt(std::max(0.0, 1.0 - 0.25 * max_chord2)));
  reach.min().array() -= arc + against_rounding;
  reach.max().array() += arc + against_rounding;
  return reach;
}

bool may_meet(const Box& reach, const Ray& ray) {
  return reach.squaredExteriorDistance(ray.point) <= ray.band * ray.band;
}

/// Neighbouring vertices, and the box of all of their rays.
struct Neighbours {
  std::span<const Index> vertices;
  Box rays;
};

std::vector<Neighbours> neighbours_in(const std::vector<Index>& order,
                                      const StreamedVertices& with) {
  std::vector<Neighbours> all;
  for (std::size_t from = 0; from < order.size(); from += first_cut_block) {
    const std::size_t count = std::min(first_cut_block, order.size() - from);
    Neighbours one{{&order[from], count}, {}};
    for (const Index v : one.vertices) one.rays.extend(with.design.vertices.row(v).transpose());
    one.rays.min().array() -= with.options.band;
    one.rays.max().array() += with.options.band;
    all.push_back(one);
  }
  return all;
}

// Keeps the first cuts of a block. Blocks of vertices that the cutter does not reach are skipped,
// which is most of them for a block of the motion that is short against the part.
void keep_firsts(const StreamedVertices& with, const CutterMotion& motion,
                 const std::vector<Neighbours>& neighbours, Surface& surface) {
  const std::vector<SweepTree> trees = sweep_trees(with.cutter, motion);
  const Box reach = reach_of(with.cutter, motion);
  const double band = with.options.band;
  tbb::parallel_for(std::size_t(0), neighbours.size(), [&](std::size_t i) {
    if (!neighbours[i].rays.intersects(reach)) return;
    std::vector<Index> open;
    for (const Index v : neighbours[i].vertices)
      // a gouge cannot be preceded by anything within the band
      if (surface.status[std::size_t(v)] != VertexStatus::Gouged) open.push_back(v);
    const auto cuts = first_cuts(trees, motion, with.design, open, band);
    for (std::size_t k = 0; k < open.size(); ++k)
      if (cuts[k]) keep_first(surface, open[k], *cuts[k], band);
  });
}

/// Returns the first cuts along rays, of equal ones that of the earlier block.
std::vector<std::optional<FirstCut>> cuts_along(const StreamedVertices& with,
                                                const MotionBlocks& next, std::size_t count,
                                                const std::function<Ray(std::size_t)>& ray_of) {
  std::vector<std::optional<FirstCut>> cuts(count);
  each_block(with, next, [&](const MotionBlock& block) {
    const std::vector<SweepTree> trees = sweep_trees(with.cutter, block.motion);
    const Box reach = reach_of(with.cutter, block.motion);
    const auto all = tbb::blocked_range<std::size_t>(0, count, 64);
    tbb::parallel_for(all, [&](const auto& range) {
      for (std::size_t k = range.begin(); k < range.end(); ++k) {
        const Ray ray = ray_of(k);
        if (cuts[k] && cuts[k]->s <= -ray.band) continue;
        if (!may_meet(reach, ray)) continue;
        const std::optional<FirstCut> cut = first_cut(trees, block.motion, ray);
        if (cut && (!cuts[k] || cut->s < cuts[k]->s)) cuts[k] = cut;
      }
    });
  });
  return cuts;
}

}  // namespace

// Up to two passes over the motion: first cuts within the band, then the depths of gouges.
Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options) {
  const StreamedVertices with{design_w, cutter, options};
  check_milled(design_w, cutter, CutterMotion{}, options.band);
  const std::vector<Index> order = judged_along_curve(design_w);
  const std::vector<Neighbours> neighbours = neighbours_in(order, with);
  Surface surface = uncut_surface(design_w, order);
  each_block(with, begin(), [&](const MotionBlock& block) {
    keep_firsts(with, block.motion, neighbours, surface);
    if (options.progress) options.progress(block.finished);
  });
  const FirstCutsFunction first_cuts = [&](std::size_t count,
                                           const std::function<Ray(std::size_t)>& ray) {
    return cuts_along(with, begin(), count, ray);
  };
  return with_gouge_depths(std::move(surface), design_w, options, first_cuts);
}

namespace {

/// Tests vertices that one tool cuts within the band and that this tool has gouged: returns those
/// at which it has removed the material at -band itself, and not only deeper.
std::vector<std::uint8_t> removed_at_band(const Design& design, const SurfaceFunction& tool,
                                          const std::vector<std::uint8_t>& asked, double band) {
  constexpr double touch = 1e-6;  // mm, band of the search at the displaced vertices
  Design below = design;
  // without triangles there is nothing behind the vertices that would limit the rays
  below.triangles.resize(0, 3);
  below.vertices -= band * design.normals;
  below.judged = asked;
  const Surface there = tool(below, touch);
  std::vector<std::uint8_t> removed(asked.size(), 0);
  for (std::size_t i = 0; i < removed.size(); ++i)
    removed[i] = there.status[i] == VertexStatus::Cut || there.status[i] == VertexStatus::Gouged;
  return removed;
}

bool is_earlier(const Surface& a, const Surface& b, Index v) {
  if (a.residual[v] != b.residual[v]) return a.residual[v] < b.residual[v];
  return a.cut_time_s[v] < b.cut_time_s[v];
}

/// Returns the cuts within the band alone, the earliest of all tools.
Surface min_cuts(const std::vector<Surface>& surfaces) {
  Surface least = surfaces.front();
  least.gouges.clear();
  for (VertexStatus& status : least.status)
    if (status == VertexStatus::Gouged) status = VertexStatus::Uncut;
  for (const Surface& one : surfaces)
    for (std::size_t i = 0; i < one.status.size(); ++i) {
      const auto v = Index(i);
      if (one.status[i] != VertexStatus::Cut) continue;
      if (least.status[i] == VertexStatus::Cut && !is_earlier(one, least, v)) continue;
      least.residual[v] = one.residual[v];
      least.cut_time_s[v] = one.cut_time_s[v];
      least.cut_line[i] = one.cut_line[i];
      least.status[i] = VertexStatus::Cut;
    }
  return least;
}

/// Returns 1 for each vertex that is gouged although a tool cuts it within the band.
std::vector<std::uint8_t> buried_cuts(const Design& design,
                                      const std::vector<SurfaceFunction>& tools,
                                      const std::vector<Surface>& surfaces, const Surface& cuts,
                                      double band) {
  std::vector<std::uint8_t> buried(cuts.status.size(), 0);
  for (std::size_t k = 0; k < tools.size(); ++k) {
    std::vector<std::uint8_t> asked(cuts.status.size(), 0);
    for (const Gouge& gouge : surfaces[k].gouges)
      asked[std::size_t(gouge.vertex)] =
          cuts.status[std::size_t(gouge.vertex)] == VertexStatus::Cut;
    if (std::find(asked.begin(), asked.end(), 1) == asked.end()) continue;
    const std::vector<std::uint8_t> removed = removed_at_band(design, tools[k], asked, band);
    for (std::size_t i = 0; i < buried.size(); ++i) buried[i] |= removed[i];
  }
  return buried;
}

/// Marks a vertex as gouged; of several gouges the deepest is kept.
void add_gouge(Surface& to, std::map<int, Gouge>& gouges, const Surface& from, const Gouge& gouge) {
  const auto [there, is_new] = gouges.emplace(gouge.vertex, gouge);
  if (!is_new && gouge.depth <= there->second.depth) return;
  there->second = gouge;
  to.status[std::size_t(gouge.vertex)] = VertexStatus::Gouged;
  to.residual[gouge.vertex] = std::numeric_limits<double>::quiet_NaN();
  to.cut_time_s[gouge.vertex] = from.cut_time_s[gouge.vertex];
  to.cut_line[std::size_t(gouge.vertex)] = from.cut_line[std::size_t(gouge.vertex)];
}

}  // namespace

Surface combined_surface(const Design& design_w, const std::vector<SurfaceFunction>& tools,
                         double band) {
  std::vector<Surface> surfaces;
  for (const SurfaceFunction& tool : tools) surfaces.push_back(tool(design_w, band));
  const Surface cuts = min_cuts(surfaces);
  const std::vector<std::uint8_t> buried = buried_cuts(design_w, tools, surfaces, cuts, band);
  Surface all = cuts;
  std::map<int, Gouge> gouges;
  for (const Surface& one : surfaces)
    for (const Gouge& gouge : one.gouges) {
      const auto v = std::size_t(gouge.vertex);
      if (cuts.status[v] != VertexStatus::Cut || buried[v]) add_gouge(all, gouges, one, gouge);
    }
  for (const auto& [vertex, gouge] : gouges) all.gouges.push_back(gouge);
  return all;
}

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double slack = 0.02;      // fraction of the corner's radius
constexpr double min_rise = slack;  // mm per mm, slope of the corner's round at that distance
constexpr double max_kept = 0.5 * slack * slack;  // fraction of the radius, height of the round
                                                  // there: R min_rise^2 / 2

/// The vertices that share an edge or a seam with each vertex, concatenated.
struct MeshNeighbours {
  std::vector<int> first;  // (n + 1)
  std::vector<int> vertex;
};

MeshNeighbours neighbours(const Design& design) {
  MeshNeighbours all{std::vector<int>(std::size_t(design.vertices.rows()) + 1, 0), {}};
  const auto each_pair = [&](const auto& act) {
    for (const auto& t : design.triangles.rowwise())
      for (int k = 0; k < 3; ++k) {  // an edge of the border has one triangle, so both directions
                                     // are listed
        act(t[k], t[(k + 1) % 3]);
        act(t[(k + 1) % 3], t[k]);
      }
    for (const auto& [a, b] : design.seams) {
      act(a, b);
      act(b, a);
    }
  };
  each_pair([&](int from, int) { ++all.first[std::size_t(from) + 1]; });
  for (std::size_t i = 1; i < all.first.size(); ++i) all.first[i] += all.first[i - 1];
  all.vertex.resize(std::size_t(all.first.back()));
  std::vector<int> next(all.first.begin(), all.first.end() - 1);
  each_pair([&](int from, int to) { all.vertex[std::size_t(next[std::size_t(from)]++)] = to; });
  return all;
}

}  // namespace

std::vector<std::uint8_t> corner_leftover(const Design& design, const Surface& surface,
                                          const Thickness& part, double radius) {
  std::vector<std::uint8_t> out(surface.status.size(), 0);
  if (!(radius > 0.0)) return out;
  tbb::parallel_for(std::size_t(0), out.size(), [&](std::size_t i) {
    const auto v = Index(i);
    // a vertex with less than a quarter of the tolerated height left needs no query of the part
    if (surface.status[i] != VertexStatus::Cut || !(surface.residual[v] > 0.25 * max_kept * radius))
      return;
    const Vector3d centre = design.vertices.row(v) + radius * design.normals.row(v);
    out[i] = part.comes_within(centre, (1.0 - slack) * radius);
  });
  return out;
}

std::vector<std::uint8_t> lead_out_leftover(const Design& design, const Surface& surface,
                                            double radius,
                                            const std::vector<std::uint8_t>& listed) {
  const std::size_t n = surface.status.size();
  if (std::size_t(design.vertices.rows()) != n || listed.size() != n)
    throw std::invalid_argument("run_out_beside: one status and one mark a vertex");
  std::vector<int> open;
  for (std::size_t i = 0; i < n; ++i)
    if (listed[i] || surface.status[i] == VertexStatus::Uncut) open.push_back(int(i));
  std::vector<std::uint8_t> found(n, 0);
  if (open.empty()) return found;
  const MeshNeighbours around = neighbours(design);
  const auto height = [&](int v) {
    return surface.status[std::size_t(v)] == VertexStatus::Uncut ? infinity : surface.residual[v];
  };
  // Flood fill from the uncut and the listed vertices, downhill along the edges.
  while (!open.empty()) {
    const int from = open.back();
    open.pop_back();
    for (int k = around.first[std::size_t(from)]; k < around.first[std::size_t(from) + 1]; ++k) {
      const int to = around.vertex[std::size_t(k)];
      const auto t = std::size_t(to);
      if (found[t] || listed[t] || surface.status[t] != VertexStatus::Cut) continue;
      const double length = (design.vertices.row(from) - design.vertices.row(to)).norm();
      const double fall = height(from) - surface.residual[to];
      if (!(fall >= min_rise * length) || !(surface.residual[to] > max_kept * radius)) continue;
      found[t] = 1;
      open.push_back(to);
    }
  }
  return found;
}

}  // namespace abbe::cutting
