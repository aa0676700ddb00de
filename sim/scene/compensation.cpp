#include "sim/scene/compensation.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/scene/cases.h"
#include "sim/scene/compliance.h"
#include "sim/scene/errors.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using Force = BeliefDescription::Force;
using From = Force::From;

// A thermal belief is a small text; the limit keeps a wrong file from filling the memory.
constexpr std::size_t max_thermal_belief_bytes = std::size_t(16) << 20;

void read_thermal_belief(TableReader& reader, BeliefDescription& belief) {
  const Node* node = reader.section("thermal");
  if (!node) return;
  TableReader thermal(*node, reader.qualified_name("thermal"), reader.input_errors());
  const std::string file = thermal.text("file");
  thermal.close();
  // text() has already reported the missing file.
  if (file.empty()) return;
  belief.thermal_file = file;
  try {
    belief.thermal =
        compensation::parse_thermal_belief(read_text(file, max_thermal_belief_bytes), file);
  } catch (const BadInput& error) {
    reader.input_errors().add(error);
  }
}

void put_thermal_belief(const BeliefDescription& belief, Node::Table& table) {
  // The coefficients stay in their file, so the written scene refers to it by name.
  if (!belief.thermal) return;
  Node::Table thermal;
  put_value(thermal, "file", belief.thermal_file.string());
  put_value(table, "thermal", std::move(thermal));
}

Key thermal_key() {
  Key thermal =
      make_key("thermal", Key::Kind::Table, "what heat adds, by the temperatures that are read");
  thermal.keys = {
      make_key(required_key("file"), Key::Kind::Text,
               "what `abbe identify --method thermal` wrote, or `--method composite` as "
               "`NAME_thermal.txt`; its sensors must be those of the scene")};
  return thermal;
}

/// Returns the fields of the scene whose part trains the law, and of the instrument that measures
/// that part.
Fields<Force> training_fields() {
  return Fields<Force>()
      .text(required_key("file"), &Force::training, "scene of that part")
      .text(required_key("instrument"), &Force::instrument, "of that scene, which measures it");
}

/// Returns the fields of a force that comes from one source.
Fields<Force> force_source_fields(From from, const MachineDescription& machine) {
  Fields<Force> fields;
  // A modelled force carries no measurement noise, so it needs no smoothing.
  if (from != From::Model)
    fields.number("smoothing_ms", &Force::smoothing_s, non_negative,
                  "of what is read: the mean of the time just passed; 0: none");
  fields.whole("passes", &Force::passes, 1, 20,
               "runs from which is learnt, each corrected by what the last taught");
  // The current yields a fitted deflection directly, so no compliance is needed with it.
  if (from == From::Current)
    return fields.table(required_key("training"), whole_struct, training_fields(),
                        "the part from which a law is fitted, d = c1 x + c2 x², x the current "
                        "above that in air; the tool gives way by d along its own z");
  Key compliance = make_key(required_key("compliance"), Key::Kind::Table,
                            "as `[compliance]`, as it is believed", compliance_keys());
  compliance.or_file = true;
  return fields.custom_field(
      {compliance},
      [machine](TableReader& reader, Force& force) {
        if (const Node* node = reader.section("compliance"))
          force.compliance = read_compliance(*node, machine, reader.input_errors());
        // If the key has a value of the wrong type, section() has reported that already.
        else if (!reader.has("compliance"))
          reader.report_missing("compliance", "a table or a file");
      },
      [machine](const Force& force, Node::Table& table) {
        put_value(table, "compliance", compliance_to_table(force.compliance, machine));
      });
}

Fields<Force> force_fields(const MachineDescription& machine) {
  Key source_key = make_key(required_key("from"), Key::Kind::Text, "what the force is known by");
  const std::array sources{From::Current, From::Dynamometer, From::Model};
  source_key.choices = {
      {"current", "read, `[signals]` must have it", {}},
      {"dynamometer", "read, `[signals]` must have it", {}},
      {"model",
       "computed, the scene's blank and material on a machine that is right but as soft "
       "as `compliance` says",
       {}}};
  for (std::size_t i = 0; i < sources.size(); ++i)
    source_key.choices[i].keys = force_source_fields(sources[i], machine).keys();
  return Fields<Force>().custom_field(
      {source_key},
      [source_key, sources, machine](TableReader& reader, Force& force) {
        const auto source_name = reader.word("from", choice_names(source_key), true);
        // An unknown source is already reported. Reading continues with the first source, so that
        // its keys cause no further errors.
        force.from = sources.front();
        for (std::size_t i = 0; i < sources.size(); ++i)
          if (source_name == source_key.choices[i].word) force.from = sources[i];
        force = force_source_fields(force.from, machine).read(reader, force);
      },
      [source_key, sources, machine](const Force& force, Node::Table& table) {
        for (std::size_t i = 0; i < sources.size(); ++i)
          if (force.from == sources[i]) put_value(table, "from", source_key.choices[i].word);
        append_entries(table, force_source_fields(force.from, machine).to_table(force));
      });
}

