#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "errors/bound_element.h"
#include "kinematics/hash.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

using Eigen::VectorXd;
using errors::ElementName;
using errors::Surroundings;
using kinematics::Joint;
using kinematics::Motion;

constexpr Range temperature{ThermalDescription::least_T_C, ThermalDescription::most_T_C};
constexpr Range power{0.0, 1e7};  // W
constexpr Range spindle_rpm{0.0, 1e6};
constexpr Range share_of_all{0.0, 1.0};
constexpr Range axis_speed{0.0, 1e6};    // mm or deg a minute
constexpr std::size_t most_nodes = 200;  // the modes of more take long
constexpr std::size_t most_phases = 10'000;
constexpr Eigen::Index most_curves = 50;
constexpr double longest_s = 1e10;  // three centuries

/// "thermal.node.column": a table of a list by its name, as --set finds it.
std::string where_of(const std::string& list, const Node& table) {
  const Node* name = table.find("name");
  return "thermal." + list + (name && name->text() ? "." + *name->text() : "");
}

/// A number whose key is a unit from end to end, as "um_per_K".
double number_of_unit(TableReader& reader, const std::string& key) {
  const auto written = reader.number_as_written(key, any_number);
  if (!written && !reader.has(key)) reader.missing(key, "a number");
  return written.value_or(0.0) * unit_of("in_" + key);  // a unit is found behind a stem only
}

/// Which of the keys is there; none if there is not exactly one, which is told.
std::optional<std::string> one_of(TableReader& reader, std::initializer_list<const char*> keys) {
  std::vector<std::string> there;
  std::string all;
  for (const char* key : keys) {
    if (reader.know(key)) there.push_back(key);
    all += (all.empty() ? "" : ", ") + std::string(key);
  }
  if (there.size() == 1) return there.front();
  if (there.empty()) reader.missing(*keys.begin(), "one of " + all);
  for (std::size_t i = 1; i < there.size(); ++i)
    reader.refuse(there[i], "only one of " + all, there[0] + " and " + there[i]);
  return std::nullopt;
}

/// FNV-1a of the scene's seed and a name: every sensor has a noise of its own.
std::uint64_t seed_of(std::uint64_t seed, const std::string& name) {
  return fnv_1a(name, fnv_1a_basis ^ seed);
}

class ThermalReader {
 public:
  ThermalReader(const Node& table, const MachineDescription& machine, std::uint64_t seed,
                Faults& faults);

  ThermalDescription read();

 private:
  /// One end of a link.
  using End = std::variant<int, Surroundings>;

  bool read_nodes();
  void read_node(const Node& table);
  int node(TableReader& reader, const std::string& key);
  void refuse_node(const Place& place, const std::string& what, const std::string& name);
  void read_links();
  std::optional<std::array<End, 2>> read_ends(TableReader& reader);
  std::optional<End> read_end(const Node& word);
  void read_sources();
  std::optional<errors::AxisHeat> read_axis_heat(TableReader& reader);
  void read_elements();
  std::optional<errors::ThermalElement> read_element(const Node& table);
  errors::ThermalFunction read_function(TableReader& element, const std::string& key,
                                        const std::string& unit);
  errors::ThermalFunction::Term read_term(TableReader& reader, const std::string& unit);
  errors::Table read_table(TableReader& reader, const std::string& value_key);
  bool is_slide(const ElementName& name) const;
  void read_axes();
  std::optional<errors::Expansion> read_expansion(TableReader& axis, char name,
                                                  const std::string& key);
  void read_workpiece();
  void bind_alone(const errors::ThermalErrors& errors, const Place& place);
  void read_sensors();
  void read_history();
  kinematics::AxisVector read_axis_speeds(TableReader& phase);
  void read_room();
  void read_plots();
  std::optional<std::array<double, 2>> read_range(TableReader& plot, char axis);
  void check_network();

