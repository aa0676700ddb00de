#if ABBE_RENDER

#include "sim/report/machine_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/cut/bodies.h"

namespace abbe::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

constexpr std::size_t max_passes = 9;     // of the cut
constexpr std::size_t max_points = 4000;  // of each pass

/// Returns the pose of a frame at `point` with z along `direction`.
Pose frame_along(const Vector3d& point, const Vector3d& direction) {
  Pose T = Pose::Identity();
  T.linear() = kinematics::rotation_between(Vector3d::UnitZ(), direction).toRotationMatrix();
  T.translation() = point;
  return T;
}

/// Returns a schematic carriage: a bar along the travel of a slide, or a disc about a rotary axis.
/// @param offset     mm, displacement in z
/// @param unit_size  mm, size to which all proportions refer
render::Body schematic_carriage(const Joint& joint, const Pose& T_b, double offset,
                                double unit_size) {
  render::Body body;
  body.label = joint.name + std::string(joint.side == Side::Workpiece ? "'" : "");
  body.T = T_b * frame_along(joint.point_b, joint.direction_b);
  body.T.translation().z() += offset;
  if (joint.motion == Motion::Linear)
    body.shape = render::BlockShape{Vector3d(0.8 * unit_size, 0.8 * unit_size, 4.0 * unit_size)};
  else
    body.shape = render::CylinderShape{0.9 * unit_size, 0.5 * unit_size};
  // The disc of a rotary axis on the workpiece side is below the part.
  if (joint.motion == Motion::Rotary && joint.side == Side::Workpiece)
    body.T.translation() -= 0.5 * unit_size * body.T.linear().col(2);
  body.colour = joint.motion == Motion::Linear ? render::Colour{0.78, 0.82, 0.88}
                                               : render::Colour{0.93, 0.84, 0.66};
  body.opacity = 0.55;
  return body;
}

/// Returns the number of joints at the same point that are nearer to the tool (or to the part). The
/// bodies of these joints are stacked in this order.
int stack_position(const Chain& chain, int i) {
  const Joint& joint = chain.joints()[std::size_t(i)];
  const int step = joint.side == Side::Tool ? 1 : -1;
  int count = 0;
  for (int k = i + step; k >= 0 && k < chain.size(); k += step) {
    const Joint& other = chain.joints()[std::size_t(k)];
    count += other.motion != Motion::Spindle && other.side == joint.side &&
             other.point_b == joint.point_b;
  }
  return count;
}

/// Centres of the carriages of each side, from the bed outwards.
struct CarriageCentres {
  std::vector<Vector3d> tool, part;
};

/// Adds the carriages of both sides at axis positions q.
CarriageCentres add_carriages(const Chain& chain, const AxisVector& q, double unit_size,
                              render::MachinePicture& picture) {
  CarriageCentres sides;
  Pose T = Pose::Identity();
  for (int i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.side != Side::Tool) continue;
    T = T * carriage_displacement(joint, q[i]);
    if (joint.motion == Motion::Spindle) continue;
    picture.bodies.push_back(
        schematic_carriage(joint, T, stack_position(chain, i) * unit_size, unit_size));
    sides.tool.push_back(picture.bodies.back().T.translation());
  }
  T = Pose::Identity();
  for (int i = chain.size() - 1; i >= 0; --i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.side != Side::Workpiece) continue;
    T = T * carriage_displacement(joint, kinematics::carriage_travel(joint.side, q[i]));
    picture.bodies.push_back(
        schematic_carriage(joint, T, -stack_position(chain, i) * unit_size, unit_size));
    sides.part.push_back(picture.bodies.back().T.translation());
  }
  return sides;
}

/// Returns a square bar between two points.
render::Body connecting_bar(const Vector3d& from, const Vector3d& to, double thickness) {
  render::Body body;
  const double length = (to - from).norm();
  body.T = frame_along(0.5 * (from + to), (to - from) / length);
  body.shape = render::BlockShape{Vector3d(thickness, thickness, length)};
  body.colour = {0.72, 0.74, 0.77};
  body.opacity = 0.45;
  return body;
}

