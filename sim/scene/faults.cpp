#include "sim/scene/faults.h"

#include <algorithm>
#include <string_view>

namespace abbe::sim {

namespace {
constexpr std::size_t max_faults = 200;
}

void Faults::add(const Place& place, const std::string& expected, const std::string& seen) {
  add(BadInput(place.file ? *place.file : "", place.line, place.column, expected, seen));
}

void Faults::add(const BadInput& fault) {
  const auto same = [&](const BadInput& other) {
    return std::string_view(other.what()) == std::string_view(fault.what());
  };
  if (list_.size() > max_faults || std::any_of(list_.begin(), list_.end(), same)) return;
  if (list_.size() == max_faults) {
    list_.emplace_back(fault.file, 0, 0, "fewer than 200 faults", "more, which are not listed");
    return;
  }
  list_.push_back(fault);
}

}  // namespace abbe::sim