  TableReader reader_;
  const MachineDescription& machine_;
  std::uint64_t seed_;
  Faults& faults_;
  std::optional<kinematics::Chain> chain_;  ///< none if the machine has faults
  std::vector<Place> node_places_;
  std::set<std::string> names_;
  ThermalDescription thermal_;
};

ThermalReader::ThermalReader(const Node& table, const MachineDescription& machine,
                             std::uint64_t seed, Faults& faults)
    : reader_(table, "thermal", faults), machine_(machine), seed_(seed), faults_(faults) {
  try {
    if (!machine.joints.empty()) chain_.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    // reported with the machine
  }
}

// ---- network

/// False if there are more than can be.
bool ThermalReader::read_nodes() {
  const auto tables = reader_.tables("node");
  if (!reader_.has("node")) reader_.missing("node", "a list of tables");
  if (tables.size() > most_nodes) {
    reader_.refuse("node", fmt::format("at most {} nodes", most_nodes),
                   fmt::format("{}", tables.size()));
    return false;
  }
  thermal_.network.start_T_C.setConstant(
      Eigen::Index(tables.size()), reader_.number("start_C", temperature, thermal_.room_T_C[0]));
  for (const Node* table : tables) read_node(*table);
  return true;
}

void ThermalReader::read_node(const Node& table) {
  TableReader reader(table, where_of("node", table), faults_);
  auto& [nodes, links, surroundings, sources, start_T_C] = thermal_.network;
  const std::string name = reader.text("name");
  if (name == "room" || name == "coolant")
    reader.refuse("name", "a node not named room or coolant, which links know already", name);
  if (!name.empty() && !names_.insert(name).second)
    reader.refuse("name", "every node once", name + " again");
  const Eigen::Index i = Eigen::Index(nodes.size());
  nodes.push_back({name, reader.number("capacity_J_per_K", positive)});
  start_T_C[i] = reader.number("start_C", temperature, start_T_C[i]);
  node_places_.push_back(reader.place());
  reader.close();
}

void ThermalReader::refuse_node(const Place& place, const std::string& what,
                                const std::string& name) {
  const auto meant = nearest(name, names_);
  faults_.add(place, what, "\"" + name + "\"" + (meant ? " (nearest: \"" + *meant + "\")" : ""));
}

int ThermalReader::node(TableReader& reader, const std::string& key) {
  const std::string name = reader.text(key);
  const auto& nodes = thermal_.network.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (!name.empty() && nodes[i].name == name) return int(i);
  if (!name.empty())
    refuse_node(reader.know(key)->place, "a node of the thermal network for " + key, name);
  return 0;
}

std::optional<ThermalReader::End> ThermalReader::read_end(const Node& word) {
  const std::string& name = *word.text();
  if (name == "room") return End(Surroundings::Room);
  if (name == "coolant") return End(Surroundings::Coolant);
  const auto& nodes = thermal_.network.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (nodes[i].name == name) return End(int(i));
  refuse_node(word.place, "a node of the thermal network, \"room\" or \"coolant\"", name);
  return std::nullopt;
}

std::optional<std::array<ThermalReader::End, 2>> ThermalReader::read_ends(TableReader& reader) {
  const Node* between = reader.know("between");
  if (!between) {
    reader.missing("between", "two names");
    return std::nullopt;
  }
  const Node::Array* words = between->array();
  if (!words || words->size() != 2 || !(*words)[0].text() || !(*words)[1].text()) {
    reader.refuse("between", "two names for thermal.link.between", shown(*between));
    return std::nullopt;
  }
  const auto a = read_end((*words)[0]);
  const auto b = read_end((*words)[1]);
  if (!a || !b) return std::nullopt;
  if (*a == *b || (a->index() == 1 && b->index() == 1)) {
    reader.refuse("between", "two different nodes, or a node and its surroundings",
                  *(*words)[0].text() + " and " + *(*words)[1].text());
    return std::nullopt;
  }
  return std::array{*a, *b};
}

