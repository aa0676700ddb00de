#include "kinematics/table_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace abbe {

namespace {

using Content = TableColumn::Content;

// A mistake such as a wrong unit repeats in every row, so 20 rows show it.
constexpr std::size_t max_row_errors = 20;

std::string_view without_unit(std::string_view head) { return head.substr(0, head.find('_')); }

/// Parser of a table.
class TableParser {
 public:
  TableParser(std::string_view text, const std::string& file, const TableSchema& schema)
      : lines_(text, file), schema_(schema), described_(schema.columns) {
    table_.text = text;
    table_.file = file;
    table_.columns.resize(described_.size());
  }

  TableFile read() {
    const auto header = lines_.next();
    if (!header)
      throw BadInput(table_.file, std::max(lines_.number(), 1), 1,
                     "a header such as " + schema_.header, "an empty table");
    table_.header = *header;
    read_header();
    std::vector<BadInput> errors;
    while (errors.size() < max_row_errors) {
      try {
        const auto line = lines_.next();
        if (!line) break;
        if (table_.rows() == schema_.max_rows) {
          errors.emplace_back(table_.file, line->number, 0,
                              fmt::format("at most {} rows", schema_.max_rows), "more");
          break;
        }
        read_row(*line);
      } catch (const BadInput& error) {
        errors.push_back(error);
      }
    }
    if (!errors.empty()) throw BadTable(std::move(errors));
    if (table_.rows() < schema_.min_rows)
      lines_.refuse(
          0, fmt::format("at least {} row{}", schema_.min_rows, schema_.min_rows == 1 ? "" : "s"),
          fmt::format("{}", table_.rows()));
    return std::move(table_);
  }

 private:
  void read_header() {
    const std::string_view text = table_.header.text;
    const auto is_in_header = [&](char c) { return text.find(c) != std::string_view::npos; };
    const auto separator = std::ranges::find_if(schema_.separators, is_in_header);
    table_.separator =
        separator == schema_.separators.end() ? schema_.separators.back() : *separator;
    for (const Cell& cell : split_cells(text, table_.separator, schema_.max_columns))
      add_column(cell);
    for (std::size_t k = 0; k < schema_.columns.size(); ++k)
      if (schema_.columns[k].required && !table_.has(k))
        table_.throw_missing_column("a column " + schema_.columns[k].names.front().head);
    if (schema_.check_header) schema_.check_header(table_);
  }

  void add_column(const Cell& cell) {
    const std::size_t i = table_.order.size();
    if (i == schema_.max_columns)
      lines_.refuse(cell.column, fmt::format("at most {} columns", schema_.max_columns), "more");
    const auto named = column_named(cell.text);
    if (!named || (i < schema_.leading_columns && named->first != i))
      lines_.refuse(cell, expected_name(cell.text, i));
    const auto [k, unit] = *named;
    if (table_.has(k) || !heads_.insert(cell.text).second)
      lines_.refuse(cell, "each column only once");
    table_.columns[k].head = std::string(cell.text);
    table_.columns[k].unit = unit;
    table_.columns[k].location = cell.column;
    table_.order.push_back(k);
  }

  /// Returns what is expected instead of a wrong name: names that differ from it in the unit only,
  /// if there are any.
  std::string expected_name(std::string_view head, std::size_t position) const {
    const bool is_leading = position < schema_.leading_columns;
    std::vector<std::string_view> names;
    for (std::size_t k = 0; k < schema_.columns.size(); ++k)
      if (!is_leading || k == position)
        for (const ColumnName& name : schema_.columns[k].names)
          // A name with a separator is a whole header, such as "time_s;X_mm".
          if (without_unit(name.head) == without_unit(head) &&
              head.find_first_of("; \t") == head.npos)
            names.push_back(name.head);
    if (!names.empty()) return fmt::format("{} as the column name", fmt::join(names, " or "));
    if (is_leading)
      return fmt::format("the column {} of {}", schema_.columns[position].names.front().head,
                         schema_.header);
    return "a column name of " + schema_.header;
  }

  /// Returns the index and the unit of the column with a name, or nothing. Adds a column that only
  /// `other_columns` describes.
  std::optional<std::pair<std::size_t, double>> column_named(std::string_view head) {
    for (std::size_t k = 0; k < schema_.columns.size(); ++k)
      for (const ColumnName& name : schema_.columns[k].names)
        if (name.head == head) return std::pair(k, name.unit);
    if (!schema_.other_columns || head.empty()) return std::nullopt;
    auto other = schema_.other_columns(head);
    if (!other) return std::nullopt;
    described_.push_back(std::move(*other));
    table_.columns.emplace_back();
    return std::pair(described_.size() - 1, described_.back().names.front().unit);
  }

