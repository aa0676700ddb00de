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

namespace {

// A program that reaches more than this fraction of the judged area gives no doubt about its unit.
constexpr double max_suspect_fraction = 0.5;
// The scaled part must be cut over this fraction of the judged area, and over so many times the
// area that is cut without scaling.
constexpr double min_fit_fraction = 0.1, min_cut_gain = 4.0;

// Ratios of any two usual units of length.
constexpr std::array unit_ratios{units::inch,       10.0, 100.0, 1000.0,
                                 1.0 / units::inch, 0.1,  0.01,  0.001};

const MeshFile* mesh_file(const Scene& scene) { return std::get_if<MeshFile>(&scene.part.shape); }

/// Returns the design scaled about the zero of its own frame.
cutting::Design scale_design(cutting::Design design_w, const kinematics::Pose& T_wm, double ratio) {
  const Eigen::RowVector3d zero = T_wm.translation().transpose();
  design_w.vertices = (ratio * (design_w.vertices.rowwise() - zero)).rowwise() + zero;
  design_w.area *= ratio * ratio;
  return design_w;
}

double largest_size(const Spans& spans) {
  double largest = 0.0;
  for (const Span& span : spans)
    if (std::isfinite(span.size())) largest = std::max(largest, span.size());
  return largest;
}

/// Returns advice about the keys or NC codes that may have the wrong unit.
/// @param ratio  scale with which the part fits
std::string unit_advice(const Job& job, double ratio) {
  std::vector<std::string> remedies;
  if (const MeshFile* mesh = mesh_file(job.scene))
    if (const std::string unit = unit_label(mesh->unit * ratio); !unit.empty())
      remedies.push_back(fmt::format("check whether part.unit should be \"{}\"", unit));
  const auto inch_word = std::ranges::find_if(job.path.unit_words, &program::UnitWord::inch);
  if (ratio == units::inch && inch_word != job.path.unit_words.end())
    remedies.push_back(fmt::format("G20 on line {} may be wrong", inch_word->line));
  if (ratio == 1.0 / units::inch && inch_word == job.path.unit_words.end())
    remedies.push_back("the program may be in inches without G20");
  if (remedies.empty()) remedies.push_back("check the units of part and program");
  std::string text = fmt::format("{}", fmt::join(remedies, ", or "));
  return mesh_file(job.scene) ? text + "; set part.any_size = true if the size is right" : text;
}

/// Returns a text such as "2 % of the judged area is cut within 2 mm of the design; with the part
/// 25.4 times as large it would be 97 %: part.unit = "inch" may be meant". It is given for a
/// program from a file that reaches less than half of the part, if the part scaled by a ratio of
/// units is cut over four times the area and over a tenth at least. Empty otherwise, and for a mesh
/// of part.any_size.
/// @param reach  of the thinned design as it stands
std::string unit_warning(const Job& job, const ReachableArea& reach) {
  const MeshFile* mesh = mesh_file(job.scene);
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source)) return {};
  if ((mesh && mesh->is_size_intended) || reach.reached_fraction >= max_suspect_fraction) return {};
  const double part_size = extents(job.design_w.vertices).maxCoeff();  // with vertices not judged
  const double path_size = largest_size(swept_spans(job).tip);
  const cutting::Design thinned_w = thin_out(job.design_w);
  double best_ratio = 1.0;
  ReachableArea best_reach;
  for (const double ratio : unit_ratios) {
    // The sizes of path and part must agree within a factor of 2, which is less than the ratio of
    // any two units. This saves the sweep for most ratios.
    if (!(path_size > 0.5 * ratio * part_size && path_size < 2.0 * ratio * part_size)) continue;
    const ReachableArea reach_scaled =
        reachable_area(scale_design(thinned_w, job.scene.part.T_wm, ratio), job);
    if (!(reach_scaled.cut > best_reach.cut)) continue;
    best_reach = reach_scaled;
    best_ratio = ratio;
  }
  if (best_reach.cut < min_fit_fraction || best_reach.cut < min_cut_gain * reach.cut) return {};
  return fmt::format(
      "{:.2g} % of the judged area is cut within {} mm of the design; with the part scaled by "
      "{:.4g} it would be {:.3g} %: {}",
      100.0 * reach.cut, job.scene.band, best_ratio, 100.0 * best_reach.cut,
      unit_advice(job, best_ratio));
}

