#include "sim/report/check_report.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "errors/element.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/files/json_files.h"
#include "sim/report/program_report.h"
#include "sim/scene/library.h"

namespace abbe::sim {

namespace {

using kinematics::AxisState;
using kinematics::Joint;

/// Returns the line on which an error motion was measured; without one it applies at the joint's
/// point.
std::string measured_line(const errors::GeometricModel& model,
                          const errors::GeometricModel::Bound& bound, const Joint& joint) {
  std::string text = "the point of the joint";
  for (const auto& line : model.lines)
    if (line.joint == bound.joint && !bound.element.name.is_angle()) {
      const Eigen::Vector3d point = joint.point_b + line.arm_b;
      text = fmt::format("line through {:.6g} {:.6g} {:.6g}, measured by the {}", point.x(),
                         point.y(), point.z(), line.is_point_fixed_in_bed ? "tool" : "carriage");
    }
  return text;
}

/// Returns an element with its value and slope at the zero of its axis. Both stay empty if one of
/// its tables does not contain zero.
Description::Element element_description(const errors::GeometricModel& model,
                                         const errors::GeometricModel::Bound& bound,
                                         const kinematics::Chain& chain) {
  const Joint& joint = chain.joints()[std::size_t(bound.joint)];
  Description::Element element;
  element.name = bound.element.name;
  element.is_on_slide = joint.motion == kinematics::Motion::Linear;
  errors::CurveState at_zero;
  at_zero.primed = joint.side == kinematics::Side::Workpiece;
  double value = 0.0, slope = 0.0;
  bool has_value = true;
  for (const errors::Curve& curve : bound.element.curves) {
    if (!curve.name.empty()) element.curves.push_back(curve.name);
    try {
      value += errors::value(curve, at_zero);
      slope += errors::slope(curve, at_zero);
    } catch (const std::out_of_range&) {
      has_value = false;
    }
  }
  if (has_value) element.value = value;
  if (bound.location) {
    element.location = location_effect(bound.element, chain);
  } else {
    if (has_value) element.slope = slope;
    element.stated_at = measured_line(model, bound, joint);
  }
  return element;
}

/// Returns the material of the scene, else that of the first tool which states one.
std::optional<cutting::CuttingCoefficients> nominal_material(const Scene& scene) {
  if (scene.cutting->material) return scene.cutting->material;
  for (const ToolDescription& tool : all_tools(scene))
    if (tool.material) return tool.material;
  return {};
}

/// Appends the names of the nodes on which a function of temperatures depends.
void add_nodes(std::vector<std::string>& names, const errors::ThermalFunction& function,
               const errors::ThermalNetwork& network) {
  for (const auto& term : function.terms) {
    std::string name = network.nodes[std::size_t(term.node)].name;
    if (term.minus) name += " - " + network.nodes[std::size_t(*term.minus)].name;
    names.push_back(name);
  }
}

/// Returns the thermal network. Its time constants are the inverse decay rates of its modes.
Description::Heat heat_description(const Truth::Heat& truth, const ThermalDescription& thermal,
                                   const kinematics::Chain& chain) {
  const errors::ThermalNetwork& network = truth.run.network;
  const auto name_of = [&](int node) { return network.nodes[std::size_t(node)].name; };
  Description::Heat heat;
  heat.nodes = network.nodes.size();
  heat.links = network.links.size() + network.surroundings.size();
  heat.sources = network.sources.size();
  heat.shortest_time_constant_s = 1.0 / truth.run.dry.rate_per_s.maxCoeff();
  heat.longest_time_constant_s = 1.0 / truth.run.dry.rate_per_s.minCoeff();
  heat.history_h = (0.0 - truth.run.knots.front().time_s) / 3600.0;
  for (const errors::ThermalElement& error : thermal.errors.elements) {
    Description::Heat::Element element{errors::to_string(error.name), {}, {}, {}};
    add_nodes(element.nodes, error.offset, network);
    add_nodes(element.nodes, error.slope, network);
    if (error.name.location)
      element.meaning =
          errors::meaning(error.name, chain, errors::axis_joint(error.name.axis, chain, ""));
    heat.elements.push_back(std::move(element));
  }
  for (const errors::AxisExpansion& axis : thermal.errors.expansions) {
    const bool motor = axis.feedback == errors::Feedback::Motor;
    heat.elements.push_back({fmt::format("E{0}{0}", axis.axis),
                             {name_of((motor ? *axis.screw : *axis.scale).node)},
                             {},
                             motor ? "motor" : "scale"});
  }
  for (const errors::TemperatureSensor& sensor : thermal.sensors)
    heat.sensors.push_back({sensor.name, name_of(sensor.node)});
  return heat;
}

/// Returns the stiffness of the tool along x, y and z, in N/um, at the middle sample.
std::array<std::optional<double>, 3> tool_stiffness(const Job& job) {
  const AxisState& state = job.samples.states[job.samples.states.size() / 2];
  // The tool that runs at this time has its own compliance.
  const Segment* part = &job;
  for (const Segment& segment : job.segments)
    if (!segment.samples.states.empty() && segment.samples.states.front().time_s <= state.time_s)
      part = &segment;
  // A central difference cancels all other deviations; with 1 N the machine is linear.
  constexpr double force = 1.0;  // N
  const auto tip = [&](int axis, double newton) {
    errors::Load load;
    load.tool_wrench_t[axis] = newton;
    return tool_in_workpiece(part->truth, state, load);
  };
  std::array<std::optional<double>, 3> stiffness;
  for (int axis = 0; axis < 3; ++axis) {
    const kinematics::Pose pushed = tip(axis, force), pulled = tip(axis, -force);
    const double deflection =
        pulled.linear().col(axis).dot(pushed.translation() - pulled.translation()) / 2;
    // Below 1e-12 mm the difference is rounding of two poses: that direction is rigid.
    if (deflection > 1e-12) stiffness[std::size_t(axis)] = force / deflection * units::um;
  }
  return stiffness;
}

}  // namespace

Description describe(const Job& job) {
  const kinematics::Chain& chain = job.machine.nominal;
  const kinematics::Topology topology = kinematics::chain_topology(chain.joints());
  const auto& states = job.samples.states;
  Description d;
  d.scene = job.scene.title;
  for (const std::filesystem::path& file : job.scene.files) d.files.push_back(library_name(file));
  d.machine = job.scene.machine.name;
  d.structural_code = kinematics::to_string(topology);
  d.bodies = kinematics::low_order_body_array(topology);
  d.axes = {chain.joints().begin(), chain.joints().end()};
  for (const auto& bound : job.truth.geometric.elements)
    d.elements.push_back(element_description(job.truth.geometric, bound, chain));
  if (job.truth.heat) d.heat = heat_description(*job.truth.heat, *job.scene.thermal, chain);
  if (job.truth.compliance && !states.empty()) d.stiffness_N_per_um = tool_stiffness(job);
  if (job.scene.cutting)
    d.cut = {nominal_material(job.scene), job.scene.cutting->spacing,
             job.nominal_process.steps.size(), totals(job.nominal_process),
             job.nominal_process.crash_lines};
  const cutting::Design& design = job.design_w;
  d.part = {job.scene.part.name,
            design.vertices.rows(),
            design.triangles.rows(),
            design.area.sum(),
            design.facet_error.size() > 0 ? design.facet_error.maxCoeff() : 0.0,
            region_coverage(job.scene.part, job.face_groups,
                            cutting::transformed(design, job.scene.part.T_wm.inverse()))};
  d.program = {job.path.motion_blocks, states.size(), states.empty() ? 0.0 : states.back().time_s,
               unreached_text(job.unreached), job.path.read_as};
  for (const Segment& segment : job.segments)
    d.tool_segments.push_back({*segment.scene.tool.number, segment.scene.tool.name,
                               segment.path.blocks.front().line, segment.path.blocks.back().line,
                               segment.path.motion_blocks});
  d.warnings = job.warnings;
  d.assumptions = job.path.assumptions;
  return d;
}

namespace {

using kinematics::Motion;
using nlohmann::ordered_json;

/// Returns the motion of an axis: slide, turn, or nose for a spindle.
const char* motion_text(const Joint& joint) {
  return joint.motion == Motion::Linear   ? "slide"
         : joint.motion == Motion::Rotary ? "turn"
                                          : "nose";
}

/// Returns the body that an axis carries; it decides the sign of the axis's commands.
const char* carried_by(const Joint& joint) {
  return joint.side == kinematics::Side::Workpiece ? "workpiece" : "tool";
}

/// Returns a travel limit in mm or degrees; empty if the axis is unlimited.
std::optional<double> travel_limit(const Joint& joint, double q) {
  if (std::abs(q) >= 1e9) return std::nullopt;
  return q / (joint.motion == Motion::Linear ? 1.0 : units::deg);
}

/// Return the unit of an element in reports, and its name.
double element_unit(const errors::ElementName& name) {
  return name.is_angle() ? units::urad : units::um;
}
const char* element_unit_name(const errors::ElementName& name) {
  return name.is_angle() ? "urad" : "um";
}

/// Returns the axis along or about which an element acts. Components 0 to 2 are translations, 3 to
/// 5 rotations.
char acting_axis(const errors::ElementName& name) { return char('X' + name.component() % 3); }

/// Returns an axis; a spindle has no travel.
ordered_json axis_json(const Joint& joint) {
  ordered_json axis = {{"name", std::string(1, joint.name)},
                       {"moves", motion_text(joint)},
                       {"carries", carried_by(joint)},
                       {"direction", numbers(joint.direction_b)},
                       {"point_mm", numbers(joint.point_b)}};
  if (joint.motion == Motion::Spindle) return axis;
  axis[joint.motion == Motion::Linear ? "travel_mm" : "travel_deg"] = {
      number(travel_limit(joint, joint.min)), number(travel_limit(joint, joint.max))};
  axis["deviations"] =
      joint.deviation_axes == kinematics::DeviationAxes::Fixed ? "fixed" : "turning";
  axis["squareness"] = joint.squareness == kinematics::Squareness::Frame ? "frame" : "travel";
  return axis;
}

/// Returns the effect of a location element: the bodies that it moves, the angles that it changes,
/// and the displacement of the tip.
ordered_json location_json(const errors::ElementName& name, const LocationEffect& effect) {
  const char* displaces[] = {"frame", "carried", "axis"};
  ordered_json angles = ordered_json::object(), tip = ordered_json::array();
  for (const LocationEffect::Angle& angle : effect.angles)
    angles[angle.between] = angle.change / units::urad;
  for (const LocationEffect::Tip& point : effect.tip)
    tip.push_back({{"at", point.at}, {"um", numbers(point.displacement_w / units::um)}});
  return {{"meaning", effect.meaning},
          {"displaces", displaces[int(effect.displaces)]},
          {"bodies", effect.bodies},
          {name.is_angle() ? "turned_urad" : "moved_um", effect.amount / element_unit(name)},
          {"about_or_along", std::string(1, acting_axis(name))},
          {"angle_change_urad", angles},
          {"tip_moved", tip}};
}

/// Returns an element with units in its keys: um or urad, slopes per mm or per rad.
ordered_json element_json(const Description::Element& element) {
  const std::string unit_name = element_unit_name(element.name);
  const double unit = element_unit(element.name);
  ordered_json json = {{"name", errors::to_string(element.name)}};
  json["value_at_zero_" + unit_name] = number(element.value, unit);
  if (element.location) {
    json["location"] = location_json(element.name, *element.location);
  } else {
    json["slope_at_zero_" + unit_name + (element.is_on_slide ? "_per_mm" : "_per_rad")] =
        number(element.slope, unit);
    json["stated_at"] = element.stated_at;
  }
  if (!element.curves.empty()) json["parts"] = element.curves;
  return json;
}

/// Returns the thermal network with the elements and sensors that depend on it.
ordered_json heat_json(const Description::Heat& heat) {
  ordered_json elements = ordered_json::array(), sensors = ordered_json::array();
  for (const Description::Heat::Element& element : heat.elements) {
    elements.push_back({{"name", element.name}, {"follows", element.nodes}});
    if (!element.meaning.empty()) elements.back()["meaning"] = element.meaning;
    if (!element.feedback.empty()) elements.back()["feedback"] = element.feedback;
  }
  for (const Description::Heat::Sensor& sensor : heat.sensors)
    sensors.push_back({{"name", sensor.name}, {"node", sensor.node}});
  return {{"nodes", heat.nodes},
          {"links", heat.links},
          {"sources", heat.sources},
          {"shortest_time_constant_s", heat.shortest_time_constant_s},
          {"longest_time_constant_s", heat.longest_time_constant_s},
          {"history_h", heat.history_h},
          {"elements", elements},
          {"sensors", sensors}};
}

/// Returns the cut of the nominal machine; the material is null if no forces are computed.
ordered_json cut_json(const Description::NominalCut& cut) {
  ordered_json material, source;
  if (cut.material) {
    material = cut.material->name;
    source = cut.material->source;
  }
  return {{"material", material},
          {"source", source},
          {"spacing_mm", cut.spacing},
          {"steps", cut.steps},
          {"removed_mm3", cut.totals.removed},
          {"force_max_N", cut.totals.max_force},
          {"crash_lines", cut.crash_lines}};
}

/// Returns the external programs that a scene would run, with their trust.
ordered_json programs_json(const std::vector<ProgramTrust>& programs) {
  ordered_json json = ordered_json::array();
  for (const ProgramTrust& trust : programs)
    json.push_back({{"program", trust.reference.program.string()},
                    {"file", trust.reference.file.string()},
                    {"line", trust.reference.line},
                    {"trusted", trust.trusted}});
  return json;
}

/// Returns the numbered bodies and, in a second line, the low-order body array.
std::string bodies_text(const kinematics::BodyArray& array) {
  std::string bodies = "bodies   ", parents = "parents  ";
  for (std::size_t i = 0; i < array.body.size(); ++i) {
    const std::string body = fmt::format("{} {}", i + 1, array.body[i]);
    const std::size_t width = body.size() + 2;
    bodies += fmt::format("{:<{}}", body, width);
    parents += fmt::format("{:<{}}", array.parent[i], width);
  }
  return bodies + "   (numbered from the bed outwards, workpiece side first)\n" + parents +
         "   (low-order body array, 0 is the bed)\n";
}

/// Returns the row of an axis; a spindle has no travel.
std::string axis_text(const Joint& joint) {
  const auto vector_text = [](const Eigen::Vector3d& v) {
    return fmt::format("{:.6g} {:.6g} {:.6g}", v.x(), v.y(), v.z());
  };
  std::string travel;
  if (joint.motion != Motion::Spindle) {
    const auto min = travel_limit(joint, joint.min), max = travel_limit(joint, joint.max);
    travel = min && max ? fmt::format("{:.6g} .. {:.6g} {}", *min, *max,
                                      joint.motion == Motion::Linear ? "mm" : "deg")
                        : "unlimited";
  }
  return fmt::format("{:<5} {:<6} {:<10} {:<22} {:<26} {}\n", joint.name, motion_text(joint),
                     carried_by(joint), vector_text(joint.direction_b), vector_text(joint.point_b),
                     travel);
}

/// Returns a line for an element: value and slope at zero, and the line on which it was measured.
std::string element_text(const Description::Element& element) {
  const auto text = [&](const std::optional<double>& number, const std::string& per) {
    return number ? fmt::format("{:.4g} {}{}", *number / element_unit(element.name),
                                element_unit_name(element.name), per)
                  : "outside the table";
  };
  std::string slope;
  if (!element.location) slope = text(element.slope, element.is_on_slide ? " per mm" : " per rad");
  return fmt::format("{:<8} {:>14} {:>22}  {}\n", errors::to_string(element.name),
                     text(element.value, ""), slope,
                     element.location ? element.location->meaning : element.stated_at);
}

/// Returns "EC0Y turns X workpiece by -40 urad about Z; angle X-Y +40 urad; tip in um: ...".
std::string location_text(const errors::ElementName& name, const LocationEffect& effect) {
  std::string bodies, angles, tip;
  for (const std::string& body : effect.bodies) bodies += " " + body;
  if (effect.displaces == kinematics::DisplacedPart::Axis) bodies += " alone";
  if (effect.displaces == kinematics::DisplacedPart::Carried) bodies += ", which it carries,";
  for (const LocationEffect::Angle& angle : effect.angles)
    angles += fmt::format("; angle {} {:+.4g} urad", angle.between, angle.change / units::urad);
  const auto um = [](double mm) {
    // Less than 1e-6 um is rounding of two poses.
    return std::abs(mm / units::um) < 1e-6 ? 0.0 : mm / units::um;
  };
  for (const LocationEffect::Tip& point : effect.tip)
    tip += fmt::format("{} {:.4g} {:.4g} {:.4g} at {}", tip.empty() ? "" : ",",
                       um(point.displacement_w.x()), um(point.displacement_w.y()),
                       um(point.displacement_w.z()), point.at);
  return fmt::format("{:<8} {}{} by {:+.4g} {} {} {}{}\n         tip um{}\n",
                     errors::to_string(name), name.is_angle() ? "turns" : "moves", bodies,
                     effect.amount / element_unit(name), element_unit_name(name),
                     name.is_angle() ? "about" : "along", acting_axis(name), angles, tip);
}

/// Returns a line on the thermal network and a line for every element that depends on it.
std::string heat_text(const Description::Heat& heat) {
  std::string text = fmt::format(
      "\nheat     {} nodes, {} links, {} sources, time constants {:.3g} s to {:.3g} h, history of "
      "{:.3g} h, {} sensors\n",
      heat.nodes, heat.links, heat.sources, heat.shortest_time_constant_s,
      heat.longest_time_constant_s / 3600.0, heat.history_h, heat.sensors.size());
  for (const Description::Heat::Element& element : heat.elements) {
    std::string note;
    if (!element.feedback.empty()) note = fmt::format(" (feedback: {})", element.feedback);
    if (!element.meaning.empty()) note = fmt::format(" ({})", element.meaning);
    text += fmt::format("{:<8} follows {}{}\n", element.name,
                        escaped(fmt::format("{}", fmt::join(element.nodes, ", "))), note);
  }
  return text;
}

/// Returns the stiffness along the axes of the tool; "stiff" for a rigid direction.
std::string stiffness_text(const std::array<std::optional<double>, 3>& stiffness) {
  std::string text = "\nstiffness at the tip, halfway through the program, along tool x y z:";
  for (const auto& k : stiffness) text += k ? fmt::format(" {:.4g}", *k) : " stiff";
  return text + " N/um\n";
}

/// Returns the cut of the nominal machine with its crashes.
std::string cut_text(const Description::NominalCut& cut) {
  std::string text = fmt::format(
      "\ncut      {}, stock grid {:.3g} mm; nominal: {:.5g} mm^3 removed in {} steps, force at "
      "most {:.4g} N\n",
      cut.material ? escaped(cut.material->name) : "stock only", cut.spacing, cut.totals.removed,
      cut.steps, cut.totals.max_force);
  if (!cut.crash_lines.empty())
    text += fmt::format(
        "         a rapid move or the shank hits material on {} lines, first on line {}\n",
        cut.crash_lines.size(), cut.crash_lines.front());
  return text;
}

/// Returns the part and its regions. If regions overlap, the last one decides.
std::string part_text(const Description::Part& part) {
  std::string text = fmt::format("\npart     {}: {} vertices, {:.4g} mm^2\n", escaped(part.name),
                                 part.vertices, part.area);
  for (const RegionCoverage& region : part.regions) {
    text += fmt::format("         region {}: {:.4g} mm^2, {:.4g} % of the part",
                        escaped(region.name), region.area, 100.0 * region.area_fraction);
    if (region.deciding_fraction < region.area_fraction)
      text +=
          fmt::format(", {:.4g} % not covered by later regions", 100.0 * region.deciding_fraction);
    text += "\n";
  }
  return text;
}

/// Returns the program with its segments by tool.
std::string program_text(const Description& d) {
  std::string text = fmt::format("program  {} moves, {} samples, {:.1f} s\n", d.program.moves,
                                 d.program.samples, d.program.time_s);
  if (!d.program.dialect.empty()) text += "         read as " + escaped(d.program.dialect) + "\n";
  for (const Description::ToolSegment& segment : d.tool_segments)
    text +=
        fmt::format("         T{} {}: {} moves, lines {} to {}\n", segment.tool,
                    escaped(segment.name), segment.moves, segment.first_line, segment.last_line);
  if (!d.program.unreached_moves.empty()) text += "         " + d.program.unreached_moves + "\n";
  return text;
}

/// Returns the external programs that a scene would run; `check` runs none of them.
std::string programs_text(const std::vector<ProgramTrust>& programs) {
  if (programs.empty()) return {};
  std::string text = "\nruns     programs named in its files; check did not run them\n";
  for (const ProgramTrust& trust : programs)
    text +=
        fmt::format("         {}, named in {}:{}, {}\n", escaped(trust.reference.program.string()),
                    escaped(trust.reference.file.string()), trust.reference.line,
                    trust.trusted ? "trusted" : "NOT trusted: needs --trust");
  return text;
}

}  // namespace

ordered_json to_json(const Description& d) {
  ordered_json axes = ordered_json::array(), elements = ordered_json::array();
  for (const Joint& joint : d.axes) axes.push_back(axis_json(joint));
  for (const Description::Element& element : d.elements) elements.push_back(element_json(element));
  ordered_json json = {{"scene", d.scene},
                       {"machine", d.machine},
                       {"structural_code", d.structural_code},
                       {"bodies", d.bodies.body},
                       {"low_order_body_array", d.bodies.parent},
                       {"axes", axes},
                       {"elements", elements}};
  if (d.heat) json["heat"] = heat_json(*d.heat);
  if (d.stiffness_N_per_um)
    for (const auto& k : *d.stiffness_N_per_um) json["stiffness_N_per_um"].push_back(number(k));
  if (d.cut) json["cut"] = cut_json(*d.cut);
  json["part"] = {{"name", d.part.name},
                  {"vertices", d.part.vertices},
                  {"triangles", d.part.triangles},
                  {"area_mm2", d.part.area},
                  {"facet_error_max_um", d.part.facet_error / units::um}};
  for (const RegionCoverage& region : d.part.regions)
    json["part"]["regions"].push_back({{"name", region.name},
                                       {"area_mm2", region.area},
                                       {"area_percent", 100.0 * region.area_fraction},
                                       {"decides_percent", 100.0 * region.deciding_fraction}});
  json["program"] = {{"moves", d.program.moves},
                     {"samples", d.program.samples},
                     {"time_s", d.program.time_s},
                     {"not_reached", d.program.unreached_moves},
                     {"read_as", d.program.dialect}};
  for (const Description::ToolSegment& segment : d.tool_segments)
    json["program"]["tools"].push_back({{"number", segment.tool},
                                        {"name", segment.name},
                                        {"first_line", segment.first_line},
                                        {"last_line", segment.last_line},
                                        {"moves", segment.moves}});
  json["files"] = d.files;
  json["assumptions"] = to_json(d.assumptions);
  json["warnings"] = d.warnings;
  if (d.programs) json["programs"] = programs_json(*d.programs);
  return json;
}

std::string to_text(const Description& d) {
  // The most important facts come first: `check` prints a limited number of lines.
  std::string text = fmt::format("{}\nmachine  {}\ncode     {}\n", escaped(d.scene),
                                 escaped(d.machine), d.structural_code);
  text += part_text(d.part);
  text += program_text(d);
  if (d.cut) text += cut_text(*d.cut);
  if (d.stiffness_N_per_um) text += stiffness_text(*d.stiffness_N_per_um);
  if (d.programs) text += programs_text(*d.programs);
  text += fmt::format("\n{:<5} {:<6} {:<10} {:<22} {:<26} {}\n", "axis", "moves", "carries",
                      "direction", "point mm", "travel");
  for (const Joint& joint : d.axes) text += axis_text(joint);
  text += "\n" + bodies_text(d.bodies);
  for (std::size_t i = 0; i < d.files.size(); ++i)
    text += fmt::format("{}{}\n", i == 0 ? "reads    " : "         ", escaped(d.files[i]));
  if (d.heat) text += heat_text(*d.heat);
  if (!d.elements.empty())
    text += fmt::format("\n{:<8} {:>14} {:>22}  {}\n", "element", "at zero", "slope at zero",
                        "stated at");
  for (const Description::Element& element : d.elements) text += element_text(element);
  for (const Description::Element& element : d.elements)
    if (element.location) text += location_text(element.name, *element.location);
  return text;
}

}  // namespace abbe::sim
