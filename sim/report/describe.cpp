#include "sim/report/describe.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "errors/bound_element.h"
#include "kinematics/units.h"
#include "sim/cut/program_warnings.h"
#include "sim/cut/unreached_text.h"
#include "sim/machine/location_effects.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using nlohmann::ordered_json;

ordered_json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json describe_axes(const kinematics::Chain& chain) {
  ordered_json axes = ordered_json::array();
  for (const kinematics::Joint& joint : chain.joints()) {
    const bool linear = joint.motion == kinematics::Motion::Linear;
    const double unit = linear ? 1.0 : units::deg;
    ordered_json axis = {
        {"name", std::string(1, joint.name)},
        {"moves",
         linear ? "slide" : (joint.motion == kinematics::Motion::Rotary ? "turn" : "nose")},
        {"carries", joint.side == kinematics::Side::Workpiece ? "workpiece" : "tool"},
        {"direction", numbers(joint.direction_b)},
        {"point_mm", numbers(joint.point_b)}};
    if (joint.motion != kinematics::Motion::Spindle) {
      const auto limit = [&](double q) {
        return std::abs(q) < 1e9 ? ordered_json(q / unit) : ordered_json();
      };
      axis[linear ? "travel_mm" : "travel_deg"] = {limit(joint.min), limit(joint.max)};
      axis["deviations"] =
          joint.deviation_axes == kinematics::DeviationAxes::Fixed ? "fixed" : "turning";
      axis["squareness"] = joint.squareness == kinematics::Squareness::Frame ? "frame" : "travel";
    }
    axes.push_back(axis);
  }
  return axes;
}

ordered_json describe_location(const errors::Element& element, const kinematics::Chain& chain) {
  const LocationEffect effect = location_effect(element, chain);
  const double unit = element.name.is_angle() ? units::urad : units::um;
  const char* displaces[] = {"frame", "carried", "axis"};
  ordered_json angles = ordered_json::object(), tip = ordered_json::array();
  for (const LocationEffect::Angle& angle : effect.angles)
    angles[angle.between] = angle.change / units::urad;
  for (const LocationEffect::Tip& one : effect.tip)
    tip.push_back({{"at", one.at}, {"um", numbers(one.moved_w / units::um)}});
  return {{"meaning", effect.meaning},
          {"displaces", displaces[int(effect.displaces)]},
          {"bodies", effect.bodies},
          {element.name.is_angle() ? "turned_urad" : "moved_um", effect.amount / unit},
          {"about_or_along", std::string(1, char('X' + element.name.component() % 3))},
          {"angle_change_urad", angles},
          {"tip_moved", tip}};
}

/// Value and slope of one element with its axis at zero, in um or urad; null where a table does not
/// reach zero.
ordered_json describe_element(const errors::GeometricModel& model,
                              const errors::GeometricModel::Bound& bound,
                              const kinematics::Chain& chain) {
  const bool angle = bound.element.name.is_angle();
  const double unit = angle ? units::urad : units::um;
  const std::string suffix = angle ? "_urad" : "_um";
  ordered_json element = {{"name", errors::to_string(bound.element.name)}};
  ordered_json parts = ordered_json::array();
  errors::CurveState at_zero;
  at_zero.primed = chain.joints()[std::size_t(bound.joint)].side == kinematics::Side::Workpiece;
  double value = 0.0, slope = 0.0;
  bool known = true;
  for (const errors::Curve& curve : bound.element.curves) {
    if (!curve.name.empty()) parts.push_back(curve.name);
    try {
      value += errors::value(curve, at_zero);
      slope += errors::slope(curve, at_zero);
    } catch (const std::out_of_range&) {
      known = false;
    }
  }
  element["value_at_zero" + suffix] = known ? ordered_json(value / unit) : ordered_json();
  if (!bound.location) {
    const bool linear =
        chain.joints()[std::size_t(bound.joint)].motion == kinematics::Motion::Linear;
    const std::string per = linear ? "_per_mm" : "_per_rad";
    element["slope_at_zero" + suffix + per] = known ? ordered_json(slope / unit) : ordered_json();
    element["stated_at"] = "the joint's point";
    for (const auto& line : model.lines)
      if (line.joint == bound.joint && !angle) {
        const Vector3d at = chain.joints()[std::size_t(bound.joint)].point_b + line.arm_b;
        element["stated_at"] =
            fmt::format("line through {:.6g} {:.6g} {:.6g}, measured by the {}", at.x(), at.y(),
                        at.z(), line.fixed_in_bed ? "tool" : "carriage");
      }
  }
  if (bound.location) element["location"] = describe_location(bound.element, chain);
  if (!parts.empty()) element["parts"] = parts;
  return element;
}

