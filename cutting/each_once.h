#pragma once

#include <algorithm>
#include <vector>

namespace abbe::cutting {

/// Numbers in rising order without repeats.
inline std::vector<int> each_once(std::vector<int> numbers) {
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

}  // namespace abbe::cutting
