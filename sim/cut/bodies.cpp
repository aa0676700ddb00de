#include "sim/cut/bodies.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <utility>

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include "sim/scene/machine.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

namespace {

using cutting::ClosedMesh;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

// Returns the allowed sag of facets, mm. Facets finer than 5 um, the default collision resolution,
// would not change a result. A ten-thousandth of the radius keeps the facet count of large bodies
// constant.
double facet_sag(double radius) { return std::max(5e-3, 1e-4 * radius); }

ClosedMesh revolved(const Eigen::MatrixX2d& profile) {
  return cutting::revolved_mesh(profile, facet_sag(profile.col(0).maxCoeff()));
}

ClosedMesh frustum(double below, double above, double height) {
  Eigen::MatrixX2d profile(2, 2);
  profile << below, 0.0, above, height;
  return revolved(profile);
}

// Builds the mesh of each kind of shape.
struct ShapeMesher {
  ClosedMesh operator()(const BoxShape& box) const { return cutting::box_mesh(box.size); }
  ClosedMesh operator()(const CylinderShape& cylinder) const {
    return frustum(cylinder.radius, cylinder.radius, cylinder.height);
  }
  ClosedMesh operator()(const ConeShape& cone) const {
    return frustum(cone.radius_below, cone.radius_above, cone.height);
  }
  ClosedMesh operator()(const SphereShape& sphere) const {
    return cutting::sphere_mesh(sphere.radius, facet_sag(sphere.radius));
  }
  ClosedMesh operator()(const RevolvedShape& shape) const { return revolved(shape.profile); }
  ClosedMesh operator()(const ExtrudedShape& prism) const {
    return cutting::extruded_mesh(prism.outline, prism.height);
  }
  ClosedMesh operator()(const MeshShape& mesh_file) const {
    cutting::ReadMeshOptions options;
    options.unit_mm = mesh_file.scale;
    cutting::Design design = read_named_mesh(mesh_file.mesh, use, options).design;
    return {std::move(design.vertices), std::move(design.triangles), 0.0};
  }

  MeshUse use;
};

/// Returns the names of a body for messages. They leave the travel out, since a body of the machine
/// may be larger than the travel.
MeshUse body_mesh_use(SolidBody::Kind kind, const std::string& name) {
  const bool is_fixture = kind == SolidBody::Kind::Fixture;
  return {fmt::format("{} \"{}\"", is_fixture ? "fixture" : "body", name),
          is_fixture ? "fixture" : "body"};
}

/// Returns the number of moving axes between each carrier and the workpiece. Carriers whose numbers
/// differ by 1 are neighbours. A spindle does not count, since it does not separate carriages.
std::vector<int> positions_in_chain(const kinematics::Chain& chain) {
  const Carriers carriers{chain.size()};
  std::vector<int> position(std::size_t(carriers.count()), 0);
  int tool_side_position = int(std::ranges::count(chain.joints(), Side::Workpiece, &Joint::side));
  position[Carriers::bed] = tool_side_position;
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.side == Side::Tool && joint.motion != Motion::Spindle) ++tool_side_position;
    position[std::size_t(carriers.carriage(i))] =
        joint.side == Side::Workpiece ? i : tool_side_position;
  }
  position[std::size_t(carriers.workpiece())] = 0;
  position[std::size_t(carriers.tool())] = tool_side_position;
  return position;
}

