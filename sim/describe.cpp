#include "sim/describe.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

ordered_json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

kinematics::Topology topology_of(const kinematics::Chain& chain) {
  kinematics::Topology topology;
  for (const kinematics::Joint& joint : chain.joints())
    topology.push_back({joint.name, joint.side});
  return topology;
}

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
  if (!parts.empty()) element["parts"] = parts;
  return element;
}

}  // namespace

ordered_json describe(const Job& job) {
  const kinematics::Chain& chain = job.machine.nominal;
  const kinematics::Topology topology = topology_of(chain);
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
      {"time_s", job.samples.states.empty() ? 0.0 : job.samples.states.back().time_s}};
  return description;
}

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
    text += fmt::format("{:<8} {:>14} {:>22}  {}\n", element["name"].get<std::string>(), value,
                        slope, element.value("stated_at", std::string("location of the axis")));
  }
  text += fmt::format(
      "\npart     {}: {} vertices, {:.4g} mm^2\nprogram  {} moves, {} samples, {:.1f} s\n",
      d["part"]["name"].get<std::string>(), d["part"]["vertices"].get<long>(),
      d["part"]["area_mm2"].get<double>(), d["program"]["moves"].get<int>(),
      d["program"]["samples"].get<long>(), d["program"]["time_s"].get<double>());
  return text;
}

}  // namespace abbe::sim