/// Adds a bed below all carriages, and bars that connect it through the carriages with tool and
/// part.
void add_structure(CarriageCentres sides, const Vector3d& tool, const Vector3d& part,
                   double unit_size, render::MachinePicture& picture) {
  Eigen::AlignedBox3d box;
  for (const auto& row : picture.part_vertices.rowwise()) box.extend(row.transpose());
  for (const auto* side : {&sides.tool, &sides.part})
    for (const Vector3d& p : *side) {
      box.extend(p + Vector3d::Constant(2.0 * unit_size));
      box.extend(p - Vector3d::Constant(2.0 * unit_size));
    }
  render::Body bed;
  bed.label = "bed";
  bed.shape = render::BlockShape{Vector3d(box.sizes().x(), box.sizes().y(), 0.3 * unit_size)};
  bed.T = Pose::Identity();
  bed.T.translation() << box.center().x(), box.center().y(), box.min().z() - 0.15 * unit_size;
  bed.opacity = 0.6;
  picture.bodies.push_back(bed);
  const auto add_bars = [&](const std::vector<Vector3d>& corners, double thickness) {
    for (std::size_t i = 1; i < corners.size(); ++i)
      if ((corners[i] - corners[i - 1]).norm() > 0.05 * unit_size)
        picture.bodies.push_back(connecting_bar(corners[i - 1], corners[i], thickness));
  };
  const auto above_bed = [&](const Vector3d& p, double y) {
    return Vector3d(p.x(), y, box.min().z());
  };
  std::vector<Vector3d> to_tool;
  if (const Vector3d first = sides.tool.empty() ? tool : sides.tool.front(); first.z() > part.z()) {
    // The column is behind the part so that it does not hide the part.
    const double back = box.max().y() - 0.3 * unit_size;
    to_tool = {above_bed(first, back), {first.x(), back, first.z()}};
  } else {
    to_tool = {above_bed(first, first.y())};
  }
  to_tool.insert(to_tool.end(), sides.tool.begin(), sides.tool.end());
  to_tool.push_back(tool);
  add_bars(to_tool, 0.22 * unit_size);
  if (sides.part.empty()) sides.part.push_back(above_bed(part, part.y()));
  const Vector3d &first = sides.part.front(), &last = sides.part.back();
  std::vector<Vector3d> to_part{above_bed(first, first.y())};
  to_part.insert(to_part.end(), sides.part.begin(), sides.part.end());
  add_bars(to_part, 0.22 * unit_size);
  // The clamping is on the last carriage.
  add_bars({last, {part.x(), part.y(), last.z()}, part}, 0.5 * unit_size);
}

/// Adds the spindle, a cylinder from the axis that carries it to the nose, if the machine has one.
void add_spindle(const Chain& chain, const AxisVector& q, double unit_size,
                 render::MachinePicture& picture) {
  const auto nose = chain.find('s');
  if (!nose || *nose == 0) return;
  const Joint& joint = chain.joints()[std::size_t(*nose)];
  const Joint& previous = chain.joints()[std::size_t(*nose) - 1];
  const double height = std::abs((previous.point_b - joint.point_b).dot(joint.direction_b));
  const Pose T_tb_home = chain.T_bt_home().inverse();
  render::Body body;
  body.label = "s";
  body.T = chain.tool_in_bed(q) * T_tb_home * frame_along(joint.point_b, joint.direction_b);
  body.shape = render::CylinderShape{0.35 * unit_size, std::max(height, 0.5 * unit_size)};
  body.opacity = 0.8;
  picture.bodies.push_back(body);
}

/// Adds the tool as a cylinder.
void add_tool(const Chain& chain, const AxisVector& q, double radius, double length,
              render::MachinePicture& picture) {
  render::Body tool;
  tool.T = chain.tool_in_bed(q);
  tool.shape = render::CylinderShape{radius, std::max(length, 4.0 * radius)};
  tool.colour = {0.45, 0.50, 0.55};
  tool.label = "tool";
  picture.bodies.push_back(tool);
}

