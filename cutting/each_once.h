#pragma once

#include <algorithm>
#include <vector>

namespace abbe::cutting {

/// Values in rising order without repeats.
template <typename Value>
std::vector<Value> each_once(std::vector<Value> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

}  // namespace abbe::cutting
