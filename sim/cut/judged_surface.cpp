#include "sim/cut/judged_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
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
#include "sim/cut/resources.h"
#include "sim/cut/sweep.h"

namespace abbe::sim {

namespace {

using cutting::Surface;
using cutting::VertexStatus;
using Eigen::Index;
using Eigen::Vector3d;

int count(const Surface& surface, VertexStatus status) {
  return int(std::count(surface.status.begin(), surface.status.end(), status));
}

std::string share(int part, int all) {
  return fmt::format("{} of {} judged vertices ({:.3g} %)", part, all, 100.0 * part / all);
}

/// Returns true if a gouge counts as one at less than the band because the part is thinner than two
/// bands.
bool thin_gouge(const Surface& surface, double band) {
  return std::any_of(surface.gouges.begin(), surface.gouges.end(),
                     [&](const cutting::Gouge& gouge) { return gouge.depth < band; });
}

std::string gouge_text(const Surface& surface, int judged, double band) {
  const auto deepest =
      std::max_element(surface.gouges.begin(), surface.gouges.end(),
                       [](const auto& a, const auto& b) { return a.depth < b.depth; });
  int first = 0;
  for (const cutting::Gouge& gouge : surface.gouges)
    if (const int line = surface.cut_line[std::size_t(gouge.vertex)]; first == 0 || line < first)
      first = line;
  return fmt::format(
      "{} are gouged deeper than the band of {} mm{}, the deepest by {}{:.3f} mm (line {}, first "
      "line {}): PV, RMS, form and alignment leave them out",
      share(int(surface.gouges.size()), judged), band,
      thin_gouge(surface, band) ? " or than half way through the part where that is less" : "",
      deepest->deeper ? "more than the searched " : "", deepest->depth,
      surface.cut_line[std::size_t(deepest->vertex)], first);
}

std::set<int> rapid_lines(const program::Path& path) {
  std::set<int> lines;
  for (const program::Block& block : path.blocks)
    if (block.interpolation == program::Interpolation::Rapid) lines.insert(block.line);
  return lines;
}

/// Tip and axis of a tool between two samples.
struct Position {
  Vector3d tip, axis;
};

Position position(const cutting::CutterMotion& motion, double time_s) {
  const double* begin = motion.time_s.data();
  const double* end = begin + motion.time_s.size();
  const Index after =
      std::min<Index>(std::lower_bound(begin, end, time_s) - begin, motion.time_s.size() - 1);
  const Index before = std::max<Index>(0, after - 1);
  const double span = motion.time_s[after] - motion.time_s[before];
  const double t = span > 0.0 ? (time_s - motion.time_s[before]) / span : 1.0;
  const Vector3d axis = (1.0 - t) * motion.axis.row(before) + t * motion.axis.row(after);
  return {(1.0 - t) * motion.tip.row(before) + t * motion.tip.row(after), axis.normalized()};
}

}  // namespace

std::vector<std::string> surface_warnings(const Surface& surface, const program::Path& path,
                                          double band) {
  std::vector<std::string> warnings;
  const int cut = count(surface, VertexStatus::Cut), uncut = count(surface, VertexStatus::Uncut);
  const int judged = cut + uncut + count(surface, VertexStatus::Gouged);
  if (judged == 0) return warnings;
  if (uncut >= uncut_warning * judged)
    warnings.push_back(
        fmt::format("{} are uncut: nothing is removed there within {} mm of the "
                    "design, and PV, RMS and form leave them out",
                    share(uncut, judged), band));
  if (!surface.gouges.empty()) warnings.push_back(gouge_text(surface, judged, band));
  const std::set<int> rapids = rapid_lines(path);
  int by_rapid = 0, first = 0;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const int line = surface.cut_line[i];
    if (surface.status[i] != VertexStatus::Cut || !rapids.contains(line)) continue;
    if (by_rapid++ == 0 || line < first) first = line;
  }
  if (by_rapid >= uncut_warning * judged && by_rapid > 0)
    warnings.push_back(
        fmt::format("{} are cut by rapids, first line {}", share(by_rapid, judged), first));
  return warnings;
}