Fields<BeliefDescription::Part> measured_part_fields() {
  using Part = BeliefDescription::Part;
  return Fields<Part>()
      .text(required_key("instrument"), &Part::instrument,
            "name of a `cmm` or `touch_probe` of the scene, whose `case` is not looked at")
      .whole("passes", &Part::passes, 1, 20, "parts cut and measured before the one that counts");
}

Fields<BeliefDescription> belief_fields(const MachineDescription& machine) {
  using Description = BeliefDescription;
  Key identified =
      make_key("identified", Key::Kind::Tables,
               "geometric errors as `errors`; mostly what `abbe identify` wrote", errors_keys());
  identified.or_file = true;
  return Fields<Description>()
      .custom_field(
          {identified},
          [machine](TableReader& reader, Description& belief) {
            if (const Node* node = reader.accept_key("identified"))
              belief.identified = join_errors_tables(
                  {read_errors(*node, machine, 0, reader.input_errors())}, machine);
          },
          [machine](const Description& belief, Node::Table& table) {
            if (belief.identified)
              put_value(table, "identified", errors_to_table({*belief.identified, 1.0}, machine));
          })
      .custom_field({thermal_key()}, read_thermal_belief, put_thermal_belief)
      .table("force", &Description::force, force_fields(machine), "how far the cut bends")
      .table("part", &Description::part, measured_part_fields(),
             "what was measured of a part that was cut before; beside other beliefs (`fused`) they "
             "act while the first part is cut, and it wants a `cmm`: a probe on a machine that "
             "nothing corrects would undo them")
      .number("scale", &Description::scale, {-1e6, 1e6},
              "factor of what `identified` and `thermal` say; 0 believes in nothing");
}

}  // namespace

BeliefDescription read_belief(const Node& table, const MachineDescription& machine,
                              InputErrors& input_errors) {
  return belief_fields(machine).read_table(table, "belief", input_errors);
}
Node::Table belief_to_table(const BeliefDescription& belief, const MachineDescription& machine) {
  return belief_fields(machine).to_table(belief);
}
std::vector<Key> belief_keys() { return belief_fields({}).keys(); }

