#pragma once

#include <string>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/scene/toml_tree.h"

namespace abbe::sim {

/// All that is wrong, in the order found; a fault found twice is kept once, and beyond 200 no more.
class Faults {
 public:
  void add(const Place& place, const std::string& expected, const std::string& seen);
  void add(const BadInput& fault);
  const std::vector<BadInput>& list() const { return list_; }
  bool empty() const { return list_.empty(); }

 private:
  std::vector<BadInput> list_;
};

}  // namespace abbe::sim