/// Adds the bodies of the machine description. The first body of each axis has a label.
void add_machine_bodies(const MachineDescription& machine, const Chain& chain, const AxisVector& q,
                        render::MachinePicture& picture) {
  const std::vector<Pose> T = carrier_poses(chain, q, {});
  std::set<std::string> labels;
  const std::vector<SolidBody> solids = machine_bodies(machine);
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const std::optional<int> carrier = machine.bodies[i].joint;
    render::Body body;
    const Joint* joint = carrier ? &chain.joints()[std::size_t(*carrier)] : nullptr;
    const std::string label =
        joint == nullptr ? "bed"
                         : joint->name + std::string(joint->side == Side::Workpiece ? "'" : "");
    if (labels.insert(label).second) body.label = label;
    body.T = T[std::size_t(solids[i].frame)];
    if (const auto* box = std::get_if<BoxShape>(&machine.bodies[i].body.shape)) {
      body.T = body.T * machine.bodies[i].body.T;
      body.shape = render::BlockShape{box->size};
    } else {
      body.shape = render::SolidShape{solids[i].mesh.vertices, solids[i].mesh.triangles};
    }
    if (joint != nullptr)
      body.colour = joint->motion == Motion::Linear ? render::Colour{0.78, 0.82, 0.88}
                                                    : render::Colour{0.93, 0.84, 0.66};
    body.opacity = 0.55;
    picture.bodies.push_back(body);
  }
}

/// Adds the fixtures, labelled by name.
void add_fixtures(const Scene& scene, const Pose& T_bw, render::MachinePicture& picture) {
  for (const SolidBody& solid : fixture_bodies(scene)) {
    render::Body body;
    body.label = solid.name;
    body.T = T_bw;
    body.shape = render::SolidShape{solid.mesh.vertices, solid.mesh.triangles};
    body.colour = {0.66, 0.62, 0.74};
    body.opacity = 0.55;
    picture.bodies.push_back(body);
  }
}

/// Adds all bodies of a machine: those of its description, or a schematic structure with carriages
/// if it has none.
/// @param part_b     position of the part in frame b
/// @param tool_size  mm, radius and length
void add_bodies(const MachineDescription& machine, const Chain& chain, const AxisVector& q,
                const Vector3d& part_b, const Vector2d& tool_size, double unit_size,
                render::MachinePicture& picture) {
  if (!machine.bodies.empty()) {
    add_machine_bodies(machine, chain, q, picture);
    return add_tool(chain, q, tool_size.x(), tool_size.y(), picture);
  }
  const CarriageCentres sides = add_carriages(chain, q, unit_size, picture);
  add_spindle(chain, q, unit_size, picture);
  add_tool(chain, q, tool_size.x(), tool_size.y(), picture);
  const render::Body& tool = picture.bodies.back();
  const double length = std::get<render::CylinderShape>(tool.shape).height;
  add_structure(sides, tool.T * Vector3d(0.0, 0.0, length), part_b, unit_size, picture);
}

/// Returns the caption that says whether the bodies of the machine are schematic.
std::string blocks_text(const MachineDescription& machine) {
  return machine.bodies.empty()
             ? "carriages are schematic: the machine description has their positions but no shapes"
             : "machine drawn from the bodies of its description, [[body]]";
}

/// Passes of the cut that are drawn: nominal positions of the tip with its errors.
struct Trace {
  struct Point {
    Vector3d tip_w;
    Vector3d error_w;
  };
  std::vector<std::vector<Point>> passes;
  std::size_t pass_count = 0;  ///< number of passes of the program
  double max_error = 0.0;      ///< mm, in `passes`
};

/// Returns the range of samples [first, last) of every pass: feed moves between two rapids.
std::vector<std::pair<std::size_t, std::size_t>> pass_ranges(const Segment& segment) {
  std::vector<std::pair<std::size_t, std::size_t>> ranges;
  bool was_feeding = false;
  for (std::size_t i = 0; i < segment.samples.states.size(); ++i) {
    const auto& block = segment.path.blocks[std::size_t(segment.samples.block[i])];
    const bool is_feeding = block.interpolation != program::Interpolation::Rapid;
    if (is_feeding && !was_feeding) ranges.emplace_back(i, i);
    if (is_feeding) ranges.back().second = i + 1;
    was_feeding = is_feeding;
  }
  return ranges;
}