namespace {

using compensation::OpenControl;
using compensation::OriginShift;
using compensation::Piezo;
using compensation::PositionLoop;
using Description = CompensationDescription;

constexpr Range cycle_ms{0.0, 1e6, true, false};
constexpr Range delay_ms{0.0, 1e6, false, false};

/// @param defaults  values of the keys that are left out
Fields<PositionLoop> loop_fields(const PositionLoop& defaults) {
  using Order = PositionLoop::Order;
  return Fields<PositionLoop>(defaults)
      .word(required_key("order"), &PositionLoop::order,
            {{"none", Order::None, "at once"},
             {"first", Order::First, "1 / (1 + s / w)"},
             {"second", Order::Second, "w² / (s² + 2 d w s + w²)"}},
            "how the position loop follows a correction")
      .number("bandwidth_Hz", &PositionLoop::bandwidth, positive, "w / 2π")
      .number("damping", &PositionLoop::damping, {1e-3, 100.0}, "d of the second order");
}

Fields<Description::PulseInsertion> pulses_fields() {
  using PulseInsertion = Description::PulseInsertion;
  return Fields<PulseInsertion>()
      .number(
          "count_um", &PulseInsertion::count, {1e-6, 1e6},
          "one signal period of a slide; where the zeros lie in a count the scene's `seed` says")
      .number("count_deg", &PulseInsertion::count_rad, {1e-9, 10.0},
              "the same of an axis that turns")
      .number("cycle_ms", &PulseInsertion::cycle_s, cycle_ms, "at which a pair may go in")
      .number("pulse_ms", &PulseInsertion::pulse_s, cycle_ms,
              "that a pair takes, while both signals are low")
      // The signals must return to high before the next pair of pulses begins.
      .check([](TableReader& reader, PulseInsertion& pulses) {
        if (pulses.pulse_s > pulses.cycle_s)
          reader.report_invalid("pulse_ms", "a compensation.pulses.pulse_ms of at most cycle_ms",
                                fmt::format("{:g} in a cycle of {:g} ms", pulses.pulse_s * 1e3,
                                            pulses.cycle_s * 1e3));
      });
}

Fields<OpenControl> open_fields() {
  return Fields<OpenControl>()
      .number("cycle_ms", &OpenControl::cycle_s, cycle_ms, "of the servo")
      .number("delay_ms", &OpenControl::delay_s, delay_ms, "from reading to acting");
}

Fields<OriginShift> origin_fields() {
  return Fields<OriginShift>()
      .number("cycle_ms", &OriginShift::cycle_s, cycle_ms, "of the PLC")
      .number("delay_ms", &OriginShift::delay_s, delay_ms, "from reading to acting")
      .number("increment_um", &OriginShift::increment, non_negative,
              "shifts are whole multiples of it; 0: not rounded")
      .number("rate_mm_per_min", &OriginShift::rate, non_negative,
              "at which the control ramps to a new shift; 0: at once");
}

Fields<Description::Table> table_fields(const std::vector<kinematics::Joint>& joints) {
  using compensation::ControlFormat;
  using Table = Description::Table;
  // Accessor of a member of `Table::options`, for fields of the table.
  const auto option = [](auto member) {
    return [member](auto& table) -> auto& { return table.options.*member; };
  };
  using Options = compensation::TableOptions;
  return Fields<Table>()
      .whole("most_points", option(&Options::max_points), 2, 100000, "of one table")
      .number("spacing_mm", option(&Options::spacing), {1e-3, 1e6},
              "between points of a slide over its travel, wider where `most_points` asks for it")
      .number(KeyName("spacing_deg").with_fallback("5.002: 0.0873 rad"),
              option(&Options::spacing_rad), {1e-3, 360.0},
              "the same of an axis that turns; of one that turns more than once, over what the "
              "program uses")
      .boolean("cross", option(&Options::cross), "tables of an axis over another")
      .boolean("both_ways", option(&Options::has_direction_columns), "a column for each direction")
      .boolean("constant", option(&Options::constant), "an offset as well")
      .word(KeyName("format").with_fallback("none"), &Table::format,
            {{"linuxcnc", ControlFormat::LinuxCnc},
             {"isg", ControlFormat::Isg},
             {"siemens", ControlFormat::Siemens},
             {"heidenhain", ControlFormat::Heidenhain}},
            "through a file of that control and what it can hold")
      .table(KeyName("reference").with_fallback("the middle of the program"), &Table::reference,
             axis_position_fields(joints), "where the other axes stand: { Z_mm = 100, C_deg = 0 }");
}

Fields<Piezo> piezo_fields() {
  return Fields<Piezo>()
      .direction("direction", &Piezo::direction_t, "along which it carries the tool, in its frame")
      .number("range_um", &Piezo::range, positive, "of the whole stroke")
      .number("stiffness_N_per_um", &Piezo::stiffness, positive, "against a force along it")
      .number("resolution_nm", &Piezo::resolution, non_negative, "of its set-points; 0: none")
      .number("cycle_ms", &Piezo::cycle_s, cycle_ms, "of its set-points")
      .table("loop", &Piezo::loop, loop_fields(Piezo{}.loop), "how it follows its set-points");
}

void read_plug_in(TableReader& reader, Description& compensation) {
  try {
    compensation.plug_in = parse_plug_in_method(reader.text("plug_in", "iterated-ideal"));
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("plug_in", "strategy and channel of plug-ins", error.what());
  }
}

Key plug_in_key() {
  return make_key(
      KeyName("plug_in").with_fallback("iterated-ideal"), Key::Kind::Text,
      "strategy and channel of compensators of your own; the strategy is for those that "
      "answer deviations, any channel but `table`, which asks for one place at a time");
}

Fields<Description> compensation_fields(const std::vector<kinematics::Joint>& joints) {
  return Fields<Description>()
      .number("rotary_bound_deg", &Description::rotary_bound, {0.0, 180.0, false, false},
              "no correction of an axis that turns is larger")
      .number("word_resolution_mm", &Description::word_resolution, {1e-9, 1e6},
              "of the words of a rewritten NC program; PVT is written with every digit")
      .number("angle_resolution_deg", &Description::angle_resolution, {1e-9, 360.0},
              "the same of words of axes that turn")
      .number("path_tolerance_um", &Description::path_tolerance, non_negative,
              "between the corrected path, tip and tool axis, and the blocks that stand for it; 0: "
              "a word, of PVT 1 nm")
      .table("loop", &Description::loop, loop_fields({}),
             "position loop after `pulses`, `open` and `origin`")
      .table("pulses", &Description::pulses, pulses_fields(),
             "counts inserted into the encoder signals")
      .table("open", &Description::open, open_fields(), "set-points of an open control")
      .table("origin", &Description::origin, origin_fields(), "work zero, shifted by the PLC")
      .table("table", &Description::table, table_fields(joints), "tables over one axis each")
      .table("piezo", &Description::piezo, piezo_fields(), "actuator that carries the tool")
      .custom_field({plug_in_key()}, read_plug_in,
                    [](const Description& compensation, Node::Table& table) {
                      put_value(table, "plug_in", plug_in_method(compensation.plug_in));
                    });
}

}  // namespace

CompensationDescription read_compensation(const Node& table,
                                          const std::vector<kinematics::Joint>& joints,
                                          InputErrors& input_errors) {
  return compensation_fields(joints).read_table(table, "compensation", input_errors);
}
Node::Table compensation_to_table(const CompensationDescription& compensation,
                                  const std::vector<kinematics::Joint>& joints) {
  return compensation_fields(joints).to_table(compensation);
}
std::vector<Key> compensation_keys() { return compensation_fields({}).keys(); }

}  // namespace abbe::sim