using cutting::TriangleTree;
using Eigen::Vector3d;
using Touch = DatumDescription::Touch;

// Largest angle between the direction of a touch and the surface normal, rad: 40 degrees. On a
// steeper face the ball slides and reads another component than that of its motion.
constexpr double max_touch_angle = 0.6981317007977318;

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
  cutting::ClosedMesh mesh_w = cutting::transformed_mesh(mesh, T);
  return {std::move(name), TriangleTree(std::move(mesh_w.vertices), std::move(mesh_w.triangles))};
}

/// Adds the blank if its shape is not that of the design.
void add_blank(const Job& job, std::vector<TouchSurface>& surfaces) {
  if (!job.scene.cutting) return;
  const kinematics::Pose& T_wm = job.scene.part.T_wm;
  const auto add_shape = [&](const BodyShape& shape, const Vector3d& position_m) {
    BodyDescription body{"blank", shape};
    body.T.translation() = position_m;
    surfaces.push_back(touch_surface("the blank", body_mesh(body, {"the blank", "cutting"}), T_wm));
  };
  const auto& blank = job.scene.cutting->blank;
  if (const auto* box = std::get_if<cutting::BoxBlank>(&blank))
    add_shape(BoxShape{box->upper_k - box->lower_k}, 0.5 * (box->upper_k + box->lower_k));
  if (const auto* cylinder = std::get_if<cutting::CylinderBlank>(&blank))
    add_shape(CylinderShape{cylinder->radius, cylinder->upper - cylinder->lower},
              {0.0, 0.0, cylinder->lower});
  if (const auto* mesh = std::get_if<MeshFile>(&blank))
    add_shape(MeshShape{*mesh}, Vector3d::Zero());
  if (const auto* offset = std::get_if<CuttingDescription::OffsetBlank>(&blank))
    surfaces.push_back({"the blank", TriangleTree(job.design_w.vertices, job.design_w.triangles),
                        offset->allowance});
  if (const auto* turned = std::get_if<CuttingDescription::TurnedBlank>(&blank)) {
    Eigen::MatrixX2d profile(turned->profile.rows(), 2);
    profile << turned->profile.col(1), turned->profile.col(0);
    add_shape(RevolvedShape{profile}, Vector3d::Zero());
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
  const int table_frame = on_carriage ? Carriers{int(joints.size())}.carriage(0) : Carriers::bed;
  for (const SolidBody& body : machine_bodies(job.scene.machine))
    if (body.frame == table_frame)
      surfaces.push_back(touch_surface(body.name, body.mesh, job.scene.machine.T_bw.inverse()));
  return surfaces;
}

Vector3d outward_normal(const TriangleTree& surface, int triangle) {
  const auto corner = [&](int k) -> Vector3d {
    return surface.vertices().row(surface.triangles()(triangle, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
}

/// Returns the contact with the smallest lean among those within the band, since near an edge the
/// touch may be meant for any of several faces. Without one it returns the nearest point.
Contact contact_with(const TouchSurface& touch_surface, const Touch& touch, double band) {
  Contact best_contact{touch_surface.name};
  const TriangleTree& surface = touch_surface.surface;
  for (const auto& candidate : surface.within(touch.point_w, band + touch_surface.beyond)) {
    const double cosine = -touch.direction_w.dot(outward_normal(surface, candidate.triangle));
    // Rounding may put the cosine beyond 1.
    const double lean = std::acos(std::clamp(cosine, -1.0, 1.0));
    const Contact contact{touch_surface.name, true, lean, std::sqrt(candidate.squared_distance)};
    if (contact.is_better_than(best_contact)) best_contact = contact;
  }
  if (best_contact.within_band) return best_contact;
  const auto nearest = surface.nearest(touch.point_w);
  if (nearest.triangle >= 0) best_contact.distance = std::sqrt(nearest.squared_distance);
  return best_contact;
}

std::string seen_text(const Contact& best) {
  if (!best.within_band)
    return fmt::format("a touch in the air: the nearest body is {}, {:.4g} mm away", best.name,
                       best.distance);
  const double lean_deg = best.lean / units::deg;
  // The same limit applies to the opposite direction: then the sign of the direction is wrong.
  if (best.lean > pi - max_touch_angle)
    return fmt::format(
        "a touch from inside {}: reverse the direction, it must be that of the probe motion",
        best.name);
  return fmt::format(
      "a touch along a face of {}: its direction is {:.3g} degrees from the normal of the nearest "
      "face",
      best.name, lean_deg);
}

/// Returns the location of a touch in the scene.
SourcePosition location_of_touch(const Scene& scene, std::size_t number) {
  const Node* node = scene.tree ? scene.tree->find("datum") : nullptr;
  const Node* touches = node ? node->find("touch") : nullptr;
  if (touches == nullptr) return {};
  const Node::Array* list = touches->array();
  if (list != nullptr && number < list->size()) touches = &(*list)[number];
  const Node* point = touches->find("point_mm");
  return point ? point->position : touches->position;
}

}  // namespace

std::optional<BadInput> touch_error(const Job& job) {
  const Scene& scene = job.scene;
  if (scene.datum.kind != DatumDescription::Kind::TouchOff) return std::nullopt;
  const std::vector<TouchSurface> surfaces = touch_surfaces(job);
  for (std::size_t i = 0; i < scene.datum.touches.size(); ++i) {
    Contact best_contact;
    for (const TouchSurface& surface : surfaces) {
      const Contact contact = contact_with(surface, scene.datum.touches[i], scene.band);
      if (contact.is_better_than(best_contact)) best_contact = contact;
    }
    if (best_contact.within_band && best_contact.lean <= max_touch_angle) continue;
    const SourcePosition position = location_of_touch(scene, i);
    return BadInput(
        position.file ? *position.file : scene.file.string(), position.line, position.column,
        fmt::format("a touch of the part, its blank, a fixture or the table within {} mm "
                    "(search.band_mm), against the outward normal within {:.0f} degrees",
                    scene.band, max_touch_angle / units::deg),
        seen_text(best_contact));
  }
  return std::nullopt;
}

namespace {

using cutting::VertexStatus;

// Fraction of the judged area that a program must reach; below it a warning is given.
constexpr double min_reachable_fraction = 0.99;

/// Returns advice such as "; with G54 Z = -80 it touches"; empty if there is no placement at which
/// the program cuts more.
/// @param now  the present reach
std::string shift_advice(const Job& job, const ReachableArea& now) {
  constexpr double least_gain =
      0.01;  // fraction of the judged area, above the noise of few vertices
  const auto suggestion = placement_suggestion(job);
  // A placement at which the tool touches helps too if nothing is reached now.
  const double cut_at_least = now.reached_fraction > 0.0 ? now.cut + least_gain : 0.0;
  return suggestion && suggestion->reach.cut >= cut_at_least ? "; " + suggestion->words : "";
}

/// Returns the advice for a program that cuts nothing, or gouges. A wrong unit is tried first,
/// since an offset would hide it.
std::string advice_text(const Job& job, const ReachableArea& now) {
  if (const std::string warning = unit_warning(job, {}); !warning.empty()) return "; " + warning;
  return shift_advice(job, now);
}

/// Returns a text such as "; the mesh of the part, read in mm, is 0.04 x 0.04 x 0.02 mm"; empty for
/// a usual size.
std::string size_advice(const Job& job) {
  const auto* mesh = std::get_if<MeshFile>(&job.scene.part.shape);
  if (mesh == nullptr) return {};
  const std::string warning =
      mesh_size_warning(*mesh, part_mesh_use(job.scene), extents(job.body_m->vertices));
  return warning.empty() ? warning : "; " + warning;
}

/// Returns the input error for a program that does not come near the part.
BadInput distance_error(const Job& job, int line, const std::string& distance_text) {
  return {job.path.file, line, 0,
          fmt::format("a program that comes within {} mm of the part", job.scene.band),
          distance_text + advice_text(job, {}) + size_advice(job)};
}

/// Returns the input error if the tool stays farther than the band from the box around the part.
/// This needs no sweep.
std::optional<BadInput> missed_part_error(const Job& job) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  // The test includes rapids, since they may cut too, but the message is about the feed.
  if (!(closest_gap(job, part, swept.all).gap > job.scene.band)) return std::nullopt;
  const ClosestGap nearest = closest_gap(job, part, swept.feed);
  return distance_error(job, nearest.line, nearest.words);
}

/// The cut nearest to the part along its normals.
struct NearestCut {
  double residual = infinity;  // mm
  int line = 0;
  int vertices = 0;  // number of vertices tried
};

NearestCut nearest_cut(const Job& job, double within) {
  const Sweep sweep = error_free_sweep(job, {.band = within, .progress = {}});
  const cutting::Surface surface = sweep.surface(thin_out(job.design_w));
  NearestCut nearest;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    nearest.vertices += surface.status[i] != VertexStatus::Outside;
    const double residual = surface.residual[Eigen::Index(i)];
    if (surface.status[i] != VertexStatus::Cut || std::abs(residual) >= std::abs(nearest.residual))
      continue;
    nearest.residual = residual;
    nearest.line = surface.cut_line[i];
  }
  return nearest;
}

std::string nearest_text(const NearestCut& nearest, double within) {
  if (!std::isfinite(nearest.residual))
    return fmt::format("nor within {} mm, where {} of its vertices were tested", within,
                       nearest.vertices);
  return fmt::format("the nearest cut lies {:.1f} mm {} it", std::abs(nearest.residual),
                     nearest.residual > 0.0 ? "above" : "below");
}

/// Returns the input error if the program cuts no judged vertex, but may cut between them, since
/// they are few or far apart.
std::optional<BadInput> sparse_error(const Job& job, const NearestCut& nearest) {
  const JudgedVertices judged = judged_vertices(job.design_w);
  if (std::isfinite(nearest.residual) || !is_sparse(judged, job.scene.tool)) return std::nullopt;
  const auto* mesh = std::get_if<MeshFile>(&job.scene.part.shape);
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal);
  std::string expected = fmt::format("at least {} judged vertices", min_judged_vertices);
  if (cutter != nullptr)
    expected += fmt::format(", at most a cutter diameter ({:.4g} mm) apart", 2.0 * cutter->radius);
  std::string seen = fmt::format(
      "{} judged {}, up to {:.4g} mm apart, none of them cut: it is unknown whether the program "
      "cuts between them",
      judged.vertices, judged.vertices == 1 ? "vertex" : "vertices", judged.max_distance);
  if (mesh != nullptr && job.scene.part.sampling.kind == PartSampling::Kind::Vertices)
    seen += "; part.sampling = \"adaptive\" adds vertices to those of the mesh";
  return BadInput(mesh != nullptr ? mesh->file.string() : job.scene.file.string(), 0, 0, expected,
                  seen);
}

std::string span_text(const char* name, const Span& tip, const Span& part) {
  // A pose leaves rounding errors, which would print as 1e-14 instead of 0.
  const auto without_rounding = [](double mm) { return std::abs(mm) < 1e-9 ? 0.0 : mm; };
  return fmt::format("{} {:.4g} to {:.4g} mm of {:.4g} to {:.4g}", name, without_rounding(tip.low),
                     without_rounding(tip.high), without_rounding(part.low),
                     without_rounding(part.high));
}

/// Returns the warning for a program that reaches only a fraction of the part.
std::string partial_reach_text(const Job& job, const ReachableArea& reach) {
  if (std::string warning = unit_warning(job, reach); !warning.empty()) return warning;
  const Spans tip = swept_spans(job).tip, part = part_spans(job);
  const bool is_milled = !job.machine.workpiece_spindle;
  std::string ranges = span_text(is_milled ? "x" : "along the spindle", tip[0], part[0]);
  ranges += ", " + span_text(is_milled ? "y" : "radius", tip[1], part[1]);
  if (is_milled) ranges += ", " + span_text("z", tip[2], part[2]);
  return fmt::format(
      "the program comes within {} mm of {:.3g} % of the judged area ({} vertices tested): its "
      "feed moves take the tip over {}, in the part's frame{}",
      job.scene.band, 100.0 * reach.reached_fraction, reach.vertex_count, ranges,
      shift_advice(job, reach));
}

/// Returns the warning if most of the reached area is gouged; none otherwise.
std::optional<std::string> gouged_text(const Job& job, const ReachableArea& reach) {
  constexpr double max_gouged = 0.5;  // fraction of the area that the program reaches
  const double gouged = reach.reached_fraction - reach.cut;
  if (!(gouged > max_gouged * reach.reached_fraction)) return std::nullopt;
  return fmt::format(
      "the program removes {:.3g} % of the judged area more than {} mm below the design and cuts "
      "{:.3g} % within it ({} vertices tested){}",
      100.0 * gouged, job.scene.band, 100.0 * reach.cut, reach.vertex_count,
      advice_text(job, reach));
}

/// Returns a warning if the part is much smaller than the range of the feed, since a program for a
/// larger part may cut all of a small one.
std::vector<std::string> small_part_warnings(const Job& job) {
  constexpr double max_ratio = 4.0;  // lead-outs, and passes beside a narrow part, stay below it
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source)) return {};
  const double feed_size = largest_size(swept_spans(job).tip);
  const double part_size = extents(job.design_w.vertices).maxCoeff();  // with vertices not judged
  if (!(feed_size > max_ratio * part_size)) return {};
  return {
      fmt::format("the program feeds over {:.4g} mm, {:.3g} times the part of {:.4g} mm: check "
                  "whether it is for this part, part.unit and the sizes in [part]",
                  feed_size, feed_size / part_size, part_size)};
}

}  // namespace

