#pragma once

#include <filesystem>
#include <string>

namespace abbe::sim {

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

}  // namespace abbe::sim
