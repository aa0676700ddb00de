#include "sim/cut/judged_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <set>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/map/interpolation.h"
#include "cutting/map/refinement.h"
#include "cutting/map/residual.h"
#include "cutting/part/remeshing.h"
#include "cutting/stock/stock.h"
#include "cutting/surface/machined_surface.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/scene_checks.h"
#include "sim/cut/sweep.h"
#include "sim/files/progress.h"

namespace abbe::sim {

namespace {

using cutting::Surface;
using cutting::VertexStatus;
using Eigen::Index;
using Eigen::Vector3d;

// Fraction of uncut judged vertices from which a warning is given.
constexpr double uncut_warning = 0.01;

int count(const Surface& surface, VertexStatus status) {
  return int(std::count(surface.status.begin(), surface.status.end(), status));
}

std::string count_text(int count, int total) {
  return fmt::format("{} of {} judged vertices ({:.3g} %)", count, total, 100.0 * count / total);
}

/// Returns true if a gouge is less deep than the band, as happens where the part is thinner than
/// two bands.
bool has_thin_gouge(const Surface& surface, double band) {
  return std::any_of(surface.gouges.begin(), surface.gouges.end(),
                     [&](const cutting::Gouge& gouge) { return gouge.depth < band; });
}

std::string gouge_text(const Surface& surface, int judged, double band) {
  const auto deepest =
      std::max_element(surface.gouges.begin(), surface.gouges.end(),
                       [](const auto& a, const auto& b) { return a.depth < b.depth; });
  int first_line = 0;
  for (const cutting::Gouge& gouge : surface.gouges)
    if (const int line = surface.cut_line[std::size_t(gouge.vertex)];
        first_line == 0 || line < first_line)
      first_line = line;
  return fmt::format(
      "{} are gouged deeper than the band of {} mm{}, the deepest by {}{:.3f} mm (line {}, first "
      "line {}): PV, RMS, form and alignment exclude them",
      count_text(int(surface.gouges.size()), judged), band,
      has_thin_gouge(surface, band) ? " or half the wall thickness where that is less" : "",
      deepest->continues_deeper ? "more than the search depth of " : "", deepest->depth,
      surface.cut_line[std::size_t(deepest->vertex)], first_line);
}

std::set<int> rapid_lines(const program::Path& path) {
  std::set<int> lines;
  for (const program::Block& block : path.blocks)
    if (block.interpolation == program::Interpolation::Rapid) lines.insert(block.line);
  return lines;
}

/// Returns the numbers of the vertices that blocks on given lines have cut.
std::vector<Index> vertices_cut_on(const Surface& surface, const std::set<int>& lines) {
  std::vector<Index> vertices;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] == VertexStatus::Cut && lines.contains(surface.cut_line[i]))
      vertices.push_back(Index(i));
  return vertices;
}

/// Tip and axis of a tool at an instant.
struct ToolPosition {
  Vector3d tip, axis;
};

ToolPosition tool_position(const cutting::CutterMotion& motion, double time_s) {
  const double* begin = motion.time_s.data();
  const double* end = begin + motion.time_s.size();
  const Index after =
      std::min<Index>(std::lower_bound(begin, end, time_s) - begin, motion.time_s.size() - 1);
  const Index before = std::max<Index>(0, after - 1);
  const double interval = motion.time_s[after] - motion.time_s[before];
  const double fraction = interval > 0.0 ? (time_s - motion.time_s[before]) / interval : 1.0;
  const Vector3d axis =
      (1.0 - fraction) * motion.axis.row(before) + fraction * motion.axis.row(after);
  return {(1.0 - fraction) * motion.tip.row(before) + fraction * motion.tip.row(after),
          axis.normalized()};
}

}  // namespace

