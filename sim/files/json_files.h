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

/// JSON values, and the JSON files that commands of abbe wrote.
namespace abbe::sim {

/// Returns `value` in the given unit as a JSON number; null if there is no value.
nlohmann::ordered_json number(const std::optional<double>& value, double unit = 1.0);

/// Returns the vector as the JSON array [x, y, z].
nlohmann::ordered_json numbers(const Eigen::Vector3d& v);

inline constexpr std::size_t max_saved_bytes = std::size_t(256) << 20;

/// Reads a JSON file that a command of abbe wrote and passes its contents to `parse`.
/// @param parse  may throw an exception of nlohmann or std::invalid_argument if the JSON is
/// incomplete
/// @throws BadInput naming the file, `expected`, and what is missing
void read_saved_json(
    const std::filesystem::path& file, const std::string& expected,
    const std::function<void(const nlohmann::ordered_json& json, const std::string& text)>& parse);

/// Returns all regular files in a folder and its subfolders; folders without read permission are
/// skipped.
std::vector<std::filesystem::path> files_below(const std::filesystem::path& folder);

}  // namespace abbe::sim
