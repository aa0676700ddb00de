#include "sim/dialects/word_table.h"

#include <fmt/format.h>

namespace abbe::sim::dialects {

std::string_view name_of(Use use) {
  switch (use) {
    case Use::Read:
      return "read";
    case Use::WithoutEffect:
      return "without effect";
    case Use::Refused:
      return "refused";
  }
  return "";
}

const WordUse* find_word(std::span<const WordUse> table, std::string_view word) {
  for (const WordUse& line : table) {
    bool has = false;
    each_word(line.word, [&](std::string_view one) { has = has || one == word; });
    if (has) return &line;
  }
  return nullptr;
}

std::string markdown_table(std::span<const WordUse> table) {
  std::string text = "| word | | what it means |\n|---|---|---|\n";
  for (const WordUse& line : table)
    text += fmt::format("| `{}` | {} | {} |\n", line.word, name_of(line.use), line.sentence);
  return text;
}

}  // namespace abbe::sim::dialects
