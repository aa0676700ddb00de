#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/scene/toml.h"

/// The installed library of machines, errors, tools, materials, parts, programs and beliefs.
namespace abbe::sim {

/// Prefix of the name of a library file, as in "library:gantry_cxyza".
inline constexpr std::string_view library_prefix = "library:";

/// Returns the library folder: that of the environment variable ABBE_LIBRARY, else `scenes` beside
/// the program, as in a build folder, else that of the installation of the program.
/// @throws BadInput if there is none
std::filesystem::path library_folder();

/// A file name as written in a scene.
struct FileName {
  std::string_view name;
  SourcePosition position;
  std::string_view kind;  ///< library folder of such files, such as "machines"; the name may omit
                          ///< it. Empty for a file that may be anywhere in the library
};

/// Returns the file that a name denotes. `library:` is followed by a path in the library or by the
/// name of a file of its kind, with or without extension. Any other name is relative to `folder`
/// or, if no file exists there, to the library. An unknown library name is reported with the names
/// of the library, nearest first; the path in `folder` is returned.
std::filesystem::path locate_file(const FileName& name, const std::filesystem::path& folder,
                                  InputErrors& input_errors);

/// Returns the library file of "library:NAME", where NAME is a path with or without extension.
/// @throws BadScene with the nearest names if there is none
std::filesystem::path library_file(const std::filesystem::path& name);

/// Returns "library:machines/gantry_cxyza.toml" for a file in the library, and any other name
/// unchanged.
std::string library_name(const std::filesystem::path& file);

/// Returns the library files of a kind as text, nearest to a name first: "library:gantry_cxyza,
/// library:lathe_zx". Empty without a library.
std::string library_names(std::string_view kind, std::string_view name);

}  // namespace abbe::sim
