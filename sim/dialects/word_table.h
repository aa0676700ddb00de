#pragma once

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
};

std::string_view name_of(Use use);

/// The line of a word, null where the dialect has none.
const WordUse* find_word(std::span<const WordUse> table, std::string_view word);

/// The table as Markdown.
std::string markdown_table(std::span<const WordUse> table);

}  // namespace abbe::sim::dialects