std::vector<std::string> surface_warnings(const Surface& surface, const program::Path& path,
                                          double band, const VertexFilter& not_fed_before) {
  std::vector<std::string> warnings;
  const int cut = count(surface, VertexStatus::Cut), uncut = count(surface, VertexStatus::Uncut);
  const int judged = cut + uncut + count(surface, VertexStatus::Gouged);
  if (judged == 0) return warnings;
  if (uncut >= uncut_warning * judged)
    warnings.push_back(
        fmt::format("{} are uncut: nothing is removed there within {} mm of the design, and PV, "
                    "RMS and form exclude them",
                    count_text(uncut, judged), band));
  if (!surface.gouges.empty()) warnings.push_back(gouge_text(surface, judged, band));
  std::vector<Index> rapid_cuts = vertices_cut_on(surface, rapid_lines(path));
  const auto deserve_warning = [&] {
    return !rapid_cuts.empty() && double(rapid_cuts.size()) >= uncut_warning * judged;
  };
  if (deserve_warning()) rapid_cuts = not_fed_before(std::move(rapid_cuts));
  if (!deserve_warning()) return warnings;
  const auto line = [&](Index i) { return surface.cut_line[std::size_t(i)]; };
  warnings.push_back(fmt::format("{} are cut by rapid moves, first line {}",
                                 count_text(int(rapid_cuts.size()), judged),
                                 line(std::ranges::min(rapid_cuts, {}, line))));
  return warnings;
}

ProgramGouge program_gouge(const Surface& surface, double explained) {
  ProgramGouge gouge;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double s = surface.residual[Index(i)];
    // Gouges beyond the band have a status of their own. Depths up to `rubbing` are tolerated.
    if (surface.status[i] != VertexStatus::Cut || !(s < -cutting::rubbing - explained)) continue;
    gouge.at.push_back(Index(i));
    ++gouge.vertices;
    if (-s <= gouge.deepest) continue;
    gouge.deepest = -s;
    gouge.line = surface.cut_line[i];
  }
  return gouge;
}

int flank_gouge_count(const ProgramGouge& gouge, const Surface& surface,
                      const cutting::Design& design_w, const cutting::Cutter& cutter,
                      const cutting::CutterMotion& motion) {
  constexpr double above_corner = 1e-3;  // mm: the tangent point of the corner is no flank
  return int(std::count_if(gouge.at.begin(), gouge.at.end(), [&](Index i) {
    const ToolPosition tool = tool_position(motion, surface.cut_time_s[i]);
    const Vector3d contact =
        design_w.vertices.row(i) + surface.residual[i] * design_w.normals.row(i);
    return tool.axis.dot(contact - tool.tip) > cutting::corner_height(cutter) + above_corner;
  }));
}

namespace {

/// Reason why the program does not intend to cut a vertex, with part.judged = "cut".
enum class ExclusionReason : std::uint8_t { NotExcluded, UnreachedPoints, Corner, LeadOut };

/// Returns the smallest corner radius, mm, of the tools of a job: no tool fits into a corner into
/// which that one does not. A turning tool counts as 0, since only its edge touches the part.
double smallest_corner(const Job& job) {
  double smallest_radius = std::numeric_limits<double>::infinity();
  for (const Segment& segment : tool_segments(job)) {
    const auto* cutter = std::get_if<cutting::Cutter>(&segment.scene.tool.nominal);
    smallest_radius = std::min(smallest_radius, cutter != nullptr ? cutter->corner_radius : 0.0);
  }
  return smallest_radius;
}

// Returns the reason of each vertex. Corner and lead-out override Unreached, since vertices there
// may be uncut too.
std::vector<ExclusionReason> exclusion_reasons(const Job& job, const Surface& nominal) {
  const double radius = smallest_corner(job);
  const auto corner = cutting::corner_leftover(job.design_w, nominal, *job.body_w, radius);
  const auto lead_out_area = cutting::lead_out_leftover(job.design_w, nominal, radius, corner);
  std::vector<ExclusionReason> reasons(nominal.status.size(), ExclusionReason::NotExcluded);
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (nominal.status[i] == VertexStatus::Uncut) reasons[i] = ExclusionReason::UnreachedPoints;
    if (corner[i]) reasons[i] = ExclusionReason::Corner;
    if (lead_out_area[i]) reasons[i] = ExclusionReason::LeadOut;
  }
  return reasons;
}

