#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// Returns the word table of Klartext. Words of several parts, such as TOOL CALL, contain no-break
/// spaces.
std::span<const WordTableEntry> heidenhain_words();

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::heidenhain {

using program::Cause;
using program::Target;

/// A block of Klartext as text, without block number and comments. It may have several lines, which
/// end in ~ except for the last one; they are joined by blanks.
struct Block {
  /// A line of the block; it begins at `offset` of the joined text.
  struct BlockLine {
    std::size_t offset = 0;
    int line = 0;
    int column = 0;  ///< column of its first byte, from 0
  };
  std::string_view text;     ///< refers to the line itself if there is only one
  std::string_view comment;  ///< after ;, or after * in a block without words
  std::size_t line_count = 1;
  bool is_skipped = false;  ///< begins with /
  std::vector<BlockLine> block_lines;
  std::string joined;
};

/// Reads the block that begins at line `at` (from 0) into `block`, whose memory is reused.
void read_block(const std::vector<std::string_view>& lines, std::size_t at, Block& block);

/// Returns the error with the line and column in the file instead of those in the joined text.
BadInput relocate_error(const Block& block, const BadInput& input_error);

/// Returns the operators and functions of Q formulas. A function takes the value that follows, with
/// or without brackets.
const ExpressionGrammar& grammar();
/// Parses the function of a formula at the cursor and its argument, and returns the value. Returns
/// nothing if no function begins there.
std::optional<double> parse_function(Cursor& cursor, OperandParser& parameters);

/// Parser of the words of a block, from left to right.
class WordReader {
 public:
  WordReader(Cursor cursor, OperandParser& parameters) : cursor(cursor), parameters_(parameters) {}

  bool at_end() {
    cursor.skip_blanks();
    return cursor.at_end();
  }
  /// Parses the letters at the cursor, without a Q parameter that follows them, and returns them in
  /// upper case. Returns an empty text if there are none.
  std::string read_name();
  /// Advances past a word if it follows. Returns false and stays otherwise.
  bool accept(std::string_view word) { return cursor.accept_word(word); }
  /// Returns true if a number or a Q parameter follows.
  bool has_value() const;
  /// Parses the value that follows. Throws BadInput.
  double read_value();
  /// Parses an integer from 0 to `max`. Throws BadInput.
  int read_whole_number(int max);
  /// Parses a label: a number or a name in quotes. Throws BadInput.
  std::string read_label();
  /// Throws BadInput unless the block ends at the cursor.
  void expect_end();
  Cause cause(std::size_t from) const { return cursor.cause(from); }
  /// Throws BadInput at the word after byte `from` and blanks.
  [[noreturn]] void throw_input_error(std::size_t from, std::string expected) const {
    while (from < cursor.text.size() && is_blank(cursor.text[from])) ++from;
    cursor.throw_input_error(from, std::move(expected));
  }

  Cursor cursor;

 private:
  OperandParser& parameters_;
};

}  // namespace abbe::sim::dialects::heidenhain
