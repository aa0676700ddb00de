#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

using Belief = CaseDescription::Belief;
using Channel = CaseDescription::Channel;
using compensation::PositionLoop;
using compensation::Strategy;

constexpr std::size_t max_thermal_belief_bytes = std::size_t(16) << 20;

constexpr std::array<std::pair<const char*, Belief>, 7> beliefs{{{"perfect", Belief::Perfect},
                                                                 {"identified", Belief::Identified},
                                                                 {"thermal", Belief::Thermal},
                                                                 {"composite", Belief::Composite},
                                                                 {"force", Belief::Force},
                                                                 {"part", Belief::Part},
                                                                 {"fused", Belief::Fused}}};
constexpr std::array<std::pair<const char*, Strategy>, 3> strategies{
    {{"position", Strategy::Position},
     {"decoupled", Strategy::Decoupled},
     {"iterated", Strategy::Iterated}}};
constexpr std::array<std::pair<const char*, Channel>, 7> channels{{{"ideal", Channel::Ideal},
                                                                   {"program", Channel::Program},
                                                                   {"pulses", Channel::Pulses},
                                                                   {"open", Channel::Open},
                                                                   {"origin", Channel::Origin},
                                                                   {"table", Channel::Table},
                                                                   {"piezo", Channel::Piezo}}};

/// The choice that a token names.
/// @throws std::invalid_argument with what it could be
template <typename T, std::size_t n>
T chosen(const std::array<std::pair<const char*, T>, n>& words, const std::string& token,
         const char* what) {
  std::string list;
  for (const auto& [word, value] : words) {
    if (token == word) return value;
    list += (list.empty() ? "" : ", ") + std::string(word);
  }
  throw std::invalid_argument(fmt::format("expected a {} ({}), seen \"{}\"", what, list, token));
}

std::vector<std::string> tokens_of(const std::string& name) {
  std::vector<std::string> tokens(1);
  for (const char c : name) {
    if (c == '-')
      tokens.emplace_back();
    else
      tokens.back() += c;
  }
  return tokens;
}

// --- [belief]

std::optional<compensation::ThermalBelief> read_thermal_belief(TableReader& belief) {
  const Node* node = belief.section("thermal");
  if (!node) return std::nullopt;
  TableReader reader(*node, "belief.thermal", belief.faults());
  const std::string file = reader.text("file");
  reader.close();
  if (file.empty()) return std::nullopt;
  try {
    return compensation::thermal_belief_of_text(read_text(file, max_thermal_belief_bytes), file);
  } catch (const BadInput& fault) {
    belief.faults().add(fault);
    return std::nullopt;
  }
}

/// The scene of a training part and what measures it.
void read_training(TableReader& parent, BeliefDescription::Force& force) {
  const Node* node = parent.section("training");
  if (!node) return parent.missing("training", "a table");
  TableReader reader(*node, "belief.force.training", parent.faults());
  force.training = reader.text("file");
  force.instrument = reader.text("instrument");
  reader.close();
}

std::optional<BeliefDescription::Force> read_force_belief(TableReader& belief,
                                                          const MachineDescription& machine) {
  using From = BeliefDescription::Force::From;
  const Node* node = belief.section("force");
  if (!node) return std::nullopt;
  TableReader reader(*node, "belief.force", belief.faults());
  BeliefDescription::Force force;
  force.from = reader.choice<From>(
      "from",
      {{"current", From::Current}, {"dynamometer", From::Dynamometer}, {"model", From::Model}});
  if (force.from != From::Model)
    force.smoothing_s = reader.number("smoothing_ms", non_negative, 0.0);
  force.passes = int(reader.integer("passes", 1, 20, force.passes));
  if (force.from == From::Current) {
    read_training(reader, force);
  } else if (const Node* compliance = reader.section("compliance")) {
    force.compliance = read_compliance(*compliance, machine, reader.faults());
  } else if (!reader.has("compliance")) {
    reader.missing("compliance", "a table or a file");
  }
  reader.close();
  return force;
}

std::optional<BeliefDescription::Part> read_part_belief(TableReader& belief) {
  const Node* node = belief.section("part");
  if (!node) return std::nullopt;
  TableReader reader(*node, "belief.part", belief.faults());
  BeliefDescription::Part part;
  part.instrument = reader.text("instrument");
  part.passes = int(reader.integer("passes", 1, 20, part.passes));
  reader.close();
  return part;
}

// --- [compensation]

PositionLoop read_loop(TableReader& parent, const std::string& where, PositionLoop loop) {
  const Node* node = parent.section("loop");
  if (!node) return loop;
  using Order = PositionLoop::Order;
  TableReader reader(*node, where + ".loop", parent.faults());
  loop.order = reader.choice<Order>(
      "order", {{"none", Order::None}, {"first", Order::First}, {"second", Order::Second}});
  loop.bandwidth = reader.number("bandwidth_Hz", positive, loop.bandwidth);
  loop.damping = reader.number("damping", {1e-3, 100.0}, loop.damping);
  reader.close();
  return loop;
}