void ThermalReader::read_links() {
  for (const Node* table : reader_.tables("link")) {
    TableReader reader(*table, "thermal.link", faults_);
    auto ends = read_ends(reader);
    const double conductance = reader.number("conductance_W_per_K", positive);
    reader.close();
    if (!ends) continue;
    auto [a, b] = *ends;
    if (a.index() == 1) std::swap(a, b);
    if (const auto* outside = std::get_if<Surroundings>(&b)) {
      thermal_.network.surroundings.push_back({std::get<int>(a), *outside, conductance});
    } else {
      thermal_.network.links.push_back({std::get<int>(a), std::get<int>(b), conductance});
    }
  }
}

std::optional<errors::AxisHeat> ThermalReader::read_axis_heat(TableReader& reader) {
  const std::string name = reader.text("axis");
  const auto& joints = machine_.joints;
  const auto found = std::find_if(joints.begin(), joints.end(), [&](const Joint& joint) {
    return name == std::string(1, joint.name) && joint.motion != Motion::Spindle;
  });
  const bool slide = found == joints.end() || found->motion == Motion::Linear;
  const std::string coulomb = slide ? "coulomb_N" : "coulomb_Nm";
  const std::string viscous = slide ? "viscous_N_s_per_mm" : "viscous_Nm_s";
  errors::AxisHeat heat;
  heat.coulomb = reader.number(coulomb, non_negative, 0.0);
  heat.viscous = reader.number(viscous, non_negative, 0.0);
  if (!reader.has(coulomb) && !reader.has(viscous))
    reader.missing(coulomb, "a number, or " + viscous + ",");
  if (found == joints.end()) {
    if (!name.empty() && chain_) reader.refuse("axis", "an axis of the machine", name);
    return std::nullopt;
  }
  if (name == "S") {
    reader.refuse("axis", "an axis; a spindle heats by kind = \"spindle\"", name);
    return std::nullopt;
  }
  heat.joint = int(found - joints.begin());
  return heat;
}

void ThermalReader::read_sources() {
  enum class Kind { Spindle, Axis, PowerOn, Cutting };
  for (const Node* table : reader_.tables("source")) {
    TableReader reader(*table, "thermal.source", faults_);
    errors::HeatSource source;
    source.node = node(reader, "node");
    const std::size_t before = faults_.list().size();
    const Kind kind = reader.choice<Kind>("kind",
                                          {{"spindle", Kind::Spindle},
                                           {"axis", Kind::Axis},
                                           {"power_on", Kind::PowerOn},
                                           {"cutting", Kind::Cutting}},
                                          Kind::Spindle);
    if (!reader.has("kind"))
      faults_.add(reader.place(), "a kind of heat for thermal.source.kind", "nothing");
    if (faults_.list().size() != before) continue;  // its other keys depend on it
    if (kind == Kind::Spindle) {
      source.law =
          errors::SpindleHeat{reader.number("power_W", power), reader.number("at_rpm", positive),
                              reader.number("exponent", non_negative, 1.0)};
    } else if (kind == Kind::Axis) {
      const auto heat = read_axis_heat(reader);
      if (heat) source.law = *heat;
    } else if (kind == Kind::PowerOn) {
      source.law = errors::PowerOnHeat{reader.number("power_W", power)};
    } else {
      source.law = errors::CuttingHeat{reader.number("share", share_of_all)};
    }
    reader.close();
    thermal_.network.sources.push_back(source);
  }
}

// ---- elements

bool ThermalReader::is_slide(const ElementName& name) const {
  if (name.location || name.axis == 'S') return false;
  for (const Joint& joint : machine_.joints)
    if (joint.name == name.axis) return joint.motion == Motion::Linear;
  return true;  // no such axis, which is refused when bound
}

