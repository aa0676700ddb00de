#include "sim/cut/depth_looks.h"

#include <algorithm>
#include <iterator>
#include <map>

namespace abbe::sim {
namespace {

/// Some numbers of [first, end), evenly spread, the first and the last among them.
std::vector<std::size_t> spread(std::size_t first, std::size_t end) {
  constexpr std::size_t most = 24;
  std::vector<std::size_t> numbers;
  const std::size_t count = end - first, n = std::min(count, most);
  for (std::size_t k = 0; k < n; ++k)
    numbers.push_back(n == 1 ? first : first + k * (count - 1) / (n - 1));
  return numbers;
}

}  // namespace

DeepestLook deepest_look(std::size_t first, std::size_t end,
                         const std::vector<std::size_t>& block_ends,
                         const std::function<double(std::size_t)>& depth_at) {
  std::map<std::size_t, double> depths;
  const auto look = [&](std::size_t i) {
    if (!depths.contains(i)) depths.emplace(i, depth_at(i));
  };
  for (const std::size_t i : spread(first, end)) look(i);
  for (const std::size_t k : spread(0, block_ends.size()))
    look(std::clamp(block_ends[k], first, end - 1));
  const auto deepest = [&] {
    return std::ranges::max_element(depths, {}, [](const auto& one) { return one.second; });
  };
  constexpr int halvings = 10;
  for (int n = 0; n < halvings; ++n) {
    const auto most = deepest();
    const std::size_t at = most->first;
    const std::size_t before = most == depths.begin() ? at : std::prev(most)->first,
                      after = std::next(most) == depths.end() ? at : std::next(most)->first;
    look(at - (at - before) / 2);
    look(at + (after - at) / 2);
  }
  const auto most = deepest();
  return {most->second, most->first, depths.size()};
}

}  // namespace abbe::sim