/// Excludes a vertex from the judged ones.
/// @return material left at it, mm
double exclude(Job& job, Surface& nominal, std::size_t i) {
  const auto v = Eigen::Index(i);
  const double height = nominal.status[i] == VertexStatus::Cut ? nominal.residual[v] : 0.0;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  job.design_w.judged[i] = 0;
  nominal.status[i] = VertexStatus::Outside;
  nominal.residual[v] = nominal.cut_time_s[v] = nan;
  nominal.cut_line[i] = 0;
  return height;
}

/// Excludes vertices from a map and from the judged vertices of a job: those that the error-free
/// cut does not reach, those in corners of the design into which no tool of the job fits, and those
/// at the lead-out beside both. Does nothing if the scene judges everything, or if no vertex would
/// be left, which the cut reports as an error.
/// @param previous  result for the first vertices, before others were added; empty: none
/// @return        (vertices) the reason; NotExcluded where the scene does not judge
std::vector<ExclusionReason> exclude_unintended(Job& job, Surface& nominal,
                                                std::vector<ExclusionReason> previous) {
  const std::size_t vertices = nominal.status.size();
  previous.resize(vertices, ExclusionReason::NotExcluded);
  if (job.scene.part.judged != PartDescription::JudgedArea::Cut) return previous;
  const std::vector<ExclusionReason> reasons = exclusion_reasons(job, nominal);
  const auto is_kept = [&](std::size_t i) {
    return reasons[i] == ExclusionReason::NotExcluded && nominal.status[i] != VertexStatus::Outside;
  };
  if (std::ranges::none_of(std::views::iota(std::size_t(0), vertices), is_kept)) return previous;
  ExcludedArea& excluded_area = job.sampled->excluded_area;
  excluded_area.radius = smallest_corner(job);
  for (std::size_t i = 0; i < vertices; ++i) {
    if (reasons[i] == ExclusionReason::NotExcluded) continue;
    previous[i] = reasons[i];
    excluded_area.max_remaining_height =
        std::max(excluded_area.max_remaining_height, exclude(job, nominal, i));
  }
  return previous;
}

/// Judged area and excluded area of a part.
struct JudgedAreas {
  double judged = 0.0;  ///< mm^2
  ExcludedArea excluded_area;
};

/// Returns the judged area of a part, and the excluded area by reason.
JudgedAreas judged_areas(const Job& job, const Surface& nominal,
                         const std::vector<ExclusionReason>& reasons) {
  JudgedAreas areas{0.0, job.sampled->excluded_area};
  areas.excluded_area.unreached = areas.excluded_area.corner = areas.excluded_area.lead_out_area =
      0.0;
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    const double area = job.design_w.area[Eigen::Index(i)];
    switch (reasons[i]) {
      case ExclusionReason::NotExcluded:
        if (nominal.status[i] != VertexStatus::Outside) areas.judged += area;
        break;
      case ExclusionReason::UnreachedPoints:
        areas.excluded_area.unreached += area;
        break;
      case ExclusionReason::Corner:
        areas.excluded_area.corner += area;
        break;
      case ExclusionReason::LeadOut:
        areas.excluded_area.lead_out_area += area;
        break;
    }
  }
  return areas;
}

}  // namespace

std::string exclusion_text(const SampledSurface& sampled) {
  const ExcludedArea& excluded_area = sampled.excluded_area;
  const double total_area = sampled.judged_area + excluded_area.area();
  std::string text = fmt::format(
      "the program is intended to cut {:.4g} % of the part's {:.4g} mm^2; not judged are",
      100.0 * sampled.judged_area / total_area, total_area);
  const char* separator = " ";
  const auto add = [&](double area, const std::string& reason) {
    if (area > 0.0)
      text += fmt::format("{}{:.4g} mm^2 {}", std::exchange(separator, ", "), area, reason);
  };
  add(excluded_area.unreached, "that it does not reach");
  add(excluded_area.corner, fmt::format("where the tool's corner radius of {:.4g} mm does not fit",
                                        excluded_area.radius));
  add(excluded_area.lead_out_area, "next to those, in the lead-out of its sweep");
  if (excluded_area.max_remaining_height > 0.0)
    text += fmt::format(", up to {:.3g} mm above the design", excluded_area.max_remaining_height);
  return text + " (set part.judged = \"all\" to judge all)";
}

