#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// Returns the path of the executable `abbe` that belongs to this code: that of the running
/// process, which can be run and read even if its file was replaced since, or the one set by
/// `name_program_file`.
std::filesystem::path program_file();

/// Returns the folder of that executable, relative to which scenes and libraries are found.
std::filesystem::path program_folder();

/// Sets the executable for libraries that run inside another process, such as a Python module. Must
/// be called before any other function of abbe.
void name_program_file(const std::filesystem::path& file);

/// Returns the version of abbe, "0.2.0".
std::string version();

/// Returns the versions of all software that affects the bits of a result, by name.
nlohmann::ordered_json versions();

}  // namespace abbe::sim
