#include "sim/readings/part_readings_file.h"

#include <array>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/scene/bad_scene.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {
namespace {

constexpr std::string_view first_part_line = "# abbe_part_readings = 1";
constexpr std::string_view columns = "x_mm,y_mm,z_mm,nx,ny,nz,deviation_um,time_s";
constexpr std::size_t width = 8;

using Row = std::array<double, width>;

Row read_row(std::string_view line, int number, const std::string& file) {
  const std::vector<Cell> cells = cells_of(line, ',', width);
  const auto refuse = [&](int column, const std::string& expected, const std::string& seen) {
    throw BadInput(file, number, column, expected, seen);
  };
  if (cells.size() != width)
    refuse(1, fmt::format("{} cells: {}", width, columns), std::to_string(cells.size()));
  Row row{};
  for (std::size_t i = 0; i < width; ++i) {
    const auto x = number_of(cells[i].text);
    if (!x) refuse(cells[i].column, "a number within +-1e9", in_quotes(cells[i].text));
    row[i] = *x;
  }
  if (std::abs(std::hypot(row[3], row[4], row[5]) - 1.0) > 1e-9)
    refuse(cells[3].column, "a normal of length 1", in_quotes(line));
  return row;
}

}  // namespace

std::string to_text(const PartReadingsFile& file) {
  const errors::metrology::PartReadings& r = file.readings;
  std::string text = fmt::format(
      "{}\n# instrument = {}\n# kind = {}\n# part = {}\n# sigma_um = {}\n# rows = {}\n{}\n",
      first_part_line, to_toml_value(file.instrument), to_toml_value(file.kind),
      to_toml_value(file.part), r.sigma / units::um, r.deviation.size(), columns);
  for (Eigen::Index i = 0; i < r.deviation.size(); ++i) {
    for (int k = 0; k < 3; ++k) text += fmt::format("{},", r.points_w(i, k));
    for (int k = 0; k < 3; ++k) text += fmt::format("{},", r.normals_w(i, k));
    text += fmt::format("{},{}\n", r.deviation[i] / units::um, r.time_s[i]);
  }
  return text;
}

bool holds_part_readings(std::string_view text) { return text.starts_with(first_part_line); }

PartReadingsFile read_part_readings(std::string_view text, const std::string& file) {
  if (!holds_part_readings(text))
    throw BadInput(file, 1, 1, "readings of a part", in_quotes(text.substr(0, text.find('\n'))));
  std::string head;
  Lines lines(text);
  auto line = lines.next();
  for (; line && line->starts_with('#'); line = lines.next())
    head += " " + std::string(line->substr(1)) + "\n";
  if (!line || *line != columns)
    throw BadInput(file, lines.number(), 1, "the columns " + std::string(columns),
                   line ? in_quotes(*line) : "the end of the file");
  const Node node = parse_toml(head, file);
  Faults faults;
  TableReader reader(node, "", faults);
  reader.integer("abbe_part_readings", 1, 1, 1);
  PartReadingsFile result;
  result.instrument = reader.text("instrument");
  result.kind = reader.text("kind");
  result.part = reader.text("part", "");
  result.readings.sigma = reader.number("sigma_um", non_negative, 0.0);
  const int stated_rows = reader.integer("rows", 0, 1000000000, 0);
  reader.close();
  if (!faults.empty()) throw BadScene(faults.list());
  std::vector<Row> rows;
  while ((line = lines.next()))
    if (line->find_first_not_of(" \t") != std::string_view::npos)
      rows.push_back(read_row(*line, lines.number(), file));
  if (stated_rows > 0 && rows.size() != std::size_t(stated_rows))
    throw BadInput(file, 0, 0, fmt::format("{} rows, as its head says in `rows`", stated_rows),
                   fmt::format("{}: the file was cut off or changed", rows.size()));
  errors::metrology::PartReadings& r = result.readings;
  const auto n = Eigen::Index(rows.size());
  r.points_w.resize(n, 3);
  r.normals_w.resize(n, 3);
  r.deviation.resize(n);
  r.time_s.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Row& row = rows[std::size_t(i)];
    for (int k = 0; k < 3; ++k) {
      r.points_w(i, k) = row[std::size_t(k)];
      r.normals_w(i, k) = row[std::size_t(3 + k)];
    }
    r.deviation[i] = row[6] * units::um;
    r.time_s[i] = row[7];
  }
  return result;
}

}  // namespace abbe::sim
