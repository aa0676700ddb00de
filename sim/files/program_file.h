#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// Returns the executable `abbe` of this build or installation, to be run or read: the running
/// executable, even if its file was replaced meanwhile, or the one that was named.
std::filesystem::path program_file();

/// Returns its folder, from which scenes and libraries are found.
std::filesystem::path program_folder();

/// Names the executable if these libraries run inside another process, such as a Python module;
/// must be called before any other function of abbe.
void name_program_file(const std::filesystem::path& file);

/// Returns the version of abbe, "0.2.0".
std::string version();

/// Returns the versions of everything that affects the bits of a result.
nlohmann::ordered_json versions();

}  // namespace abbe::sim
