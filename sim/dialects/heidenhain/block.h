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

/// Returns the words of Klartext. Words of several parts, such as TOOL CALL, contain no-break
/// spaces.
std::span<const WordTableEntry> heidenhain_words();

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::heidenhain {

using program::Cause;
using program::Target;

// A block of Klartext as text, and the parser of its words.

/// A block: its lines, all but the last one ending in ~, joined by blanks, without block number and
/// comments.
struct Block {
  /// A line of the block; it begins at `offset` of the joined text.
  struct Piece {
    std::size_t offset = 0;
    int line = 0;
    int column = 0;  ///< of its first byte, from 0
  };
  std::string_view text;     ///< refers to the line itself if there is only one
  std::string_view comment;  ///< behind ;, or behind * in a block without words
  std::size_t lines = 1;
  bool skipped = false;  ///< begins with /
  std::vector<Piece> pieces;
  std::string joined;
};

/// Reads the block that begins at line `at` (from 0) into `block`, whose memory is reused.
void read_block(const std::vector<std::string_view>& lines, std::size_t at, Block& block);

/// Returns an error with the line and column in the file instead of those in the joined text.
BadInput relocate_error(const Block& block, const BadInput& fault);

/// Returns the operators and functions of Q formulas. A function takes the value that follows, with
/// or without brackets.
const ExpressionGrammar& grammar();
/// Returns the value of the function of a formula at the cursor, applied to what follows; nothing
/// if there is none.
std::optional<double> function_value(Cursor& cursor, OperandParser& parameters);

/// Parses the words of a block from left to right.
class Words {
 public:
  Words(Cursor cursor, OperandParser& parameters) : cursor(cursor), parameters_(parameters) {}

  bool at_end() {
    cursor.skip_blanks();
    return cursor.at_end();
  }
  /// Returns the letters at the cursor in upper case, without a Q parameter that follows them;
  /// empty if there are none.
  std::string name();
  bool take(std::string_view word) { return cursor.accept_word(word); }
  /// Returns true if a number or a Q parameter follows.
  bool has_value() const;
  /// Returns the value that follows. Throws BadInput.
  double value();
  /// Returns the value that follows, which must be a whole number of 0 to `most`.
  int whole(int most);
  /// Returns a label: a number or a name in quotes. Throws BadInput.
  std::string label();
  /// Throws BadInput unless nothing follows.
  void ends();
  Cause cause(std::size_t from) const { return cursor.cause(from); }
  /// Throws BadInput at the word there, after blanks.
  [[noreturn]] void refuse(std::size_t from, std::string expected) const {
    while (from < cursor.text.size() && is_blank(cursor.text[from])) ++from;
    cursor.refuse(from, std::move(expected));
  }

  Cursor cursor;

 private:
  OperandParser& parameters_;
};

}  // namespace abbe::sim::dialects::heidenhain
