#include "sim/cut/bodies.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "sim/scene/machine.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

namespace {

using cutting::ClosedMesh;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

// Returns the allowed sag of facets, mm. 5 um is the default collision resolution, finer facets
// would not change a result; a ten-thousandth of the radius keeps the facet count of large bodies
// constant.
double sag_of(double radius) { return std::max(5e-3, 1e-4 * radius); }

ClosedMesh revolved(const Eigen::MatrixX2d& profile) {
  return cutting::revolved_mesh(profile, sag_of(profile.col(0).maxCoeff()));
}

ClosedMesh frustum(double below, double above, double height) {
  Eigen::MatrixX2d profile(2, 2);
  profile << below, 0.0, above, height;
  return revolved(profile);
}

// Visitor that builds the mesh of each kind of shape.
struct MeshOfShape {
  ClosedMesh operator()(const BoxShape& box) const { return cutting::box_mesh(box.size); }
  ClosedMesh operator()(const CylinderShape& one) const {
    return frustum(one.radius, one.radius, one.height);
  }
  ClosedMesh operator()(const ConeShape& one) const {
    return frustum(one.radius_below, one.radius_above, one.height);
  }
  ClosedMesh operator()(const SphereShape& one) const {
    return cutting::sphere_mesh(one.radius, sag_of(one.radius));
  }
  ClosedMesh operator()(const RevolvedShape& one) const { return revolved(one.profile); }
  ClosedMesh operator()(const ExtrudedShape& one) const {
    return cutting::extruded_mesh(one.outline, one.height);
  }
  ClosedMesh operator()(const MeshShape& one) const {
    cutting::ReadMeshOptions options;
    options.unit_mm = one.scale;
    cutting::Design design = read_named_mesh(one.mesh, use, options).design;
    return {std::move(design.vertices), std::move(design.triangles), 0.0};
  }

  MeshUse use;
};

/// Returns the names of a body in messages. It sets no travel, since a body of the machine may be
/// larger than the travel.
MeshUse body_mesh_use(SolidBody::Kind kind, const std::string& name) {
  const bool fixture = kind == SolidBody::Kind::Fixture;
  return {fmt::format("{} \"{}\"", fixture ? "fixture" : "body", name),
          fixture ? "fixture" : "body"};
}

/// Returns for every carrier the number of moving axes between it and the workpiece; carriers whose
/// numbers differ by 1 are neighbours. A spindle does not count, as it moves no carriage away.
std::vector<int> places_in_chain(const kinematics::Chain& chain) {
  const Carriers carriers{chain.size()};
  std::vector<int> place(std::size_t(carriers.count()), 0);
  int on_workpiece_side = 0, last = 0;
  for (const Joint& joint : chain.joints()) on_workpiece_side += joint.side == Side::Workpiece;
  place[Carriers::bed] = last = on_workpiece_side;
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.side == Side::Tool && joint.motion != Motion::Spindle) ++last;
    place[std::size_t(carriers.carriage(i))] = joint.side == Side::Workpiece ? i : last;
  }
  place[std::size_t(carriers.workpiece())] = 0;
  place[std::size_t(carriers.tool())] = last;
  return place;
}

// Returns the mesh moved up along z by `height` mm.
ClosedMesh raised(const ClosedMesh& mesh, double height) {
  Pose up = Pose::Identity();
  up.translation().z() = height;
  return cutting::moved(mesh, up);
}

/// Builds cutter, shank and holder of a tool.
class ToolBodies {
 public:
  /// @param skin  mm of cutter and shank that may enter the part
  ToolBodies(const ToolDescription& tool, int frame, double skin)
      : tool_(tool), frame_(frame), skin_(skin) {
    if (const auto* cutter = std::get_if<cutting::Cutter>(&tool.actual)) {
      add_cutter(*cutter);
      add_shank(*cutter);
    }
    if (tool.holder) add(SolidBody::Kind::Holder, "holder", revolved(*tool.holder));
  }

  std::vector<SolidBody> bodies;

 private:
  using Pieces = std::vector<ClosedMesh>;

  void add(SolidBody::Kind kind, const char* name, ClosedMesh mesh, Pieces pieces = {},
           Pieces core = {}) {
    bodies.push_back(
        {kind, name, "t", frame_, std::move(mesh), std::move(pieces), std::move(core)});
  }

