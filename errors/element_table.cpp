#include "errors/element_table.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/table_file.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

bool is_rotary(char axis) { return (axis >= 'A' && axis <= 'C') || axis == 'S'; }

/// Returns the axis letter with which the header begins; X for an empty table, which the schema of
/// X then rejects.
char header_axis(std::string_view text, const std::string& file) {
  TableLineReader lines(text, file);
  const auto header = lines.next();
  if (!header) return 'X';
  const Cell first = split_cells(header->text, cell_separator(header->text), 1).front();
  constexpr std::string_view letters = "XYZUVWABCS";
  if (first.text.empty() || letters.find(first.text.front()) == std::string_view::npos)
    lines.refuse(first, "a header such as X,EXX,EYX that begins with an axis letter");
  return first.text.front();
}

/// Returns the schema of the table of an axis: its positions, then any of its six error motions.
TableSchema element_table_schema(char axis, std::size_t max_bytes) {
  TableSchema schema{.leading_columns = 1, .max_bytes = max_bytes, .min_rows = 2};
  schema.columns.push_back({.increasing = true});
  std::vector<ColumnName>& positions = schema.columns.front().names;
  schema.header = std::string(1, axis);
  if (is_rotary(axis))
    positions = {{schema.header, units::deg},
                 {schema.header + "_deg", units::deg},
                 {schema.header + "_rad"}};
  else
    positions = {{schema.header}, {schema.header + "_mm"}};
  for (const char* motion : {"EX", "EY", "EZ", "EA", "EB", "EC"}) {
    const std::string name = std::string(motion) + axis;
    schema.header += "," + name;
    if (parse_element_name(name).is_angle())
      schema.columns.push_back(
          {.names = {{name}, {name + "_rad"}, {name + "_urad", units::urad}}, .required = false});
    else
      schema.columns.push_back(
          {.names = {{name}, {name + "_mm"}, {name + "_um", units::um}}, .required = false});
  }
  schema.check_header = [axis](const TableFile& header) {
    if (header.order.size() < 2)
      header.throw_missing_column(fmt::format("an element, such as EX{}", axis));
  };
  return schema;
}

}  // namespace

ElementTable read_element_table(std::string_view text, const std::string& file,
                                std::size_t max_bytes) {
  const char axis = text.size() > max_bytes ? 'X' : header_axis(text, file);
  const TableFile file_table = read_table(text, file, element_table_schema(axis, max_bytes));
  ElementTable table{axis, file_table.values(0), {}, {}};
  table.values.resize(table.q.size(), Eigen::Index(file_table.order.size()) - 1);
  for (std::size_t i = 1; i < file_table.order.size(); ++i) {
    const std::size_t column = file_table.order[i];
    table.elements.push_back(parse_element_name(file_table.columns[column].head.substr(0, 3)));
    table.values.col(Eigen::Index(i) - 1) = file_table.values(column);
  }
  return table;
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
