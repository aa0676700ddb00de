#pragma once

#include <string>

#include "kinematics/fault_list.h"
#include "sim/scene/toml_tree.h"

namespace abbe::sim {

/// All that is wrong with a scene.
class Faults : public FaultList {
 public:
  using FaultList::add;
  void add(const Place& place, const std::string& expected, const std::string& seen);
};

}  // namespace abbe::sim