/// Nodes that a function of temperatures looks at.
void add_nodes(ordered_json& names, const errors::ThermalFunction& function,
               const errors::ThermalNetwork& network) {
  for (const auto& term : function.terms) {
    std::string name = network.nodes[std::size_t(term.node)].name;
    if (term.minus) name += " - " + network.nodes[std::size_t(*term.minus)].name;
    names.push_back(name);
  }
}

ordered_json describe_heat(const Truth::Heat& heat, const ThermalDescription& thermal,
                           const kinematics::Chain& chain) {
  const errors::ThermalNetwork& network = heat.run.network;
  const Eigen::VectorXd& rate = heat.run.dry.rate_per_s;
  ordered_json elements = ordered_json::array(), sensors = ordered_json::array();
  for (const errors::ThermalElement& element : thermal.errors.elements) {
    ordered_json nodes = ordered_json::array();
    add_nodes(nodes, element.offset, network);
    add_nodes(nodes, element.slope, network);
    elements.push_back({{"name", errors::to_string(element.name)}, {"follows", nodes}});
    if (element.name.location) {
      const int joint = errors::joint_of(element.name.axis, chain, "");
      elements.back()["meaning"] = errors::meaning(element.name, chain, joint);
    }
  }
  for (const errors::AxisExpansion& axis : thermal.errors.expansions) {
    const bool motor = axis.feedback == errors::Feedback::Motor;
    const errors::Expansion& grows = motor ? *axis.screw : *axis.scale;
    elements.push_back({{"name", fmt::format("E{0}{0}", axis.axis)},
                        {"follows", {network.nodes[std::size_t(grows.node)].name}},
                        {"feedback", motor ? "motor" : "scale"}});
  }
  for (const errors::TemperatureSensor& sensor : thermal.sensors)
    sensors.push_back(
        {{"name", sensor.name}, {"node", network.nodes[std::size_t(sensor.node)].name}});
  return {{"nodes", network.nodes.size()},
          {"links", network.links.size() + network.surroundings.size()},
          {"sources", network.sources.size()},
          {"shortest_time_constant_s", 1.0 / rate.maxCoeff()},
          {"longest_time_constant_s", 1.0 / rate.minCoeff()},
          {"history_h", (0.0 - heat.run.knots.front().time_s) / 3600.0},
          {"elements", elements},
          {"sensors", sensors}};
}

/// Static stiffness at the tip along the axes of frame t, the axes half way through the program;
/// null where nothing gives way.
ordered_json stiffness_N_per_um(const Job& job) {
  const AxisState& state = job.samples.states[job.samples.states.size() / 2];
  constexpr double force = 1.0;  // N
  const auto tip = [&](int axis, double newton) {
    errors::Load load;
    load.on_tool_t[axis] = newton;
    return tool_in_workpiece(job.truth, state, load);
  };
  ordered_json stiffness = ordered_json::array();
  for (int axis = 0; axis < 3; ++axis) {
    const kinematics::Pose pushed = tip(axis, force), pulled = tip(axis, -force);
    const double gives =
        pulled.linear().col(axis).dot(pushed.translation() - pulled.translation()) / 2;
    stiffness.push_back(gives > 1e-12 ? ordered_json(force / gives * units::um) : ordered_json());
  }
  return stiffness;
}

ordered_json describe_cut(const CuttingDescription& cutting, const Process& process) {
  const ProcessTotals all = totals(process);
  return {{"material", cutting.material ? ordered_json(cutting.material->name) : ordered_json()},
          {"source", cutting.material ? ordered_json(cutting.material->source) : ordered_json()},
          {"spacing_mm", cutting.spacing},
          {"steps", process.steps.size()},
          {"removed_mm3", all.removed},
          {"force_max_N", all.force_max},
          {"crash_lines", process.crash_lines}};
}

}  // namespace

