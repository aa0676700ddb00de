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

/// The number in a unit; null where there is none.
nlohmann::ordered_json number(const std::optional<double>& value, double unit = 1.0);

/// [x, y, z]
nlohmann::ordered_json numbers(const Eigen::Vector3d& v);

inline constexpr std::size_t max_saved_bytes = std::size_t(256) << 20;

/// Makes something of JSON that a command of abbe left.
/// @param make  what the JSON lacks may end it with an exception of nlohmann's or with
///              std::invalid_argument
/// @throws BadInput naming the file, what was expected, and what of it is missing
void read_saved_json(
    const std::filesystem::path& file, const std::string& expected,
    const std::function<void(const nlohmann::ordered_json& json, const std::string& text)>& make);

/// Files in a folder and below it, but what nobody lets it look into.
std::vector<std::filesystem::path> saved_files(const std::filesystem::path& folder);

}  // namespace abbe::sim
