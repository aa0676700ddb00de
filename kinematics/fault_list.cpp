#include "kinematics/fault_list.h"

#include <algorithm>
#include <string_view>

namespace abbe {

void FaultList::add(const BadInput& fault) {
  const auto same = [&](const BadInput& other) {
    return std::string_view(other.what()) == std::string_view(fault.what());
  };
  if (full() || std::any_of(list_.begin(), list_.end(), same)) return;
  if (list_.size() == most) {
    list_.emplace_back(fault.file, 0, 0, "fewer than 200 faults", "more, which are not listed");
    return;
  }
  list_.push_back(fault);
}

}  // namespace abbe