errors::Table ThermalReader::read_table(TableReader& reader, const std::string& value_key) {
  const auto between = read_between(reader);
  const auto outside = read_outside(reader);
  const std::size_t before = faults_.list().size();
  VectorXd dT_K = reader.numbers("dT_K");
  VectorXd value = reader.numbers(value_key);
  if (faults_.list().size() != before || !reader.has("dT_K") || !reader.has(value_key)) return {};
  if (dT_K.size() != value.size()) {
    reader.refuse(value_key, fmt::format("as many values as temperatures, {}", dT_K.size()),
                  fmt::format("{}", value.size()));
    return {};
  }
  try {
    return errors::make_table(std::move(dT_K), std::move(value), between, outside);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("dT_K", "a table with rising temperatures and at least 2 rows", fault.what());
    return {};
  }
}

errors::ThermalFunction::Term ThermalReader::read_term(TableReader& reader,
                                                       const std::string& unit) {
  const std::string per_K = unit + (unit.ends_with("_per_m") ? "_K" : "_per_K");
  errors::ThermalFunction::Term term;
  term.node = node(reader, "node");
  if (reader.know("minus")) term.minus = node(reader, "minus");
  if (reader.has("dT_K") || reader.has("value_" + unit)) {
    term.table = read_table(reader, "value_" + unit);
    if (reader.know(per_K)) reader.refuse(per_K, "either a table of dT_K or " + per_K, "both");
  } else {
    reader.know("dT_K");
    reader.know("value_" + unit);
    term.per_K = number_of_unit(reader, per_K);
  }
  reader.close();
  return term;
}

errors::ThermalFunction ThermalReader::read_function(TableReader& element, const std::string& key,
                                                     const std::string& unit) {
  errors::ThermalFunction function;
  function.constant = element.number(key + "_" + unit, any_number, 0.0);
  for (const Node* table : element.tables(key)) {
    TableReader term(*table, where_of("element", element.node()) + "." + key, faults_);
    function.terms.push_back(read_term(term, unit));
  }
  return function;
}

std::optional<errors::ThermalElement> ThermalReader::read_element(const Node& table) {
  TableReader reader(table, where_of("element", table), faults_);
  const std::size_t before = faults_.list().size();
  errors::ThermalElement element;
  const std::string name = reader.text("name", "");
  try {
    element.name = errors::parse_element_name(name);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("name", "the name of an element for thermal.element.name", fault.what());
    return std::nullopt;  // its other keys depend on it
  }
  const std::string unit = element.name.is_angle() ? "urad" : "um";
  const std::string wrong = element.name.is_angle() ? "um" : "urad";
  for (const std::string& key : {"offset_" + wrong, "slope_" + wrong + "_per_m"})
    if (reader.has(key)) reader.refuse(key, "values of " + name + " in " + unit, key);
  element.offset = read_function(reader, "offset", unit);
  if (is_slide(element.name)) {
    element.slope = read_function(reader, "slope", unit + "_per_m");
    element.fixed = reader.number("fixed_mm", any_number, 0.0);
  } else {
    for (const std::string& key : {std::string("slope"), "slope_" + unit + "_per_m",
                                   std::string("fixed_mm"), std::string("fixed_deg")})
      if (reader.has(key)) reader.refuse(key, "no slope: only a slide's error motion has one", key);
  }
  reader.close();
  if (faults_.list().size() != before) return std::nullopt;
  return element;
}

// Each is bound alone, so that a refusal is reported where it stands.
void ThermalReader::bind_alone(const errors::ThermalErrors& alone, const Place& place) {
  if (!chain_ || thermal_.network.nodes.empty()) return;
  try {
    errors::bind(alone, *chain_, int(thermal_.network.nodes.size()));
  } catch (const std::invalid_argument& fault) {
    faults_.add(place, "thermal errors that fit the machine", fault.what());
  }
}

void ThermalReader::read_elements() {
  for (const Node* table : reader_.tables("element")) {
    const auto element = read_element(*table);
    if (!element) continue;
    auto& elements = thermal_.errors.elements;
    const bool twice = std::any_of(elements.begin(), elements.end(),
                                   [&](const auto& other) { return other.name == element->name; });
    const Place& place = table->find("name")->place;
    if (twice) {
      faults_.add(place, "each element once (its terms are one list)",
                  to_string(element->name) + " again");
      continue;
    }
    bind_alone({{*element}, {}, std::nullopt, 20.0}, place);
    elements.push_back(*element);
  }
}

