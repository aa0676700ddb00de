#include "sim/scene/scene_thermal_day.h"

#include <array>

#include <fmt/format.h>

namespace abbe::sim {

namespace {

using Eigen::VectorXd;
using kinematics::Joint;
using kinematics::Motion;

constexpr Range phase_spindle_rpm{0.0, 1e6};
constexpr Range axis_speed{0.0, 1e6};  // mm or deg a minute
constexpr std::size_t most_rows = 10'000;

// ---- room

void read_room_table(const Node& section, ThermalDescription& thermal, Faults& faults) {
  TableReader reader(section, "thermal.room", faults);
  const std::size_t before = faults.list().size();
  const auto key = time_key(reader, "time");
  const VectorXd T_C = reader.numbers("T_C");
  const VectorXd time_s = key ? reader.numbers(*key) : VectorXd();
  reader.close();
  if (faults.list().size() != before) return;
  if (T_C.size() != time_s.size())
    reader.refuse("T_C", fmt::format("as many temperatures as times, {}", time_s.size()),
                  fmt::format("{}", T_C.size()));
  for (Eigen::Index i = 1; i < time_s.size(); ++i)
    if (!(time_s[i] > time_s[i - 1]))
      reader.refuse(*key, "rising times for thermal.room." + *key,
                    fmt::format("{} s after {} s", time_s[i], time_s[i - 1]));
  if (T_C.size() > Eigen::Index(most_rows))
    reader.refuse("T_C", fmt::format("at most {} rows", most_rows), fmt::format("{}", T_C.size()));
  const Range& range = temperature_range;
  if (T_C.minCoeff() < range.min || T_C.maxCoeff() > range.max)
    reader.refuse("T_C", fmt::format("temperatures of {} .. {}", range.min, range.max),
                  fmt::format("{} .. {}", T_C.minCoeff(), T_C.maxCoeff()));
  thermal.room_time_s = time_s;
  thermal.room_T_C = T_C;
}

void read_room(TableReader& reader, ThermalDescription& thermal) {
  thermal.room_time_s = VectorXd::Zero(1);
  thermal.room_T_C = VectorXd::Constant(1, reader.number("room_C", temperature_range, 20.0));
  const Node* section = reader.section("room");
  if (!section) return;
  if (reader.has("room_C")) reader.refuse("room", "either room_C or a table room", "both");
  read_room_table(*section, thermal, reader.faults());
}

void write_room(const ThermalDescription& from, Node::Table& to) {
  if (from.room_time_s.size() == 1 && from.room_time_s[0] == 0.0)
    return put(to, "room_C", from.room_T_C[0]);
  Node::Table room;
  put_numbers(room, "time_s", from.room_time_s, 1.0);
  put_numbers(room, "T_C", from.room_T_C, 1.0);
  put(to, "room", std::move(room));
}

// ---- history

struct SpeedKey {
  const char* name;
  Motion motion;
  const char* axes;
  const char* sentence;
};
constexpr std::array speed_keys{
    SpeedKey{"axis_speed_mm_per_min", Motion::Linear, "[XYZUVW]",
             "mean speeds of slides that go to and fro, `{ X = 5000 }`"},
    SpeedKey{"axis_speed_deg_per_min", Motion::Rotary, "[ABCS]",
             "mean speeds of axes that turn to and fro, `{ A = 100 }`"}};

void read_axis_speeds(TableReader& phase, kinematics::AxisVector& speeds,
                      const ThermalSetting& setting) {
  if (setting.chain) speeds.setZero(setting.chain->size());
  for (const SpeedKey& key : speed_keys) {
    const Node* section = phase.section(key.name);
    if (!section || !setting.chain) continue;
    TableReader reader(*section, std::string("thermal.history.") + key.name, phase.faults());
    for (int j = 0; j < setting.chain->size(); ++j) {
      const Joint& joint = setting.chain->joints()[std::size_t(j)];
      if (joint.motion != key.motion) continue;
      const auto written = reader.number_as_written(std::string(1, joint.name), axis_speed);
      if (written) speeds[j] = *written * unit_of(key.name);
    }
    reader.close();
  }
}

void write_axis_speeds(const kinematics::AxisVector& speeds, Node::Table& to,
                       const ThermalSetting& setting) {
  for (const SpeedKey& key : speed_keys) {
    Node::Table axes;
    for (int j = 0; j < int(speeds.size()); ++j) {
      const Joint& joint = setting.chain->joints()[std::size_t(j)];
      if (joint.motion == key.motion && speeds[j] != 0.0)
        put(axes, std::string(1, joint.name), speeds[j] / unit_of(key.name));
    }
    if (!axes.empty()) put(to, key.name, std::move(axes));
  }
}

std::vector<Key> axis_speed_keys() {
  std::vector<Key> keys;
  for (const SpeedKey& one : speed_keys) {
    Key axis = key_of("<axis>", Key::Kind::Number, "of one axis, in the unit of the table");
    axis.pattern = one.axes;
    axis.range = axis_speed;
    Key key = key_of(KeyName(one.name).otherwise("0"), Key::Kind::Table, one.sentence);
    key.keys = {axis};
    keys.push_back(key);
  }
  return keys;
}

Range duration_range(const std::string& key) {
  return {0.0, longest_s / unit_of(key), true, false};
}

Fields<ThermalPhase> phase_fields(const ThermalSetting& setting) {
  std::vector<Key> durations = time_keys("duration", Key::Kind::Number, "how long it lasts");
  for (Key& key : durations) key.range = duration_range(key.name);
  return Fields<ThermalPhase>()
      .custom(
          {key_of("name", Key::Kind::Text, "of the phase, for people")},
          [](TableReader& reader, ThermalPhase&) { reader.text("name", ""); },
          [](const ThermalPhase&, Node::Table&) {})
      .custom(
          durations,
          [](TableReader& reader, ThermalPhase& phase) {
            if (const auto key = time_key(reader, "duration"))
              phase.duration = reader.number(*key, duration_range(*key));
          },
          [](const ThermalPhase& from, Node::Table& to) { put(to, "duration_s", from.duration); })
      .number("speed_rpm", &ThermalPhase::spindle_speed, phase_spindle_rpm, "of the spindle")
      .custom(
          axis_speed_keys(),
          [&setting](TableReader& reader, ThermalPhase& phase) {
            read_axis_speeds(reader, phase.axis_speed, setting);
          },
          [&setting](const ThermalPhase& from, Node::Table& to) {
            write_axis_speeds(from.axis_speed, to, setting);
          })
      .boolean("powered", &ThermalPhase::powered, "the machine is switched on")
      .boolean("coolant", &ThermalPhase::coolant, "the coolant flows");
}

void read_history(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  const auto phases = reader.tables("history");
  if (phases.size() > most_rows) {
    reader.refuse("history", fmt::format("at most {} phases", most_rows),
                  fmt::format("{}", phases.size()));
    return;
  }
  const Fields<ThermalPhase> fields = phase_fields(setting);
  for (const Node* table : phases)
    thermal.history.push_back(
        fields.read_table(*table, where_of("history", *table), reader.faults()));
}

}  // namespace

Fields<ThermalDescription> room_fields() {
  Key constant = key_of(KeyName("room_C").otherwise("20"), Key::Kind::Number,
                        "temperature of a room that stays the same; or `room`");
  constant.range = temperature_range;
  Key room = key_of("room", Key::Kind::Table,
                    "temperature of the room, linear between its rows, held outside; at most "
                    "10 000 rows");
  room.keys = time_keys("time", Key::Kind::Numbers, "rising, before the program negative");
  room.keys.push_back(
      key_of(must("T_C"), Key::Kind::Numbers, "temperatures, one for each of the times"));
  return Fields<ThermalDescription>().custom({constant, room}, read_room, write_room);
}

Fields<ThermalDescription> history_fields(const ThermalSetting& setting) {
  return Fields<ThermalDescription>().tables(
      "history", &ThermalDescription::history, phase_fields(setting),
      "stretch of time before the program, in order; at most 10 000",
      [&setting](TableReader& reader, ThermalDescription& to) {
        read_history(reader, to, setting);
      });
}

}  // namespace abbe::sim