ClosedMesh raise(const ClosedMesh& mesh, double height) {
  Pose T = Pose::Identity();
  T.translation().z() = height;
  return cutting::transformed_mesh(mesh, T);
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
  using Meshes = std::vector<ClosedMesh>;

  void add(SolidBody::Kind kind, const char* name, ClosedMesh mesh, Meshes pieces = {},
           Meshes core = {}) {
    bodies.push_back(
        {kind, name, "t", frame_, std::move(mesh), std::move(pieces), std::move(core)});
  }

  void add_cutter(const cutting::Cutter& cutter) {
    const double sag = facet_sag(cutter.radius);
    Meshes core;
    if (skin_ > 0.0) {
      const cutting::InsetCutter inner = cutting::inset_cutter(cutter, skin_);
      for (const ClosedMesh& piece : cutting::cutter_meshes(inner.cutter, sag))
        core.push_back(raise(piece, inner.raised));
    }
    add(SolidBody::Kind::Cutter, "cutter", cutting::cutter_mesh(cutter, sag),
        cutting::cutter_meshes(cutter, sag), std::move(core));
  }

  /// Adds the shank, from the end of the flank to the holder, or to the spindle nose if there is no
  /// holder. Adds nothing if the flank leaves no room for it.
  void add_shank(const cutting::Cutter& cutter) {
    const double end = tool_.holder ? (*tool_.holder)(0, 1) : tool_.actual_length;
    const double length = end - cutter.flank_length;
    const double radius = tool_.shank_radius.value_or(cutting::shank_radius(cutter));
    // A skin of at most a quarter of the radius leaves a thin shank a core that can still collide.
    const double skin = std::min(skin_, 0.25 * radius);
    if (!(length > skin)) return;
    Meshes core;
    if (skin > 0.0)
      core.push_back(
          raise(frustum(radius - skin, radius - skin, length - skin), cutter.flank_length + skin));
    add(SolidBody::Kind::Shank, "shank",
        raise(frustum(radius, radius, length), cutter.flank_length), {}, std::move(core));
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
  // Joints run from the workpiece to the tool: the first of the workpiece side carries the
  // workpiece, the last of the tool side carries the tool. Without joints a side is the bed.
  const auto carriage_pose = [&](Side side, std::size_t joint) {
    const bool has_joint = !carriages.empty() && chain.joints()[joint].side == side;
    return has_joint ? carriages[joint] : Pose(Pose::Identity());
  };
  T[std::size_t(carriers.workpiece())] = carriage_pose(Side::Workpiece, 0) * chain.T_bw_home();
  T[std::size_t(carriers.tool())] =
      carriage_pose(Side::Tool, carriages.size() - 1) * chain.T_bt_home();
  return T;
}

ClosedMesh body_mesh(const BodyDescription& body, const MeshUse& use) {
  return cutting::transformed_mesh(std::visit(ShapeMesher{use}, body.shape), body.T);
}

std::vector<SolidBody> machine_bodies(const MachineDescription& machine) {
  std::vector<SolidBody> bodies;
  const Carriers carriers{int(machine.joints.size())};
  const std::vector<std::string> names = machine_body_names(machine);
  for (const MachineBody& machine_body : machine.bodies) {
    SolidBody body;
    body.carrier = machine_body.joint
                       ? std::string(1, machine.joints[std::size_t(*machine_body.joint)].name)
                       : std::string("b");
    body.frame = machine_body.joint ? carriers.carriage(*machine_body.joint) : Carriers::bed;
    body.name = names[bodies.size()];
    body.mesh = body_mesh(machine_body.body, body_mesh_use(SolidBody::Kind::Machine, body.name));
    bodies.push_back(std::move(body));
  }
  return bodies;
}

std::vector<SolidBody> tool_bodies(const Segment& segment, double skin) {
  return ToolBodies(segment.scene.tool, Carriers{segment.truth.actual.size()}.tool(), skin).bodies;
}

std::vector<SolidBody> fixture_bodies(const Scene& scene) {
  std::vector<SolidBody> bodies;
  const int frame = Carriers{int(scene.machine.joints.size())}.workpiece();
  const std::vector<std::string> names = fixture_names(scene.fixtures);
  for (std::size_t i = 0; i < names.size(); ++i)
    bodies.push_back(
        {SolidBody::Kind::Fixture, names[i], "w", frame,
         body_mesh(scene.fixtures[i], body_mesh_use(SolidBody::Kind::Fixture, names[i]))});
  return bodies;
}

namespace {

/// Returns the part as a body: as it is judged, or with several tools as it was loaded, since the
/// search goes through its triangles for each tool.
cutting::ClosedMesh part_body(const Job& job) {
  if (job.segments.empty()) return {job.design_w.vertices, job.design_w.triangles, 0.0};
  const cutting::Design loaded_w = cutting::transformed(*job.body_m, job.scene.part.T_wm);
  return {loaded_w.vertices, loaded_w.triangles, 0.0};
}

}  // namespace

std::vector<SolidBody> segment_bodies(const Job& job, const Segment& segment) {
  std::vector<SolidBody> bodies = machine_bodies(segment.scene.machine);
  std::ranges::move(fixture_bodies(segment.scene), std::back_inserter(bodies));
  const Carriers carriers{segment.truth.actual.size()};
  bodies.push_back({SolidBody::Kind::Part, "part", "w", carriers.workpiece(), part_body(job)});
  std::ranges::move(tool_bodies(segment, segment.scene.collision.gouge),
                    std::back_inserter(bodies));
  return bodies;
}

namespace {

/// Returns warnings about fixtures inside the part. The search leaves out pairs of bodies that are
/// both fixed to the workpiece, so that a wrong pose or unit would pass unnoticed.
std::vector<std::string> inside_fixture_warnings(const std::vector<SolidBody>& bodies) {
  std::vector<std::string> warnings;
  const auto part = std::ranges::find(bodies, SolidBody::Kind::Part, &SolidBody::kind);
  if (part == bodies.end()) return warnings;
  const auto bounding_box = [](const SolidBody& body) {
    return Eigen::AlignedBox3d(body.mesh.vertices.colwise().minCoeff().transpose(),
                               body.mesh.vertices.colwise().maxCoeff().transpose());
  };
  const Eigen::AlignedBox3d part_box = bounding_box(*part);
  for (const SolidBody& fixture : bodies) {
    if (fixture.kind != SolidBody::Kind::Fixture || !part_box.contains(bounding_box(fixture)))
      continue;
    const cutting::Body part_body = search_body(*part), fixture_body = search_body(fixture);
    const Pose identity = Pose::Identity();
    // `is_inside` holds only for surfaces that do not intersect, so the distance is tested first.
    if (cutting::gap(part_body, identity, fixture_body, identity).distance > 0.0 &&
        cutting::is_inside(part_body, identity, fixture_body, identity))
      warnings.push_back(
          fmt::format("{} is entirely inside the part: check its position and unit", fixture.name));
  }
  return warnings;
}

}  // namespace

std::vector<std::string> body_warnings(const Segment& segment,
                                       const std::vector<SolidBody>& bodies) {
  std::vector<std::string> warnings;
  if (segment.scene.machine.bodies.empty())
    warnings.push_back(
        "the machine has no [[body]]: only tool, holder, fixtures and part are checked");
  if (!segment.scene.tool.holder)
    warnings.push_back(
        "the tool has no [tool.holder]: behind the tool only the bodies of the machine are "
        "checked");
  if (std::holds_alternative<cutting::Nose>(segment.scene.tool.actual)) {
    warnings.push_back("a turning tool is checked by its holder only because its edge has no body");
    if (segment.scene.cutting)
      warnings.push_back(
          "this search does not include the stock of a turned part; the cut warns of a rapid "
          "through it");
  }
  if (segment.machine.workpiece_spindle)
    warnings.push_back(
        "the spindle does not turn in this search: the bodies it carries are checked at 0 deg");
  if (const auto* cutter = std::get_if<cutting::Cutter>(&segment.scene.tool.actual))
    if (const double max_gouge = 0.25 * cutter->radius; segment.scene.collision.gouge > max_gouge)
      warnings.push_back(fmt::format(
          "collision.gouge_mm = {:g} is more than a quarter of the cutter radius: {:g} mm is used",
          segment.scene.collision.gouge, max_gouge));
  std::vector<const BodyDescription*> descriptions;
  for (const MachineBody& body : segment.scene.machine.bodies) descriptions.push_back(&body.body);
  for (const BodyDescription& fixture : segment.scene.fixtures) descriptions.push_back(&fixture);
  for (std::size_t i = 0; i < descriptions.size(); ++i) {
    const auto* mesh = std::get_if<MeshShape>(&descriptions[i]->shape);
    if (mesh == nullptr) continue;
    const ClosedMesh file_mesh =
        cutting::transformed_mesh(bodies[i].mesh, descriptions[i]->T.inverse());
    std::string text = mesh_size_warning(mesh->mesh, body_mesh_use(bodies[i].kind, bodies[i].name),
                                         extents(file_mesh.vertices));
    if (!text.empty()) warnings.push_back(std::move(text));
  }
  std::ranges::move(inside_fixture_warnings(bodies), std::back_inserter(warnings));
  return warnings;
}

cutting::Body search_body(const SolidBody& solid) {
  return solid.pieces.empty() ? cutting::make_body(solid.mesh) : cutting::make_body(solid.pieces);
}

cutting::Body search_core(const SolidBody& solid) {
  return solid.core.empty() ? search_body(solid) : cutting::make_body(solid.core);
}

bool is_ignored(const IgnoredPairs& ignored, const std::string& a, const std::string& b) {
  return std::ranges::any_of(ignored, [&](const CollisionDescription::Pair& pair) {
    return (pair.a == a && pair.b == b) || (pair.a == b && pair.b == a);
  });
}

std::vector<cutting::BodyPair> collision_pairs(
    const kinematics::Chain& chain, const std::vector<SolidBody>& bodies,
    const std::vector<CollisionDescription::Pair>& ignored) {
  using Kind = SolidBody::Kind;
  const std::vector<int> position = positions_in_chain(chain);
  std::vector<cutting::BodyPair> pairs;
  for (std::size_t a = 0; a < bodies.size(); ++a)
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      const SolidBody &body_a = bodies[a], &body_b = bodies[b];
      // Neighbouring bodies of the machine overlap at their guideways by design, so that a pair of
      // machine bodies is searched only with two axes between them, any other pair with one.
      const int axes_between =
          std::abs(position[std::size_t(body_a.frame)] - position[std::size_t(body_b.frame)]);
      const bool is_machine_pair = body_a.kind == Kind::Machine && body_b.kind == Kind::Machine;
      if (axes_between < (is_machine_pair ? 2 : 1) || is_ignored(ignored, body_a.name, body_b.name))
        continue;
      pairs.push_back({int(a), int(b)});
    }
  return pairs;
}