/// Returns the nominal tip and its error at a sample.
Trace::Point traced_point(const Segment& segment, std::size_t sample) {
  kinematics::AxisState state = segment.samples.states[sample];
  // The path on a rotating part would fill a disc, so its spindle is drawn at rest.
  if (segment.machine.workpiece_spindle) state.q[*segment.machine.workpiece_spindle] = 0.0;
  const Vector3d tip_w = segment.machine.nominal.tool_in_workpiece(state.q).translation();
  return {tip_w, tool_in_workpiece(segment.truth, state).translation() - tip_w};
}

using TracePoints = std::vector<Trace::Point>;

/// Returns the path of a pass. A path that goes back and forth many times without a rapid would
/// look like a solid sheet; then only segments about as long as the part are returned.
std::vector<TracePoints> thinned_path(const TracePoints& points) {
  constexpr double max_ratio = 12.0;  // of the length of the path to the diagonal of its box
  Eigen::AlignedBox3d box;
  std::vector<double> length(points.size(), 0.0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    box.extend(points[i].tip_w);
    if (i > 0) length[i] = length[i - 1] + (points[i].tip_w - points[i - 1].tip_w).norm();
  }
  const double size = points.empty() ? 0.0 : box.diagonal().norm();
  if (points.empty() || length.back() <= max_ratio * size) return {points};
  std::vector<TracePoints> segments;
  for (std::size_t k = 0; k < max_passes; ++k) {
    const double middle = length.back() * (double(k) + 0.5) / double(max_passes);
    const auto point_at = [&](double arc_length) {
      return points.begin() +
             (std::lower_bound(length.begin(), length.end(), arc_length) - length.begin());
    };
    segments.emplace_back(point_at(middle - 0.6 * size), point_at(middle + 0.6 * size));
  }
  return segments;
}

/// Returns the trace of one segment of a job.
Trace segment_trace(const Segment& segment) {
  Trace trace;
  const auto passes = pass_ranges(segment);
  trace.pass_count = passes.size();
  const std::size_t stride = (passes.size() + max_passes - 1) / max_passes;
  const std::size_t max_samples = passes.size() > 1 ? max_points : 5 * max_points;
  for (std::size_t k = stride / 2; k < passes.size(); k += std::max<std::size_t>(1, stride)) {
    const auto [first, last] = passes[k];
    const std::size_t step = (last - first) / max_samples + 1;
    TracePoints points;
    for (std::size_t i = first; i < last; i += step) points.push_back(traced_point(segment, i));
    for (TracePoints& path : thinned_path(points)) {
      for (const Trace::Point& point : path)
        trace.max_error = std::max(trace.max_error, point.error_w.norm());
      trace.passes.push_back(std::move(path));
    }
  }
  return trace;
}

/// Returns the trace of all segments of a job.
Trace job_trace(const Job& job) {
  Trace total;
  for (const Segment& segment : job_segments(job)) {
    Trace trace = segment_trace(segment);
    std::move(trace.passes.begin(), trace.passes.end(), std::back_inserter(total.passes));
    total.pass_count += trace.pass_count;
    total.max_error = std::max(total.max_error, trace.max_error);
  }
  return total;
}

}  // namespace

double round_magnification(double part_size, double largest_error) {
  if (largest_error <= 0.0) return 1.0;
  // The factor is rounded down to 1, 2 or 5 of a decade, which is easy to read in a caption.
  const double factor = 0.05 * part_size / largest_error;
  const double decade = std::pow(10.0, std::floor(std::log10(factor)));
  return std::max(1.0, decade * (factor >= 5.0 * decade   ? 5.0
                                 : factor >= 2.0 * decade ? 2.0
                                                          : 1.0));
}