ordered_json describe(const Job& job) {
  const kinematics::Chain& chain = job.machine.nominal;
  const kinematics::Topology topology = kinematics::topology_of(chain.joints());
  const kinematics::BodyArray bodies = kinematics::low_order_body_array(topology);
  ordered_json description = {
      {"scene", job.scene.title},
      {"machine", job.scene.machine.name},
      {"structural_code", kinematics::to_string(topology)},
      {"bodies", bodies.body},
      {"low_order_body_array", bodies.parent},
      {"axes", describe_axes(chain)},
  };
  ordered_json elements = ordered_json::array();
  for (const auto& bound : job.truth.geometric.elements)
    elements.push_back(describe_element(job.truth.geometric, bound, chain));
  description["elements"] = elements;
  if (job.truth.heat)
    description["heat"] = describe_heat(*job.truth.heat, *job.scene.thermal, chain);
  if (job.truth.compliance && !job.samples.states.empty())
    description["stiffness_N_per_um"] = stiffness_N_per_um(job);
  if (job.scene.cutting) description["cut"] = describe_cut(*job.scene.cutting, job.nominal_process);
  description["part"] = {
      {"name", job.scene.part.name},
      {"vertices", job.design_w.vertices.rows()},
      {"triangles", job.design_w.triangles.rows()},
      {"area_mm2", job.design_w.area.sum()},
      {"facet_error_max_um", job.design_w.facet_error.size() > 0
                                 ? job.design_w.facet_error.maxCoeff() / units::um
                                 : 0.0}};
  description["program"] = {
      {"moves", job.path.motion_blocks},
      {"samples", job.samples.states.size()},
      {"time_s", job.samples.states.empty() ? 0.0 : job.samples.states.back().time_s},
      {"not_reached", unreached_text(job.unreached)}};
  description["warnings"] = job.warnings;
  return description;
}

namespace {

std::string heat_text(const ordered_json& heat) {
  std::string text = fmt::format(
      "\nheat     {} nodes, {} links, {} sources, time constants {:.3g} s to {:.3g} h, history of "
      "{:.3g} h, {} sensors\n",
      heat["nodes"].get<int>(), heat["links"].get<int>(), heat["sources"].get<int>(),
      heat["shortest_time_constant_s"].get<double>(),
      heat["longest_time_constant_s"].get<double>() / 3600.0, heat["history_h"].get<double>(),
      heat["sensors"].size());
  for (const auto& element : heat["elements"]) {
    std::string nodes;
    for (const auto& node : element["follows"])
      nodes += (nodes.empty() ? "" : ", ") + node.get<std::string>();
    std::string more;
    if (element.contains("feedback"))
      more = fmt::format(" (feedback: {})", element["feedback"].get<std::string>());
    if (element.contains("meaning"))
      more = fmt::format(" ({})", element["meaning"].get<std::string>());
    text += fmt::format("{:<8} follows {}{}\n", element["name"].get<std::string>(), nodes, more);
  }
  return text;
}

/// "EC0Y turns X workpiece by -40 urad about Z; angle X-Y +40 urad; tip in um: ..."
std::string location_text(const std::string& name, const ordered_json& location) {
  const bool turns = location.contains("turned_urad");
  const double amount = location[turns ? "turned_urad" : "moved_um"].get<double>();
  std::string bodies, angles, tip;
  for (const auto& body : location["bodies"]) bodies += " " + body.get<std::string>();
  const std::string way = location["displaces"].get<std::string>();
  if (way == "axis") bodies += " alone";
  if (way == "carried") bodies += ", which it carries,";
  for (const auto& [between, change] : location["angle_change_urad"].items())
    angles += fmt::format("; angle {} {:+.4g} urad", between, change.get<double>());
  const auto um = [](const ordered_json& value) {  // what two poses cannot tell is no motion
    const double v = value.get<double>();
    return std::abs(v) < 1e-6 ? 0.0 : v;
  };
  for (const auto& one : location["tip_moved"])
    tip += fmt::format("{} {:.4g} {:.4g} {:.4g} at {}", tip.empty() ? "" : ",", um(one["um"][0]),
                       um(one["um"][1]), um(one["um"][2]), one["at"].get<std::string>());
  return fmt::format("{:<8} {}{} by {:+.4g} {} {}{}\n         tip um{}\n", name,
                     turns ? "turns" : "moves", bodies, amount, turns ? "urad about" : "um along",
                     location["about_or_along"].get<std::string>(), angles, tip);
}

std::string stiffness_text(const ordered_json& stiffness) {
  std::string text = "\nstiffness at the tip, half way, along tool x y z:";
  for (const auto& k : stiffness)
    text += k.is_null() ? " stiff" : fmt::format(" {:.4g}", k.get<double>());
  return text + " N/um\n";
}

std::string programs_text(const ordered_json& programs) {
  std::string text = "\nruns     programs that its files name; check ran none\n";
  for (const auto& one : programs)
    text += fmt::format("         {}, named in {}:{}, {}\n", one["program"].get<std::string>(),
                        one["file"].get<std::string>(), one["line"].get<int>(),
                        one["trusted"].get<bool>() ? "trusted" : "NOT trusted: asks --trust");
  return text;
}

std::string cut_text(const ordered_json& cut) {
  std::string text = fmt::format(
      "\ncut      {}, stock followed every {:.3g} mm; nominal: {:.5g} mm^3 removed in {} steps, at "
      "most "
      "{:.4g} N\n",
      cut["material"].is_null() ? "stock alone" : cut["material"].get<std::string>(),
      cut["spacing_mm"].get<double>(), cut["removed_mm3"].get<double>(), cut["steps"].get<long>(),
      cut["force_max_N"].get<double>());
  if (!cut["crash_lines"].empty())
    text += fmt::format("         a rapid or the shank meets material on {} lines, first line {}\n",
                        cut["crash_lines"].size(), cut["crash_lines"][0].get<int>());
  return text;
}

}  // namespace

