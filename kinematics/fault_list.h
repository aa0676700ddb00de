#pragma once

#include <cstddef>
#include <vector>

#include "kinematics/bad_input.h"

namespace abbe {

/// All that is wrong with something from outside, in the order found; a fault found twice is kept
/// once, and beyond 200 no more but one that says so.
class FaultList {
 public:
  static constexpr std::size_t most = 200;

  void add(const BadInput& fault);
  const std::vector<BadInput>& list() const { return list_; }
  bool empty() const { return list_.empty(); }
  bool full() const { return list_.size() > most; }

 private:
  std::vector<BadInput> list_;
};

}  // namespace abbe