std::optional<errors::Expansion> ThermalReader::read_expansion(TableReader& axis, char name,
                                                               const std::string& key) {
  const Node* table = axis.section(key);
  if (!table) return std::nullopt;
  TableReader reader(*table, fmt::format("thermal.axis.{}.{}", name, key), faults_);
  errors::Expansion expansion;
  expansion.node = node(reader, "node");
  expansion.per_K = number_of_unit(reader, "um_per_m_K");
  expansion.fixed = reader.number("fixed_mm", any_number, 0.0);
  reader.close();
  return expansion;
}

void ThermalReader::read_axes() {
  const Node* section = reader_.section("axis");
  if (!section) return;
  TableReader axes(*section, "thermal.axis", faults_);
  for (const Joint& joint : machine_.joints) {
    if (joint.motion != Motion::Linear) continue;
    const std::string name(1, joint.name);
    const Node* table = axes.section(name);
    if (!table) continue;
    TableReader reader(*table, "thermal.axis." + name, faults_);
    const std::size_t before = faults_.list().size();
    errors::AxisExpansion axis;
    axis.axis = joint.name;
    axis.feedback = reader.choice<errors::Feedback>(
        "feedback", {{"motor", errors::Feedback::Motor}, {"scale", errors::Feedback::Scale}});
    axis.screw = read_expansion(reader, joint.name, "screw");
    axis.scale = read_expansion(reader, joint.name, "scale");
    reader.close();
    if (faults_.list().size() == before) bind_alone({{}, {axis}, std::nullopt, 20.0}, table->place);
    thermal_.errors.expansions.push_back(axis);
  }
  if (!machine_.joints.empty()) axes.close();
}

void ThermalReader::read_workpiece() {
  const Node* table = reader_.section("workpiece");
  if (!table) return;
  TableReader reader(*table, "thermal.workpiece", faults_);
  const std::size_t before = faults_.list().size();
  errors::WorkpieceExpansion workpiece;
  workpiece.node = node(reader, "node");
  workpiece.per_K = number_of_unit(reader, "um_per_m_K");
  workpiece.fixed_w = reader.vector("fixed_mm", Eigen::Vector3d::Zero());
  reader.close();
  if (faults_.list().size() == before) bind_alone({{}, {}, workpiece, 20.0}, table->place);
  thermal_.errors.workpiece = workpiece;
}

// ---- sensors, history, room

void ThermalReader::read_sensors() {
  std::set<std::string> names;
  for (const Node* table : reader_.tables("sensor")) {
    TableReader reader(*table, where_of("sensor", *table), faults_);
    errors::TemperatureSensor sensor;
    sensor.name = reader.text("name");
    if (!sensor.name.empty() && !names.insert(sensor.name).second)
      reader.refuse("name", "every sensor once", sensor.name + " again");
    sensor.node = node(reader, "node");
    sensor.offset_K = reader.number("offset_K", any_number, 0.0);
    sensor.noise_K = reader.number("noise_K", non_negative, 0.0);
    sensor.resolution_K = reader.number("resolution_K", non_negative, 0.0);
    sensor.lag_s = reader.number("lag_s", non_negative, 0.0);
    sensor.sampling_s = reader.number("sampling_s", {1e-4, longest_s}, 1.0);
    const auto seed = reader.maybe_integer("seed", 0, std::numeric_limits<std::int64_t>::max());
    sensor.seed = seed ? std::uint64_t(*seed) : seed_of(seed_, sensor.name);
    reader.close();
    thermal_.sensors.push_back(sensor);
  }
}

