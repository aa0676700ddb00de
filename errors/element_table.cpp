#include "errors/element_table.h"

#include <algorithm>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

constexpr std::size_t max_cells = 7;  // an axis and its six elements

/// A name of the header and the unit after its underscore.
struct HeaderCell {
  std::string_view name;
  std::optional<std::string_view> unit;
};

HeaderCell header_cell(const Cell& cell) {
  const std::size_t at = cell.text.find('_');
  if (at == std::string_view::npos) return {cell.text, std::nullopt};
  return {cell.text.substr(0, at), cell.text.substr(at + 1)};
}

bool is_rotary(char axis) { return (axis >= 'A' && axis <= 'C') || axis == 'S'; }

/// The content of the header line.
struct TableHeader {
  ElementTable table;         ///< without rows
  std::vector<double> units;  ///< (1 + m) mm or rad per unit of the column
  char separator = ' ';
};

/// Parser of the header cells: one axis, then its elements.
class HeaderReader {
 public:
  HeaderReader(const TableLineReader& lines, const Line& line) : lines_(lines), line_(line) {}

  TableHeader read() {
    header_.separator = cell_separator(line_.text);
    const std::vector<Cell> cells = split_cells(line_.text, header_.separator, max_cells);
    read_axis(cells.front());
    for (std::size_t i = 1; i < cells.size(); ++i) read_element(cells[i]);
    if (cells.size() < 2)
      refuse({"", int(line_.text.size()) + 1}, "an element name after the axis");
    return std::move(header_);
  }

 private:
  [[noreturn]] void refuse(const Cell& cell, const std::string& expected) const {
    lines_.refuse(cell, expected);
  }

  void read_axis(const Cell& cell) {
    const HeaderCell heading = header_cell(cell);
    constexpr std::string_view letters = "XYZUVWABCS";
    if (heading.name.size() != 1 || letters.find(heading.name.front()) == std::string_view::npos)
      refuse(cell, "a header such as X EXX EYX that begins with an axis letter");
    header_.table.axis = heading.name.front();
    if (is_rotary(header_.table.axis)) {
      if (heading.unit && *heading.unit != "deg" && *heading.unit != "rad")
        refuse(cell, "deg or rad as the unit of a rotary axis");
      header_.units.push_back(heading.unit == "rad" ? 1.0 : units::deg);
    } else {
      if (heading.unit && *heading.unit != "mm") refuse(cell, "mm as the unit of a slide");
      header_.units.push_back(1.0);
    }
  }

  void read_element(const Cell& cell) {
    const HeaderCell heading = header_cell(cell);
    const ElementName name = element_name(cell, heading.name);
    // The positions of the rows belong to one axis, and a location element has none.
    if (name.location || name.axis != header_.table.axis)
      refuse(cell, fmt::format("an error motion of {}, such as EX{}", header_.table.axis,
                               header_.table.axis));
    for (const ElementName& other : header_.table.elements)
      if (other == name) refuse(cell, "each element only once");
    header_.table.elements.push_back(name);
    const std::string_view base_unit = name.is_angle() ? "rad" : "mm";
    const std::string_view small_unit_name = name.is_angle() ? "urad" : "um";
    if (heading.unit && *heading.unit != base_unit && *heading.unit != small_unit_name)
      refuse(cell, fmt::format("{} or {} as the unit of {}", base_unit, small_unit_name,
                               to_string(name)));
    const double small_unit = name.is_angle() ? units::urad : units::um;
    header_.units.push_back(heading.unit == small_unit_name ? small_unit : 1.0);
  }

  ElementName element_name(const Cell& cell, std::string_view text) const {
    try {
      return parse_element_name(text);
    } catch (const std::invalid_argument&) {
      refuse(cell, fmt::format("an element name, such as EX{}", header_.table.axis));
    }
  }

  const TableLineReader& lines_;
  const Line& line_;
  TableHeader header_;
};

/// Reads the rows: 1 + m numbers each, converted to mm and rad.
std::vector<double> read_rows(TableLineReader& lines, const TableHeader& header) {
  const std::size_t width = header.units.size();
  std::vector<double> numbers;
  while (const auto line = lines.next()) {
    const std::vector<Cell> cells = split_cells(line->text, header.separator, max_cells);
    for (std::size_t i = 0; i < std::min(cells.size(), width); ++i)
      numbers.push_back(lines.number_in(cells[i]) * header.units[i]);
    const std::string expected_cells = fmt::format("{} cells, as in the header", width);
    if (cells.size() < width)
      lines.refuse(int(line->text.size()) + 1, expected_cells, fmt::format("{}", cells.size()));
    if (cells.size() > width) lines.refuse(cells[width].column, expected_cells, "more");
    const std::size_t row_begin = numbers.size() - width;
    // The negated comparison also rejects NaN.
    if (row_begin > 0 && !(numbers[row_begin] > numbers[row_begin - width]))
      lines.refuse(cells[0], "positions that increase from row to row");
  }
  return numbers;
}

}  // namespace

ElementTable read_element_table(std::string_view text, const std::string& file,
                                std::size_t max_bytes) {
  if (text.size() > max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", max_bytes),
                   fmt::format("{}", text.size()));
  TableLineReader lines(text, file);
  const auto first = lines.next();
  if (!first) throw BadInput(file, 1, 1, "a header such as X EXX EYX", "an empty table");
  TableHeader header = HeaderReader(lines, *first).read();
  const std::vector<double> numbers = read_rows(lines, header);
  const auto width = Eigen::Index(header.units.size());
  const Eigen::Index rows = Eigen::Index(numbers.size()) / width;
  if (rows < 2) lines.refuse(0, "at least 2 rows", fmt::format("{}", rows));
  // The numbers were collected row by row, whereas Eigen matrices store columns by default.
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> columns(numbers.data(), rows, width);
  header.table.q = columns.col(0);
  header.table.values = columns.rightCols(width - 1);
  return std::move(header.table);
}

ElementTable read_element_table_file(const std::filesystem::path& file, std::size_t max_bytes) {
  return read_element_table(read_text(file, max_bytes), file.string(), max_bytes);
}

std::string write_element_table(const ElementTable& table, char separator) {
  if (table.values.rows() != table.q.size() ||
      table.values.cols() != Eigen::Index(table.elements.size()))
    throw std::invalid_argument("element table: expected one value per position and element");
  std::string text(1, table.axis);
  for (const ElementName& name : table.elements) text += separator + to_string(name);
  // The quotient is the nearest number of degrees: if any number reads back exactly, it does.
  const double unit = is_rotary(table.axis) ? units::deg : 1.0;
  for (Eigen::Index i = 0; i < table.q.size(); ++i) {
    text += fmt::format("\n{}", table.q[i] / unit);
    for (Eigen::Index k = 0; k < table.values.cols(); ++k)
      text += fmt::format("{}{}", separator, table.values(i, k));
  }
  return text + "\n";
}

std::vector<Element> to_elements(const ElementTable& table, const ElementConversionOptions& use) {
  std::vector<Element> elements;
  for (std::size_t k = 0; k < table.elements.size(); ++k) {
    Table shape = make_table(table.q, table.values.col(Eigen::Index(k)), use.between, use.outside);
    elements.push_back(
        {table.elements[k], {Curve{std::move(shape), use.name, use.argument, use.negate, 1.0}}});
  }
  return elements;
}

}  // namespace abbe::errors
