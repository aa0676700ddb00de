#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/scene/toml.h"

/// The machines, errors, tools, materials, parts, programs and beliefs that come with abbe.
namespace abbe::sim {

/// What stands before the name of a file of the library: "library:gantry_cxyza".
inline constexpr std::string_view library_prefix = "library:";

/// Where the library is: the folder that ABBE_LIBRARY names, else `scenes` beside the program, as
/// in a build, else that of the installation to which the program belongs.
/// @throws BadInput where there is none
std::filesystem::path library_folder();

/// A name as a scene writes it.
struct FileName {
  std::string_view name;
  Place place;
  std::string_view kind;  ///< folder of the library in which its name alone is enough: "machines";
                          ///< empty for a file that may be anywhere in it
};

/// The file that a name means. After `library:` stands a path in the library, or the name of a
/// file of its kind, with or without its ending. Any other name is relative to `folder`, and where
/// no file is there, to the library. A name that means nothing there is a fault that lists what
/// the library has, the nearest first, and is returned as a path beside the scene.
std::filesystem::path locate_file(const FileName& name, const std::filesystem::path& folder,
                                  InputErrors& input_errors);

/// The file of the library that "library:NAME" means, a path in it with or without its ending.
/// @throws BadScene that lists the nearest names
std::filesystem::path library_file(const std::filesystem::path& name);

/// "library:machines/gantry_cxyza.toml" of a file in the library, any other as it is.
std::string library_name(const std::filesystem::path& file);

/// What the library has of a kind, as a sentence says it, the nearest to a name first:
/// "library:gantry_cxyza, library:lathe_zx"; empty where there is no library.
std::string library_names(std::string_view kind, std::string_view name);

}  // namespace abbe::sim
