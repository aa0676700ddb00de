#include "sim/dialects/code_table.h"

#include <charconv>
#include <cmath>

namespace abbe::sim::dialects {

int tenths_of(std::string_view word) {
  double number = 0.0;
  std::from_chars(word.data() + 1, word.data() + word.size(), number);
  return int(std::lround(number * 10));
}

}  // namespace abbe::sim::dialects
