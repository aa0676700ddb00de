#include "sim/report/json_numbers.h"

#include <nlohmann/json.hpp>

namespace abbe::sim {

using nlohmann::ordered_json;

ordered_json number(const std::optional<double>& value, double unit) {
  return value ? ordered_json(*value / unit) : ordered_json();
}

ordered_json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace abbe::sim