CommandedSamples::CommandedSamples(const Segment& segment, const Commands& commands)
    : samples_(&commands.samples),
      path_(&path_of(segment, commands)),
      count_(commands.samples.states.size()) {}

CommandedSamples::CommandedSamples(const Job& job, std::size_t tool,
                                   const WindowedProgram& program) {
  const WindowRange range = window_ranges(job)[tool];
  make_range_ = [&job, &program, first = range.first, this](std::size_t number) {
    const Segment window = make_window(job, first + number);
    Commands commands = program.commands(window, first + number);
    const program::SampleWindow& blocks = program.windows[first + number].blocks;
    return Range{std::move(commands.samples),
                 commands.path ? *std::move(commands.path) : window.path, starts_[number],
                 blocks.first - (blocks.continued_from ? 1 : 0)};
  };
  // A window begins with the last sample of the one before.
  for (std::size_t number = 0; number < range.last - range.first; ++number) {
    starts_.push_back(number == 0 ? 0 : count_ - 1);
    const Range window = make_range_(number);
    check_travel(tool_segments(job)[tool].machine, window.path, window.samples);
    count_ = starts_.back() + window.samples.states.size();
  }
}

CommandedSample CommandedSamples::sample_of(const program::Samples& samples,
                                            const program::Path& path, std::size_t i,
                                            std::size_t first_block) {
  const program::Block& block = path.blocks[std::size_t(samples.block[i])];
  return {samples.states[i], samples.line[i], first_block + std::size_t(samples.block[i]),
          block.file, block.interpolation == program::Interpolation::Rapid};
}

