#include "sim/scene/library.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "sim/files/program_file.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {
namespace {

using std::filesystem::path;

constexpr std::array endings{".toml", ".csv", ".ngc", ".nc",  ".tap", ".pvt",
                             ".stl",  ".obj", ".off", ".ply", ".txt", ".vtu"};
constexpr std::size_t names_listed = 12;

bool is_file(const path& file) {
  std::error_code failure;
  return std::filesystem::is_regular_file(file, failure);
}

bool is_library(const path& folder) {
  std::error_code failure;
  // The folder of machines serves as the mark of a library.
  return std::filesystem::is_directory(folder / "machines", failure);
}

/// Returns the files below one folder of the library, as sorted paths in the library.
std::vector<path> files_of(const path& library, std::string_view kind) {
  std::vector<path> files;
  // The error code keeps a missing folder from throwing; such a folder has no files.
  std::error_code failure;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(library / kind, failure)) {
    const bool known = std::ranges::find(endings, entry.path().extension()) != endings.end();
    if (known && is_file(entry.path())) files.push_back(entry.path().lexically_relative(library));
  }
  // The order of a directory listing depends on the file system, and messages must not.
  std::ranges::sort(files);
  return files;
}

path strip_extension(path file) { return file.replace_extension(); }

/// Returns the shortest name that denotes this file alone.
std::string shortest(const path& file, const std::vector<path>& files, std::string_view kind) {
  const auto same = [&](const path& other) {
    return strip_extension(other) == strip_extension(file);
  };
  // Files such as a program and its tool table may differ in the extension only.
  const path name = std::ranges::count_if(files, same) > 1 ? file : strip_extension(file);
  return std::string(library_prefix) +
         (kind.empty() ? name : name.lexically_relative(kind)).generic_string();
}

/// Returns the files that a name may denote, by its path in the library or in the folder of its
/// kind.
std::vector<path> meant(const path& name, const std::vector<path>& files, std::string_view kind) {
  std::vector<path> found;
  for (const path& file : files)
    for (const path& in : {path(), path(kind)})
      if (in / name == file || in / name == strip_extension(file)) {
        found.push_back(file);
        // With an empty kind both folders coincide, and the file must not be found twice.
        break;
      }
  return found;
}

std::string listed(std::vector<path> files, std::string_view kind, std::string_view name) {
  const std::vector<path> all = files;
  const auto far = [&](const path& file) {
    return edit_distance(path(name).stem().string(), file.stem().string());
  };
  // The nearest name comes first, since the list is cut and a misspelling is the usual cause.
  std::ranges::stable_sort(files, {}, far);
  std::string text;
  for (std::size_t i = 0; i < std::min(files.size(), names_listed); ++i)
    text += (i == 0 ? "" : ", ") + shortest(files[i], all, kind);
  if (files.size() > names_listed) text += fmt::format(" and {} more", files.size() - names_listed);
  return text;
}

path in_library(const FileName& wanted, InputErrors& input_errors) {
  const path name = path(wanted.name.substr(library_prefix.size())).lexically_normal();
  const path library = library_folder();
  std::vector<path> found = meant(name, files_of(library, ""), wanted.kind);
  if (found.size() == 1) return library / found.front();
  if (found.size() > 1) {
    input_errors.add(wanted.place, "one of " + listed(found, "", name.string()),
                     fmt::format("\"{}\", which may mean each of them", wanted.name));
  } else {
    // Names of the wanted kind only, because other files would not fit the section.
    const std::vector<path> files = files_of(library, wanted.kind);
    input_errors.add(wanted.place,
                     "a name of the library: " + listed(files, wanted.kind, name.string()),
                     fmt::format("\"{}\"", wanted.name));
  }
  return name;
}

}  // namespace

path library_folder() {
  // The variable takes precedence, so that a user can replace the installed library.
  if (const char* named = std::getenv("ABBE_LIBRARY")) {
    // A wrong variable is an error and not ignored, as results would else come from another
    // library.
    if (is_library(named)) return std::filesystem::canonical(named);
    throw BadInput("ABBE_LIBRARY", 0, 0, "a folder that has abbe's machines/", named);
  }
  const path program = program_folder();
  for (const path& folder : {program / "scenes", program / ABBE_LIBRARY_FROM_PROGRAM})
    if (is_library(folder)) return std::filesystem::canonical(folder);
  throw BadInput("library:", 0, 0,
                 fmt::format("the library of abbe in {} (or ABBE_LIBRARY=FOLDER)",
                             (program / ABBE_LIBRARY_FROM_PROGRAM).lexically_normal().string()),
                 "no such folder");
}

path locate_file(const FileName& name, const path& folder, InputErrors& input_errors) {
  const path beside = (folder / name.name).lexically_normal();
  try {
    if (name.name.starts_with(library_prefix)) return in_library(name, input_errors);
    const path inside = path(name.name).lexically_normal();
    // Names with `..` leave the library and are never looked up in it.
    if (is_file(beside) || inside.is_absolute() || *inside.begin() == "..") return beside;
    const path file = library_folder() / inside;
    return is_file(file) ? file : beside;
  } catch (const BadInput& fault) {  // without a library only a name with the prefix is an error
    if (name.name.starts_with(library_prefix))
      input_errors.add(name.place, fault.expected, fault.seen);
    return beside;
  }
}

path library_file(const path& name) {
  InputErrors input_errors;
  const std::string text = name.string();
  const Place place{std::make_shared<const std::string>(text), 0, 0, true};
  const path file = locate_file({text, place, ""}, "", input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  return file;
}

std::string library_name(const path& file) {
  try {
    const path inside = file.lexically_relative(library_folder());
    if (!inside.empty() && *inside.begin() != "..")
      return std::string(library_prefix) + inside.generic_string();
  } catch (const BadInput&) {
    // without a library no file is in it
  }
  return file.string();
}

std::string library_names(std::string_view kind, std::string_view name) {
  try {
    return listed(files_of(library_folder(), kind), kind, name);
  } catch (const BadInput&) {
    return {};
  }
}

}  // namespace abbe::sim