constexpr Range cycle_ms{0.0, 1e6, true, false};
constexpr Range delay_ms{0.0, 1e6, false, false};

CompensationDescription::Pulses read_pulses(TableReader& parent) {
  CompensationDescription::Pulses pulses;
  const Node* node = parent.section("pulses");
  if (!node) return pulses;
  TableReader reader(*node, "compensation.pulses", parent.faults());
  pulses.count = reader.number("count_um", {1e-6, 1e6}, pulses.count);
  pulses.count_rad = reader.number("count_deg", {1e-9, 10.0}, pulses.count_rad);
  pulses.cycle_s = reader.number("cycle_ms", cycle_ms, pulses.cycle_s);
  pulses.pulse_s = reader.number("pulse_ms", cycle_ms, pulses.pulse_s);
  reader.close();
  return pulses;
}

compensation::OpenControl read_open(TableReader& parent) {
  compensation::OpenControl open;
  const Node* node = parent.section("open");
  if (!node) return open;
  TableReader reader(*node, "compensation.open", parent.faults());
  open.cycle_s = reader.number("cycle_ms", cycle_ms, open.cycle_s);
  open.delay_s = reader.number("delay_ms", delay_ms, open.delay_s);
  reader.close();
  return open;
}

compensation::OriginShift read_origin(TableReader& parent) {
  compensation::OriginShift origin;
  const Node* node = parent.section("origin");
  if (!node) return origin;
  TableReader reader(*node, "compensation.origin", parent.faults());
  origin.cycle_s = reader.number("cycle_ms", cycle_ms, origin.cycle_s);
  origin.delay_s = reader.number("delay_ms", delay_ms, origin.delay_s);
  origin.increment = reader.number("increment_um", non_negative, origin.increment);
  origin.rate = reader.number("rate_mm_per_min", non_negative, origin.rate);
  reader.close();
  return origin;
}

CompensationDescription::Table read_table(TableReader& parent,
                                          const std::vector<kinematics::Joint>& joints) {
  using compensation::ControlFormat;
  CompensationDescription::Table table;
  const Node* node = parent.section("table");
  if (!node) return table;
  TableReader reader(*node, "compensation.table", parent.faults());
  compensation::TableOptions& options = table.options;
  options.most_points = int(reader.integer("most_points", 2, 100000, options.most_points));
  options.spacing = reader.number("spacing_mm", {1e-3, 1e6}, options.spacing);
  options.spacing_rad = reader.number("spacing_deg", {1e-3, 360.0}, options.spacing_rad);
  options.cross = reader.boolean("cross", options.cross);
  options.both_ways = reader.boolean("both_ways", options.both_ways);
  options.constant = reader.boolean("constant", options.constant);
  if (reader.has("format"))
    table.format =
        reader.choice<ControlFormat>("format", {{"linuxcnc", ControlFormat::LinuxCnc},
                                                {"isg", ControlFormat::Isg},
                                                {"siemens", ControlFormat::Siemens},
                                                {"heidenhain", ControlFormat::Heidenhain}});
  if (const Node* words = reader.section("reference")) {
    TableReader axes(*words, "compensation.table.reference", parent.faults());
    table.reference = read_axis_words(axes, joints);
    axes.close();
  }
  reader.close();
  return table;
}

compensation::Piezo read_piezo(TableReader& parent) {
  compensation::Piezo piezo;
  const Node* node = parent.section("piezo");
  if (!node) return piezo;
  TableReader reader(*node, "compensation.piezo", parent.faults());
  piezo.direction_t = reader.direction("direction", piezo.direction_t);
  piezo.range = reader.number("range_um", positive, piezo.range);
  piezo.stiffness = reader.number("stiffness_N_per_um", positive, piezo.stiffness);
  piezo.resolution = reader.number("resolution_nm", non_negative, piezo.resolution);
  piezo.cycle_s = reader.number("cycle_ms", cycle_ms, piezo.cycle_s);
  piezo.loop = read_loop(reader, "compensation.piezo", piezo.loop);
  reader.close();
  return piezo;
}

/// How a plug-in's corrections are made and brought: "iterated-pulses".
void read_plug_in(TableReader& reader, CaseDescription& plug_in) {
  const std::string text = reader.text("plug_in", "iterated-ideal");
  const std::vector<std::string> tokens = tokens_of(text);
  try {
    if (tokens.size() != 2)
      throw std::invalid_argument(
          fmt::format("expected strategy-channel such as iterated-ideal, seen \"{}\"", text));
    plug_in.strategy = chosen(strategies, tokens[0], "strategy");
    plug_in.channel = chosen(channels, tokens[1], "channel");
    if (plug_in.channel == Channel::Table)
      throw std::invalid_argument(
          "expected another channel than table, which asks for one place "
          "at a time; a plug-in can be a table itself");
  } catch (const std::invalid_argument& fault) {
    reader.refuse("plug_in", "strategy and channel of plug-ins", fault.what());
  }
}

}  // namespace

