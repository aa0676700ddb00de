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

// Functions for ASCII characters; unlike those of <cctype> they do not depend on the locale.

char upper(char c);
bool is_digit(char c);
bool is_letter(char c);
bool is_blank(char c);

/// Returns all lines of a text without their line ends.
std::vector<std::string_view> lines_of_text(std::string_view text);

/// A position in a line that is being parsed.
struct Cursor {
  std::string_view text;
  program::NcLocation location;
  std::size_t at = 0;
  int depth = 0;  ///< current nesting of the expression, see `NestingLevel`

  bool at_end() const { return at >= text.size(); }
  char current() const { return at < text.size() ? text[at] : '\0'; }
  char peek(std::size_t n = 1) const { return at + n < text.size() ? text[at + n] : '\0'; }
  void skip_blanks() {
    while (at < text.size() && (text[at] == ' ' || text[at] == '\t')) ++at;
  }
  /// Advances past `expected_text` (upper case) if it follows after blanks, in either case. Returns
  /// false and stays otherwise.
  bool accept(std::string_view expected_text);
  /// Same as `take`, but only for a whole word: no letter, digit or _ may follow.
  bool accept_word(std::string_view expected_text);
  /// Returns the text from a byte of the line to the next blank, for messages.
  std::string_view text_until_blank(std::size_t from) const;
  program::Cause cause(std::size_t from, std::size_t to) const {
    return {int(from) + 1, text.substr(from, to - from)};
  }
  program::Cause cause(std::size_t from) const { return cause(from, at); }
  /// Throws BadInput at a byte of the line.
  [[noreturn]] void throw_input_error(std::size_t from, std::string expected,
                                      std::string seen) const;
  /// Throws BadInput at a byte of the line and quotes the text there, or the end of the line.
  [[noreturn]] void throw_input_error(std::size_t from, std::string expected) const;

  /// Parses a number with at most one decimal point, and with a sign if `sign`. Returns nothing and
  /// stays if there is none. With `blanks_within` blanks inside the number are ignored, as in
  /// RS274. Throws BadInput beyond 1e9.
  std::optional<double> number(bool sign = true, bool blanks_within = false);
};

/// Treatment of a word by a dialect.
enum class WordTreatment {
  Read,
  WithoutEffect,  ///< read, but without effect on the motion
  Refused,        ///< an input error whose message names the word
};

/// An entry of the word table of a dialect. Both the messages that reject a word by name and the
/// table in the README of this folder are made from it.
struct WordTableEntry {
  /// The word as a program has it, "G64"; several words with one meaning together, "G54 G55".
  std::string_view word;
  WordTreatment use = WordTreatment::Read;
  std::string_view sentence;  ///< its meaning, or for a rejected word the alternative
  /// True if axis words in its block belong to the motion in force. Axis words with any other
  /// word belong to that word: they have no effect, or are an error.
  bool beside_motion = false;
};

/// Returns the name of a treatment, for example "without effect".
std::string_view name_of(WordTreatment use);

/// Calls `act(word)` for every word of an entry such as "G54 G55".
template <typename Act>
void each_word(std::string_view words, const Act& act) {
  for (std::size_t at = 0; at < words.size();) {
    const std::size_t end = std::min(words.find(' ', at), words.size());
    act(words.substr(at, end - at));
    at = end + 1;
  }
}

/// Returns the entry of a word, or null if the dialect does not have it.
const WordTableEntry* find_word(std::span<const WordTableEntry> table, std::string_view word);

/// Returns the table as Markdown.
std::string markdown_table(std::span<const WordTableEntry> table);

// Codes of controls that number G and M in tenths: G59.1 is 591.

/// An entry of a code table: codes such as "G54 G55" of one modal group.
template <typename Group>
struct CodeTableLine {
  std::string_view words;
  Group group;
  WordTreatment use;
  std::string_view sentence;
  bool beside_motion = false;  ///< as in `WordTableEntry`, whatever the group says
};

/// Properties of one code.
template <typename Group>
struct CodeProperties {
  bool known = false;
  Group group = {};
  WordTreatment use = WordTreatment::Read;
  std::string_view sentence;
};

/// Returns the tenths of a code written as "G59.1".
int parse_tenths(std::string_view word);

/// Table of the properties of codes by letter and tenths.
template <typename Group>
class CodeTable {
 public:
  /// `lines` holds the G and M codes and must outlive the table.
  explicit CodeTable(std::span<const CodeTableLine<Group>> lines) {
    for (auto& codes_of_letter : properties_) codes_of_letter.resize(max_tenths);
    for (const CodeTableLine<Group>& line : lines)
      each_word(line.words, [&](std::string_view word) {
        properties_[word[0] == 'M'][std::size_t(parse_tenths(word))] = {true, line.group, line.use,
                                                                        line.sentence};
      });
  }

  /// `letter` is G or M. Returns an entry with `known` false for a code that is not in the table.
  const CodeProperties<Group>& find_entry(char letter, int tenths) const {
    static const CodeProperties<Group> unknown;
    if (tenths < 0 || tenths >= max_tenths) return unknown;
    return properties_[letter == 'M'][std::size_t(tenths)];
  }

 private:
  static constexpr int max_tenths = 10000;
  std::array<std::vector<CodeProperties<Group>>, 2> properties_;  // G, then M
};

/// Returns the word table of a dialect: its codes, then its other words. The namespace of the group
/// must declare `is_beside_motion(Group)`.
template <typename Line>
std::vector<WordTableEntry> word_table(std::span<const Line> codes,
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
  int tenths = -1;  ///< ten times the number: G43.4 is 434; -1: the block has no such code
  Word word;
  explicit operator bool() const { return tenths >= 0; }
};

/// Words of a block by letter, or codes by group. A block uses few of the slots, and `clear` resets
/// only these.
template <typename T, std::size_t n>
class SparseSlots {
  static_assert(n <= 32);

 public:
  const T& operator[](std::size_t i) const { return slots_[i]; }
  void put(std::size_t i, const T& value) {
    slots_[i] = value;
    used_ |= std::uint32_t(1) << i;
  }
  auto begin() const { return slots_.begin(); }
  auto end() const { return slots_.end(); }
  bool empty() const { return used_ == 0; }
  void clear() {
    for (std::size_t i = 0; i < n && used_ >> i; ++i)
      if ((used_ >> i) & 1u) slots_[i] = {};
    used_ = 0;
  }

 private:
  std::array<T, n> slots_{};
  std::uint32_t used_ = 0;  ///< one bit per slot
};

}  // namespace abbe::sim::dialects
