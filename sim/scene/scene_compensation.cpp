#include <stdexcept>

#include "sim/scene/case_name.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

using compensation::OpenControl;
using compensation::OriginShift;
using compensation::Piezo;
using compensation::PositionLoop;
using Description = CompensationDescription;

constexpr Range cycle_ms{0.0, 1e6, true, false};
constexpr Range delay_ms{0.0, 1e6, false, false};

Fields<PositionLoop> loop_fields(const PositionLoop& usual) {
  using Order = PositionLoop::Order;
  return Fields<PositionLoop>(usual)
      .word(must("order"), &PositionLoop::order,
            {{"none", Order::None, "at once"},
             {"first", Order::First, "1 / (1 + s / w)"},
             {"second", Order::Second, "w² / (s² + 2 d w s + w²)"}},
            "how the position loop follows a correction")
      .number("bandwidth_Hz", &PositionLoop::bandwidth, positive, "w / 2π")
      .number("damping", &PositionLoop::damping, {1e-3, 100.0}, "d of the second order");
}

Fields<Description::Pulses> pulses_fields() {
  using Pulses = Description::Pulses;
  return Fields<Pulses>()
      .number(
          "count_um", &Pulses::count, {1e-6, 1e6},
          "one signal period of a slide; where the zeros lie in a count the scene's `seed` says")
      .number("count_deg", &Pulses::count_rad, {1e-9, 10.0}, "the same of an axis that turns")
      .number("cycle_ms", &Pulses::cycle_s, cycle_ms, "at which a pair may go in")
      .number("pulse_ms", &Pulses::pulse_s, cycle_ms,
              "that a pair takes, while both signals are low")
      .check([](TableReader& reader, Pulses& pulses) {
        if (pulses.pulse_s > pulses.cycle_s)
          reader.refuse("pulse_ms", "a compensation.pulses.pulse_ms of at most cycle_ms",
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
  const auto option = [](auto member) {
    return [member](auto& table) -> auto& { return table.options.*member; };
  };
  using Options = compensation::TableOptions;
  return Fields<Table>()
      .whole("most_points", option(&Options::most_points), 2, 100000, "of one table")
      .number("spacing_mm", option(&Options::spacing), {1e-3, 1e6},
              "between points of a slide over its travel, wider where `most_points` asks for it")
      .number(KeyName("spacing_deg").otherwise("5.002: 0.0873 rad"), option(&Options::spacing_rad),
              {1e-3, 360.0},
              "the same of an axis that turns; of one that turns more than once, over what the "
              "program uses")
      .boolean("cross", option(&Options::cross), "tables of an axis over another")
      .boolean("both_ways", option(&Options::both_ways), "a column for each direction")
      .boolean("constant", option(&Options::constant), "an offset as well")
      .word(KeyName("format").otherwise("none"), &Table::format,
            {{"linuxcnc", ControlFormat::LinuxCnc},
             {"isg", ControlFormat::Isg},
             {"siemens", ControlFormat::Siemens},
             {"heidenhain", ControlFormat::Heidenhain}},
            "through a file of that control and what it can hold")
      .table(KeyName("reference").otherwise("the middle of the program"), &Table::reference,
             axis_word_fields(joints), "where the other axes stand: { Z_mm = 100, C_deg = 0 }");
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
    compensation.plug_in = parse_plug_in_way(reader.text("plug_in", "iterated-ideal"));
  } catch (const std::invalid_argument& fault) {
    reader.refuse("plug_in", "strategy and channel of plug-ins", fault.what());
  }
}

Key plug_in_key() {
  return key_of(KeyName("plug_in").otherwise("iterated-ideal"), Key::Kind::Text,
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
      .custom({plug_in_key()}, read_plug_in, [](const Description& from, Node::Table& table) {
        put(table, "plug_in", plug_in_way(from.plug_in));
      });
}

}  // namespace

CompensationDescription read_compensation(const Node& table,
                                          const std::vector<kinematics::Joint>& joints,
                                          Faults& faults) {
  return compensation_fields(joints).read_table(table, "compensation", faults);
}
Node::Table written_compensation(const CompensationDescription& compensation,
                                 const std::vector<kinematics::Joint>& joints) {
  return compensation_fields(joints).written(compensation);
}
std::vector<Key> compensation_keys() { return compensation_fields({}).keys(); }

}  // namespace abbe::sim
