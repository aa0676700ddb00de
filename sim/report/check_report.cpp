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

/// Returns where an error motion is stated: on the line on which it was measured, if one is given.
std::string place_of(const errors::GeometricModel& model,
                     const errors::GeometricModel::Bound& bound, const Joint& joint) {
  std::string place = "the joint's point";
  for (const auto& line : model.lines)
    if (line.joint == bound.joint && !bound.element.name.is_angle()) {
      const Eigen::Vector3d at = joint.point_b + line.arm_b;
      place = fmt::format("line through {:.6g} {:.6g} {:.6g}, measured by the {}", at.x(), at.y(),
                          at.z(), line.is_fixed_in_bed ? "tool" : "carriage");
    }
  return place;
}

/// Returns an element with its value and slope at zero of its axis; a table need not contain zero.
Description::Element described(const errors::GeometricModel& model,
                               const errors::GeometricModel::Bound& bound,
                               const kinematics::Chain& chain) {
  const Joint& joint = chain.joints()[std::size_t(bound.joint)];
  Description::Element element;
  element.name = bound.element.name;
  element.is_on_slide = joint.motion == kinematics::Motion::Linear;
  errors::CurveState at_zero;
  at_zero.primed = joint.side == kinematics::Side::Workpiece;
  double value = 0.0, slope = 0.0;
  bool known = true;
  for (const errors::Curve& curve : bound.element.curves) {
    if (!curve.name.empty()) element.parts.push_back(curve.name);
    try {
      value += errors::value(curve, at_zero);
      slope += errors::slope(curve, at_zero);
    } catch (const std::out_of_range&) {
      known = false;
    }
  }
  if (known) element.value = value;
  if (bound.location) {
    element.location = location_effect(bound.element, chain);
  } else {
    if (known) element.slope = slope;
    element.stated_at = place_of(model, bound, joint);
  }
  return element;
}

/// Adds the nodes on which a function of temperatures depends.
void add_nodes(std::vector<std::string>& names, const errors::ThermalFunction& function,
               const errors::ThermalNetwork& network) {
  for (const auto& term : function.terms) {
    std::string name = network.nodes[std::size_t(term.node)].name;
    if (term.minus) name += " - " + network.nodes[std::size_t(*term.minus)].name;
    names.push_back(name);
  }
}

