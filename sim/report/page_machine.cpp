#include "sim/report/page_machine.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/compensation/course.h"
#include "sim/cut/bodies.h"

namespace abbe::sim {
namespace {

using compensation::Course;
using nlohmann::ordered_json;

constexpr double motion_tolerance = 0.01;  // mm and degrees
constexpr double motion_step = 1e-3;       // the same
constexpr double spindle_tolerance = 1.0;  // degrees
constexpr double time_step_s = 1e-3;
constexpr double body_step_mm = 0.01;
constexpr double track_share = 0.02, track_least = 5e-5;  // mm, and rad by the metre
constexpr double signal_share = 1.0 / 500.0;

void add_body(PageData& data, const SolidBody& body, int tool) {
  if (body.kind == SolidBody::Kind::Part || body.mesh.vertices.rows() == 0) return;
  ordered_json& bodies = data.index["machine"]["bodies"];
  const bool is_machine = body.kind == SolidBody::Kind::Machine;
  const bool hides = is_machine && body.carrier != "b";
  const std::string number = std::to_string(bodies.size());
  add(data, {"body" + number}, packed_values(body.mesh.vertices, body_step_mm));
  add(data, {"facet" + number}, packed_numbers(body.mesh.triangles));
  bodies.push_back(
      {{"on", body.carrier == "w" ? "f" : body.carrier},
       {"tool", tool},  // -1: it is there always
       {"opacity", hides ? 0.35 : 1.0},
       {"colour", is_machine ? std::vector{0.62, 0.68, 0.76} : std::vector{0.45, 0.50, 0.55}}});
}

bool is_of_tool(const SolidBody& body) {
  return body.kind == SolidBody::Kind::Holder || body.kind == SolidBody::Kind::Shank ||
         body.kind == SolidBody::Kind::Cutter;
}

void add_bodies(PageData& data, const Job& job) {
  data.index["machine"]["bodies"] = ordered_json::array();
  const std::span<const Job> parts = parts_of(job);
  for (std::size_t tool = 0; tool < parts.size(); ++tool)
    for (const SolidBody& body : bodies_of(parts[tool]))
      if (is_of_tool(body))
        add_body(data, body, parts.size() > 1 ? int(tool) : -1);
      else if (tool == 0)
        add_body(data, body, -1);
}

/// Commanded axes along the parts of a job, in mm and degrees.
Course motion_of(const Job& job) {
  Eigen::Index count = 0, row = 0;
  for (const Job& part : parts_of(job)) count += Eigen::Index(part.samples.states.size());
  const kinematics::Chain& chain = job.machine.nominal;
  Course course{Eigen::VectorXd(count), Eigen::MatrixXd(count, chain.size())};
  for (const Job& part : parts_of(job))
    for (const kinematics::AxisState& state : part.samples.states) {
      course.time_s[row] = state.time_s;
      for (int j = 0; j < chain.size(); ++j) {
        const bool turns = chain.joints()[std::size_t(j)].motion != kinematics::Motion::Linear;
        course.value(row, j) = state.q[j] * (turns ? 180.0 / std::numbers::pi : 1.0);
      }
      ++row;
    }
  return course;
}

void add_motion(PageData& data, const Job& job) {
  const Course course = motion_of(job);
  Eigen::VectorXd tolerance = Eigen::VectorXd::Constant(course.value.cols(), motion_tolerance);
  for (int j = 0; j < int(tolerance.size()); ++j)
    if (is_spindle(job.machine, j)) tolerance[j] = spindle_tolerance;
  Course few = compensation::thinned(course, tolerance);
  // a spindle turns so far that it needs a coarser step
  const Eigen::VectorXd coarser = tolerance / motion_tolerance;
  for (Eigen::Index j = 0; j < few.value.cols(); ++j) few.value.col(j) /= coarser[j];
  Packed packed = packed_values(few.value, motion_step);
  for (Eigen::Index j = 0; j < few.value.cols(); ++j) {
    packed.step[std::size_t(j)] *= coarser[j];
    packed.offset[std::size_t(j)] *= coarser[j];
  }
  add(data, {"q"}, packed);
  add(data, {"t"}, packed_values(few.time_s, time_step_s));
}

ordered_json tools_of(const Job& job) {
  ordered_json tools = ordered_json::array();
  for (const Job& part : parts_of(job)) {
    if (part.samples.states.empty()) continue;
    const auto& number = part.scene.tool.number;
    tools.push_back({{"from", part.samples.states.front().time_s},
                     {"name", (number ? fmt::format("T{} ", *number) : "") + part.scene.tool.name},
                     {"T_bt_home", to_json(part.machine.nominal.T_bt_home())}});
  }
  return tools;
}

/// A signal or a clearance by its name.
void add_signal(PageData& data, std::size_t number, const std::string& name,
                const Eigen::VectorXd& time_s, const Eigen::VectorXd& value) {
  if (time_s.size() < 2) return;
  const double span = value.maxCoeff() - value.minCoeff();
  if (!(span > 0.0) || !std::isfinite(span)) return;
  const Course few = compensation::thinned(Course{time_s, value},
                                           Eigen::VectorXd::Constant(1, signal_share * span / 2.0));
  ordered_json& all = data.index["cases"][number]["signals"];
  const std::string key = fmt::format("signal{}_{}", number, all.size());
  add(data, {"t:" + key}, packed_values(few.time_s, time_step_s));
  add(data, {key}, packed_values(few.value, signal_share * span / 2.0));
  all.push_back({{"name", name}, {"key", key}});
}

void add_signals(PageData& data, const Signals& signals, std::size_t number) {
  const auto time = std::ranges::find(signals.columns, "time_s");
  if (time == signals.columns.end()) return;
  const Eigen::VectorXd time_s = signals.rows.col(time - signals.columns.begin());
  std::vector<Eigen::Index> rows;  // the history before the program has no place on its slider
  for (Eigen::Index row = 0; row < time_s.size(); ++row)
    if (time_s[row] >= 0.0 && (rows.empty() || time_s[row] >= time_s[rows.back()]))
      rows.push_back(row);
  for (std::size_t c = 0; c < signals.columns.size(); ++c)
    if (signals.columns[c] != "time_s" && signals.columns[c] != "line")
      add_signal(data, number, signals.columns[c], time_s(rows),
                 signals.rows(rows, Eigen::Index(c)));
}

void add_clearance(PageData& data, const Collisions& collisions, std::size_t number) {
  std::vector<double> time, value;
  for (const BlockClearance& block : collisions.blocks) {
    if (block.pair < 0 || !std::isfinite(block.at_least)) continue;
    for (const double t : {block.place.time_s, block.end_s}) {
      time.push_back(t);
      value.push_back(block.at_least);
    }
  }
  const auto count = Eigen::Index(time.size());
  add_signal(data, number, "clearance_mm", Eigen::Map<const Eigen::VectorXd>(time.data(), count),
             Eigen::Map<const Eigen::VectorXd>(value.data(), count));
}

void add_track(PageData& data, const ToolTrack& track, std::size_t number) {
  Course course{track.time_s, Eigen::MatrixXd(track.time_s.size(), 6)};
  course.value << track.actual_tip - track.nominal_tip,
      track.actual_direction - track.nominal_direction;
  const auto largest = [&](Eigen::Index from) {
    return course.value.middleCols(from, 3).cwiseAbs().maxCoeff();
  };
  const double mm = std::max(track_least, track_share * largest(0)),
               rad = std::max(track_least * 1e-3, track_share * largest(3));
  Eigen::VectorXd tolerance(6);
  tolerance << mm, mm, mm, rad, rad, rad;
  const Course few = compensation::thinned(course, tolerance);
  const std::string key = fmt::format("track{}", number);
  add(data, {"t:" + key}, packed_values(few.time_s, time_step_s));
  add(data, {key + "_tip"}, packed_values(few.value.leftCols(3), mm / 10.0));
  add(data, {key + "_direction"}, packed_values(few.value.rightCols(3), rad / 10.0));
  data.index["cases"][number]["track"] = key;
}

}  // namespace

std::vector<std::string> add_machine(PageData& data, const Job& job) {
  std::size_t samples = 0;
  for (const Job& part : parts_of(job)) samples += part.samples.states.size();
  if (samples < 2)
    return {
        fmt::format("the motion of the machine is left out of the report: its program has {} "
                    "samples",
                    samples)};
  const kinematics::Chain& chain = job.machine.nominal;
  ordered_json joints = ordered_json::array();
  for (const kinematics::Joint& joint : chain.joints())
    joints.push_back({{"name", std::string(1, joint.name)},
                      {"rotary", joint.motion != kinematics::Motion::Linear},
                      {"spindle", is_spindle(job.machine, int(joints.size()))},
                      {"workpiece", joint.side == kinematics::Side::Workpiece},
                      {"direction", to_json(joint.direction_b)},
                      {"point", to_json(joint.point_b)}});
  data.index["machine"] = {{"joints", joints},
                           {"T_bf_home", to_json(chain.T_bw_home())},
                           {"T_bw_home", to_json(chain.T_bw_home() * job.scene.part.T_wm)},
                           {"tools", tools_of(job)}};
  add_motion(data, job);
  add_bodies(data, job);
  if (job.machine.workpiece_spindle)
    return {
        "where the tool really was is left out of the report: in the frame of a part that turns "
        "its deviation turns with it"};
  return {};
}

void add_course(PageData& data, const Compared& one, std::size_t number) {
  const Cut& cut = one.verdict.cut;
  data.index["cases"][number]["signals"] = ordered_json::array();
  if (cut.track && cut.track->time_s.size() > 1 && !one.job->machine.workpiece_spindle)
    add_track(data, in_part_frame(*cut.track, one.job->scene.part.T_wm), number);
  add_signals(data, cut.signals, number);
  if (cut.collisions) add_clearance(data, *cut.collisions, number);
}

}  // namespace abbe::sim
