#include "tests/safety/mistakes/sheet.h"

namespace abbe::safety {

std::vector<Mistake> mistakes_in_temperatures() {
  return {
      input_error("sensor that was not logged", "day", {}, "a logged sensor, seen S99", {},
                  [](auto& o) { o.sensors = {"S99"}; }),
      warning("sensor unplugged after half a day", "day", {{"day.csv", with_dead_sensor(s12, "0")}},
              "a loose contact"),
      warning("decimal point lost in a temperature", "day",
              {{"day.csv", with_cell(s12, 50, times(10.0))}}, "a loose contact"),
      warning("temperatures in tenths", "day", {{"day.csv", with_column(s12, times(10.0))}},
              "implausible for a machine"),
      warning("sign of a temperature", "day", {{"day.csv", with_column(s12, times(-1.0))}},
              "while the median of all sensors is"),
      warning("columns of two sensors exchanged", "day",
              {{"day.csv", with_columns_exchanged(s12, "S01_room_C")}},
              "these temperatures explain"),
      input_error("sensor named twice", "day",
                  {{"day.csv", "S01_room_C", "S12_spindle_box_bearing_C"}},
                  "each column only once"),
      warning("log in reversed time", "day",
              {{"day.csv", with_rows([](auto& rows) { std::ranges::reverse(rows); })}},
              "time decreases at"),
      warning("times of a day in ms", "day", {{"day.csv", with_column("time_s", times(1000.0))}},
              "check the unit of the times"),
      warning("decimal point lost in a drift", "day",
              {{"day.csv", with_cell("reading", 300, times(1000.0))}},
              "these temperatures explain"),
      input_error("a day under two names", "day", {{"day_2.csv", "", day_files().at("day.csv")}},
                  "copied, or rounded more coarsely than stated"),
      reported(warning("temperatures of all in Fahrenheit", "day",
                       {{"day.csv", with_sensors_in_Fahrenheit()}}, "not Fahrenheit")),
  };
}

}  // namespace abbe::safety
