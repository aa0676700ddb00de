#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Text from outside, as every reader takes it apart.
namespace abbe {

/// Whole text of a file.
/// @throws BadInput if it cannot be read or is larger than `max_bytes`
std::string read_text(const std::filesystem::path& file, std::size_t max_bytes);

/// Walks through the lines of a text; a byte order mark and the CR of a CRLF are left out.
class Lines {
 public:
  explicit Lines(std::string_view text);
  std::optional<std::string_view> next();
  int number() const { return number_; }  ///< of the line last given, from 1

 private:
  std::string_view rest_;
  int number_ = 0;
};

/// At most 40 bytes of something seen, unprintable ones as \xNN.
std::string shown(std::string_view text);
/// The same between quotes; "nothing" if it is empty.
std::string in_quotes(std::string_view text);

/// One cell of a line of a table, without the blanks around it.
struct Cell {
  std::string_view text;
  int column = 1;  ///< from 1
};

/// What parts the cells of a line: the first of ; and , that it has, else blanks and tabs (' ').
char separator_of(std::string_view line);

/// Cells of a line, but no more than one beyond `most`, so that a line of nothing but separators
/// costs nothing.
std::vector<Cell> cells_of(std::string_view line, char separator, std::size_t most);

/// The whole text as a number within +-1e9 (beyond is a mistake, and sums of it stay finite).
std::optional<double> number_of(std::string_view text);

/// A line that says something.
struct Line {
  std::string_view text;
  int number = 0;
};

/// The lines of a table that say something, one after another: empty lines and those that begin
/// with `comment` are passed over. Refusals name the file and the line last given.
class TableLines {
 public:
  TableLines(std::string_view text, std::string file, std::optional<char> comment = '#');

  /// @throws BadInput for a control byte
  std::optional<Line> next();
  int number() const { return lines_.number(); }

  [[noreturn]] void refuse(int column, const std::string& expected, const std::string& seen) const;
  [[noreturn]] void refuse(const Cell& cell, const std::string& expected) const;

  /// The number that a cell holds. @throws BadInput unless it is one within +-1e9
  double number_in(const Cell& cell) const;
  /// A whole number. @throws BadInput unless it is one from `least` to `most`
  int count_in(const Cell& cell, int least, int most) const;

 private:
  Lines lines_;
  std::string file_;
  std::optional<char> comment_;
};

}  // namespace abbe
