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

/// The words of Klartext; those of several parts have no-break spaces between them, as TOOL CALL.
std::span<const WordTableEntry> heidenhain_words();

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::heidenhain {

using program::Cause;
using program::Target;

// A block of Klartext as text, and its words one by one.

/// A block: its lines, which all but the last end in ~, joined by blanks, without number and
/// comments.
struct Block {
  /// A line of it begins at `offset` of the text.
  struct Piece {
    std::size_t offset = 0;
    int line = 0;
    int column = 0;  ///< of its first byte, from 0
  };
  std::string_view text;     ///< of the line itself where there is only one
  std::string_view comment;  ///< behind ; or * of a block of no words
  std::size_t lines = 1;
  bool skipped = false;  ///< it begins with /
  std::vector<Piece> pieces;
  std::string joined;
};

/// Reads the block that begins at line `at` (from 0) into `block`, whose memory is used again.
void read_block(const std::vector<std::string_view>& lines, std::size_t at, Block& block);

/// The same fault at the line and column where what it points at stands.
BadInput relocate_error(const Block& block, const BadInput& fault);

/// The operators and functions of Q formulas; functions take what follows them, brackets or not.
const ExpressionGrammar& grammar();
/// The function of a formula that begins at the cursor, applied to what follows it; none if none
/// does.
std::optional<double> function_value(Cursor& cursor, Operands& parameters);

/// The words of a block from the left.
class Words {
 public:
  Words(Cursor cursor, Operands& parameters) : cursor(cursor), parameters_(parameters) {}

  bool at_end() {
    cursor.skip_blanks();
    return cursor.at_end();
  }
  /// Letters that begin there, in upper case; a Q parameter behind them is left. Empty if there is
  /// no letter.
  std::string name();
  bool take(std::string_view word) { return cursor.take_word(word); }
  /// A number or a Q parameter begins there.
  bool has_value() const;
  /// It. @throws BadInput
  double value();
  /// The same where it is a whole number of 0 to `most`.
  int whole(int most);
  /// A number or a name in quotes, as a label has. @throws BadInput
  std::string label();
  /// @throws BadInput unless nothing follows
  void ends();
  Cause cause(std::size_t from) const { return cursor.cause(from); }
  /// Refuses the word there, or behind blanks.
  [[noreturn]] void refuse(std::size_t from, std::string expected) const {
    while (from < cursor.text.size() && is_blank(cursor.text[from])) ++from;
    cursor.refuse(from, std::move(expected));
  }

  Cursor cursor;

 private:
  Operands& parameters_;
};

}  // namespace abbe::sim::dialects::heidenhain