kinematics::AxisVector ThermalReader::read_axis_speeds(TableReader& phase) {
  kinematics::AxisVector speeds;
  if (chain_) speeds.setZero(chain_->size());
  for (const auto& [key, motion] : {std::pair("axis_speed_mm_per_min", Motion::Linear),
                                    std::pair("axis_speed_deg_per_min", Motion::Rotary)}) {
    const Node* section = phase.section(key);
    if (!section || !chain_) continue;
    TableReader reader(*section, std::string("thermal.history.") + key, faults_);
    for (int j = 0; j < chain_->size(); ++j) {
      const Joint& joint = chain_->joints()[std::size_t(j)];
      if (joint.motion != motion) continue;
      const auto written = reader.number_as_written(std::string(1, joint.name), axis_speed);
      if (written) speeds[j] = *written * unit_of(key);
    }
    reader.close();
  }
  return speeds;
}

void ThermalReader::read_history() {
  const auto phases = reader_.tables("history");
  if (phases.size() > most_phases) {
    reader_.refuse("history", fmt::format("at most {} phases", most_phases),
                   fmt::format("{}", phases.size()));
    return;
  }
  for (const Node* table : phases) {
    TableReader reader(*table, where_of("history", *table), faults_);
    reader.text("name", "");
    ThermalPhase phase;
    if (const auto key = one_of(reader, {"duration_h", "duration_min", "duration_s"})) {
      const Range range{0.0, longest_s / unit_of(*key), true, false};
      phase.duration = reader.number(*key, range);
    }
    phase.spindle_speed = reader.number("speed_rpm", spindle_rpm, 0.0);
    phase.axis_speed = read_axis_speeds(reader);
    phase.powered = reader.boolean("powered", true);
    phase.coolant = reader.boolean("coolant", false);
    reader.close();
    thermal_.history.push_back(phase);
  }
}

void ThermalReader::read_room() {
  thermal_.room_time_s = VectorXd::Zero(1);
  thermal_.room_T_C = VectorXd::Constant(1, reader_.number("room_C", temperature, 20.0));
  const Node* section = reader_.section("room");
  if (!section) return;
  if (reader_.has("room_C")) reader_.refuse("room", "either room_C or a table room", "both");
  TableReader reader(*section, "thermal.room", faults_);
  const std::size_t before = faults_.list().size();
  const auto key = one_of(reader, {"time_h", "time_min", "time_s"});
  const VectorXd T_C = reader.numbers("T_C");
  const VectorXd time_s = key ? reader.numbers(*key) : VectorXd();
  reader.close();
  if (faults_.list().size() != before) return;
  if (T_C.size() != time_s.size())
    reader.refuse("T_C", fmt::format("as many temperatures as times, {}", time_s.size()),
                  fmt::format("{}", T_C.size()));
  for (Eigen::Index i = 1; i < time_s.size(); ++i)
    if (!(time_s[i] > time_s[i - 1]))
      reader.refuse(*key, "rising times for thermal.room." + *key,
                    fmt::format("{} s after {} s", time_s[i], time_s[i - 1]));
  if (T_C.size() > Eigen::Index(most_phases))
    reader.refuse("T_C", fmt::format("at most {} rows", most_phases),
                  fmt::format("{}", T_C.size()));
  if (T_C.minCoeff() < temperature.min || T_C.maxCoeff() > temperature.max)
    reader.refuse("T_C", fmt::format("temperatures of {} .. {}", temperature.min, temperature.max),
                  fmt::format("{} .. {}", T_C.minCoeff(), T_C.maxCoeff()));
  thermal_.room_time_s = time_s;
  thermal_.room_T_C = T_C;
}

