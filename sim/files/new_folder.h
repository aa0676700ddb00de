#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace abbe::sim {

/// A file to be, by its name in the folder.
struct NewFile {
  std::string name;
  std::string text;
};

/// Refuses a folder that is there and holds anything but hidden files, and makes nothing.
/// @throws OutputFailure
void check_new_folder(const std::filesystem::path& folder);

/// Writes files into a folder that is new or empty. They are the user's from then on: no mark says
/// that abbe may replace them. On failure nothing is left of them, nor of a folder that was made.
/// @throws OutputFailure
void write_new_folder(const std::filesystem::path& folder, const std::vector<NewFile>& files);

}  // namespace abbe::sim
