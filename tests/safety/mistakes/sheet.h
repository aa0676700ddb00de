#pragma once

#include <fmt/ranges.h>
#include "tests/safety/mistakes/mistake.h"
#include "tests/test.h"

/// Changes of files of readings, cell by cell.
namespace abbe::safety {

inline const std::string s12 = "S12_spindle_box_bearing_C";

/// A file of readings: its head with the line of columns, and its cells.
struct Sheet {
  std::string head;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;

  std::size_t column(const std::string& name) const {
    return std::size_t(std::ranges::find(columns, name) - columns.begin());
  }
};

inline std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

inline Sheet sheet_of(const std::string& text) {
  const std::size_t columns = text.find("set_up,channel,"), rows = text.find('\n', columns) + 1;
  Sheet sheet{text.substr(0, rows), cells_of(text.substr(columns, rows - 1 - columns)), {}};
  std::istringstream in(text.substr(rows));
  for (std::string line; std::getline(in, line);) sheet.rows.push_back(cells_of(line));
  return sheet;
}

inline std::string text_of(const Sheet& sheet) {
  std::string text = sheet.head;
  for (const auto& row : sheet.rows) text += fmt::format("{}\n", fmt::join(row, ","));
  return text;
}

using Change = std::function<std::string(const std::string&)>;
using NumberChange = std::function<double(double)>;

inline NumberChange times(double factor) {
  return [factor](double value) { return factor * value; };
}
inline NumberChange plus(double offset) {
  return [offset](double value) { return value + offset; };
}

inline void change_cell(std::string& cell, const NumberChange& change) {
  cell = fmt::format("{}", change(std::stod(cell)));
}

inline Change with_sheet(const std::function<void(Sheet&)>& change) {
  return [change](const std::string& text) {
    Sheet sheet = sheet_of(text);
    change(sheet);
    return text_of(sheet);
  };
}

inline Change with_cell(const std::string& column, std::size_t row, const NumberChange& change) {
  return with_sheet(
      [=](Sheet& sheet) { change_cell(sheet.rows.at(row).at(sheet.column(column)), change); });
}

/// Every row of a column; of one set-up, where that is named.
inline Change with_column(const std::string& column, const NumberChange& change, int set_up = -1) {
  return with_sheet([=](Sheet& sheet) {
    for (auto& row : sheet.rows)
      if (set_up < 0 || row[0] == std::to_string(set_up))
        change_cell(row.at(sheet.column(column)), change);
  });
}

inline Change with_columns_exchanged(const std::string& a, const std::string& b) {
  return with_sheet([=](Sheet& sheet) {
    for (auto& row : sheet.rows) std::swap(row.at(sheet.column(a)), row.at(sheet.column(b)));
  });
}

/// Readings of one place, where two are named by cells, in that of the other.
inline Change with_readings_copied(std::size_t column, const std::string& from,
                                   const std::string& to) {
  return with_sheet([=](Sheet& sheet) {
    const std::size_t reading = sheet.column("reading");
    std::vector<std::string> values;
    for (const auto& row : sheet.rows)
      if (row[column] == from) values.push_back(row[reading]);
    std::size_t at = 0;
    for (auto& row : sheet.rows)
      if (row[column] == to) row[reading] = values.at(at++ % values.size());
  });
}

inline Change with_readings_shifted() {
  return with_sheet([](Sheet& sheet) {
    const std::size_t reading = sheet.column("reading");
    for (std::size_t i = sheet.rows.size() - 1; i > 0; --i)
      sheet.rows[i][reading] = sheet.rows[i - 1][reading];
  });
}

/// Readings minus the positions of the axis that its set-up moves.
inline Change with_deviations() {
  return with_sheet([](Sheet& sheet) {
    const std::size_t reading = sheet.column("reading");
    const std::vector<std::string> moved{"X_mm", "Y_mm", "Z_mm"};
    for (auto& row : sheet.rows) {
      const double position = std::stod(row[sheet.column(moved.at(std::stoul(row[0])))]);
      change_cell(row[reading], plus(-position));
    }
  });
}

/// The readings of every return in the order in which they were taken upwards.
inline Change with_returns_reversed() {
  return with_sheet([](Sheet& sheet) {
    const std::size_t reading = sheet.column("reading"), way = sheet.column("X_way");
    for (std::size_t from = 0, to = 0; from < sheet.rows.size(); from = to) {
      for (to = from + 1; to < sheet.rows.size() && sheet.rows[to][way] == sheet.rows[from][way];)
        ++to;
      for (std::size_t i = from, j = to - 1; sheet.rows[from][way] == "-1" && i < j; ++i, --j)
        std::swap(sheet.rows[i][reading], sheet.rows[j][reading]);
    }
  });
}

inline Change with_rows(const std::function<void(std::vector<std::vector<std::string>>&)>& change) {
  return with_sheet([change](Sheet& sheet) {
    const std::size_t before = sheet.rows.size();
    change(sheet.rows);
    sheet.head = replaced(sheet.head, fmt::format("# rows = {}", before),
                          fmt::format("# rows = {}", sheet.rows.size()));
  });
}

inline Change without_set_up(const std::string& set_up) {
  return with_rows(
      [=](auto& rows) { std::erase_if(rows, [&](const auto& row) { return row[0] == set_up; }); });
}

inline double rounded_to_um(double value) { return std::round(value * 1e3) / 1e3; }
inline double in_Fahrenheit(double value) { return 1.8 * value + 32.0; }

/// From the middle of the day on a sensor reads one value.
inline Change with_dead_sensor(const std::string& sensor, const std::string& value) {
  return with_sheet([=](Sheet& sheet) {
    for (std::size_t i = sheet.rows.size() / 2; i < sheet.rows.size(); ++i)
      sheet.rows[i].at(sheet.column(sensor)) = value;
  });
}

inline Change with_sensors_in_Fahrenheit() {
  return with_sheet([](Sheet& sheet) {
    for (auto& row : sheet.rows)
      for (std::size_t k = sheet.column("unit") + 1; k < row.size(); ++k)
        change_cell(row[k], in_Fahrenheit);
  });
}

inline std::string without_head(const std::string& text) {
  return text.substr(text.find("set_up,"));
}

}  // namespace abbe::safety