ProgramGouge program_gouge(const Surface& surface, double explained) {
  ProgramGouge gouge;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double s = surface.residual[Index(i)];
    // gouges beyond the band have their own status; up to `rubbing` is tolerated for any tool
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
  constexpr double above_corner = 1e-3;  // mm; contact at the tangent point of the corner does not
                                         // count as flank
  return int(std::count_if(gouge.at.begin(), gouge.at.end(), [&](Index i) {
    const Position tool = position(motion, surface.cut_time_s[i]);
    const Vector3d contact =
        design_w.vertices.row(i) + surface.residual[i] * design_w.normals.row(i);
    return tool.axis.dot(contact - tool.tip) > cutting::corner_height(cutter) + above_corner;
  }));
}

namespace {

/// Returns the smallest corner radius, mm, of the tools of a job: where that does not fit, none
/// does. A turning tool counts as 0, since it touches the part along its edge only.
double smallest_corner(const Job& job) {
  double least = std::numeric_limits<double>::infinity();
  for (const Job& part : job.windows ? std::span(&job, 1) : parts_of(job)) {
    const auto* cutter = std::get_if<cutting::Cutter>(&part.scene.tool.nominal);
    least = std::min(least, cutter != nullptr ? cutter->corner_radius : 0.0);
  }
  return least;
}

// Returns the reason of each vertex. Later reasons override earlier ones: a corner may be uncut as
// well.
std::vector<ExclusionReason> reasons(const Job& job, const Surface& nominal) {
  const double radius = smallest_corner(job);
  const auto corner = cutting::corner_leftover(job.design_w, nominal, *job.body_w, radius);
  const auto lead_out = cutting::lead_out_leftover(job.design_w, nominal, radius, corner);
  std::vector<ExclusionReason> why(nominal.status.size(), ExclusionReason::NotExcluded);
  for (std::size_t i = 0; i < why.size(); ++i) {
    if (nominal.status[i] == VertexStatus::Uncut) why[i] = ExclusionReason::Unreached;
    if (corner[i]) why[i] = ExclusionReason::Corner;
    if (lead_out[i]) why[i] = ExclusionReason::LeadOut;
  }
  return why;
}

/// Excludes a vertex from the judged ones.
/// @return material left there, mm
double leave_out(Job& job, Surface& nominal, std::size_t i) {
  const auto v = Eigen::Index(i);
  const double left = nominal.status[i] == VertexStatus::Cut ? nominal.residual[v] : 0.0;
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  // The residual is read first: it is valid only while the status is Cut.
  job.design_w.judged[i] = 0;
  nominal.status[i] = VertexStatus::Outside;
  nominal.residual[v] = nominal.cut_time_s[v] = none;
  nominal.cut_line[i] = 0;
  return left;
}

}  // namespace

std::vector<ExclusionReason> exclude_unintended(Job& job, Surface& nominal,
                                                std::vector<ExclusionReason> before) {
  const std::size_t n = nominal.status.size();
  before.resize(n, ExclusionReason::NotExcluded);
  if (job.scene.part.judged != PartDescription::JudgedArea::Cut) return before;
  const std::vector<ExclusionReason> why = reasons(job, nominal);
  const auto is_left = [&](std::size_t i) {
    return why[i] == ExclusionReason::NotExcluded && nominal.status[i] != VertexStatus::Outside;
  };
  bool any = false;
  for (std::size_t i = 0; i < n && !any; ++i) any = is_left(i);
  if (!any) return before;
  ExcludedArea& excluded_area = job.sampled->excluded_area;
  excluded_area.radius = smallest_corner(job);
  for (std::size_t i = 0; i < n; ++i) {
    if (why[i] == ExclusionReason::NotExcluded) continue;
    before[i] = why[i];
    excluded_area.max_left = std::max(excluded_area.max_left, leave_out(job, nominal, i));
  }
  return before;
}

JudgedAreas judged_areas(const Job& job, const Surface& nominal,
                         const std::vector<ExclusionReason>& why) {
  JudgedAreas areas{0.0, job.sampled->excluded_area};
  areas.excluded_area.unreached = areas.excluded_area.corner = areas.excluded_area.lead_out = 0.0;
  for (std::size_t i = 0; i < why.size(); ++i) {
    const double area = job.design_w.area[Eigen::Index(i)];
    switch (why[i]) {
      case ExclusionReason::NotExcluded:
        if (nominal.status[i] != VertexStatus::Outside) areas.judged += area;
        break;
      case ExclusionReason::Unreached:
        areas.excluded_area.unreached += area;
        break;
      case ExclusionReason::Corner:
        areas.excluded_area.corner += area;
        break;
      case ExclusionReason::LeadOut:
        areas.excluded_area.lead_out += area;
        break;
    }
  }
  return areas;
}

