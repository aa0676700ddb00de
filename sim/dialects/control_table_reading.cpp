#include "sim/dialects/control_table_reading.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/encoding.h"
#include "kinematics/text.h"

namespace abbe::sim::dialects {

namespace {
constexpr std::size_t most_unused_names = 200;
}  // namespace

void TableReading::leave_out(const std::string& name) {
  const bool known = unused.contains(name) || unused.size() < most_unused_names;
  ++unused[known ? name : "others"];
}

void TableReading::read_beyond(int system, const std::function<void()>& read) {
  try {
    read();
  } catch (const BadInput&) {
    leave_out("offsets beyond the sixth that cannot be read");
    unread.insert(system);
  }
}

double TableReading::unit_at(const Cursor& cursor, std::size_t from) const {
  if (!unit)
    cursor.refuse(from, "a unit beside the name of the file, which does not say it", "none");
  return *unit;
}

void TableReading::state_unit(double mm, const Cursor& cursor, std::size_t from) {
  const auto named = [](double length) { return length == 1.0 ? "mm" : "inch"; };
  if (unit && *unit != mm)
    cursor.refuse(from, fmt::format("a table in {}, as is stated beside its name", named(*unit)),
                  named(mm));
  unit = mm;
}

void each_line(TableReading& reading, const std::function<bool(Cursor&)>& read) {
  try {
    check_encoding(reading.text, reading.table.file);
  } catch (const BadInput& fault) {
    reading.faults.add(fault);
    return;
  }
  Lines lines(reading.text);
  while (const auto line = lines.next()) {
    Cursor cursor{*line, {reading.table.file, lines.number()}};
    try {
      for (std::size_t i = 0; i < line->size(); ++i) {
        const auto c = static_cast<unsigned char>((*line)[i]);
        if ((c < ' ' && c != '\t') || c == 0x7f)
          cursor.refuse(i, "plain text", fmt::format("a byte 0x{:02x}", c));
      }
      if (!read(cursor)) return;
    } catch (const BadInput& fault) {
      reading.faults.add(fault);
      if (reading.faults.full()) return;
    }
  }
}

double table_number(Cursor& cursor, std::string_view what) {
  constexpr double most = 1e6;
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const auto value = cursor.number();
  if (!value || !(std::abs(*value) <= most))
    cursor.refuse(from, fmt::format("a number within 1e6 for {}", what));
  const bool ends = cursor.at_end() || is_blank(cursor.here()) || cursor.here() == ';' ||
                    cursor.here() == ',' || cursor.here() == ')';
  if (!ends) cursor.refuse(from, fmt::format("a number for {}", what));
  return *value;
}

int table_whole(Cursor& cursor, int least, int most, std::string_view what) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const auto value = cursor.number();
  if (!value || *value != std::floor(*value) || *value < least || *value > most)
    cursor.refuse(from, fmt::format("a whole number from {} to {} for {}", least, most, what));
  return int(*value);
}

}  // namespace abbe::sim::dialects
