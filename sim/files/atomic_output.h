#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

/// Files that appear under their name only when they are complete.
namespace abbe::sim {

/// Thrown if output cannot be written, or would change files that abbe did not make; leads to exit
/// code 5.
struct OutputFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws OutputFailure with the path and the reason, each escaped to one line.
[[noreturn]] void throw_output_failure(const std::filesystem::path& file,
                                       const std::string& reason);

inline constexpr const char* manifest_name = ".abbe-result";

/// A temporary file, in the folder and with the extension of its final name. The process holds a
/// lock on it, which the system releases even if the process is killed. A file without a lock was
/// therefore abandoned; one with a lock is still being written, on any computer that shares the
/// folder.
class UnfinishedFile {
 public:
  /// Creates the file, empty.
  /// @throws OutputFailure
  UnfinishedFile(const std::filesystem::path& folder, const std::string& name);
  /// Removes the file unless it was renamed.
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Renames the file to `path`, replacing an older file.
  /// @throws OutputFailure
  void rename(const std::filesystem::path& path);

 private:
  std::filesystem::path path_;
  int lock_ = -1;
};

/// Removes the unfinished files of this process. The process must write nothing afterwards.
/// Thread-safe.
void remove_own_unfinished_files();

/// Removes the unfinished files of processes that no longer exist. On file systems without locks
/// they stay.
void remove_abandoned_files(const std::filesystem::path& folder);

/// The name and the text of a file to be written into a folder.
struct NewFile {
  std::string name;
  std::string text;
};

/// Checks that a folder does not exist or holds only hidden files; creates nothing.
/// @throws OutputFailure otherwise
void check_new_folder(const std::filesystem::path& folder);

/// Writes files into a new or empty folder. They belong to the user from then on, because no
/// manifest lists them. On failure all files and folders created so far are removed.
/// @throws OutputFailure
void write_new_folder(const std::filesystem::path& folder, const std::vector<NewFile>& files);

}  // namespace abbe::sim