Placement placement(const Job& job) {
  if (job.path.motion_blocks == 0)
    return {
        BadInput(job.path.file, 0, 0, "a program that cuts the part", "a program without motion"),
        {}};
  if (auto error = missed_part_error(job)) return {std::move(error), {}};
  if (auto error = touch_error(job)) return {std::move(error), {}};
  // Cheap checks come first: boxes, touches, a sweep over thinned vertices, a sweep over all.
  const ReachableArea reach = reachable_area(thin_out(job.design_w), job);
  if (auto text = gouged_text(job, reach)) return {std::nullopt, {std::move(*text)}};
  if (reach.reached_fraction >= min_reachable_fraction)
    return {std::nullopt, small_part_warnings(job)};
  if (reach.reached_fraction > 0.0 || reachable_area(job.design_w, job).reached_fraction > 0.0)
    return {std::nullopt, {partial_reach_text(job, reach)}};
  const double within = cutting::gouge_bands * job.scene.band;
  const NearestCut nearest = nearest_cut(job, within);
  if (auto error = sparse_error(job, nearest)) return {std::move(error), {}};
  return {distance_error(job, nearest.line, "nothing cut; " + nearest_text(nearest, within)), {}};
}

Job check_placement(Job job) {
  Placement result = placement(job);
  if (result.fault) throw *result.fault;
  job.warnings.insert(job.warnings.end(), result.warnings.begin(), result.warnings.end());
  return job;
}

void check_cuts_part(const Job& job, const Cut& cut) {
  const auto& status = cut.surface.status;
  const auto is_reached = [](VertexStatus vertex) {
    return vertex == VertexStatus::Cut || vertex == VertexStatus::Gouged;
  };
  if (std::ranges::any_of(status, is_reached)) return;
  const double within = cutting::gouge_bands * job.scene.band;
  const NearestCut nearest = nearest_cut(job, within);
  if (auto error = sparse_error(job, nearest)) throw BadInput(std::move(*error));
  throw BadInput(
      job.path.file, nearest.line, 0,
      fmt::format("a program that cuts the part within {} mm of the design", job.scene.band),
      fmt::format("nothing cut ({}); {}", cut.name, nearest_text(nearest, within)));
}

}  // namespace abbe::sim