namespace {

using cutting::Design;

/// Returns the additional samples that the triangles need. Adaptive vertices lie on crests and do
/// not represent their surroundings, so the middle of each triangle is added. Samples are random if
/// the vertices do not resolve the map, which regular samples would alias.
cutting::Surface::InteriorSample samples_within(const Job& job, const Sweep& sweep,
                                                const cutting::Surface& nominal) {
  const cutting::InterpolationError error =
      cutting::interpolation_error(job.design_w, nominal, surface_interpolator(job), sweep.surface,
                                   {.seed = job.scene.seed, .resolution = job.sampled->resolution});
  if (error.unresolved > max_unresolved_fraction) return cutting::Surface::InteriorSample::Random;
  return job.scene.part.sampling.kind == PartSampling::Kind::Adaptive
             ? cutting::Surface::InteriorSample::Middle
             : cutting::Surface::InteriorSample::None;
}

/// Returns the gouges of a surface from its statuses. Only gouged vertices are cut again.
std::vector<cutting::Gouge> find_gouges(Design design, const cutting::Surface& surface,
                                        const Sweep& sweep) {
  bool has_gouges = false;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    design.judged[i] = surface.status[i] == VertexStatus::Gouged;
    has_gouges = has_gouges || design.judged[i];
  }
  return has_gouges ? sweep.surface(design).gouges : std::vector<cutting::Gouge>{};
}

cutting::RefinementResult refine_part(const Job& job, const Sweep& sweep, SampledSurface& sampled,
                                      const Progress& progress) {
  const PartSampling& part_sampling = job.scene.part.sampling;
  cutting::RefineOptions options;
  options.resolution = sampled.resolution;
  options.floor = part_sampling.min_edge_length;
  options.points = part_sampling.points;
  // Edges may be flipped only if the vertices lie on a known surface, as those of a mesh do that is
  // recognised almost completely.
  constexpr double nearly_all = 0.999;  // of its area
  options.can_flip_edges = std::holds_alternative<cutting::Primitive>(job.scene.part.shape) ||
                           job.recognised_fraction > nearly_all;
  if (progress) options.progress = [&](double fraction) { progress("sampling", fraction); };
  cutting::RefinementResult result = cutting::refined(
      job.design_w, surface_interpolator(job),
      [&](const Design& candidates) {
        cutting::Surface surface = sweep.surface(candidates);
        cutting::PassGradients contacts = sweep.contacts(candidates, surface);
        return cutting::SurfaceProbe{std::move(surface), std::move(contacts)};
      },
      options);
  sampled.reached = result.reached;
  result.surface.gouges = find_gouges(result.design, result.surface, sweep);
  return result;
}

std::string spacing_text(const Design& design, const PartSampling& part_sampling) {
  const double max_edge = judged_vertices(design).max_distance;
  if (!(max_edge > part_sampling.spacing)) return {};
  return fmt::format(
      "part.points = {} is too small for part.spacing_mm = {:.4g}: {:.4g} mm reached",
      part_sampling.points, part_sampling.spacing, max_edge);
}