  void add_cutter(const cutting::Cutter& cutter) {
    const double sag = sag_of(cutter.radius);
    Pieces core;
    if (skin_ > 0.0) {
      const cutting::InsetCutter inner = cutting::shrunk(cutter, skin_);
      for (const ClosedMesh& piece : cutting::cutter_pieces(inner.cutter, sag))
        core.push_back(raised(piece, inner.raised));
    }
    add(SolidBody::Kind::Cutter, "cutter", cutting::cutter_mesh(cutter, sag),
        cutting::cutter_pieces(cutter, sag), std::move(core));
  }

  /// Adds the shank, from the end of the flank to the holder or, without one, the spindle nose, if
  /// there is room.
  void add_shank(const cutting::Cutter& cutter) {
    const double end = tool_.holder ? (*tool_.holder)(0, 1) : tool_.actual_length;
    const double length = end - cutter.flank_length;
    const double radius = tool_.shank_radius.value_or(cutting::shank_radius(cutter));
    // a quarter of the radius at most: a thin shank keeps a core that can still collide
    const double skin = std::min(skin_, 0.25 * radius);
    if (!(length > skin)) return;
    Pieces core;
    if (skin > 0.0)
      core.push_back(
          raised(frustum(radius - skin, radius - skin, length - skin), cutter.flank_length + skin));
    add(SolidBody::Kind::Shank, "shank",
        raised(frustum(radius, radius, length), cutter.flank_length), {}, std::move(core));
  }

  const ToolDescription& tool_;
  int frame_;
  double skin_;
};

using IgnoredPairs = std::vector<CollisionDescription::Pair>;

}  // namespace

std::vector<Pose> carrier_poses(const kinematics::Chain& chain, const kinematics::AxisVector& q,
                                std::span<const kinematics::JointDeviation> deviations) {
  const Carriers carriers{chain.size()};
  const std::vector<Pose> carriages = kinematics::carriage_poses(chain, q, deviations);
  std::vector<Pose> T(std::size_t(carriers.count()), Pose::Identity());
  std::ranges::copy(carriages, T.begin() + 1);
  // The first joint of the workpiece side carries the workpiece, the last of the tool side the
  // tool; a side without joints is the bed itself.
  const auto on = [&](Side side, std::size_t joint) {
    const bool has = !carriages.empty() && chain.joints()[joint].side == side;
    return has ? carriages[joint] : Pose(Pose::Identity());
  };
  T[std::size_t(carriers.workpiece())] = on(Side::Workpiece, 0) * chain.T_bw_home();
  T[std::size_t(carriers.tool())] = on(Side::Tool, carriages.size() - 1) * chain.T_bt_home();
  return T;
}

ClosedMesh mesh_of(const BodyDescription& body, const MeshUse& use) {
  return cutting::moved(std::visit(MeshOfShape{use}, body.shape), body.T);
}

std::vector<SolidBody> machine_bodies(const MachineDescription& machine) {
  std::vector<SolidBody> bodies;
  const Carriers carriers{int(machine.joints.size())};
  const std::vector<std::string> names = machine_body_names(machine);
  for (const MachineBody& one : machine.bodies) {
    SolidBody body;
    body.carrier =
        one.joint ? std::string(1, machine.joints[std::size_t(*one.joint)].name) : std::string("b");
    body.frame = one.joint ? carriers.carriage(*one.joint) : Carriers::bed;
    body.name = names[bodies.size()];
    body.mesh = mesh_of(one.body, body_mesh_use(SolidBody::Kind::Machine, body.name));
    bodies.push_back(std::move(body));
  }
  return bodies;
}

std::vector<SolidBody> tool_bodies(const Job& part, double skin) {
  return ToolBodies(part.scene.tool, Carriers{part.truth.actual.size()}.tool(), skin).bodies;
}

