#include "sim/cut/datum_touches.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "cutting/triangle_tree.h"
#include "kinematics/numbers.h"
#include "kinematics/units.h"
#include "sim/cut/bodies.h"
#include "sim/scene/toml_tree.h"

namespace abbe::sim {
namespace {

using cutting::TriangleTree;
using Eigen::Vector3d;
using Touch = DatumDescription::Touch;

/// Something that a probe can touch, in the workpiece frame.
struct Touchable {
  std::string name;
  TriangleTree surface;
  double beyond = 0.0;  ///< mm, further than its triangles: the allowance of a raised design
};

/// What is nearest to a touch.
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

Touchable touchable(std::string name, const cutting::ClosedMesh& mesh, const kinematics::Pose& T) {
  cutting::ClosedMesh mesh_w = cutting::moved(mesh, T);
  return {std::move(name), TriangleTree(std::move(mesh_w.vertices), std::move(mesh_w.triangles))};
}

/// The blank, as far as it is more than the design.
void add_blank(const Job& job, std::vector<Touchable>& surfaces) {
  if (!job.scene.cutting) return;
  const kinematics::Pose& T_wm = job.scene.part.T_wm;
  const auto add = [&](const BodyShape& shape, const Vector3d& at_m) {
    BodyDescription body{"blank", shape};
    body.T.translation() = at_m;
    surfaces.push_back(touchable("the blank", mesh_of(body, {"the blank", "cutting"}), T_wm));
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

/// What stands still against the part while it is touched.
std::vector<Touchable> touchables(const Job& job) {
  std::vector<Touchable> surfaces;
  surfaces.push_back(
      {"the part", TriangleTree(job.design_w.vertices, job.design_w.triangles), 0.0});
  add_blank(job, surfaces);
  for (const SolidBody& fixture : fixture_bodies(job.scene))
    surfaces.push_back(touchable(fixture.name, fixture.mesh, kinematics::Pose::Identity()));
  const auto& joints = job.scene.machine.joints;
  const bool on_carriage = !joints.empty() && joints.front().side == kinematics::Side::Workpiece;
  const int holder = on_carriage ? Carriers{int(joints.size())}.carriage(0) : Carriers::bed;
  for (const SolidBody& body : machine_bodies(job.scene.machine))
    if (body.frame == holder)
      surfaces.push_back(touchable(body.name, body.mesh, job.scene.machine.T_bw.inverse()));
  return surfaces;
}

Vector3d normal_of(const TriangleTree& surface, int triangle) {
  const auto corner = [&](int k) -> Vector3d {
    return surface.vertices().row(surface.triangles()(triangle, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
}

/// The contact of a touch with a surface that leans least, of those within the band; without one
/// the nearest place.
Contact contact_with(const Touchable& touchable, const Touch& touch, double band) {
  Contact best{touchable.name};
  const TriangleTree& surface = touchable.surface;
  for (const auto& near : surface.within(touch.point_w, band + touchable.beyond)) {
    const double against = -touch.direction_w.dot(normal_of(surface, near.triangle));
    const double lean = std::acos(std::clamp(against, -1.0, 1.0));
    const Contact contact{touchable.name, true, lean, std::sqrt(near.squared)};
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
  if (best.lean > pi - most_touch_lean)
    return fmt::format(
        "a touch from within {}: its direction is that in which the probe moves, turn it round",
        best.name);
  return fmt::format(
      "a touch along a face of {}: its direction leans {:.3g} degrees from the "
      "normal of the nearest face",
      best.name, degrees);
}

/// Place of a touch in the scene.
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
  const std::vector<Touchable> surfaces = touchables(job);
  for (std::size_t i = 0; i < scene.datum.touches.size(); ++i) {
    Contact best;
    for (const Touchable& surface : surfaces) {
      const Contact contact = contact_with(surface, scene.datum.touches[i], scene.band);
      if (contact.is_better_than(best)) best = contact;
    }
    if (best.within_band && best.lean <= most_touch_lean) continue;
    const Place place = location_of_touch(scene, i);
    return BadInput(
        place.file ? *place.file : scene.file.string(), place.line, place.column,
        fmt::format("a touch of the part, its blank, a fixture or the table within {} mm "
                    "(search.band_mm), in a direction against the outward normal to {:.0f} degrees",
                    scene.band, most_touch_lean / units::deg),
        seen_text(best));
  }
  return std::nullopt;
}

}  // namespace abbe::sim