render::MachinePicture machine_picture(const Job& job) {
  const AxisVector q = job.samples.states[job.samples.states.size() / 2].q;
  const Pose T_bw = job.machine.nominal.workpiece_in_bed(q);
  const auto& vertices = job.design_w.vertices;
  const Eigen::RowVector3d lower = vertices.colwise().minCoeff(),
                           upper = vertices.colwise().maxCoeff();
  const double part_size = (upper - lower).norm();

  render::MachinePicture picture;
  picture.title = job.scene.title + ": " + job.scene.machine.name;
  picture.part_vertices = cutting::transformed(job.design_w, T_bw).vertices;
  picture.part_triangles = job.design_w.triangles;
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal);
  add_bodies(
      job.scene.machine, job.machine.nominal, q, picture.part_vertices.colwise().mean().transpose(),
      {cutter != nullptr ? cutter->radius : 1.0, job.scene.tool.length}, 0.35 * part_size, picture);
  add_fixtures(job.scene, T_bw, picture);
  picture.frames = {{"w", T_bw}, {"b", Pose::Identity()}};

  const Trace trace = job_trace(job);
  picture.magnification = round_magnification(part_size, trace.max_error);
  const auto add_paths = [&](const std::string& name, double error_factor,
                             const render::Colour& colour) {
    for (std::size_t k = 0; k < trace.passes.size(); ++k) {
      render::DrawnPath path{k == 0 ? name : std::string(), {}, colour, 2.0};
      path.points.resize(Eigen::Index(trace.passes[k].size()), 3);
      for (std::size_t i = 0; i < trace.passes[k].size(); ++i) {
        const Trace::Point& point = trace.passes[k][i];
        path.points.row(Eigen::Index(i)) =
            (T_bw * Vector3d(point.tip_w + error_factor * point.error_w)).transpose();
      }
      picture.paths.push_back(path);
    }
  };
  add_paths("tip as programmed", 0.0, {0.20, 0.35, 0.65});
  if (trace.max_error > 0.0) add_paths("actual tip", picture.magnification, {0.80, 0.25, 0.20});
  picture.caption = {
      blocks_text(job.scene.machine),
      fmt::format("{} drawn; largest deviation of the drawn tip {:.1f} \u00b5m",
                  trace.passes.size() > trace.pass_count
                      ? fmt::format("{} path segments", trace.passes.size())
                      : fmt::format("{} of {} passes", trace.passes.size(), trace.pass_count),
                  trace.max_error / units::um)};
  return picture;
}

std::vector<SchematicBody> schematic_bodies(const Machine& machine,
                                            const cutting::Design& design_w) {
  const Chain& chain = machine.nominal;
  const AxisVector home = AxisVector::Zero(chain.size());
  const Carriers carriers{chain.size()};
  const auto& vertices = design_w.vertices;
  const double unit_size =
      0.35 * (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).norm();
  render::MachinePicture picture;
  add_carriages(chain, home, unit_size, picture);
  std::vector<SchematicBody> bodies;
  const auto add_carriage = [&](Side side, int i) {
    const Joint& joint = chain.joints()[std::size_t(i)];
    if (joint.side != side || joint.motion == Motion::Spindle) return;
    bodies.push_back({picture.bodies[bodies.size()], carriers.carriage(i)});
  };
  for (int i = 0; i < chain.size(); ++i) add_carriage(Side::Tool, i);
  for (int i = chain.size() - 1; i >= 0; --i) add_carriage(Side::Workpiece, i);
  render::MachinePicture spindle;
  add_spindle(chain, home, unit_size, spindle);
  for (const render::Body& body : spindle.bodies)
    bodies.push_back({body, carriers.carriage(*chain.find('s'))});
  return bodies;
}

namespace {

constexpr std::size_t max_runs = 3000;            // that are drawn
constexpr std::size_t max_path_points = 300'000;  // that are drawn

/// Returns the range of points [first, last) of every run of consecutive feed moves or rapids. A
/// run begins at the last point of the previous one.
std::vector<std::pair<std::size_t, std::size_t>> move_runs(const TipTrace& trace) {
  std::vector<std::pair<std::size_t, std::size_t>> runs;
  for (std::size_t i = 1; i < trace.places.size(); ++i) {
    if (runs.empty() || trace.rapid[i] != trace.rapid[i - 1]) runs.emplace_back(i - 1, i);
    runs.back().second = i + 1;
  }
  return runs;
}

/// Returns the point where the segment from `inside` to `outside` leaves the box.
Vector3d exit_point(const Vector3d& outside, const Vector3d& inside,
                    const Eigen::AlignedBox3d& box) {
  double fraction = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double delta = outside[k] - inside[k];
    if (delta > 0.0) fraction = std::min(fraction, (box.max()[k] - inside[k]) / delta);
    if (delta < 0.0) fraction = std::min(fraction, (box.min()[k] - inside[k]) / delta);
  }
  return inside + std::max(fraction, 0.0) * (outside - inside);
}