/// Returns the thermal network with its time constants, which are the inverse decay rates of its
/// modes.
Description::Heat described(const Truth::Heat& truth, const ThermalDescription& thermal,
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
  for (const errors::ThermalElement& one : thermal.errors.elements) {
    Description::Heat::Element element{errors::to_string(one.name), {}, {}, {}};
    add_nodes(element.follows, one.offset, network);
    add_nodes(element.follows, one.slope, network);
    if (one.name.location)
      element.meaning =
          errors::meaning(one.name, chain, errors::joint_of(one.name.axis, chain, ""));
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

/// Returns the stiffness along x, y and z of the tool, half way through the program.
std::array<std::optional<double>, 3> stiffness_N_per_um(const Job& job) {
  const AxisState& state = job.samples.states[job.samples.states.size() / 2];
  // Pushed and pulled, so that all other deviations cancel; 1 N stays in the linear range.
  constexpr double force = 1.0;  // N
  const auto tip = [&](int axis, double newton) {
    errors::Load load;
    load.on_tool_t[axis] = newton;
    return tool_in_workpiece(job.truth, state, load);
  };
  std::array<std::optional<double>, 3> stiffness;
  for (int axis = 0; axis < 3; ++axis) {
    const kinematics::Pose pushed = tip(axis, force), pulled = tip(axis, -force);
    const double gives =
        pulled.linear().col(axis).dot(pushed.translation() - pulled.translation()) / 2;
    // Below 1e-12 mm per N the difference is rounding: that direction is rigid.
    if (gives > 1e-12) stiffness[std::size_t(axis)] = force / gives * units::um;
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
    d.elements.push_back(described(job.truth.geometric, bound, chain));
  if (job.truth.heat) d.heat = described(*job.truth.heat, *job.scene.thermal, chain);
  if (job.truth.compliance && !states.empty()) d.stiffness_N_per_um = stiffness_N_per_um(job);
  if (job.scene.cutting)
    d.cut = {job.scene.cutting->material, job.scene.cutting->spacing,
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
  for (const Job& one : job.stretches)
    d.stretches.push_back({*one.scene.tool.number, one.scene.tool.name,
                           one.path.blocks.front().line, one.path.blocks.back().line,
                           one.path.motion_blocks});
  d.warnings = job.warnings;
  d.assumptions = job.path.assumptions;
  return d;
}

namespace {

using kinematics::Motion;
using nlohmann::ordered_json;

/// Returns the kind of an axis: slide, turn or nose.
const char* way_of(const Joint& joint) {
  return joint.motion == Motion::Linear   ? "slide"
         : joint.motion == Motion::Rotary ? "turn"
                                          : "nose";
}

/// Returns the side of an axis, which decides the sign of its commands.
const char* carried_by(const Joint& joint) {
  return joint.side == kinematics::Side::Workpiece ? "workpiece" : "tool";
}

/// Returns a travel limit in mm or degrees; empty if the axis is unlimited.
std::optional<double> limit(const Joint& joint, double q) {
  if (std::abs(q) >= 1e9) return std::nullopt;
  return q / (joint.motion == Motion::Linear ? 1.0 : units::deg);
}

/// Returns the unit in which an element is stated, and its name below.
double unit_of(const errors::ElementName& name) {
  return name.is_angle() ? units::urad : units::um;
}
const char* word_of(const errors::ElementName& name) { return name.is_angle() ? "urad" : "um"; }

/// Returns the axis along or about which an element acts: components 0 to 2 are translations, 3 to
/// 5 rotations.
char direction_of(const errors::ElementName& name) { return char('X' + name.component() % 3); }

/// Returns an axis; a spindle has no travel.
ordered_json axis_json(const Joint& joint) {
  ordered_json axis = {{"name", std::string(1, joint.name)},
                       {"moves", way_of(joint)},
                       {"carries", carried_by(joint)},
                       {"direction", numbers(joint.direction_b)},
                       {"point_mm", numbers(joint.point_b)}};
  if (joint.motion == Motion::Spindle) return axis;
  axis[joint.motion == Motion::Linear ? "travel_mm" : "travel_deg"] = {
      number(limit(joint, joint.min)), number(limit(joint, joint.max))};
  axis["deviations"] =
      joint.deviation_axes == kinematics::DeviationAxes::Fixed ? "fixed" : "turning";
  axis["squareness"] = joint.squareness == kinematics::Squareness::Frame ? "frame" : "travel";
  return axis;
}

/// Returns the effect of a location element: bodies moved, changed angles, displacement of the tip.
ordered_json location_json(const errors::ElementName& name, const LocationEffect& effect) {
  const char* displaces[] = {"frame", "carried", "axis"};
  ordered_json angles = ordered_json::object(), tip = ordered_json::array();
  for (const LocationEffect::Angle& angle : effect.angles)
    angles[angle.between] = angle.change / units::urad;
  for (const LocationEffect::Tip& one : effect.tip)
    tip.push_back({{"at", one.at}, {"um", numbers(one.moved_w / units::um)}});
  return {{"meaning", effect.meaning},
          {"displaces", displaces[int(effect.displaces)]},
          {"bodies", effect.bodies},
          {name.is_angle() ? "turned_urad" : "moved_um", effect.amount / unit_of(name)},
          {"about_or_along", std::string(1, direction_of(name))},
          {"angle_change_urad", angles},
          {"tip_moved", tip}};
}

/// Returns an element with units in its keys: um or urad, slopes per mm or per rad.
ordered_json element_json(const Description::Element& one) {
  const std::string word = word_of(one.name);
  ordered_json element = {{"name", errors::to_string(one.name)}};
  element["value_at_zero_" + word] = number(one.value, unit_of(one.name));
  if (one.location) {
    element["location"] = location_json(one.name, *one.location);
  } else {
    element["slope_at_zero_" + word + (one.is_on_slide ? "_per_mm" : "_per_rad")] =
        number(one.slope, unit_of(one.name));
    element["stated_at"] = one.stated_at;
  }
  if (!one.parts.empty()) element["parts"] = one.parts;
  return element;
}

ordered_json heat_json(const Description::Heat& heat) {
  ordered_json elements = ordered_json::array(), sensors = ordered_json::array();
  for (const Description::Heat::Element& one : heat.elements) {
    elements.push_back({{"name", one.name}, {"follows", one.follows}});
    if (!one.meaning.empty()) elements.back()["meaning"] = one.meaning;
    if (!one.feedback.empty()) elements.back()["feedback"] = one.feedback;
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

/// Returns the cut of the nominal machine; without forces its material is null.
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
          {"force_max_N", cut.totals.force_max},
          {"crash_lines", cut.crash_lines}};
}

/// Returns the programs that a scene would run, and whether they are trusted.
ordered_json programs_json(const std::vector<ProgramTrust>& programs) {
  ordered_json all = ordered_json::array();
  for (const ProgramTrust& one : programs)
    all.push_back({{"program", one.named.program.string()},
                   {"file", one.named.file.string()},
                   {"line", one.named.line},
                   {"trusted", one.trusted}});
  return all;
}

/// Returns the numbered bodies and, below them, the low-order body array.
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

std::string axis_text(const Joint& joint) {
  const auto triple = [](const Eigen::Vector3d& v) {
    return fmt::format("{:.6g} {:.6g} {:.6g}", v.x(), v.y(), v.z());
  };
  std::string travel;
  if (joint.motion != Motion::Spindle) {
    const auto from = limit(joint, joint.min), to = limit(joint, joint.max);
    travel = from && to ? fmt::format("{:.6g} .. {:.6g} {}", *from, *to,
                                      joint.motion == Motion::Linear ? "mm" : "deg")
                        : "unlimited";
  }
  return fmt::format("{:<5} {:<6} {:<10} {:<22} {:<26} {}\n", joint.name, way_of(joint),
                     carried_by(joint), triple(joint.direction_b), triple(joint.point_b), travel);
}

/// Returns one line for an element: value and slope at zero, and where it is stated.
std::string element_text(const Description::Element& one) {
  const auto text = [&](const std::optional<double>& number, const std::string& per) {
    return number ? fmt::format("{:.4g} {}{}", *number / unit_of(one.name), word_of(one.name), per)
                  : "outside its table";
  };
  std::string slope;
  if (!one.location) slope = text(one.slope, one.is_on_slide ? " per mm" : " per rad");
  return fmt::format("{:<8} {:>14} {:>22}  {}\n", errors::to_string(one.name), text(one.value, ""),
                     slope, one.location ? one.location->meaning : one.stated_at);
}

/// Returns "EC0Y turns X workpiece by -40 urad about Z; angle X-Y +40 urad; tip in um: ...".
std::string location_text(const errors::ElementName& name, const LocationEffect& effect) {
  std::string bodies, angles, tip;
  for (const std::string& body : effect.bodies) bodies += " " + body;
  if (effect.displaces == kinematics::DisplacedPart::Axis) bodies += " alone";
  if (effect.displaces == kinematics::DisplacedPart::Carried) bodies += ", which it carries,";
  for (const LocationEffect::Angle& angle : effect.angles)
    angles += fmt::format("; angle {} {:+.4g} urad", angle.between, angle.change / units::urad);
  const auto um = [](double mm) {  // less than 1e-6 um is rounding of two poses
    return std::abs(mm / units::um) < 1e-6 ? 0.0 : mm / units::um;
  };
  for (const LocationEffect::Tip& one : effect.tip)
    tip += fmt::format("{} {:.4g} {:.4g} {:.4g} at {}", tip.empty() ? "" : ",", um(one.moved_w.x()),
                       um(one.moved_w.y()), um(one.moved_w.z()), one.at);
  return fmt::format("{:<8} {}{} by {:+.4g} {} {} {}{}\n         tip um{}\n",
                     errors::to_string(name), name.is_angle() ? "turns" : "moves", bodies,
                     effect.amount / unit_of(name), word_of(name),
                     name.is_angle() ? "about" : "along", direction_of(name), angles, tip);
}

std::string heat_text(const Description::Heat& heat) {
  std::string text = fmt::format(
      "\nheat     {} nodes, {} links, {} sources, time constants {:.3g} s to {:.3g} h, history of "
      "{:.3g} h, {} sensors\n",
      heat.nodes, heat.links, heat.sources, heat.shortest_time_constant_s,
      heat.longest_time_constant_s / 3600.0, heat.history_h, heat.sensors.size());
  for (const Description::Heat::Element& one : heat.elements) {
    std::string more;
    if (!one.feedback.empty()) more = fmt::format(" (feedback: {})", one.feedback);
    if (!one.meaning.empty()) more = fmt::format(" ({})", one.meaning);
    text += fmt::format("{:<8} follows {}{}\n", one.name,
                        escaped(fmt::format("{}", fmt::join(one.follows, ", "))), more);
  }
  return text;
}

std::string stiffness_text(const std::array<std::optional<double>, 3>& stiffness) {
  std::string text = "\nstiffness at the tip, half way, along tool x y z:";
  for (const auto& k : stiffness) text += k ? fmt::format(" {:.4g}", *k) : " stiff";
  return text + " N/um\n";
}

/// Returns the cut of the nominal machine, with the lines of its first crash.
std::string cut_text(const Description::NominalCut& cut) {
  std::string text = fmt::format(
      "\ncut      {}, stock followed every {:.3g} mm; nominal: {:.5g} mm^3 removed in {} steps, at "
      "most {:.4g} N\n",
      cut.material ? escaped(cut.material->name) : "stock alone", cut.spacing, cut.totals.removed,
      cut.steps, cut.totals.force_max);
  if (!cut.crash_lines.empty())
    text += fmt::format("         a rapid or the shank meets material on {} lines, first line {}\n",
                        cut.crash_lines.size(), cut.crash_lines.front());
  return text;
}

/// Returns part and regions; where regions overlap, the last one decides.
std::string part_text(const Description::Part& part) {
  std::string text = fmt::format("\npart     {}: {} vertices, {:.4g} mm^2\n", escaped(part.name),
                                 part.vertices, part.area);
  for (const RegionCoverage& one : part.regions) {
    text += fmt::format("         region {}: {:.4g} mm^2, {:.4g} % of it", escaped(one.name),
                        one.area, 100.0 * one.share);
    if (one.decides < one.share)
      text += fmt::format(", {:.4g} % where no later region holds", 100.0 * one.decides);
    text += "\n";
  }
  return text;
}

std::string program_text(const Description& d) {
  std::string text = fmt::format("program  {} moves, {} samples, {:.1f} s\n", d.program.moves,
                                 d.program.samples, d.program.time_s);
  if (!d.program.read_as.empty()) text += "         read as " + escaped(d.program.read_as) + "\n";
  for (const Description::Stretch& one : d.stretches)
    text += fmt::format("         T{} {}: {} moves, lines {} to {}\n", one.tool, escaped(one.name),
                        one.moves, one.first_line, one.last_line);
  if (!d.program.unreached_moves.empty()) text += "         " + d.program.unreached_moves + "\n";
  return text;
}

/// Returns the programs that a scene would run; a check runs none of them.
std::string programs_text(const std::vector<ProgramTrust>& programs) {
  if (programs.empty()) return {};
  std::string text = "\nruns     programs that its files name; check ran none\n";
  for (const ProgramTrust& one : programs)
    text += fmt::format("         {}, named in {}:{}, {}\n", escaped(one.named.program.string()),
                        escaped(one.named.file.string()), one.named.line,
                        one.trusted ? "trusted" : "NOT trusted: asks --trust");
  return text;
}

}  // namespace

ordered_json to_json(const Description& d) {
  ordered_json axes = ordered_json::array(), elements = ordered_json::array();
  for (const Joint& joint : d.axes) axes.push_back(axis_json(joint));
  for (const Description::Element& one : d.elements) elements.push_back(element_json(one));
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
  for (const RegionCoverage& one : d.part.regions)
    json["part"]["regions"].push_back({{"name", one.name},
                                       {"area_mm2", one.area},
                                       {"area_percent", 100.0 * one.share},
                                       {"decides_percent", 100.0 * one.decides}});
  json["program"] = {{"moves", d.program.moves},
                     {"samples", d.program.samples},
                     {"time_s", d.program.time_s},
                     {"not_reached", d.program.unreached_moves},
                     {"read_as", d.program.read_as}};
  for (const Description::Stretch& one : d.stretches)
    json["program"]["tools"].push_back({{"number", one.tool},
                                        {"name", one.name},
                                        {"first_line", one.first_line},
                                        {"last_line", one.last_line},
                                        {"moves", one.moves}});
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
  for (const Description::Element& one : d.elements) text += element_text(one);
  for (const Description::Element& one : d.elements)
    if (one.location) text += location_text(one.name, *one.location);
  return text;
}

}  // namespace abbe::sim
