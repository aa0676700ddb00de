#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Encoding of external text, and its lines, table cells and numbers.
namespace abbe {

/// Returns the position of the first byte that is not valid UTF-8; empty if all are valid.
std::optional<std::size_t> find_invalid_utf8(std::string_view text);

/// Throws one input error for a file in a foreign encoding, instead of one error per line.
/// @throws BadInput naming the encoding if the text is UTF-16, UTF-32, EBCDIC or binary; also for a
///         CR between two tokens without LF beside it, as in files whose lines end in CR alone
void check_encoding(std::string_view text, const std::string& file);

/// Returns the text without characters that only move a paper tape or a print head: NUL bytes at
/// either end of a line or of the text, and CR beside LF. Line numbers are unchanged.
std::string strip_tape_characters(std::string_view text);

// Nesting limit of external text. Parsers descend by recursion: without a limit, a file of brackets
// alone would overflow the stack.

/// Maximum number of nested brackets, signs, functions, parameters, tables or arrays.
inline constexpr int max_nesting = 100;

/// One level of a recursive descent; counts itself in `depth` during its lifetime.
class NestingLevel {
 public:
  explicit NestingLevel(int& depth) : depth_(depth) { ++depth_; }
  ~NestingLevel() { --depth_; }
  NestingLevel(const NestingLevel&) = delete;
  NestingLevel& operator=(const NestingLevel&) = delete;

  bool too_deep() const { return depth_ > max_nesting; }

 private:
  int& depth_;
};

/// Returns the nesting depth of the brackets and braces of a JSON text; those within strings are
/// ignored. JSON values are copied, written and destroyed by recursion, so callers check the depth
/// before parsing.
inline int json_depth(std::string_view text) {
  int depth = 0, deepest = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\') ++i;
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    if (c == '[' || c == '{') deepest = std::max(deepest, ++depth);
    if (c == ']' || c == '}') --depth;
  }
  return deepest;
}

// Reading of external text.

/// Returns the whole text of a file.
/// @throws BadInput if it cannot be read or is larger than `max_bytes`
std::string read_text(const std::filesystem::path& file, std::size_t max_bytes);

/// Iterator over the lines of a text, without byte order mark and without the CR of CR LF.
class LineReader {
 public:
  explicit LineReader(std::string_view text);
  std::optional<std::string_view> next();
  int number() const { return number_; }  ///< of the last line returned, from 1

 private:
  std::string_view rest_;
  int number_ = 0;
};

/// Returns at most the first 40 bytes of a text, non-printable ones as \xNN.
std::string shown(std::string_view text);
/// Returns the same excerpt in quotes; "nothing" if the text is empty.
std::string quoted_excerpt(std::string_view text);

/// A cell of a table row, without surrounding blanks.
struct Cell {
  std::string_view text;
  int column = 1;  ///< from 1
};

/// Returns the cell separator of a line: the first of ; and , that occurs, else ' ' for blanks and
/// tabs.
char cell_separator(std::string_view line);

/// Returns the cells of a line, at most `max_cells` + 1, so that a long line of separators costs
/// neither time nor memory.
std::vector<Cell> split_cells(std::string_view line, char separator, std::size_t max_cells);

/// Returns the number if the whole text is one within +-1e9, else empty. A larger number is a
/// mistake; with this limit, sums stay finite.
std::optional<double> number_of(std::string_view text);

/// A line of a table that has content.
struct Line {
  std::string_view text;
  int number = 0;
};

/// Iterator over the lines of a table that have content: empty lines and lines that begin with
/// `comment` are skipped. Input errors name the file and the last line returned.
class TableLineReader {
 public:
  TableLineReader(std::string_view text, std::string file, std::optional<char> comment = '#');

  /// Returns the next line; empty at the end. @throws BadInput for a control byte
  std::optional<Line> next();
  int number() const { return lines_.number(); }

  [[noreturn]] void refuse(int column, const std::string& expected, const std::string& seen) const;
  [[noreturn]] void refuse(const Cell& cell, const std::string& expected) const;

  /// Returns the number in a cell. @throws BadInput unless it is a number within +-1e9
  double number_in(const Cell& cell) const;
  /// Returns the whole number in a cell. @throws BadInput unless it is one from `min` to `max`
  int read_whole_number(const Cell& cell, int min, int max) const;

 private:
  LineReader lines_;
  std::string file_;
  std::optional<char> comment_;
};

}  // namespace abbe