std::string exclusion_text(const SampledSurface& sampled) {
  const ExcludedArea& excluded_area = sampled.excluded_area;
  const double all = sampled.judged_area + excluded_area.area();
  std::string text =
      fmt::format("the program means to cut {:.4g} % of the part's {:.4g} mm^2; not judged are",
                  100.0 * sampled.judged_area / all, all);
  const char* joint = " ";
  const auto add = [&](double area, const std::string& words) {
    if (area > 0.0)
      text += fmt::format("{}{:.4g} mm^2 {}", std::exchange(joint, ", "), area, words);
  };
  add(excluded_area.unreached, "that it does not come to");
  add(excluded_area.corner,
      fmt::format("into which the tool's corner of {:.4g} mm does not fit", excluded_area.radius));
  add(excluded_area.lead_out, "beside those, where its sweep runs out");
  if (excluded_area.max_left > 0.0)
    text += fmt::format(", up to {:.3g} mm above the design", excluded_area.max_left);
  return text + " (part.judged = \"all\" judges all)";
}

namespace {

using cutting::Design;

/// Returns where further samples within triangles are needed. Adaptive vertices lie on crests and
/// do not represent their surroundings, so the middle of each triangle is added; a map that its
/// vertices do not resolve would alias regular samples, so they are random.
cutting::Surface::Within where_within(const Job& job, const Sweep& sweep,
                                      const cutting::Surface& nominal) {
  const cutting::InterpolationError error =
      cutting::interpolation_error(job.design_w, nominal, on_surface(job), sweep.surface,
                                   {.seed = job.scene.seed, .resolution = job.sampled->resolution});
  if (error.unresolved > max_unresolved_fraction) return cutting::Surface::Within::Random;
  return job.scene.part.sampling.kind == PartSampling::Kind::Adaptive
             ? cutting::Surface::Within::Middle
             : cutting::Surface::Within::None;
}

/// Returns the gouges of a surface whose statuses are known. Only gouged vertices are cut again.
std::vector<cutting::Gouge> gouges_of(Design design, const cutting::Surface& surface,
                                      const Sweep& sweep) {
  bool any = false;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    design.judged[i] = surface.status[i] == VertexStatus::Gouged;
    any = any || design.judged[i];
  }
  return any ? sweep.surface(design).gouges : std::vector<cutting::Gouge>{};
}

cutting::RefinementResult refined_for(const Job& job, const Sweep& sweep, SampledSurface& sampled,
                                      const Progress& progress) {
  const PartSampling& wanted = job.scene.part.sampling;
  cutting::RefineOptions options;
  options.resolution = sampled.resolution;
  options.floor = wanted.finest;
  options.points = wanted.points;
  // Edges may be flipped only if the vertices lie on a known surface; a mesh of which 99.9 % of the
  // area is recognised counts as one.
  constexpr double nearly_all = 0.999;
  options.can_flip_edges = std::holds_alternative<cutting::Primitive>(job.scene.part.shape) ||
                           job.recognised_fraction > nearly_all;
  if (progress) options.progress = [&](double fraction) { progress("sampling", fraction); };
  cutting::RefinementResult refined = cutting::refined(
      job.design_w, on_surface(job),
      [&](const Design& places) {
        cutting::Surface surface = sweep.surface(places);
        cutting::PassGradients contacts = sweep.contacts(places, surface);
        return cutting::SurfaceProbe{std::move(surface), std::move(contacts)};
      },
      options);
  sampled.reached = refined.reached;
  refined.surface.gouges = gouges_of(refined.design, refined.surface, sweep);
  return refined;
}

std::string spacing_text(const Design& design, const PartSampling& wanted) {
  double longest = 0.0;
  for (const auto& t : design.triangles.rowwise())
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      if (design.judged[std::size_t(a)] && design.judged[std::size_t(b)])
        longest = std::max(longest, (design.vertices.row(a) - design.vertices.row(b)).norm());
    }
  if (!(longest > wanted.spacing)) return {};
  return fmt::format(
      "part.points = {} do not suffice for part.spacing_mm = {:.4g}: {:.4g} mm reached",
      wanted.points, wanted.spacing, longest);
}

