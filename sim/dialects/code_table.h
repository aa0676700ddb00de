#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "sim/dialects/word_table.h"

/// G and M codes of controls that number them in tenths: G59.1 is 591.
namespace abbe::sim::dialects {

/// A line of a table of codes, "G54 G55", that are of one group of a dialect.
template <typename Group>
struct CodeLine {
  std::string_view words;
  Group group;
  Use use;
  std::string_view sentence;
  bool beside_motion = false;  ///< as `WordUse` has it, whatever the group says
};

/// What a table says of a code.
template <typename Group>
struct CodeFact {
  bool known = false;
  Group group = {};
  Use use = Use::Read;
  std::string_view sentence;
};

/// Tenths of a code as "G59.1" names it.
int tenths_of(std::string_view word);

/// Codes by letter and tenths.
template <typename Group>
class CodeTable {
 public:
  /// @param lines  of G and M; they outlive the table
  explicit CodeTable(std::span<const CodeLine<Group>> lines) {
    for (auto& one : facts_) one.resize(most_tenths);
    for (const CodeLine<Group>& line : lines)
      each_word(line.words, [&](std::string_view word) {
        facts_[word[0] == 'M'][std::size_t(tenths_of(word))] = {true, line.group, line.use,
                                                                line.sentence};
      });
  }

  /// @param letter  G or M
  const CodeFact<Group>& fact_of(char letter, int tenths) const {
    static const CodeFact<Group> unknown;
    if (tenths < 0 || tenths >= most_tenths) return unknown;
    return facts_[letter == 'M'][std::size_t(tenths)];
  }

 private:
  static constexpr int most_tenths = 10000;
  std::array<std::vector<CodeFact<Group>>, 2> facts_;  // of G and M
};

/// The lines of a dialect's table of words: those of its codes, then the others. The namespace of
/// the group has `is_beside_motion(Group)`.
template <typename Line>
std::vector<WordUse> joined_words(std::span<const Line> codes, std::span<const WordUse> others) {
  std::vector<WordUse> words;
  for (const Line& line : codes) words.push_back({line.words, line.use, line.sentence, line.beside_motion || is_beside_motion(line.group)});
  words.insert(words.end(), others.begin(), others.end());
  return words;
}

}  // namespace abbe::sim::dialects
