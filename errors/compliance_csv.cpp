#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "errors/compliance_field.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

constexpr double largest = 1e9;  // mm or um/N; anything beyond is a slip
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

struct Cell {
  std::string_view text;
  int column = 1;
};

std::string shown(std::string_view text) {
  if (text.empty()) return "nothing";
  std::string result = "'";
  for (const char c : text.substr(0, 40)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > 40 ? "...'" : "'");
}

/// A line at a time, with its number for refusals.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : rest_(text), file_(file) {
    if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
  }

  [[noreturn]] void refuse(int column, const std::string& expected, const std::string& seen) const {
    throw BadInput(file_, number_, column, expected, seen);
  }

  /// Goes on to the next line that says something; false at the end.
  bool next() {
    while (!rest_.empty()) {
      const std::size_t end = rest_.find('\n');
      line_ = rest_.substr(0, end);
      rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
      ++number_;
      if (line_.ends_with('\r')) line_.remove_suffix(1);
      const std::size_t start = line_.find_first_not_of(" \t");
      if (start != std::string_view::npos && line_[start] != '#') return true;
    }
    return false;
  }

  std::string_view line() const { return line_; }

  /// Cells of the line, but no more than one beyond what a head can have.
  std::vector<Cell> cells(char separator) const {
    std::vector<Cell> result;
    std::size_t at = 0;
    while (result.size() <= columns.size()) {
      const std::size_t end = std::min(line_.find(separator, at), line_.size());
      std::size_t from = at, to = end;
      while (from < to && (line_[from] == ' ' || line_[from] == '\t')) ++from;
      while (to > from && (line_[to - 1] == ' ' || line_[to - 1] == '\t')) --to;
      result.push_back({line_.substr(from, to - from), int(from) + 1});
      if (end == line_.size()) break;
      at = end + 1;
    }
    return result;
  }

 private:
  std::string_view rest_;
  std::string_view line_;
  const std::string& file_;
  int number_ = 0;
};

std::vector<const Column*> read_head(const Reader& reader, char separator) {
  std::vector<const Column*> head;
  for (const Cell& cell : reader.cells(separator)) {
    const auto found = std::find_if(columns.begin(), columns.end(),
                                    [&](const Column& c) { return c.name == cell.text; });
    if (found == columns.end())
      reader.refuse(cell.column, fmt::format("a column of a head such as {}", wanted_head),
                    shown(cell.text));
    if (std::find(head.begin(), head.end(), &*found) != head.end())
      reader.refuse(cell.column, "every column once", shown(cell.text));
    head.push_back(&*found);
  }
  for (const Column& column : columns) {
    if (column.required && std::find(head.begin(), head.end(), &column) == head.end())
      reader.refuse(int(reader.line().size()) + 1, fmt::format("a column {}", column.name), "none");
  }
  return head;
}

double number(const Reader& reader, const Cell& cell) {
  double x = 0.0;
  std::string_view digits = cell.text;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  const auto [end, fault] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
  if (fault != std::errc{} || end != digits.data() + digits.size() || !(std::abs(x) <= largest))
    reader.refuse(cell.column, "a number within +-1e9", shown(cell.text));
  return x;
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
  if (!fault.empty()) reader.refuse(1, fault, shown(reader.line()));
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
