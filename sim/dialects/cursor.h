#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/program/nc_block.h"

namespace abbe::sim::dialects {

char upper(char c);
bool is_digit(char c);
bool is_letter(char c);
bool is_blank(char c);

/// All lines of a text, as `Lines` gives them.
std::vector<std::string_view> lines_of_text(std::string_view text);

/// Where a front end stands in a line.
struct Cursor {
  std::string_view text;
  program::NcLocation place;
  std::size_t at = 0;
  int depth = 0;  ///< levels of the expression that is read there, `NestingLevel`

  bool at_end() const { return at >= text.size(); }
  char here() const { return at < text.size() ? text[at] : '\0'; }
  char next(std::size_t n = 1) const { return at + n < text.size() ? text[at + n] : '\0'; }
  void skip_blanks() {
    while (at < text.size() && (text[at] == ' ' || text[at] == '\t')) ++at;
  }
  /// Takes the text if it stands there after blanks, letters of either case.
  bool take(std::string_view wanted);
  /// The same, but not where a letter, digit or _ follows: a whole word.
  bool take_word(std::string_view wanted);
  /// From there to the next blank, for messages.
  std::string_view cell(std::size_t from) const;
  program::Cause cause(std::size_t from, std::size_t to) const {
    return {int(from) + 1, text.substr(from, to - from)};
  }
  program::Cause cause(std::size_t from) const { return cause(from, at); }
  /// @throws BadInput at a byte of the line
  [[noreturn]] void refuse(std::size_t from, std::string expected, std::string seen) const;
  /// The same; what is seen is the word there, or the end of the line.
  [[noreturn]] void refuse(std::size_t from, std::string expected) const;

  /// A number of digits with at most one point, a sign before it if `sign`; none if there is none,
  /// and then nothing is taken. Blanks within are passed over, as RS274 does, if `blanks_within`.
  /// @throws BadInput beyond 1e9
  std::optional<double> number(bool sign = true, bool blanks_within = false);
};

/// What a dialect does with a word.
enum class Use { Read, WithoutEffect, Refused };

/// A line of the table of words of a dialect: the one statement from which come refusals by name
/// and the table in the README of this folder.
struct WordTableEntry {
  std::string_view word;  ///< as a program has it, "G64"; several of one use together, "G54 G55"
  Use use = Use::Read;
  std::string_view sentence;  ///< what it means; where it is refused, what to do instead
  /// Axis words in its block are those of the motion in force. Those beside other words are their
  /// own: they have no effect, or are an error.
  bool beside_motion = false;
};

std::string_view name_of(Use use);

/// Calls `act(word)` for every word of a line, "G54 G55".
template <typename Act>
void each_word(std::string_view words, const Act& act) {
  for (std::size_t at = 0; at < words.size();) {
    const std::size_t end = std::min(words.find(' ', at), words.size());
    act(words.substr(at, end - at));
    at = end + 1;
  }
}

/// The line of a word, null where the dialect has none.
const WordTableEntry* find_word(std::span<const WordTableEntry> table, std::string_view word);

/// The table as Markdown.
std::string markdown_table(std::span<const WordTableEntry> table);

// G and M codes of controls that number them in tenths: G59.1 is 591.

/// A line of a table of codes, "G54 G55", that are of one group of a dialect.
template <typename Group>
struct CodeLine {
  std::string_view words;
  Group group;
  Use use;
  std::string_view sentence;
  bool beside_motion = false;  ///< as `WordTableEntry` has it, whatever the group says
};

/// What a table says of a code.
template <typename Group>
struct CodeEntry {
  bool known = false;
  Group group = {};
  Use use = Use::Read;
  std::string_view sentence;
};

/// Tenths of a code as "G59.1" names it.
int parse_tenths(std::string_view word);

/// Codes by letter and tenths.
template <typename Group>
class CodeTable {
 public:
  /// @param lines  of G and M; they outlive the table
  explicit CodeTable(std::span<const CodeLine<Group>> lines) {
    for (auto& one : facts_) one.resize(max_tenths);
    for (const CodeLine<Group>& line : lines)
      each_word(line.words, [&](std::string_view word) {
        facts_[word[0] == 'M'][std::size_t(parse_tenths(word))] = {true, line.group, line.use,
                                                                   line.sentence};
      });
  }

  /// @param letter  G or M
  const CodeEntry<Group>& find_entry(char letter, int tenths) const {
    static const CodeEntry<Group> unknown;
    if (tenths < 0 || tenths >= max_tenths) return unknown;
    return facts_[letter == 'M'][std::size_t(tenths)];
  }

 private:
  static constexpr int max_tenths = 10000;
  std::array<std::vector<CodeEntry<Group>>, 2> facts_;  // of G and M
};

/// The lines of a dialect's table of words: those of its codes, then the others. The namespace of
/// the group has `is_beside_motion(Group)`.
template <typename Line>
std::vector<WordTableEntry> joined_words(std::span<const Line> codes,
                                         std::span<const WordTableEntry> others) {
  std::vector<WordTableEntry> words;
  for (const Line& line : codes)
    words.push_back(
        {line.words, line.use, line.sentence, line.beside_motion || is_beside_motion(line.group)});
  words.insert(words.end(), others.begin(), others.end());
  return words;
}

/// A code of a block, such as G43.4.
template <typename Word>
struct TenthsCode {
  int tenths = -1;  ///< of the number: G43.4 is 434; -1 where the block has none
  Word word;
  explicit operator bool() const { return tenths >= 0; }
};

/// Words of a block by letter, or codes by group. Of many a block has few: only these are cleared.
template <typename T, std::size_t n>
class SparseSlots {
  static_assert(n <= 32);

 public:
  const T& operator[](std::size_t i) const { return all_[i]; }
  void put(std::size_t i, const T& one) {
    all_[i] = one;
    used_ |= std::uint32_t(1) << i;
  }
  auto begin() const { return all_.begin(); }
  auto end() const { return all_.end(); }
  bool empty() const { return used_ == 0; }
  void clear() {
    for (std::size_t i = 0; i < n && used_ >> i; ++i)
      if ((used_ >> i) & 1u) all_[i] = {};
    used_ = 0;
  }

 private:
  std::array<T, n> all_{};
  std::uint32_t used_ = 0;  ///< bits by slot
};

}  // namespace abbe::sim::dialects