CommandedSample CommandedSamples::operator[](std::size_t i) const {
  if (samples_ != nullptr) return sample_of(*samples_, *path_, i, 0);
  const std::shared_ptr<const Range> range = range_with(i);
  return sample_of(range->samples, range->path, i - range->first, range->first_block);
}

std::shared_ptr<const CommandedSamples::Range> CommandedSamples::range_with(
    std::size_t sample) const {
  // The threads work on neighbouring chunks, which lie in two windows unless these are short.
  constexpr std::size_t max_kept = 3;
  const auto window = std::size_t(std::ranges::upper_bound(starts_, sample) - starts_.begin()) - 1;
  const std::lock_guard lock(mutex_);
  const auto match = std::ranges::find(kept_, window, [](const auto& kept) { return kept.first; });
  if (match != kept_.end()) {
    std::rotate(match, match + 1, kept_.end());
  } else {
    if (kept_.size() == max_kept) kept_.erase(kept_.begin());
    // Isolated, since a task of the caller that this thread took up meanwhile would wait for its
    // own lock.
    tbb::this_task_arena::isolate(
        [&] { kept_.emplace_back(window, std::make_shared<const Range>(make_range_(window))); });
  }
  return kept_.back().second;
}

kinematics::AxisState ActualMotion::state(const cutting::Moment& moment) const {
  kinematics::AxisState state = samples[moment.instant].state;
  if (moment.u > 0.0 && moment.instant + 1 < samples.size()) {
    const kinematics::AxisState next = samples[moment.instant + 1].state;
    const kinematics::AxisState previous = state;
    // A sample holds the directions and the spindle speed of the move that ends at it.
    state = next;
    state.q = previous.q + moment.u * (next.q - previous.q);
    state.time_s = previous.time_s + moment.u * (next.time_s - previous.time_s);
  }
  if (const auto& spindle = segment.machine.workpiece_spindle) state.q[*spindle] = 0.0;
  return state;
}

