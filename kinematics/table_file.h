#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

/// Tables in text files: a header line with the names of the columns, then a row of cells a line.
namespace abbe {

/// A name of a column, and the size of one unit of its numbers in mm, rad, s or another base unit.
struct ColumnName {
  std::string head;  ///< with the unit, such as "target_deg"
  double unit = 1.0;
};

/// A column that a table may have.
struct TableColumn {
  enum class Content { Number, NumberOrEmpty, Integer, Text, Ignored };

  std::vector<ColumnName> names = {};  ///< at least one; a table uses at most one of them
  Content content = Content::Number;
  bool required = true;
  /// Range of the numbers after conversion to the base unit.
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool increasing = false;  ///< true if each number must exceed that of the row above
};

struct TableFile;

/// Description of a table.
struct TableSchema {
  std::string header = {};  ///< a typical header, for messages
  std::vector<TableColumn> columns = {};
  std::size_t leading_columns = 0;  ///< number of `columns` that come first, in this order
  /// Returns the description of a column that is not in `columns`, or nothing for an unknown
  /// column. Called once for each such column, from left to right.
  std::function<std::optional<TableColumn>(std::string_view head)> other_columns = {};
  /// Throws BadInput if the columns do not belong together. Called before the rows are read.
  std::function<void(const TableFile& header)> check_header = {};
  /// Possible separators of cells; the first that occurs in the header is used, else the last. A
  /// blank stands for blanks and tabs.
  std::string separators = ";, ";
  int max_exponent = 9;  ///< numbers are within +-10 to this power
  std::size_t max_bytes = std::numeric_limits<std::size_t>::max();
  std::size_t max_columns = 1000;
  std::size_t min_rows = 1;
  std::size_t max_rows = std::numeric_limits<std::size_t>::max();
};

/// Content of a table. It refers to the text from which it was read.
struct TableFile {
  struct Column {
    std::string head;  ///< as in the file; empty if the file lacks the column
    double unit = 1.0;
    int location = 0;                     ///< of the head in its line, from 1
    std::vector<double> numbers;          ///< (rows) in the unit of the file, NaN for an empty cell
    std::vector<std::string_view> texts;  ///< (rows) of a column of texts
  };

  std::string_view text;
  std::string file;
  char separator = ' ';
  Line header;
  std::vector<Column> columns;     ///< those of the schema in its order, then other columns
  std::vector<std::size_t> order;  ///< indices of the columns in the order of the file
  std::vector<int> line;           ///< (rows) line of each row, from 1

  std::size_t rows() const { return line.size(); }
  bool has(std::size_t column) const { return !columns[column].head.empty(); }
  /// Returns a number in the base unit; 0 if the file lacks the column.
  double value(std::size_t row, std::size_t column) const;
  /// Returns (rows) the numbers of a column in the base unit; zeros if the file lacks the column.
  Eigen::VectorXd values(std::size_t column) const;
  /// Returns the text of a row.
  std::string_view row_text(std::size_t row) const;

  /// Throws BadInput at a cell.
  /// @param seen  empty: the cell in quotes
  [[noreturn]] void throw_cell_error(std::size_t row, std::size_t column,
                                     const std::string& expected, std::string seen = {}) const;
  /// Throws BadInput at the name of a column.
  [[noreturn]] void throw_column_error(std::size_t column, const std::string& expected) const;
  /// Throws BadInput at the end of the header for a column that it lacks.
  [[noreturn]] void throw_missing_column(const std::string& expected) const;
};

/// Input errors of the rows of a table. The base class has the first.
struct BadTable : BadInput {
  explicit BadTable(std::vector<BadInput> errors);
  std::vector<BadInput> input_errors;
};

/// Reads a table. Byte order mark, LF and CR LF, blank lines and lines that begin with # are
/// skipped; every other row has as many cells as the header. `text` must outlive the table.
/// @param file  name in input errors
/// @throws BadInput with line and column for an unknown, repeated or missing column; BadTable with
///     the errors of up to 20 rows, one each: a missing or surplus cell, a cell that is not a
///     number, a number outside its range, a control byte, too many rows; BadInput for too few
///     rows, too many bytes or an encoding other than ASCII and UTF-8
TableFile read_table(std::string_view text, const std::string& file, const TableSchema& schema);

}  // namespace abbe
