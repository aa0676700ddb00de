#include "sim/cut/placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cutting/part/design_points.h"
#include "kinematics/units.h"
#include "sim/cut/bodies.h"
#include "sim/cut/part.h"
#include "sim/cut/placement_suggestion.h"
#include "sim/cut/scene_checks.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// Returns a text such as "2 % of the judged area is cut within 2 mm of the design; with the part
/// 25.4 times as large it would be 97 %: part.unit = "inch" may be meant". It is given for a
/// program from a file that reaches less than half of the part, if the part scaled by a ratio of
/// units is cut over four times the area and over a tenth at least. Empty otherwise, and for a mesh
/// of part.any_size.
/// @param reach  of the thinned design as it stands
std::string unit_warning(const Job& job, const ReachableArea& reach);

namespace {

constexpr double max_suspect_fraction = 0.5;  // of the judged area; a program that reaches more is
                                              // not doubted
constexpr double min_fit_fraction = 0.1;      // of the judged area, cut with the scaled part
constexpr double min_cut_gain = 4.0;          // ratio to the area cut without scaling

// Ratios of two units of length.
constexpr std::array factors{units::inch, 10.0, 100.0, 1000.0, 1.0 / units::inch, 0.1, 0.01, 0.001};

const MeshFile* mesh_of(const Scene& scene) { return std::get_if<MeshFile>(&scene.part.shape); }

/// Returns the design scaled about the zero of its own frame.
cutting::Design scaled(cutting::Design design_w, const kinematics::Pose& T_wm, double factor) {
  const Eigen::RowVector3d zero = T_wm.translation().transpose();
  design_w.vertices = (factor * (design_w.vertices.rowwise() - zero)).rowwise() + zero;
  design_w.area *= factor * factor;
  return design_w;
}

double largest_size(const Spans& spans) {
  double largest = 0.0;
  for (const Span& span : spans)
    if (std::isfinite(span.size())) largest = std::max(largest, span.size());
  return largest;
}

/// Returns the keys or NC codes that may have the wrong unit if the part fits when scaled by
/// `factor`.
std::string advice(const Job& job, double factor) {
  std::vector<std::string> all;
  if (const MeshFile* mesh = mesh_of(job.scene))
    if (const std::string word = unit_label(mesh->unit * factor); !word.empty())
      all.push_back(fmt::format("part.unit = \"{}\" may be meant", word));
  const auto inch = std::ranges::find_if(job.path.unit_words, &program::UnitWord::inch);
  if (factor == units::inch && inch != job.path.unit_words.end())
    all.push_back(fmt::format("G20 on line {} may not belong there", inch->line));
  if (factor == 1.0 / units::inch && inch == job.path.unit_words.end())
    all.push_back("the program may be in inches and lack its G20");
  if (all.empty()) all.push_back("part or program may be in another unit");
  std::string text = fmt::format("{}", fmt::join(all, ", or "));
  return mesh_of(job.scene) ? text + "; part.any_size = true if its size is meant" : text;
}

}  // namespace

std::string unit_warning(const Job& job, const ReachableArea& reach) {
  const MeshFile* mesh = mesh_of(job.scene);
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source)) return {};
  if ((mesh && mesh->any_size) || reach.share >= max_suspect_fraction) return {};
  const auto& vertices = job.design_w.vertices;  // including vertices that are not judged
  const double part = (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).maxCoeff();
  const double path = largest_size(swept_spans(job).tip);
  const cutting::Design few_w = thinned(job.design_w);
  double best_factor = 1.0;
  ReachableArea best;
  for (const double factor : factors) {
    // The sizes of path and part must agree within a factor of 2, less than between any two units:
    // this saves a sweep for most ratios.
    if (!(path > 0.5 * factor * part && path < 2.0 * factor * part)) continue;  // another size
    const ReachableArea with = reachable_area(scaled(few_w, job.scene.part.T_wm, factor), job);
    if (!(with.cut > best.cut)) continue;
    best = with;
    best_factor = factor;
  }
  if (best.cut < min_fit_fraction || best.cut < min_cut_gain * reach.cut) return {};
  return fmt::format(
      "{:.2g} % of the judged area is cut within {} mm of the design; with the part {:.4g} times "
      "as "
      "large it would be {:.3g} %: {}",
      100.0 * reach.cut, job.scene.band, best_factor, 100.0 * best.cut, advice(job, best_factor));
}