std::vector<kinematics::Pose> ActualMotion::carriers(const cutting::Moment& moment) const {
  const kinematics::AxisState at = state(moment);
  return carrier_poses(segment.truth.actual, at.q, deviations(segment.truth, at).joints);
}

std::size_t ActualMotion::target_sample(const cutting::Moment& moment) const {
  return std::min(moment.instant + (moment.u > 0.0 ? 1u : 0u), samples.size() - 1);
}

ProgramLocation ActualMotion::place(const cutting::Moment& moment) const {
  const CommandedSample target = samples[target_sample(moment)];
  return {target.line, target.file, state(moment).time_s};
}

bool ActualMotion::is_rapid(const cutting::Moment& moment) const {
  return samples[target_sample(moment)].is_rapid;
}

Collision collision_at(const ActualMotion& actual_motion, const cutting::Moment& moment,
                       const Eigen::Vector3d& place_b) {
  const Carriers carriers{actual_motion.segment.truth.actual.size()};
  const std::vector<kinematics::Pose> T = actual_motion.carriers(moment);
  Collision event;
  event.first = event.worst = event.last = actual_motion.place(moment);
  event.place_b = place_b;
  event.position_w = T[std::size_t(carriers.workpiece())].inverse() * place_b;
  event.state = actual_motion.state(moment);
  event.rapid = actual_motion.is_rapid(moment);
  return event;
}

}  // namespace abbe::sim