std::vector<SolidBody> fixture_bodies(const Scene& scene) {
  std::vector<SolidBody> bodies;
  const int frame = Carriers{int(scene.machine.joints.size())}.workpiece();
  const std::vector<std::string> names = fixture_names(scene.fixtures);
  for (std::size_t i = 0; i < names.size(); ++i)
    bodies.push_back(
        {SolidBody::Kind::Fixture, names[i], "w", frame,
         mesh_of(scene.fixtures[i], body_mesh_use(SolidBody::Kind::Fixture, names[i]))});
  return bodies;
}

std::vector<SolidBody> job_bodies(const Job& part) {
  std::vector<SolidBody> bodies = machine_bodies(part.scene.machine);
  std::ranges::move(fixture_bodies(part.scene), std::back_inserter(bodies));
  const Carriers carriers{part.truth.actual.size()};
  bodies.push_back({SolidBody::Kind::Part,
                    "part",
                    "w",
                    carriers.workpiece(),
                    {part.design_w.vertices, part.design_w.triangles, 0.0}});
  std::ranges::move(tool_bodies(part, part.scene.collision.gouge), std::back_inserter(bodies));
  return bodies;
}

namespace {

/// Returns warnings for fixtures inside the part. The search leaves such pairs out, since both
/// bodies are fixed to the workpiece, so a wrong pose or unit would pass unnoticed.
std::vector<std::string> fixtures_inside(const std::vector<SolidBody>& bodies) {
  std::vector<std::string> warnings;
  const auto part = std::ranges::find(bodies, SolidBody::Kind::Part, &SolidBody::kind);
  if (part == bodies.end()) return warnings;
  const auto box_of = [](const SolidBody& body) {
    return Eigen::AlignedBox3d(body.mesh.vertices.colwise().minCoeff().transpose(),
                               body.mesh.vertices.colwise().maxCoeff().transpose());
  };
  const Eigen::AlignedBox3d box = box_of(*part);
  for (const SolidBody& fixture : bodies) {
    if (fixture.kind != SolidBody::Kind::Fixture || !box.contains(box_of(fixture))) continue;
    const cutting::Body whole = searched(*part), clamp = searched(fixture);
    const Pose same = Pose::Identity();
    // the distance comes first: a fixture that cuts through the surface of the part is not inside
    // it
    if (cutting::gap(whole, same, clamp, same).distance > 0.0 &&
        cutting::is_inside(whole, same, clamp, same))
      warnings.push_back(fmt::format(
          "{} lies wholly inside the part: are its place and its unit right?", fixture.name));
  }
  return warnings;
}

}  // namespace

std::vector<std::string> body_warnings(const Job& part, const std::vector<SolidBody>& bodies) {
  std::vector<std::string> warnings;
  if (part.scene.machine.bodies.empty())
    warnings.push_back(
        "the machine has no [[body]]: only tool, holder, fixtures and part are looked at");
  if (!part.scene.tool.holder)
    warnings.push_back(
        "the tool has no [tool.holder]: of what holds it only the bodies of the "
        "machine are looked at");
  if (std::holds_alternative<cutting::Nose>(part.scene.tool.actual)) {
    warnings.push_back("a turning tool is looked at by its holder alone, its edge has no body");
    if (part.scene.cutting)
      warnings.push_back(
          "the stock of a turned part is not met in this search: a rapid through it is "
          "warned of by the cut");
  }
  if (part.machine.workpiece_spindle)
    warnings.push_back(
        "the spindle stands still in this search: what it turns is looked at as it "
        "stands at 0 deg");
  if (const auto* cutter = std::get_if<cutting::Cutter>(&part.scene.tool.actual))
    if (const double most = 0.25 * cutter->radius; part.scene.collision.gouge > most)
      warnings.push_back(
          fmt::format("collision.gouge_mm = {:g} is more than a quarter of the cutter's radius: "
                      "{:g} mm is taken",
                      part.scene.collision.gouge, most));
  std::vector<const BodyDescription*> described;
  for (const MachineBody& one : part.scene.machine.bodies) described.push_back(&one.body);
  for (const BodyDescription& one : part.scene.fixtures) described.push_back(&one);
  for (std::size_t i = 0; i < described.size(); ++i) {
    const auto* mesh = std::get_if<MeshShape>(&described[i]->shape);
    if (mesh == nullptr) continue;
    const ClosedMesh own = cutting::moved(bodies[i].mesh, described[i]->T.inverse());
    std::string text = mesh_size_warning(mesh->mesh, body_mesh_use(bodies[i].kind, bodies[i].name),
                                         extents(own.vertices));
    if (!text.empty()) warnings.push_back(std::move(text));
  }
  std::ranges::move(fixtures_inside(bodies), std::back_inserter(warnings));
  return warnings;
}

