#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>

namespace abbe::oracles {

/// Where LinuxCNC's packages are unpacked (usr below): the folder that the environment variable
/// ABBE_LINUXCNC names, else where `./abbe setup --linuxcnc` puts them, if they are there.
inline std::optional<std::filesystem::path> linuxcnc_folder() {
  const char* named = std::getenv("ABBE_LINUXCNC");
  if (named != nullptr && *named != '\0') return std::filesystem::absolute(named);
  const auto unpacked = std::filesystem::path(ABBE_SOURCE_DIR) / "build/linuxcnc";
  if (!std::filesystem::is_directory(unpacked / "usr")) return std::nullopt;
  return unpacked;
}

}  // namespace abbe::oracles
