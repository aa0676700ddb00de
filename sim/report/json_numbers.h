#pragma once

#include <optional>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// The number in a unit; null where there is none.
nlohmann::ordered_json number(const std::optional<double>& value, double unit = 1.0);

/// [x, y, z]
nlohmann::ordered_json numbers(const Eigen::Vector3d& v);

}  // namespace abbe::sim
