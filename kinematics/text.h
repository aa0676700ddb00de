#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Texts from outside that are no text, or one of another encoding than ASCII and UTF-8.
namespace abbe {

/// Returns the first byte that is not UTF-8; none if all are.
std::optional<std::size_t> find_invalid_utf8(std::string_view text);

/// One input error for a file that no reader of text understands, instead of one a line.
/// @throws BadInput with the encoding: UTF-16, UTF-32, EBCDIC, or none, and for a CR between words
///         without a LF beside it, as in texts whose lines end in CR alone
void check_encoding(std::string_view text, const std::string& file);

/// The text without what only moves a paper tape or a print head: NUL bytes at either end of a line
/// or of the text, and CR beside LF. Lines keep their numbers.
std::string strip_tape_characters(std::string_view text);

// The one limit on how deep a text from outside may nest. Readers descend by recursion: without it
// a file of nothing but brackets ends the stack.

/// Levels of brackets, signs, functions, parameters, tables or arrays within each other.
inline constexpr int max_nesting = 100;

/// One level of a recursive descent, counted in `depth` while it lives.
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

/// Returns how deep the brackets and braces of a JSON text nest, those in strings left out. Its
/// values are copied, written and thrown away by recursion, so this is asked before it is parsed.
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

// Text from outside, as every reader takes it apart.

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
char cell_separator(std::string_view line);

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
  int whole_number_in(const Cell& cell, int least, int most) const;

 private:
  Lines lines_;
  std::string file_;
  std::optional<char> comment_;
};

}  // namespace abbe