/// Returns the warning about facets of a mesh that deviate from its surface by more than the map
/// resolves; empty if there are none.
std::string coarse_facets_text(const Job& job) {
  const double resolution = job.sampled->resolution;
  Eigen::Index worst = 0;
  double max_uncertainty = 0.0;
  for (Eigen::Index v = 0; v < job.facet_uncertainty.size(); ++v) {
    if (!job.design_w.judged[std::size_t(v)] || !(job.facet_uncertainty[v] > resolution)) continue;
    if (job.facet_uncertainty[v] > max_uncertainty) worst = v;
    max_uncertainty = std::max(max_uncertainty, job.facet_uncertainty[v]);
  }
  if (!(max_uncertainty > 0.0)) return {};
  const Eigen::RowVector3d point = job.design_w.vertices.row(worst);
  return fmt::format(
      "where the mesh is not a plane, sphere, cylinder, cone or torus, its facets deviate from the "
      "true surface by up to about {:.3g} um, at ({:.4g}, {:.4g}, {:.4g}) in the workpiece: "
      "smaller residuals come from the mesh; export it with finer facets",
      max_uncertainty / units::um, point.x(), point.y(), point.z());
}

}  // namespace

double trimmed_range(const cutting::Surface& surface, const Design& design) {
  constexpr double outer_fraction = 0.01;         // fraction of the area at either end
  std::vector<std::pair<double, double>> values;  // residual, area
  double total_area = 0.0;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    if (surface.status[i] != VertexStatus::Cut) continue;
    values.emplace_back(surface.residual[Eigen::Index(i)], design.area[Eigen::Index(i)]);
    total_area += values.back().second;
  }
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  double area_below = 0.0, low = values.front().first, high = values.back().first;
  for (const auto& [value, area] : values) {
    if (area_below <= outer_fraction * total_area) low = value;
    if (area_below <= (1.0 - outer_fraction) * total_area) high = value;
    area_below += area;
  }
  return high - low;
}

cutting::SurfaceInterpolator surface_interpolator(const Job& job) {
  return surface_between_vertices(job.scene.part, job.recognised, job.scene.part.T_wm);
}

Job sampled(Job job, const Progress& progress) {
  Stopwatch watch;
  const Sweep sweep = error_free_sweep(job, surface_options(job, {}));
  job.sampled = SampledSurface{.given = job.design_w.vertices.rows()};
  if (job.design_w.judged.empty())
    job.design_w.judged.assign(std::size_t(job.design_w.vertices.rows()), 1);
  cutting::Surface nominal = sweep.surface(job.design_w);
  std::vector<ExclusionReason> reasons = exclude_unintended(job, nominal, {});
  const PartSampling& part_sampling = job.scene.part.sampling;
  job.sampled->resolution = part_sampling.resolution.value_or(
      cutting::default_resolution(trimmed_range(nominal, job.design_w)));
  if (part_sampling.kind == PartSampling::Kind::Adaptive) {
    cutting::RefinementResult refinement = refine_part(job, sweep, *job.sampled, progress);
    job.design_w = std::move(refinement.design);
    nominal = std::move(refinement.surface);
  }
  if (part_sampling.kind == PartSampling::Kind::Spacing) {
    job.design_w = cutting::subdivide(job.design_w, surface_interpolator(job),
                                      {part_sampling.spacing, part_sampling.points});
    if (std::string text = spacing_text(job.design_w, part_sampling); !text.empty())
      job.warnings.push_back(std::move(text));
    nominal = sweep.surface(job.design_w);
  }
  if (part_sampling.kind != PartSampling::Kind::Vertices)  // vertices were added
    reasons = exclude_unintended(job, nominal, std::move(reasons));
  const JudgedAreas areas = judged_areas(job, nominal, reasons);
  job.sampled->judged_area = areas.judged;
  job.sampled->excluded_area = areas.excluded_area;
  if (part_sampling.kind != PartSampling::Kind::Vertices)
    if (std::string text = coarse_facets_text(job); !text.empty())
      job.warnings.push_back(std::move(text));
  job.sampled->within = samples_within(job, sweep, nominal);
  job.sampled->error_free = std::make_shared<const cutting::Surface>(std::move(nominal));
  if (job.sampled->excluded_area.area() > 0.0) job.warnings.push_back(exclusion_text(*job.sampled));
  job.timing_s["sampling"] = watch.lap();
  return job;
}

}  // namespace abbe::sim
