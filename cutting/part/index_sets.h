#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace abbe::cutting {

/// Returns the values in ascending order without duplicates.
template <typename Value>
std::vector<Value> sorted_unique(std::vector<Value> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

/// Disjoint sets (union-find). A set is identified by its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t n) : parent_(n) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  /// Returns the smallest member of the set of i.
  int representative(int i) {
    while (parent_[std::size_t(i)] != i) {
      int& parent = parent_[std::size_t(i)];
      parent = parent_[std::size_t(parent)];
      i = parent;
    }
    return i;
  }
  void join(int a, int b) {
    a = representative(a);
    b = representative(b);
    parent_[std::size_t(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<int> parent_;
};

}  // namespace abbe::cutting
