#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// The program `abbe` of this build or installation, to be run or read: the executable that runs,
/// also where its file was replaced meanwhile, or the one that was named.
std::filesystem::path program_file();

/// The folder it stands in, from which scenes and libraries are found.
std::filesystem::path program_folder();

/// Names it where these libraries run inside another's process, as a Python module does; before
/// anything else of abbe is called.
void name_program_file(const std::filesystem::path& file);

/// Of abbe itself, "0.2.0".
std::string version();

/// Versions of everything that shapes the bits of a result.
nlohmann::ordered_json versions();

}  // namespace abbe::sim
