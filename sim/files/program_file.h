#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

/// The executable of abbe and its version.
namespace abbe::sim {

/// Returns the path of the executable `abbe` that contains this code: the one set by
/// `name_program_file`, otherwise that of the running process, which can be run and read even if
/// its file was replaced meanwhile.
std::filesystem::path program_file();

/// Returns the folder of the executable, from which the paths of scenes and libraries are derived.
std::filesystem::path program_folder();

/// Sets the path of the executable for a library that runs inside another process, such as the
/// Python module. Must be called before any other function of abbe.
void name_program_file(const std::filesystem::path& file);

/// Returns the version of abbe, for example "0.2.0".
std::string version();

/// Returns the name and version of all software that affects the bits of a result.
nlohmann::ordered_json versions();

}  // namespace abbe::sim
