#pragma once

#include <filesystem>
#include <optional>

namespace abbe::sim::dialects {

/// The folder that holds LinuxCNC's interpreter as usr/bin/rs274: what the environment variable
/// ABBE_LINUXCNC names, else `linuxcnc` beside the build (`./abbe setup --linuxcnc`), else the
/// system's own.
/// @return none where there is none
std::optional<std::filesystem::path> linuxcnc_packages();

/// The library that, preloaded into rs274, gives its numbers all their digits.
/// @throws BadInput where it was not built or installed
std::filesystem::path all_digits_library();

}  // namespace abbe::sim::dialects