namespace {

using cutting::TriangleTree;
using Eigen::Vector3d;
using Touch = DatumDescription::Touch;

/// A surface that a probe can touch, in the workpiece frame.
struct TouchSurface {
  std::string name;
  TriangleTree surface;
  double beyond = 0.0;  ///< mm outside its triangles: the allowance of a blank raised from the
                        ///< design
};

/// The contact nearest to a touch.
struct Contact {
  std::string name;
  bool within_band = false;
  double lean = pi;            ///< rad, from the inward normal to the direction of the touch
  double distance = infinity;  ///< mm

  bool is_better_than(const Contact& other) const {
    return std::tuple(!within_band, lean, distance) <
           std::tuple(!other.within_band, other.lean, other.distance);
  }
};

TouchSurface touch_surface(std::string name, const cutting::ClosedMesh& mesh,
                           const kinematics::Pose& T) {
  cutting::ClosedMesh mesh_w = cutting::moved(mesh, T);
  return {std::move(name), TriangleTree(std::move(mesh_w.vertices), std::move(mesh_w.triangles))};
}

/// Adds the blank if its shape is not that of the design.
void add_blank(const Job& job, std::vector<TouchSurface>& surfaces) {
  if (!job.scene.cutting) return;
  const kinematics::Pose& T_wm = job.scene.part.T_wm;
  const auto add = [&](const BodyShape& shape, const Vector3d& at_m) {
    BodyDescription body{"blank", shape};
    body.T.translation() = at_m;
    surfaces.push_back(touch_surface("the blank", mesh_of(body, {"the blank", "cutting"}), T_wm));
  };
  const auto& blank = job.scene.cutting->blank;
  if (const auto* box = std::get_if<cutting::BoxBlank>(&blank))
    add(BoxShape{box->upper_k - box->lower_k}, 0.5 * (box->upper_k + box->lower_k));
  if (const auto* cylinder = std::get_if<cutting::CylinderBlank>(&blank))
    add(CylinderShape{cylinder->radius, cylinder->upper - cylinder->lower},
        {0.0, 0.0, cylinder->lower});
  if (const auto* mesh = std::get_if<MeshFile>(&blank)) add(MeshShape{*mesh}, Vector3d::Zero());
  if (const auto* offset = std::get_if<CuttingDescription::OffsetBlank>(&blank))
    surfaces.push_back({"the blank", TriangleTree(job.design_w.vertices, job.design_w.triangles),
                        offset->allowance});
  if (const auto* turned = std::get_if<CuttingDescription::TurnedBlank>(&blank)) {
    Eigen::MatrixX2d profile(turned->profile.rows(), 2);
    profile << turned->profile.col(1), turned->profile.col(0);
    add(RevolvedShape{profile}, Vector3d::Zero());
  }
}

/// Returns the surfaces that do not move relative to the part while it is touched.
std::vector<TouchSurface> touch_surfaces(const Job& job) {
  std::vector<TouchSurface> surfaces;
  surfaces.push_back(
      {"the part", TriangleTree(job.design_w.vertices, job.design_w.triangles), 0.0});
  add_blank(job, surfaces);
  for (const SolidBody& fixture : fixture_bodies(job.scene))
    surfaces.push_back(touch_surface(fixture.name, fixture.mesh, kinematics::Pose::Identity()));
  // The table is the first carriage on the workpiece side, or the bed.
  const auto& joints = job.scene.machine.joints;
  const bool on_carriage = !joints.empty() && joints.front().side == kinematics::Side::Workpiece;
  const int holder = on_carriage ? Carriers{int(joints.size())}.carriage(0) : Carriers::bed;
  for (const SolidBody& body : machine_bodies(job.scene.machine))
    if (body.frame == holder)
      surfaces.push_back(touch_surface(body.name, body.mesh, job.scene.machine.T_bw.inverse()));
  return surfaces;
}

Vector3d normal_of(const TriangleTree& surface, int triangle) {
  const auto corner = [&](int k) -> Vector3d {
    return surface.vertices().row(surface.triangles()(triangle, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
}

/// Returns the contact with the smallest lean among those within the band; if there is none, the
/// nearest point. Near an edge several faces are within the band, and the probe may mean any of
/// them.
Contact contact_with(const TouchSurface& touch_surface, const Touch& touch, double band) {
  Contact best{touch_surface.name};
  const TriangleTree& surface = touch_surface.surface;
  for (const auto& near : surface.within(touch.point_w, band + touch_surface.beyond)) {
    const double against = -touch.direction_w.dot(normal_of(surface, near.triangle));
    // clamped: rounding may put the cosine beyond 1
    const double lean = std::acos(std::clamp(against, -1.0, 1.0));
    const Contact contact{touch_surface.name, true, lean, std::sqrt(near.squared)};
    if (contact.is_better_than(best)) best = contact;
  }
  if (best.within_band) return best;
  const auto nearest = surface.nearest(touch.point_w);
  if (nearest.triangle >= 0) best.distance = std::sqrt(nearest.squared);
  return best;
}

std::string seen_text(const Contact& best) {
  if (!best.within_band)
    return fmt::format("a touch in the air: {} is nearest, {:.4g} mm away", best.name,
                       best.distance);
  const double degrees = best.lean / units::deg;
  // the same limit about the opposite direction: the sign of the touch is wrong
  if (best.lean > pi - max_touch_lean)
    return fmt::format(
        "a touch from within {}: its direction is that in which the probe moves, turn it round",
        best.name);
  return fmt::format(
      "a touch along a face of {}: its direction leans {:.3g} degrees from the "
      "normal of the nearest face",
      best.name, degrees);
}

/// Returns the location of a touch in the scene.
Place location_of_touch(const Scene& scene, std::size_t number) {
  const Node* node = scene.tree ? scene.tree->find("datum") : nullptr;
  const Node* touches = node ? node->find("touch") : nullptr;
  if (touches == nullptr) return {};
  const Node::Array* list = touches->array();
  if (list != nullptr && number < list->size()) touches = &(*list)[number];
  const Node* point = touches->find("point_mm");
  return point ? point->place : touches->place;
}

}  // namespace

std::optional<BadInput> touch_error(const Job& job) {
  const Scene& scene = job.scene;
  if (scene.datum.kind != DatumDescription::Kind::TouchOff) return std::nullopt;
  const std::vector<TouchSurface> surfaces = touch_surfaces(job);
  for (std::size_t i = 0; i < scene.datum.touches.size(); ++i) {
    Contact best;
    for (const TouchSurface& surface : surfaces) {
      const Contact contact = contact_with(surface, scene.datum.touches[i], scene.band);
      if (contact.is_better_than(best)) best = contact;
    }
    if (best.within_band && best.lean <= max_touch_lean) continue;
    const Place place = location_of_touch(scene, i);
    return BadInput(
        place.file ? *place.file : scene.file.string(), place.line, place.column,
        fmt::format("a touch of the part, its blank, a fixture or the table within {} mm "
                    "(search.band_mm), in a direction against the outward normal to {:.0f} degrees",
                    scene.band, max_touch_lean / units::deg),
        seen_text(best));
  }
  return std::nullopt;
}

namespace {

using cutting::VertexStatus;

/// Returns advice such as "; with G54 Z = -80 it touches". A wrong unit comes first, as an offset
/// would hide it.
std::string next_step(const Job& job) {
  if (const std::string doubt = unit_warning(job, {}); !doubt.empty()) return "; " + doubt;
  const auto out = placement_suggestion(job);
  return out ? "; " + out->words : "";
}

/// Returns a text such as "; the mesh of the part, read in mm, is 0.04 x 0.04 x 0.02 mm"; empty if
/// the size is usual.
std::string size_warning_advice(const Job& job) {
  const auto* mesh = std::get_if<MeshFile>(&job.scene.part.shape);
  if (mesh == nullptr) return {};
  const std::string odd =
      mesh_size_warning(*mesh, part_mesh_use(job.scene), extents(job.body_m->vertices));
  return odd.empty() ? odd : "; " + odd;
}

BadInput refusal(const Job& job, int line, const std::string& words) {
  return {job.path.file, line, 0,
          fmt::format("a program that comes within {} mm of the part", job.scene.band),
          words + next_step(job) + size_warning_advice(job)};
}

/// Returns the input error if the tool keeps clear of the box around the part by more than the
/// band. This needs no sweep.
std::optional<BadInput> missed_box(const Job& job) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  // Rapids count for the test, so that no contact is missed, but the message is about the feed.
  if (!(closest_gap(job, part, swept.all).gap > job.scene.band)) return std::nullopt;
  const ClosestGap by = closest_gap(job, part, swept.feed);
  return refusal(job, by.line, by.words);
}

/// The nearest cut along the normals of the part, beyond the band.
struct Nearest {
  double s = infinity;  // mm
  int line = 0;
  int tried = 0;  // number of vertices
};

Nearest nearest_cut(const Job& job, double within) {
  const Sweep sweep = error_free_sweep(job, {.band = within, .progress = {}});
  const cutting::Surface surface = sweep.surface(thinned(job.design_w));
  Nearest nearest;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    nearest.tried += surface.status[i] != VertexStatus::Outside;
    const double s = surface.residual[Eigen::Index(i)];
    if (surface.status[i] != VertexStatus::Cut || std::abs(s) >= std::abs(nearest.s)) continue;
    nearest.s = s;
    nearest.line = surface.cut_line[i];
  }
  return nearest;
}

std::string words_of(const Nearest& nearest, double within) {
  if (!std::isfinite(nearest.s))
    return fmt::format("nor within {} mm, where {} of its vertices were tried", within,
                       nearest.tried);
  return fmt::format("the nearest cut lies {:.1f} mm {} it", std::abs(nearest.s),
                     nearest.s > 0.0 ? "above" : "below");
}

/// Returns the input error if the part is judged at vertices so far apart that the program may cut
/// between them.
std::optional<BadInput> is_sparsely_judged(const Job& job, const Nearest& nearest) {
  const JudgedVertices places = judged_vertices(job.design_w);
  if (std::isfinite(nearest.s) || !is_sparse(places, job.scene.tool)) return std::nullopt;
  const auto* mesh = std::get_if<MeshFile>(&job.scene.part.shape);
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal);
  std::string expected = fmt::format("{} judged vertices or more", min_judged);
  if (cutter != nullptr)
    expected +=
        fmt::format(", no farther apart than the cutter is wide, {:.4g} mm", 2.0 * cutter->radius);
  std::string seen = fmt::format(
      "{} judged {}, up to {:.4g} mm apart, none of which the program cuts: whether it cuts "
      "between them is not known",
      places.vertices, places.vertices == 1 ? "vertex" : "vertices", places.apart);
  if (mesh != nullptr && job.scene.part.sampling.kind == PartSampling::Kind::Vertices)
    seen += "; part.sampling = \"adaptive\" adds vertices to those of the mesh";
  return BadInput(mesh != nullptr ? mesh->file.string() : job.scene.file.string(), 0, 0, expected,
                  seen);
}

std::string span_text(const char* name, const Span& tip, const Span& part) {
  // a pose leaves rounding instead of a zero, which would print as 1e-14
  const auto shown = [](double mm) { return std::abs(mm) < 1e-9 ? 0.0 : mm; };
  return fmt::format("{} {:.4g} to {:.4g} mm of {:.4g} to {:.4g}", name, shown(tip.low),
                     shown(tip.high), shown(part.low), shown(part.high));
}

/// Returns the warning for a part that the program cuts in some regions only.
std::string partial_reach_text(const Job& job, const ReachableArea& reach) {
  if (std::string doubt = unit_warning(job, reach); !doubt.empty()) return doubt;
  const Spans tip = swept_spans(job).tip, part = part_spans(job);
  const bool milled = !job.machine.workpiece_spindle;
  const auto out = placement_suggestion(job);
  std::string where = span_text(milled ? "x" : "along the spindle", tip[0], part[0]);
  where += ", " + span_text(milled ? "y" : "radius", tip[1], part[1]);
  if (milled) where += ", " + span_text("z", tip[2], part[2]);
  return fmt::format(
      "the program comes within {} mm of {:.3g} % of the judged area ({} vertices tried): its feed "
      "takes the tip over {}, in the part's frame{}",
      job.scene.band, 100.0 * reach.share, reach.tried, where, out ? "; " + out->words : "");
}

/// Returns the warning if most of what the program reaches is gouged; none otherwise.
std::optional<std::string> too_deep(const Job& job, const ReachableArea& reach) {
  constexpr double max_gouged = 0.5;  // fraction of the area that the program reaches
  const double gouged = reach.share - reach.cut;
  if (!(gouged > max_gouged * reach.share)) return std::nullopt;
  return fmt::format(
      "the program takes away {:.3g} % of the judged area, more than {} mm below the design, and "
      "cuts {:.3g} % within it ({} vertices tried){}",
      100.0 * gouged, job.scene.band, 100.0 * reach.cut, reach.tried, next_step(job));
}

/// Returns a warning if the part is much smaller than the range of the feed: a program of a larger
/// part may cut all of a small one.
std::vector<std::string> much_smaller_part(const Job& job) {
  constexpr double max_times = 4.0;  // lead-outs and the passes beside a narrow part stay below
                                     // this ratio
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source)) return {};
  const auto largest = [](const Spans& spans) {
    double size = 0.0;
    for (const Span& span : spans)
      if (std::isfinite(span.size())) size = std::max(size, span.size());
    return size;
  };
  const double feed = largest(swept_spans(job).tip);
  // Including vertices that are not judged.
  const double part = extents(job.design_w.vertices).maxCoeff();
  if (!(feed > max_times * part)) return {};
  return {fmt::format(
      "the program feeds over {:.4g} mm, {:.3g} times the part of {:.4g} mm: it looks like "
      "the program of another part, or part.unit or a size of [part] like another unit",
      feed, feed / part, part)};
}

}  // namespace