BeliefDescription read_belief(const Node& table, const MachineDescription& machine,
                              Faults& faults) {
  TableReader reader(table, "belief", faults);
  BeliefDescription belief;
  if (const Node* node = reader.know("identified"))
    belief.identified = read_errors(*node, machine, 0, faults).geometric;
  belief.thermal = read_thermal_belief(reader);
  belief.force = read_force_belief(reader, machine);
  belief.part = read_part_belief(reader);
  belief.scale = reader.number("scale", {-1e6, 1e6}, belief.scale);
  reader.close();
  return belief;
}

void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription& given = scene.belief;
  for (const CaseDescription& one : cases) {
    if (!one.plug_in.empty()) continue;
    const auto wants = [&](Belief kind, bool is, const char* what) {
      const bool named =
          one.belief == kind || (one.belief == Belief::Composite &&
                                 (kind == Belief::Identified || kind == Belief::Thermal));
      if (named && !is) reader.refuse("compare", fmt::format("{} for {}", what, one.name), "none");
    };
    wants(Belief::Identified, given.identified.has_value(), "belief.identified");
    wants(Belief::Thermal, given.thermal.has_value(), "[belief.thermal]");
    wants(Belief::Force, given.force.has_value(), "[belief.force]");
    wants(Belief::Part, given.part.has_value(), "[belief.part]");
    wants(Belief::Fused, given.identified || given.thermal || given.force || given.part,
          "something in [belief]");
    const bool probes =
        given.part &&
        std::any_of(scene.part_instruments.begin(), scene.part_instruments.end(),
                    [&](const PartInstrumentDescription& instrument) {
                      return instrument.name == given.part->instrument &&
                             std::holds_alternative<errors::metrology::TouchProbe>(instrument.how);
                    });
    if (one.belief == Belief::Fused && probes && (given.identified || given.thermal))
      reader.refuse("compare",
                    "a part measured apart (cmm) for " + one.name +
                        ": a probe on the machine that nothing corrects would undo the rest",
                    "a touch probe");
    const bool feels = given.force && (one.belief == Belief::Force || one.belief == Belief::Fused);
    if (!feels) continue;
    const bool cuts = scene.cutting && scene.cutting->material;
    if (!cuts) reader.refuse("compare", "[cutting] with a material for " + one.name, "none");
    if (given.force->from == From::Current && !scene.signals.current)
      reader.refuse("compare", "[signals.current] for " + one.name, "none");
    if (given.force->from == From::Dynamometer && !scene.signals.dynamometer)
      reader.refuse("compare", "[signals.dynamometer] for " + one.name, "none");
  }
}

CompensationDescription read_compensation(const Node& table,
                                          const std::vector<kinematics::Joint>& joints,
                                          Faults& faults) {
  TableReader reader(table, "compensation", faults);
  CompensationDescription compensation;
  compensation.rotary_bound =
      reader.number("rotary_bound_deg", {0.0, 180.0, false, false}, compensation.rotary_bound);
  compensation.word_resolution =
      reader.number("word_resolution_mm", {1e-9, 1e6}, compensation.word_resolution);
  compensation.angle_resolution =
      reader.number("angle_resolution_deg", {1e-9, 360.0}, compensation.angle_resolution);
  compensation.path_tolerance = reader.number("path_tolerance_um", non_negative, 0.0);
  compensation.loop = read_loop(reader, "compensation", compensation.loop);
  compensation.pulses = read_pulses(reader);
  compensation.open = read_open(reader);
  compensation.origin = read_origin(reader);
  compensation.table = read_table(reader, joints);
  compensation.piezo = read_piezo(reader);
  read_plug_in(reader, compensation.plug_in);
  reader.close();
  return compensation;
}

CaseDescription plug_in_case(const std::filesystem::path& file) {
  CaseDescription description;
  description.name = file.filename().string();
  // with a slash it is a file wherever it is read again
  description.plug_in = std::filesystem::absolute(file).lexically_normal();
  if (description.name == "error_free" || description.name == "uncompensated")
    throw std::invalid_argument("expected another name for a plug-in than that of a case, seen \"" +
                                description.name + "\"");
  if (!names_a_folder(description.name))
    throw std::invalid_argument(fmt::format(
        "expected a plug-in whose file name is letters, digits, blanks, _ - ., seen \"{}\"",
        file.string()));
  return description;
}

CaseDescription parse_case(const std::string& name) {
  if (name.find_first_of("./") != std::string::npos) return plug_in_case(name);
  CaseDescription description;
  description.name = name;
  const std::vector<std::string> tokens = tokens_of(name);
  if (tokens.size() != 3)
    throw std::invalid_argument(
        fmt::format("expected belief-strategy-channel such as perfect-iterated-ideal, or a "
                    "plug-in's file such as ./mine.py, seen \"{}\"",
                    name));
  description.belief = chosen(beliefs, tokens[0], "belief");
  description.strategy = chosen(strategies, tokens[1], "strategy");
  description.channel = chosen(channels, tokens[2], "channel");
  return description;
}

}  // namespace abbe::sim
