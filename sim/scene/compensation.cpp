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
  Key thermal = make_key("thermal", Key::Kind::Table,
                         "thermal errors, predicted from the measured temperatures");
  thermal.keys = {
      make_key(required_key("file"), Key::Kind::Text,
               "file written by `abbe identify --method thermal`, or by `--method composite` as "
               "`NAME_thermal.txt`; its sensors must be those of the scene")};
  return thermal;
}

/// Returns the fields of the scene whose part trains the law, and of the instrument that measures
/// that part.
Fields<Force> training_fields() {
  return Fields<Force>()
      .text(required_key("file"), &Force::training, "scene of the training part")
      .text(required_key("instrument"), &Force::instrument,
            "instrument of that scene that measures the part");
}

/// Returns the fields of a force that comes from one source.
Fields<Force> force_source_fields(From from, const MachineDescription& machine) {
  Fields<Force> fields;
  // A modelled force carries no measurement noise, so it needs no smoothing.
  if (from != From::Model)
    fields.number("smoothing_ms", &Force::smoothing_s, non_negative,
                  "averaging time of the readings, up to the present; 0: no averaging");
  fields.integer("passes", &Force::passes, 1, 20,
                 "training runs, each corrected by the law learnt from the previous run");
  // The current yields a fitted deflection directly, so no compliance is needed with it.
  if (from == From::Current)
    return fields.table(required_key("training"), whole_struct, training_fields(),
                        "training part from which the law d = c1 x + c2 x² is fitted, where x is "
                        "the current above that in air; the tool deflects by d along its own z");
  Key compliance =
      make_key(required_key("compliance"), Key::Kind::Table,
               "believed compliance, in the form of `[compliance]`", compliance_keys());
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
  Key source_key = make_key(required_key("from"), Key::Kind::Text, "how the force is known");
  const std::array sources{From::Current, From::Dynamometer, From::Model};
  source_key.choices = {{"current", "measured; requires `[signals.current]`", {}},
                        {"dynamometer", "measured; requires `[signals.dynamometer]`", {}},
                        {"model",
                         "computed from the blank and material of the scene, on an error-free "
                         "machine with the compliance of `compliance`",
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
            "name of a `cmm` or `touch_probe` of the scene, whose `case` has no effect")
      .integer("passes", &Part::passes, 1, 20, "parts cut and measured before the final one");
}

Fields<BeliefDescription> belief_fields(const MachineDescription& machine) {
  using Description = BeliefDescription;
  Key identified =
      make_key("identified", Key::Kind::Tables,
               "geometric errors, in the form of `errors`; usually written by `abbe identify`",
               errors_keys());
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
      .table("force", &Description::force, force_fields(machine),
             "deflection under the cutting force")
      .table("part", &Description::part, measured_part_fields(),
             "deviations measured on a part that was cut before. With other beliefs (`fused`), "
             "those act while the first part is cut, and the instrument must be a `cmm`: a probe "
             "on an uncorrected machine would cancel them")
      .number("scale", &Description::scale, {-1e6, 1e6},
              "factor of `identified` and `thermal`; 0 disables both");
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
      .choice(required_key("order"), &PositionLoop::order,
              {{"none", Order::None, "immediately"},
               {"first", Order::First, "1 / (1 + s / w)"},
               {"second", Order::Second, "w² / (s² + 2 d w s + w²)"}},
              "response of the position loop to a correction")
      .number("bandwidth_Hz", &PositionLoop::bandwidth, positive, "w / 2π")
      .number("damping", &PositionLoop::damping, {1e-3, 100.0}, "d of the second-order response");
}

Fields<Description::PulseInsertion> pulses_fields() {
  using PulseInsertion = Description::PulseInsertion;
  return Fields<PulseInsertion>()
      .number("count_um", &PulseInsertion::count, {1e-6, 1e6},
              "one signal period of a slide; the scene's `seed` sets the positions of the zeros "
              "within a count")
      .number("count_deg", &PulseInsertion::count_rad, {1e-9, 10.0},
              "one signal period of a rotary axis")
      .number("cycle_ms", &PulseInsertion::cycle_s, cycle_ms,
              "cycle in which a pair of pulses may be inserted")
      .number("pulse_ms", &PulseInsertion::pulse_s, cycle_ms,
              "duration of a pair of pulses, during which both signals are low")
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
      .number("cycle_ms", &OpenControl::cycle_s, cycle_ms, "cycle of the servo")
      .number("delay_ms", &OpenControl::delay_s, delay_ms, "delay from reading to action");
}

Fields<OriginShift> origin_fields() {
  return Fields<OriginShift>()
      .number("cycle_ms", &OriginShift::cycle_s, cycle_ms, "cycle of the PLC")
      .number("delay_ms", &OriginShift::delay_s, delay_ms, "delay from reading to action")
      .number("increment_um", &OriginShift::increment, non_negative,
              "shifts are integer multiples of it; 0: not rounded")
      .number("rate_mm_per_min", &OriginShift::rate, non_negative,
              "rate at which the control ramps to a new shift; 0: immediately");
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
      .integer("most_points", option(&Options::max_points), 2, 100000,
               "largest number of points in one table")
      .number(
          "spacing_mm", option(&Options::spacing), {1e-3, 1e6},
          "spacing of the points over the travel of a slide, wider if `most_points` requires it")
      .number(KeyName("spacing_deg").with_fallback("5.002 (0.0873 rad)"),
              option(&Options::spacing_rad), {1e-3, 360.0},
              "the same for a rotary axis; if the axis turns more than once, over the range used "
              "by the program")
      .boolean("cross", option(&Options::cross),
               "true: tables of one axis over the position of another axis")
      .boolean("both_ways", option(&Options::has_direction_columns),
               "true: a column for each direction of approach")
      .boolean("constant", option(&Options::constant), "true: a constant offset as well")
      .choice(KeyName("format").with_fallback("none"), &Table::format,
              {{"linuxcnc", ControlFormat::LinuxCnc},
               {"isg", ControlFormat::Isg},
               {"siemens", ControlFormat::Siemens},
               {"heidenhain", ControlFormat::Heidenhain}},
              "the table is exported to a file of that control, within its limits, and read back")
      .table(KeyName("reference").with_fallback("the middle of the program"), &Table::reference,
             axis_position_fields(joints), "positions of the other axes: { Z_mm = 100, C_deg = 0 }")
      .integer(KeyName("tool").with_fallback("the first of the program"), &Table::tool, 0, 99999999,
               "number of the tool whose tip the tables correct; they act under every tool");
}

Fields<Piezo> piezo_fields() {
  return Fields<Piezo>()
      .direction("direction", &Piezo::direction_t,
                 "direction in which it moves the tool, in the tool frame")
      .number("range_um", &Piezo::range, positive, "full stroke")
      .number("stiffness_N_per_um", &Piezo::stiffness, positive,
              "stiffness against a force along its direction")
      .number("resolution_nm", &Piezo::resolution, non_negative,
              "resolution of its set-points; 0: not rounded")
      .number("cycle_ms", &Piezo::cycle_s, cycle_ms, "cycle of its set-points")
      .table("loop", &Piezo::loop, loop_fields(Piezo{}.loop), "response to its set-points");
}

void read_plug_in(TableReader& reader, Description& compensation) {
  try {
    compensation.plug_in = parse_plug_in_method(reader.text("plug_in", "iterated-ideal"));
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("plug_in", "strategy and channel of plug-ins", error.what());
  }
}

Key plug_in_key() {
  return make_key(KeyName("plug_in").with_fallback("iterated-ideal"), Key::Kind::Text,
                  "strategy and channel of your own compensators; the strategy applies to those "
                  "that return deviations, and any channel but `table` is allowed, as that one "
                  "requests one position at a time");
}

Fields<Description> compensation_fields(const std::vector<kinematics::Joint>& joints) {
  return Fields<Description>()
      .number("rotary_bound_deg", &Description::rotary_bound, {0.0, 180.0, false, false},
              "largest correction of a rotary axis")
      .number("word_resolution_mm", &Description::word_resolution, {1e-9, 1e6},
              "resolution of the words in a rewritten NC program; PVT is written with all digits")
      .number("angle_resolution_deg", &Description::angle_resolution, {1e-9, 360.0},
              "the same for words of rotary axes")
      .number("path_tolerance_um", &Description::path_tolerance, non_negative,
              "largest deviation of tip and tool axis between the corrected path and the rewritten "
              "blocks; 0: the resolution of a word, 1 nm for PVT")
      .table("loop", &Description::loop, loop_fields({}),
             "position loop that follows `pulses`, `open` and `origin`")
      .table("pulses", &Description::pulses, pulses_fields(),
             "counts inserted into the encoder signals")
      .table("open", &Description::open, open_fields(), "set-points of an open control")
      .table("origin", &Description::origin, origin_fields(), "work zero, shifted by the PLC")
      .table("table", &Description::table, table_fields(joints), "one table per axis")
      .table("piezo", &Description::piezo, piezo_fields(), "actuator that moves the tool")
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