/// Returns a warning if the facets of a mesh deviate from its surface by more than the map
/// resolves.
std::string coarse_facets_text(const Job& job) {
  const double resolution = job.sampled->resolution;
  Eigen::Index worst = 0;
  double most = 0.0;
  for (Eigen::Index v = 0; v < job.facet_uncertainty.size(); ++v) {
    if (!job.design_w.judged[std::size_t(v)] || !(job.facet_uncertainty[v] > resolution)) continue;
    if (job.facet_uncertainty[v] > most) worst = v;
    most = std::max(most, job.facet_uncertainty[v]);
  }
  if (!(most > 0.0)) return {};
  const Eigen::RowVector3d at = job.design_w.vertices.row(worst);
  return fmt::format(
      "where the mesh is no plane, sphere, cylinder, cone or torus its facets leave the surface "
      "that they stand for by up to about {:.3g} um, at ({:.4g}, {:.4g}, {:.4g}) of the workpiece: "
      "residuals below this are the mesh's; export it with finer facets",
      most / units::um, at.x(), at.y(), at.z());
}

}  // namespace

double trimmed_range(const cutting::Surface& surface, const Design& design) {
  constexpr double outer = 0.01;                  // fraction of the area at either end
  std::vector<std::pair<double, double>> values;  // residual, area
  double all = 0.0;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    if (surface.status[i] != VertexStatus::Cut) continue;
    values.emplace_back(surface.residual[Eigen::Index(i)], design.area[Eigen::Index(i)]);
    all += values.back().second;
  }
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  double upto = 0.0, low = values.front().first, high = values.back().first;
  for (const auto& [value, area] : values) {
    if (upto <= outer * all) low = value;
    if (upto <= (1.0 - outer) * all) high = value;
    upto += area;
  }
  return high - low;
}

cutting::SurfaceInterpolator on_surface(const Job& job) {
  return surface_between_vertices(job.scene.part, job.recognised, job.scene.part.T_wm);
}

Job sampled(Job job, const Progress& progress) {
  Stopwatch watch;
  const Sweep sweep = error_free_sweep(job, options_of(job, {}));
  job.sampled = SampledSurface{.given = job.design_w.vertices.rows()};
  if (job.design_w.judged.empty())
    job.design_w.judged.assign(std::size_t(job.design_w.vertices.rows()), 1);
  cutting::Surface nominal = sweep.surface(job.design_w);
  std::vector<ExclusionReason> why = exclude_unintended(job, nominal, {});
  const PartSampling& wanted = job.scene.part.sampling;
  job.sampled->resolution =
      wanted.resolution.value_or(cutting::default_resolution(trimmed_range(nominal, job.design_w)));
  if (wanted.kind == PartSampling::Kind::Adaptive) {
    cutting::RefinementResult refined = refined_for(job, sweep, *job.sampled, progress);
    job.design_w = std::move(refined.design);
    nominal = std::move(refined.surface);
  }
  if (wanted.kind == PartSampling::Kind::Spacing) {
    job.design_w =
        cutting::subdivided(job.design_w, on_surface(job), {wanted.spacing, wanted.points});
    if (std::string text = spacing_text(job.design_w, wanted); !text.empty())
      job.warnings.push_back(std::move(text));
    nominal = sweep.surface(job.design_w);
  }
  if (wanted.kind != PartSampling::Kind::Vertices)  // vertices added by refinement are checked too
    why = exclude_unintended(job, nominal, std::move(why));
  const JudgedAreas areas = judged_areas(job, nominal, why);
  job.sampled->judged_area = areas.judged;
  job.sampled->excluded_area = areas.excluded_area;
  if (wanted.kind != PartSampling::Kind::Vertices)
    if (std::string text = coarse_facets_text(job); !text.empty())
      job.warnings.push_back(std::move(text));
  job.sampled->within = where_within(job, sweep, nominal);
  job.sampled->error_free = std::make_shared<const cutting::Surface>(std::move(nominal));
  if (job.sampled->excluded_area.area() > 0.0) job.warnings.push_back(exclusion_text(*job.sampled));
  job.timing_s["sampling"] = watch.lap();
  return job;
}

}  // namespace abbe::sim
