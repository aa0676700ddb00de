#pragma once

#include <filesystem>
#include <string_view>

namespace abbe::render {

/// Writes a whole file and makes sure that the system took every byte.
/// @throws std::system_error with the path and the system's reason
void write_bytes(const std::filesystem::path& path, std::string_view bytes);

}  // namespace abbe::render
