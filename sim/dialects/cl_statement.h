#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/text.h"
#include "sim/dialects/program_run.h"

/// APT statements as text: `MAJOR / item, item, ...`, over several lines with $.
namespace abbe::sim::dialects::cl {

using program::Cause;

/// A number or a word behind the slash.
struct Item {
  std::string_view text;
  std::optional<double> number;  ///< none: it is a word
  int line = 0, column = 0;      ///< from 1

  Cause cause() const { return {column, text}; }
  /// It is this word, letters of either case.
  bool is(std::string_view word) const;
};

/// A line, or as many as $ joins, without comments.
struct Statement {
  std::string major;  ///< first word, upper case; empty where there is none
  Cause cause;        ///< of the major word
  int line = 0;
  bool in_comment = false;  ///< it stands behind "$$->", as Creo writes what no processor needs
  std::vector<Item> items;  ///< once `read_items` has read them

  struct Piece {
    std::string_view text;
    int line = 0;
    std::size_t from = 0;  ///< byte at which the items begin
  };
  std::vector<Piece> pieces;
};

/// Walks through the statements of a program.
class Statements {
 public:
  explicit Statements(std::string_view text) : lines_(text) {}
  /// The next one that says something, its items not yet read.
  /// @return false at the end of the text
  bool next(Statement& statement);

 private:
  Lines lines_;
};

/// Takes the items apart: between commas, or blanks.
/// @throws BadInput for nothing between commas, 1000 items, 200 lines of one statement
void read_items(Statement& statement, const program::Canon& canon);

/// Refuses an item at its own line.
[[noreturn]] void refuse(const program::Canon& canon, const Item& item, std::string expected,
                         std::optional<std::string> seen = {});

}  // namespace abbe::sim::dialects::cl
