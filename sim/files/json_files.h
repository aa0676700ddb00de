#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// Returns the number in a unit; null if there is none.
nlohmann::ordered_json number(const std::optional<double>& value, double unit = 1.0);

/// Returns [x, y, z].
nlohmann::ordered_json numbers(const Eigen::Vector3d& v);

inline constexpr std::size_t max_saved_bytes = std::size_t(256) << 20;

/// Reads JSON that a command of abbe wrote and passes it to `make`.
/// @param make  may throw an exception of nlohmann or std::invalid_argument if the JSON is
/// incomplete
/// @throws BadInput naming the file, what was expected, and what is missing
void read_saved_json(
    const std::filesystem::path& file, const std::string& expected,
    const std::function<void(const nlohmann::ordered_json& json, const std::string& text)>& make);

/// Returns all files in a folder and below, except where permission is denied.
std::vector<std::filesystem::path> saved_files(const std::filesystem::path& folder);

}  // namespace abbe::sim
