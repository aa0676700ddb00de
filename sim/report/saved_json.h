#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace abbe::sim {

inline constexpr std::size_t most_saved_bytes = std::size_t(256) << 20;

/// Makes something of JSON that a command of abbe left.
/// @param make  what the JSON lacks may end it with an exception of nlohmann's or with
///              std::invalid_argument
/// @throws BadInput naming the file, what was expected, and what of it is missing
void with_saved_json(
    const std::filesystem::path& file, const std::string& expected,
    const std::function<void(const nlohmann::ordered_json& json, const std::string& text)>& make);

/// Files in a folder and below it, but what nobody lets it look into.
std::vector<std::filesystem::path> saved_files(const std::filesystem::path& folder);

}  // namespace abbe::sim