std::string to_text(const ordered_json& d) {
  std::string text =
      fmt::format("{}\nmachine  {}\ncode     {}\n", d["scene"].get<std::string>(),
                  d["machine"].get<std::string>(), d["structural_code"].get<std::string>());
  std::string bodies = "bodies   ", parents = "parents  ";
  for (std::size_t i = 0; i < d["bodies"].size(); ++i) {
    const std::string body = fmt::format("{} {}", i + 1, d["bodies"][i].get<std::string>());
    const std::size_t width = body.size() + 2;
    bodies += fmt::format("{:<{}}", body, width);
    parents += fmt::format("{:<{}}", d["low_order_body_array"][i].get<int>(), width);
  }
  text += bodies + "   (numbered from the bed outwards, workpiece side first)\n";
  text += parents + "   (low-order body array, 0 is the bed)\n\n";

  text += fmt::format("{:<5} {:<6} {:<10} {:<22} {:<26} {}\n", "axis", "moves", "carries",
                      "direction", "point mm", "travel");
  const auto triple = [](const ordered_json& v) {
    return fmt::format("{:.6g} {:.6g} {:.6g}", v[0].get<double>(), v[1].get<double>(),
                       v[2].get<double>());
  };
  for (const auto& axis : d["axes"]) {
    std::string travel;
    for (const char* key : {"travel_mm", "travel_deg"})
      if (axis.contains(key))
        travel = axis[key][0].is_null()
                     ? std::string("unlimited")
                     : fmt::format("{:.6g} .. {:.6g} {}", axis[key][0].get<double>(),
                                   axis[key][1].get<double>(), key + 7);
    text += fmt::format("{:<5} {:<6} {:<10} {:<22} {:<26} {}\n", axis["name"].get<std::string>(),
                        axis["moves"].get<std::string>(), axis["carries"].get<std::string>(),
                        triple(axis["direction"]), triple(axis["point_mm"]), travel);
  }
  if (!d["elements"].empty())
    text += fmt::format("\n{:<8} {:>14} {:>22}  {}\n", "element", "at zero", "slope at zero",
                        "stated at");
  for (const auto& element : d["elements"]) {
    std::string value, slope;
    for (const auto& [key, number] : element.items()) {
      const bool is_value = key.rfind("value_at_zero_", 0) == 0,
                 is_slope = key.rfind("slope_at_zero_", 0) == 0;
      if (!is_value && !is_slope) continue;
      std::string unit = key.substr(14);
      std::replace(unit.begin(), unit.end(), '_', ' ');
      (is_value ? value : slope) = number.is_null()
                                       ? "outside its table"
                                       : fmt::format("{:.4g} {}", number.get<double>(), unit);
    }
    text +=
        fmt::format("{:<8} {:>14} {:>22}  {}\n", element["name"].get<std::string>(), value, slope,
                    element.contains("location") ? element["location"]["meaning"].get<std::string>()
                                                 : element["stated_at"].get<std::string>());
  }
  for (const auto& element : d["elements"])
    if (element.contains("location"))
      text += location_text(element["name"].get<std::string>(), element["location"]);
  if (d.contains("heat")) text += heat_text(d["heat"]);
  if (d.contains("stiffness_N_per_um")) text += stiffness_text(d["stiffness_N_per_um"]);
  if (d.contains("cut")) text += cut_text(d["cut"]);
  if (d.contains("programs") && !d["programs"].empty()) text += programs_text(d["programs"]);
  text += fmt::format(
      "\npart     {}: {} vertices, {:.4g} mm^2\nprogram  {} moves, {} samples, {:.1f} s\n",
      d["part"]["name"].get<std::string>(), d["part"]["vertices"].get<long>(),
      d["part"]["area_mm2"].get<double>(), d["program"]["moves"].get<int>(),
      d["program"]["samples"].get<long>(), d["program"]["time_s"].get<double>());
  if (const std::string missed = d["program"]["not_reached"]; !missed.empty())
    text += "         " + missed + "\n";
  return text;
}

}  // namespace abbe::sim