cutting::Body searched(const SolidBody& solid) {
  return solid.pieces.empty() ? cutting::make_body(solid.mesh) : cutting::make_body(solid.pieces);
}

cutting::Body search_core(const SolidBody& solid) {
  return solid.core.empty() ? searched(solid) : cutting::make_body(solid.core);
}

bool is_ignored(const IgnoredPairs& ignored, const std::string& a, const std::string& b) {
  return std::ranges::any_of(ignored, [&](const CollisionDescription::Pair& pair) {
    return (pair.a == a && pair.b == b) || (pair.a == b && pair.b == a);
  });
}

std::vector<cutting::BodyPair> pairs_of(const kinematics::Chain& chain,
                                        const std::vector<SolidBody>& bodies,
                                        const std::vector<CollisionDescription::Pair>& ignored) {
  using Kind = SolidBody::Kind;
  const std::vector<int> place = places_in_chain(chain);
  std::vector<cutting::BodyPair> pairs;
  for (std::size_t a = 0; a < bodies.size(); ++a)
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      const SolidBody &one = bodies[a], &other = bodies[b];
      // Neighbouring bodies of the machine overlap at their guideways by design, so a pair of
      // machine bodies needs two axes between it; any other pair needs one.
      const int between = std::abs(place[std::size_t(one.frame)] - place[std::size_t(other.frame)]);
      const bool of_machine = one.kind == Kind::Machine && other.kind == Kind::Machine;
      if (between < (of_machine ? 2 : 1) || is_ignored(ignored, one.name, other.name)) continue;
      pairs.push_back({int(a), int(b)});
    }
  return pairs;
}

kinematics::AxisState ActualMotion::state(const cutting::Moment& moment) const {
  kinematics::AxisState state = samples.states[moment.instant];
  if (moment.u > 0.0 && moment.instant + 1 < samples.states.size()) {
    const kinematics::AxisState& next = samples.states[moment.instant + 1];
    const kinematics::AxisState before = state;
    // directions and spindle speed are those of the move under way, i.e. of its end sample
    state = next;
    state.q = before.q + moment.u * (next.q - before.q);
    state.time_s = before.time_s + moment.u * (next.time_s - before.time_s);
  }
  if (const auto& spindle = part.machine.workpiece_spindle) state.q[*spindle] = 0.0;
  return state;
}

std::vector<kinematics::Pose> ActualMotion::carriers(const cutting::Moment& moment) const {
  const kinematics::AxisState at = state(moment);
  return carrier_poses(part.truth.actual, at.q, deviations(part.truth, at).joints);
}

std::size_t ActualMotion::running(const cutting::Moment& moment) const {
  return std::min(moment.instant + (moment.u > 0.0 ? 1u : 0u), samples.states.size() - 1);
}

ProgramLocation ActualMotion::place(const cutting::Moment& moment) const {
  const std::size_t i = running(moment);
  return {samples.line[i], path.blocks[std::size_t(samples.block[i])].file, state(moment).time_s};
}

bool ActualMotion::is_rapid(const cutting::Moment& moment) const {
  const auto block = std::size_t(samples.block[running(moment)]);
  return path.blocks[block].interpolation == program::Interpolation::Rapid;
}

Collision collision_at(const ActualMotion& actual_motion, const cutting::Moment& moment,
                       const Eigen::Vector3d& place_b) {
  const Carriers carriers{actual_motion.part.truth.actual.size()};
  const std::vector<kinematics::Pose> T = actual_motion.carriers(moment);
  Collision event;
  event.first = event.worst = event.last = actual_motion.place(moment);
  event.place_b = place_b;
  event.place_w = T[std::size_t(carriers.workpiece())].inverse() * place_b;
  event.state = actual_motion.state(moment);
  event.rapid = actual_motion.is_rapid(moment);
  return event;
}

}  // namespace abbe::sim