/// Returns every `step`th point of a run and its last point. Rapids are clipped at the box.
std::vector<Vector3d> run_points(const TipTrace& trace, std::pair<std::size_t, std::size_t> run,
                                 std::size_t step, const Eigen::AlignedBox3d& box) {
  const auto point = [&](std::size_t i) -> Vector3d { return trace.places[i].cast<double>(); };
  const auto [first, last] = run;
  std::vector<Vector3d> points;
  for (std::size_t i = first; i + 1 < last; i += step) points.push_back(point(i));
  points.push_back(point(last - 1));
  if (trace.rapid[last - 1] == 0) return points;
  std::vector<Vector3d> clipped;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool is_inside = box.contains(points[i]);
    if (is_inside) clipped.push_back(points[i]);
    if (!is_inside && i > 0 && box.contains(points[i - 1]))
      clipped.push_back(exit_point(points[i], points[i - 1], box));
    if (!is_inside && i + 1 < points.size() && box.contains(points[i + 1]))
      clipped.push_back(exit_point(points[i], points[i + 1], box));
  }
  return clipped;
}

}  // namespace

render::MachinePicture machine_picture(const ProgramInspection& inspection) {
  const TipTrace& trace = inspection.trace;
  if (trace.places.size() < 2)
    throw BadInput(inspection.file.string(), 0, 0, "a program with motion", "none");
  AxisVector q = AxisVector::Zero(inspection.machine.control.size());
  if (inspection.description.home.size() == q.size()) q = inspection.description.home;
  const Pose T_bw = inspection.machine.control.workpiece_in_bed(q);
  Eigen::AlignedBox3d box = inspection.figures.feed_extent_w;
  if (box.isEmpty()) box = inspection.figures.tip_extent_w;
  const double size = std::max(box.diagonal().norm(), 1.0);
  const Vector3d below(box.center().x(), box.center().y(), box.min().z());

  render::MachinePicture picture;
  picture.title = inspection.file.filename().string() + ": " + inspection.machine_name;
  add_bodies(inspection.description, inspection.machine.control, q, T_bw * below,
             {0.02 * size, inspection.tool_length}, std::max(0.25 * size, 40.0), picture);
  picture.frames = {{"w", T_bw}, {"b", Pose::Identity()}};
  // Rapids are clipped: with a whole rapid to a distant tool change the part would be tiny.
  const Eigen::AlignedBox3d drawn_box(box.min() - Vector3d::Constant(0.3 * size),
                                      box.max() + Vector3d::Constant(0.3 * size));
  const auto runs = move_runs(trace);
  const std::size_t stride = (runs.size() + max_runs - 1) / max_runs;
  const std::size_t step = trace.places.size() / max_path_points + 1;
  std::array<bool, 2> has_label{};
  std::size_t run_count = 0;  // drawn
  for (std::size_t k = 0; k < runs.size(); k += stride, ++run_count) {
    const bool is_rapid = trace.rapid[runs[k].second - 1] != 0;
    const std::vector<Vector3d> points = run_points(trace, runs[k], step, drawn_box);
    if (points.size() < 2) continue;
    render::DrawnPath path{
        std::exchange(has_label[is_rapid], true) ? ""
        : is_rapid                               ? "rapid"
                                                 : "feed",
        {},
        is_rapid ? render::Colour{0.80, 0.45, 0.20} : render::Colour{0.20, 0.35, 0.65},
        is_rapid ? 1.2 : 2.0};
    path.points.resize(Eigen::Index(points.size()), 3);
    for (std::size_t i = 0; i < points.size(); ++i)
      path.points.row(Eigen::Index(i)) = (T_bw * points[i]).transpose();
    picture.paths.push_back(std::move(path));
  }
  picture.caption = {blocks_text(inspection.description) +
                         "; axes at home position; path of the tip in the workpiece, rapids "
                         "clipped to its surroundings",
                     fmt::format("{} of {} segments drawn, {} moves", run_count, runs.size(),
                                 inspection.figures.blocks - inspection.figures.dwells.count)};
  return picture;
}

}  // namespace abbe::sim

#endif