  void read_row(const Line& line) {
    const std::size_t width = table_.order.size();
    const std::vector<Cell> cells = split_cells(line.text, table_.separator, width);
    const auto expected_cells = [&] { return fmt::format("{} cells, as in the header", width); };
    if (cells.size() < width)
      lines_.refuse(int(line.text.size()) + 1, expected_cells(), fmt::format("{}", cells.size()));
    if (cells.size() > width) lines_.refuse(cells[width].column, expected_cells(), "more");
    row_.clear();
    for (std::size_t i = 0; i < width; ++i) row_.push_back(number(cells[i], table_.order[i]));
    // A row is stored after all of its cells are known to be valid.
    for (std::size_t i = 0; i < width; ++i) {
      TableFile::Column& column = table_.columns[table_.order[i]];
      const Content content = described_[table_.order[i]].content;
      if (content == Content::Text)
        column.texts.push_back(cells[i].text);
      else if (content != Content::Ignored)
        column.numbers.push_back(row_[i]);
    }
    table_.line.push_back(line.number);
  }

  /// Returns the number in a cell of a column, NaN if the cell has none and needs none.
  double number(const Cell& cell, std::size_t k) const {
    const TableColumn& described = described_[k];
    const TableFile::Column& column = table_.columns[k];
    const Content content = described.content;
    if (content == Content::Text || content == Content::Ignored ||
        (content == Content::NumberOrEmpty && cell.text.empty()))
      return std::numeric_limits<double>::quiet_NaN();
    const auto x = finite_number(cell.text);
    const double value = x.value_or(0.0) * column.unit;
    const bool is_in_range = value >= described.min && value <= described.max;
    if (content == Content::Integer && !(x && *x == std::floor(*x) && is_in_range))
      lines_.refuse(cell, fmt::format("an integer from {} to {}", described.min, described.max));
    if (!x) lines_.refuse(cell, fmt::format("a number within +-1e{}", schema_.max_exponent));
    if (!is_in_range)
      lines_.refuse(cell, fmt::format("{} between {:.6g} and {:.6g}", column.head,
                                      described.min / column.unit, described.max / column.unit));
    if (described.increasing && !column.numbers.empty() && !(*x > column.numbers.back()))
      lines_.refuse(cell, column.head + " that increases from row to row");
    return *x;
  }

  /// Returns the number if the whole text is one within the limit of the schema.
  std::optional<double> finite_number(std::string_view text) const {
    double x = 0.0;
    // std::from_chars accepts no plus sign.
    if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
    const bool is_number = error == std::errc{} && end == text.data() + text.size();
    if (!is_number || !(std::abs(x) <= max_number_)) return std::nullopt;
    return x;
  }

  TableLineReader lines_;
  const TableSchema& schema_;
  const double max_number_ = std::pow(10.0, schema_.max_exponent);
  std::vector<TableColumn> described_;  // columns of the schema, then other columns
  TableFile table_;
  std::set<std::string_view> heads_;
  std::vector<double> row_;
};

}  // namespace

double TableFile::value(std::size_t row, std::size_t column) const {
  return has(column) ? columns[column].numbers[row] * columns[column].unit : 0.0;
}

Eigen::VectorXd TableFile::values(std::size_t column) const {
  const auto n = Eigen::Index(rows());
  if (!has(column)) return Eigen::VectorXd::Zero(n);
  return Eigen::Map<const Eigen::VectorXd>(columns[column].numbers.data(), n) *
         columns[column].unit;
}

std::string_view TableFile::row_text(std::size_t row) const {
  // The lines are counted again, because errors are rare and an index would take memory.
  LineReader lines(text);
  auto result = lines.next();
  while (result && lines.number() < line[row]) result = lines.next();
  return result.value_or("");
}

void TableFile::throw_cell_error(std::size_t row, std::size_t column, const std::string& expected,
                                 std::string seen) const {
  const auto i = std::size_t(std::ranges::find(order, column) - order.begin());
  const Cell cell = split_cells(row_text(row), separator, order.size()).at(i);
  if (seen.empty()) seen = quoted_excerpt(cell.text);
  throw BadInput(file, line[row], cell.column, expected, std::move(seen));
}

void TableFile::throw_column_error(std::size_t column, const std::string& expected) const {
  throw BadInput(file, header.number, columns[column].location, expected,
                 quoted_excerpt(columns[column].head));
}

void TableFile::throw_missing_column(const std::string& expected) const {
  throw BadInput(file, header.number, int(header.text.size()) + 1, expected, "none");
}

BadTable::BadTable(std::vector<BadInput> errors)
    : BadInput(errors.at(0)), input_errors(std::move(errors)) {}

TableFile read_table(std::string_view text, const std::string& file, const TableSchema& schema) {
  constexpr std::size_t MiB = 1 << 20;
  if (text.size() > schema.max_bytes)
    throw BadInput(file, 0, 0,
                   schema.max_bytes % MiB == 0
                       ? fmt::format("at most {} MiB", schema.max_bytes / MiB)
                       : fmt::format("at most {} bytes", schema.max_bytes),
                   fmt::format("{} bytes", text.size()));
  return TableParser(text, file, schema).read();
}

}  // namespace abbe