/// The stretch of the axis that a plot is drawn over; none: its travel.
std::optional<std::array<double, 2>> ThermalReader::read_range(TableReader& plot, char axis) {
  const auto& joints = machine_.joints;
  const auto joint = std::find_if(joints.begin(), joints.end(),
                                  [&](const Joint& candidate) { return candidate.name == axis; });
  if (joint == joints.end()) {  // which is reported
    plot.know("range_mm");
    plot.know("range_deg");
    return std::nullopt;
  }
  const std::string key = joint->motion == Motion::Linear ? "range_mm" : "range_deg";
  const auto range = plot.maybe_numbers(key, 2);
  if (!range) return std::nullopt;
  const double from = (*range)[0], to = (*range)[1], unit = unit_of(key);
  if (!(from < to && from >= joint->min && to <= joint->max)) {
    plot.refuse(key,
                fmt::format("a rising range within the travel, {} .. {}, for thermal.plot.{}",
                            joint->min / unit, joint->max / unit, key),
                fmt::format("{} .. {}", from / unit, to / unit));
    return std::nullopt;
  }
  return std::array{from, to};
}

void ThermalReader::read_plots() {
  for (const Node* table : reader_.tables("plot")) {
    TableReader reader(*table, "thermal.plot", faults_);
    const std::size_t before = faults_.list().size();
    ThermalDescription::Plot plot;
    const std::string name = reader.text("element");
    try {
      if (!name.empty()) plot.element = errors::parse_element_name(name);
    } catch (const std::invalid_argument& fault) {
      reader.refuse("element", "the name of an element for thermal.plot.element", fault.what());
    }
    if (plot.element.location || plot.element.axis == 'S')
      reader.refuse("element", "an error motion of an axis, which has a curve", name);
    const auto key = one_of(reader, {"at_h", "at_min", "at_s"});
    if (key) plot.time_s = reader.numbers(*key);
    if (plot.time_s.size() > most_curves)
      reader.refuse(*key, fmt::format("at most {} curves", most_curves),
                    fmt::format("{}", plot.time_s.size()));
    for (const ThermalDescription::Plot& other : thermal_.plots)
      if (other.element == plot.element)
        reader.refuse("element", "one plot an element", name + " again");
    plot.range = read_range(reader, plot.element.axis);
    reader.close();
    if (faults_.list().size() != before) continue;
    const Place& place = table->find("element")->place;
    bind_alone({{{plot.element, {}, {}, 0.0}}, {}, std::nullopt, 20.0}, place);
    thermal_.plots.push_back(plot);
  }
}

void ThermalReader::check_network() {
  const errors::ThermalNetwork& network = thermal_.network;
  if (const auto node = errors::cut_off_node(network)) {
    faults_.add(node_places_[std::size_t(*node)],
                "links over which heat reaches the room from thermal.node." +
                    network.nodes[std::size_t(*node)].name,
                "none");
    return;
  }
  errors::Activity rest;
  try {
    errors::simulate(network, {&rest, 1});
  } catch (const std::invalid_argument& fault) {
    faults_.add(reader_.place(), "a thermal network that can be", fault.what());
  }
}

ThermalDescription ThermalReader::read() {
  const std::size_t before = faults_.list().size();
  reader_.text("name", "");
  read_room();
  if (!read_nodes()) return std::move(thermal_);
  read_links();
  const bool whole = faults_.list().size() == before && reader_.has("node");
  read_sources();
  read_elements();
  read_axes();
  read_workpiece();
  read_sensors();
  read_history();
  read_plots();
  thermal_.scale = reader_.number("scale", {-1e6, 1e6}, 1.0);
  thermal_.errors.reference_T_C = reader_.number("reference_C", temperature, 20.0);
  thermal_.powered = reader_.boolean("powered", true);
  thermal_.coolant = reader_.boolean("coolant", false);
  thermal_.coolant_T_C = reader_.number("coolant_C", temperature, 20.0);
  thermal_.interval = reader_.number("interval_s", {1e-3, longest_s}, 1.0);
  reader_.close();
  if (whole) check_network();
  return std::move(thermal_);
}

}  // namespace

ThermalDescription read_thermal(const Node& table, const MachineDescription& machine,
                                std::uint64_t seed, Faults& faults) {
  return ThermalReader(table, machine, seed, faults).read();
}

}  // namespace abbe::sim
