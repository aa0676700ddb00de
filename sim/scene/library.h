#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/scene/toml.h"

/// The library of machines, errors, tools, materials, parts, programs and beliefs that abbe
/// installs.
namespace abbe::sim {

/// Prefix of the name of a library file, as in "library:gantry_cxyza".
inline constexpr std::string_view library_prefix = "library:";

/// Returns the library folder: the one that ABBE_LIBRARY names, else `scenes` beside the program,
/// as in a build, else that of the installation to which the program belongs.
/// @throws BadInput if there is none
std::filesystem::path library_folder();

/// A file name as written in a scene.
struct FileName {
  std::string_view name;
  Place place;
  std::string_view kind;  ///< library folder in which the bare name suffices, such as "machines";
                          ///< empty for a file that may be anywhere in the library
};

/// Returns the file that a name denotes. After `library:` follows a path in the library, or the
/// name of a file of its kind, with or without extension. Any other name is relative to `folder`
/// or, if no file exists there, to the library. An unknown library name is an error that lists the
/// contents of the library, nearest name first; the path beside the scene is returned.
std::filesystem::path locate_file(const FileName& name, const std::filesystem::path& folder,
                                  InputErrors& input_errors);

/// Returns the library file of "library:NAME", a path with or without extension.
/// @throws BadScene that lists the nearest names
std::filesystem::path library_file(const std::filesystem::path& name);

/// Returns "library:machines/gantry_cxyza.toml" for a file in the library, and any other name
/// unchanged.
std::string library_name(const std::filesystem::path& file);

/// Returns the library files of a kind in the form of a sentence, nearest to a name first:
/// "library:gantry_cxyza, library:lathe_zx"; empty without a library.
std::string library_names(std::string_view kind, std::string_view name);

}  // namespace abbe::sim
