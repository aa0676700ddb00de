#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/dialect.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// A word of a program that stands in the table of its dialect.
struct UsedWord {
  std::string word;  ///< as the table has it, "G1" of G01
  Use use = Use::Read;
  std::string_view sentence;
  std::size_t count = 0;  ///< how often it stands in the file; not how often it is executed
  int line = 0;           ///< of the first
};

/// The words of a program in the order in which they first stand there, comments and texts left
/// out; of a table of locations none.
/// @param turning  read as for a turning control
std::vector<UsedWord> used_words(std::string_view text, Dialect dialect, bool turning = false);

}  // namespace abbe::sim::dialects
