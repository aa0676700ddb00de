#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <string_view>

namespace abbe::sim::dialects {

/// What a dialect does with a word.
enum class Use { Read, WithoutEffect, Refused };

/// A line of the table of words of a dialect: the one statement from which come refusals by name
/// and the table in the README of this folder.
struct WordUse {
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
const WordUse* find_word(std::span<const WordUse> table, std::string_view word);

/// The table as Markdown.
std::string markdown_table(std::span<const WordUse> table);

}  // namespace abbe::sim::dialects
