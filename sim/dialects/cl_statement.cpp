#include "sim/dialects/cl_statement.h"

#include <algorithm>
#include <array>
#include <utility>

#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects::cl {
namespace {

constexpr std::size_t most_items = 1000;
constexpr std::size_t most_lines = 200;  // of one statement
// What follows these is text to the end of the line, $ and all.
constexpr std::array<std::string_view, 9> text_words = {
    "PARTNO", "PPRINT", "REMARK", "INSERT", "TITLES", "LETTER", "PRINT", "TPRINT", "TOOL"};

bool is_word_byte(char c) { return is_letter(c) || is_digit(c) || c == '-' || c == '_'; }

/// The byte behind the blanks from `at`.
std::size_t behind_blanks(std::string_view text, std::size_t at) {
  while (at < text.size() && is_blank(text[at])) ++at;
  return at;
}

/// The first word of a line into the statement. @return the byte behind it
std::size_t take_major(std::string_view line, std::size_t at, Statement& statement) {
  const std::size_t from = at;
  statement.major.clear();
  if (at < line.size() && is_letter(line[at]))
    for (; at < line.size() && is_word_byte(line[at]); ++at) statement.major += upper(line[at]);
  statement.cause = {int(from) + 1, line.substr(from, at - from)};
  if (statement.major.empty()) statement.cause.text = line.substr(from);
  return at;
}

bool takes_text(const std::string& major) {
  return std::find(text_words.begin(), text_words.end(), major) != text_words.end();
}

/// The line up to its comment. @return whether it goes on in the next
bool cut_comment(std::string_view& line) {
  const std::size_t dollar = line.find('$');
  if (dollar == std::string_view::npos) return false;
  const bool goes_on = dollar + 1 >= line.size() || line[dollar + 1] != '$';
  line = line.substr(0, dollar);
  return goes_on;
}

/// Behind "$$->" or "$$ ->"; npos where the line has none.
std::size_t behind_arrow(std::string_view line, std::size_t at) {
  if (line.substr(at, 2) != "$$") return std::string_view::npos;
  at = behind_blanks(line, at + 2);
  return line.substr(at, 2) == "->" ? behind_blanks(line, at + 2) : std::string_view::npos;
}

}  // namespace

bool Item::is(std::string_view word) const {
  return text.size() == word.size() && std::equal(text.begin(), text.end(), word.begin(),
                                                  [](char a, char b) { return upper(a) == b; });
}

bool Statements::next(Statement& statement) {
  statement.items.clear();
  statement.pieces.clear();
  while (const auto whole = lines_.next()) {
    std::string_view line = *whole;
    std::size_t at = behind_blanks(line, 0);
    if (at == line.size()) continue;
    const std::size_t arrow = behind_arrow(line, at);
    statement.in_comment = arrow != std::string_view::npos;
    if (statement.in_comment) {
      at = arrow;
    } else if (line.substr(at, 2) == "$$") {
      continue;
    }
    statement.line = lines_.number();
    at = take_major(line, at, statement);
    if (takes_text(statement.major)) {
      statement.pieces.push_back({line, lines_.number(), at});
      return true;
    }
    bool goes_on = false;
    if (statement.in_comment && at >= line.size()) return true;
    std::string_view rest = line.substr(at);
    goes_on = cut_comment(rest);
    line = line.substr(0, at + rest.size());
    at = behind_blanks(line, at);
    if (at < line.size() && line[at] == '/') ++at;
    statement.pieces.push_back({line, lines_.number(), at});
    while (goes_on) {
      auto more = lines_.next();
      if (!more) break;
      goes_on = cut_comment(*more);
      if (statement.pieces.size() <= most_lines)
        statement.pieces.push_back({*more, lines_.number(), 0});
    }
    if (statement.major.empty() && statement.cause.text.starts_with('$')) continue;
    return true;
  }
  return false;
}

void read_items(Statement& statement, const program::Canon& canon) {
  if (statement.pieces.size() > most_lines)
    canon.refuse(statement.cause, "a statement of at most 200 lines", "more");
  bool separated = true;  // a comma, or nothing yet
  bool comma = false;
  Item last;
  for (const Statement::Piece& piece : statement.pieces)
    for (std::size_t at = behind_blanks(piece.text, piece.from); at < piece.text.size();
         at = behind_blanks(piece.text, at)) {
      Item item{{}, {}, piece.line, int(at) + 1};
      if (piece.text[at] == ',') {
        item.text = piece.text.substr(at, 1);
        if (separated) refuse(canon, item, "a value between the commas");
        separated = comma = true;
        last = item;
        ++at;
        continue;
      }
      const std::size_t end = std::min(piece.text.find_first_of(" \t,", at), piece.text.size());
      item.text = piece.text.substr(at, end - at);
      item.number = number_of(item.text);
      if (statement.items.size() == most_items)
        refuse(canon, item, "at most 1000 values in a statement");
      statement.items.push_back(item);
      separated = comma = false;
      at = end;
    }
  if (comma) refuse(canon, last, "a value behind the last comma", "none");
}

void refuse(const program::Canon& canon, const Item& item, std::string expected,
            std::optional<std::string> seen) {
  program::refuse({canon.place().file, item.line}, item.cause(), std::move(expected),
                  std::move(seen));
}

}  // namespace abbe::sim::dialects::cl