Placement placement(const Job& job) {
  if (job.path.motion_blocks == 0)
    return {BadInput(job.path.file, 0, 0, "a program that cuts the part", "one that moves nothing"),
            {}};
  if (auto fault = missed_box(job)) return {std::move(fault), {}};
  if (auto fault = touch_error(job)) return {std::move(fault), {}};
  // The checks go from cheap to expensive: boxes, touches, a sweep over thinned vertices, one over
  // all.
  const ReachableArea reach = reachable_area(thinned(job.design_w), job);
  if (auto text = too_deep(job, reach)) return {std::nullopt, {std::move(*text)}};
  if (reach.share >= min_within_reach) return {std::nullopt, much_smaller_part(job)};
  if (reach.share > 0.0 || reachable_area(job.design_w, job).share > 0.0)
    return {std::nullopt, {partial_reach_text(job, reach)}};
  const double within = cutting::gouge_bands * job.scene.band;
  const Nearest nearest = nearest_cut(job, within);
  if (auto fault = is_sparsely_judged(job, nearest)) return {std::move(fault), {}};
  return {refusal(job, nearest.line, "nothing cut; " + words_of(nearest, within)), {}};
}

Job placed(Job job) {
  Placement found = placement(job);
  if (found.fault) throw *found.fault;
  job.warnings.insert(job.warnings.end(), found.warnings.begin(), found.warnings.end());
  return job;
}

void check_cuts_part(const Job& job, const Cut& cut) {
  const auto& status = cut.surface.status;
  if (std::any_of(status.begin(), status.end(), [](VertexStatus one) {
        return one == VertexStatus::Cut || one == VertexStatus::Gouged;
      }))
    return;
  const double within = cutting::gouge_bands * job.scene.band;
  const Nearest nearest = nearest_cut(job, within);
  if (auto fault = is_sparsely_judged(job, nearest)) throw BadInput(std::move(*fault));
  throw BadInput(
      job.path.file, nearest.line, 0,
      fmt::format("a program that cuts the part within {} mm of the design", job.scene.band),
      fmt::format("nothing cut ({}); {}", cut.name, words_of(nearest, within)));
}

}  // namespace abbe::sim
