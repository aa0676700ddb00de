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

constexpr std::array known_extensions{".toml", ".csv", ".ngc", ".nc",  ".tap", ".pvt",
                                      ".stl",  ".obj", ".off", ".ply", ".txt", ".vtu"};
constexpr std::size_t max_listed_names = 12;

bool is_file(const path& file) {
  std::error_code error_code;
  return std::filesystem::is_regular_file(file, error_code);
}

bool is_library(const path& folder) {
  std::error_code error_code;
  // Every library has a folder of machines.
  return std::filesystem::is_directory(folder / "machines", error_code);
}

/// Returns the sorted files below one folder of the library, relative to the library.
std::vector<path> library_files(const path& library, std::string_view kind) {
  std::vector<path> files;
  // With an error code, a missing folder does not throw and simply has no files.
  std::error_code error_code;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(library / kind, error_code)) {
    const bool has_known_extension =
        std::ranges::find(known_extensions, entry.path().extension()) != known_extensions.end();
    if (has_known_extension && is_file(entry.path()))
      files.push_back(entry.path().lexically_relative(library));
  }
  // The order of a directory listing depends on the file system; that of messages must not.
  std::ranges::sort(files);
  return files;
}

path without_extension(path file) { return file.replace_extension(); }

/// Returns the shortest library name that denotes this file and no other.
std::string shortest_name(const path& file, const std::vector<path>& files, std::string_view kind) {
  const auto has_same_stem = [&](const path& other) {
    return without_extension(other) == without_extension(file);
  };
  // A program and its tool table, for example, may differ in the extension only.
  const path name =
      std::ranges::count_if(files, has_same_stem) > 1 ? file : without_extension(file);
  return std::string(library_prefix) +
         (kind.empty() ? name : name.lexically_relative(kind)).generic_string();
}

/// Returns the files that a name, relative to the library or the folder of the kind, may denote.
std::vector<path> matching_files(const path& name, const std::vector<path>& files,
                                 std::string_view kind) {
  std::vector<path> matches;
  for (const path& file : files)
    for (const path& folder : {path(), path(kind)})
      if (folder / name == file || folder / name == without_extension(file)) {
        matches.push_back(file);
        // With an empty kind both folders are the same; the file must appear only once.
        break;
      }
  return matches;
}

/// Returns the names of files as text, nearest to a name first.
std::string joined_names(const std::vector<path>& files, std::string_view kind,
                         std::string_view name) {
  std::vector<path> sorted_files = files;
  // A misspelling is the usual cause, so the nearest names come first and the others may be cut.
  std::ranges::stable_sort(sorted_files, {}, [&](const path& file) {
    return edit_distance(path(name).stem().string(), file.stem().string());
  });
  std::string text;
  for (std::size_t i = 0; i < std::min(files.size(), max_listed_names); ++i)
    text += (i == 0 ? "" : ", ") + shortest_name(sorted_files[i], files, kind);
  if (files.size() > max_listed_names)
    text += fmt::format(" and {} more", files.size() - max_listed_names);
  return text;
}

path locate_library_file(const FileName& file_name, InputErrors& input_errors) {
  const path name = path(file_name.name.substr(library_prefix.size())).lexically_normal();
  const path library = library_folder();
  std::vector<path> matches = matching_files(name, library_files(library, ""), file_name.kind);
  if (matches.size() == 1) return library / matches.front();
  if (matches.size() > 1) {
    input_errors.add(file_name.position, "one of " + joined_names(matches, "", name.string()),
                     fmt::format("\"{}\", which is ambiguous", file_name.name));
  } else {
    // Only files of this kind fit the section.
    const std::vector<path> files = library_files(library, file_name.kind);
    input_errors.add(file_name.position,
                     "a library name: " + joined_names(files, file_name.kind, name.string()),
                     fmt::format("\"{}\"", file_name.name));
  }
  return name;
}

}  // namespace

path library_folder() {
  // The variable takes precedence, so that users can replace the installed library.
  if (const char* named_folder = std::getenv("ABBE_LIBRARY")) {
    // An invalid variable is an error; otherwise results would come from another library.
    if (is_library(named_folder)) return std::filesystem::canonical(named_folder);
    throw BadInput("ABBE_LIBRARY", 0, 0, "a folder that contains abbe's machines/", named_folder);
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
  const path relative_file = (folder / name.name).lexically_normal();
  try {
    if (name.name.starts_with(library_prefix)) return locate_library_file(name, input_errors);
    const path library_path = path(name.name).lexically_normal();
    // A name with `..` would leave the library.
    if (is_file(relative_file) || library_path.is_absolute() || *library_path.begin() == "..")
      return relative_file;
    const path file = library_folder() / library_path;
    return is_file(file) ? file : relative_file;
  } catch (const BadInput& error) {
    // There is no library, which matters only for names with the prefix.
    if (name.name.starts_with(library_prefix))
      input_errors.add(name.position, error.expected, error.seen);
    return relative_file;
  }
}

path library_file(const path& name) {
  InputErrors input_errors;
  const std::string text = name.string();
  const SourcePosition position{std::make_shared<const std::string>(text), 0, 0, true};
  const path file = locate_file({text, position, ""}, "", input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  return file;
}

std::string library_name(const path& file) {
  try {
    const path library_path = file.lexically_relative(library_folder());
    if (!library_path.empty() && *library_path.begin() != "..")
      return std::string(library_prefix) + library_path.generic_string();
  } catch (const BadInput&) {
    // There is no library, so the file is not in it.
  }
  return file.string();
}

std::string library_names(std::string_view kind, std::string_view name) {
  try {
    return joined_names(library_files(library_folder(), kind), kind, name);
  } catch (const BadInput&) {
    return {};
  }
}

}  // namespace abbe::sim
