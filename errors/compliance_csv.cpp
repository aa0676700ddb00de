#include <algorithm>
#include <array>
#include <optional>

#include <fmt/format.h>

#include "errors/compliance_field.h"
#include "kinematics/bad_input.h"
#include "kinematics/encoding.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

constexpr std::string_view wanted_head = "x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N";

/// A column of the head: the coordinate it holds, or the entry of the compliance.
struct Column {
  std::string_view name;
  int row = 0;
  int entry = -1;  ///< column of the compliance; -1: coordinate `row`
  bool required = true;
};
constexpr std::array columns{Column{"x_mm", 0},
                             Column{"y_mm", 1},
                             Column{"z_mm", 2},
                             Column{"Cxx_um_per_N", 0, 0},
                             Column{"Cyy_um_per_N", 1, 1},
                             Column{"Czz_um_per_N", 2, 2},
                             Column{"Cxy_um_per_N", 0, 1, false},
                             Column{"Cyz_um_per_N", 1, 2, false},
                             Column{"Cxz_um_per_N", 0, 2, false}};

/// A line at a time, with its number for refusals.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : lines_(text), file_(file) {
    check_encoding(text, file);
  }

  [[noreturn]] void refuse(int column, const std::string& expected, const std::string& seen) const {
    throw BadInput(file_, lines_.number(), column, expected, seen);
  }

  /// Goes on to the next line that says something; false at the end.
  bool next() {
    while (const auto line = lines_.next()) {
      line_ = *line;
      const std::size_t start = line_.find_first_not_of(" \t");
      if (start != std::string_view::npos && line_[start] != '#') return true;
    }
    return false;
  }

  std::string_view line() const { return line_; }
  std::vector<Cell> cells(char separator) const {
    return cells_of(line_, separator, columns.size());
  }

 private:
  Lines lines_;
  std::string_view line_;
  const std::string& file_;
};

std::vector<const Column*> read_head(const Reader& reader, char separator) {
  std::vector<const Column*> head;
  for (const Cell& cell : reader.cells(separator)) {
    const auto found = std::find_if(columns.begin(), columns.end(),
                                    [&](const Column& c) { return c.name == cell.text; });
    if (found == columns.end())
      reader.refuse(cell.column, fmt::format("a column of a head such as {}", wanted_head),
                    in_quotes(cell.text));
    if (std::find(head.begin(), head.end(), &*found) != head.end())
      reader.refuse(cell.column, "every column once", in_quotes(cell.text));
    head.push_back(&*found);
  }
  for (const Column& column : columns) {
    if (column.required && std::find(head.begin(), head.end(), &column) == head.end())
      reader.refuse(int(reader.line().size()) + 1, fmt::format("a column {}", column.name), "none");
  }
  return head;
}

double number(const Reader& reader, const Cell& cell) {
  const std::optional<double> x = number_of(cell.text);
  if (!x) reader.refuse(cell.column, "a number within +-1e9", in_quotes(cell.text));
  return *x;
}

struct NodeRow {
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();
  Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
};

NodeRow read_row(const Reader& reader, const std::vector<const Column*>& head, char separator) {
  const std::vector<Cell> cells = reader.cells(separator);
  const std::string wanted = fmt::format("{} cells, as the head has", head.size());
  if (cells.size() < head.size())
    reader.refuse(int(reader.line().size()) + 1, wanted, fmt::format("{}", cells.size()));
  if (cells.size() > head.size()) reader.refuse(cells[head.size()].column, wanted, "more");
  NodeRow node;
  for (std::size_t i = 0; i < head.size(); ++i) {
    const Column& column = *head[i];
    const double x = number(reader, cells[i]);
    if (column.entry < 0) {
      node.point_w[column.row] = x;
    } else {
      node.C(column.row, column.entry) = x * units::um;
      node.C(column.entry, column.row) = x * units::um;
    }
  }
  const std::string fault = fault_of_node(node.point_w, node.C);
  if (!fault.empty()) reader.refuse(1, fault, in_quotes(reader.line()));
  return node;
}

}  // namespace

WorkpieceField read_compliance_field(std::string_view text, const std::string& file) {
  Reader reader(text, file);
  if (text.size() > max_field_bytes)
    reader.refuse(0, "at most 64 MiB", fmt::format("{} bytes", text.size()));
  if (!reader.next()) reader.refuse(0, fmt::format("a head such as {}", wanted_head), "nothing");
  const char separator = reader.line().find(';') != std::string_view::npos ? ';' : ',';
  const std::vector<const Column*> head = read_head(reader, separator);
  std::vector<double> points;
  WorkpieceField field;
  while (reader.next()) {
    const NodeRow node = read_row(reader, head, separator);
    points.insert(points.end(), node.point_w.data(), node.point_w.data() + 3);
    field.compliance_w.push_back(node.C);
  }
  if (field.compliance_w.empty()) reader.refuse(0, "at least one node", "none");
  field.points_w = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
      points.data(), Eigen::Index(field.compliance_w.size()), 3);
  return field;
}

}  // namespace abbe::errors
