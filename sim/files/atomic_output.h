#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace abbe::sim {

/// Output could not be written, or would touch what abbe did not make: exit 5.
struct OutputFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr const char* manifest_name = ".abbe-result";

/// A file while it is written, in the folder and with the ending that it will have. Its process
/// holds a lock on it, which ends with the process however that ends: what a killed process left is
/// told from what another one is writing, on any computer that shares the folder.
class UnfinishedFile {
 public:
  /// Makes the file, empty. @throws OutputFailure
  UnfinishedFile(const std::filesystem::path& folder, const std::string& name);
  /// Removes it unless it was renamed.
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Its name is `path` from now on, in the place of an older file. @throws OutputFailure
  void rename(const std::filesystem::path& path);

 private:
  std::filesystem::path path_;
  int lock_ = -1;
};

/// Removes those of this process, which writes no more. Thread-safe.
void remove_own_unfinished_files();

/// Removes the unfinished files of processes that are gone. Where the file system has no locks,
/// they stay.
void remove_abandoned_files(const std::filesystem::path& folder);

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
