#include "sim/files/atomic_output.h"

#include <cctype>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "kinematics/bad_input.h"

namespace abbe::sim {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view unfinished_prefix = ".unfinished-";

/// Returns true for a name of the form ".unfinished-NUMBER-NAME", which only abbe uses.
bool is_unfinished_name(std::string_view name) {
  if (!name.starts_with(unfinished_prefix)) return false;
  name.remove_prefix(unfinished_prefix.size());
  std::size_t digits = 0;
  while (digits < name.size() && std::isdigit(static_cast<unsigned char>(name[digits])) != 0)
    ++digits;
  return digits > 0 && name.substr(digits).starts_with('-') && name.size() > digits + 1;
}

/// Returns true if the path still leads to the open file.
bool has_same_inode(const fs::path& path, int descriptor) {
  struct stat open_file {};
  struct stat named_file {};
  return ::fstat(descriptor, &open_file) == 0 && ::lstat(path.c_str(), &named_file) == 0 &&
         open_file.st_dev == named_file.st_dev && open_file.st_ino == named_file.st_ino;
}

/// Returns false if another process holds the lock. A file system without locks counts as locked by
/// us, since the name is unique to this process anyway.
bool lock_unfinished(int descriptor) {
  return ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

/// Paths of the unfinished files of this process.
struct UnfinishedFiles {
  std::mutex mutex;
  std::set<fs::path> paths;
};

UnfinishedFiles& unfinished_files() {
  static auto& files = *new UnfinishedFiles;  // never destroyed: the thread that removes the files
                                              // may outlive static objects
  return files;
}

}  // namespace

void throw_output_failure(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": " + escaped(reason));
}

UnfinishedFile::UnfinishedFile(const fs::path& folder, const std::string& name) {
  // Another process may use the same number in a shared folder, so numbers are tried in turn.
  for (int k = 0;; ++k) {
    path_ = folder / fmt::format("{}{}-{}-{}", unfinished_prefix, ::getpid(), k, name);
    lock_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (lock_ < 0 && errno != EEXIST)
      throw_output_failure(folder / name,
                           std::string("cannot be written: ") + std::strerror(errno));
    if (lock_ < 0) continue;
    // Another process may have taken the file for abandoned and removed it before it was locked.
    if (lock_unfinished(lock_) && has_same_inode(path_, lock_)) break;
    ::close(lock_);
  }
  const std::lock_guard lock(unfinished_files().mutex);
  unfinished_files().paths.insert(path_);
}

UnfinishedFile::~UnfinishedFile() {
  std::error_code ignored;
  const std::lock_guard lock(unfinished_files().mutex);
  if (unfinished_files().paths.erase(path_) > 0) fs::remove(path_, ignored);
  ::close(lock_);
}

void UnfinishedFile::rename(const fs::path& path) {
  std::error_code error;
  const std::lock_guard lock(unfinished_files().mutex);
  fs::rename(path_, path, error);
  if (error) throw_output_failure(path, "cannot be written: " + error.message());
  unfinished_files().paths.erase(path_);
}

void remove_own_unfinished_files() {
  std::error_code ignored;
  const std::lock_guard lock(unfinished_files().mutex);
  for (const fs::path& path : unfinished_files().paths) fs::remove(path, ignored);
}

void remove_abandoned_files(const fs::path& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (!is_unfinished_name(entry.path().filename().string())) continue;
    // O_NONBLOCK: opening a pipe of that name must not wait. A lock that can be taken means that
    // the writer has ended.
    const int descriptor =
        ::open(entry.path().c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0) continue;
    struct stat file {};
    if (::fstat(descriptor, &file) == 0 && S_ISREG(file.st_mode) && file.st_uid == ::geteuid() &&
        ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 && has_same_inode(entry.path(), descriptor))
      fs::remove(entry.path(), ignored);
    ::close(descriptor);
  }
}

namespace {

/// Creates a file that must not exist; a link of that name is not followed.
void create_file(const fs::path& file, const std::string& text) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW, 0666);
  if (descriptor < 0)
    throw_output_failure(file, "cannot be written: " + std::string(std::strerror(errno)));
  int error_number = 0;
  // write may write less than requested, for example when a signal arrives.
  for (std::string_view remaining_text = text; error_number == 0 && !remaining_text.empty();) {
    const ssize_t bytes_written = ::write(descriptor, remaining_text.data(), remaining_text.size());
    if (bytes_written < 0)
      error_number = errno;
    else
      remaining_text.remove_prefix(std::size_t(bytes_written));
  }
  // Network file systems report a full disk only at close.
  if (::close(descriptor) != 0 && error_number == 0) error_number = errno;
  if (error_number == 0) return;
  std::error_code ignored;
  fs::remove(file, ignored);
  throw_output_failure(file, "cannot be written: " + std::string(std::strerror(error_number)));
}

/// Paths created so far. The destructor removes them, unless `keep` was called.
class CreatedPaths {
 public:
  ~CreatedPaths() {
    std::error_code ignored;
    // Files stand after their folders, so in reverse order every folder is empty when it is
    // removed.
    for (auto path = paths_.rbegin(); path != paths_.rend(); ++path) fs::remove(*path, ignored);
  }
  void add(const fs::path& path) { paths_.push_back(path); }
  void keep() { paths_.clear(); }

 private:
  std::vector<fs::path> paths_;
};

void create_folders(const fs::path& folder, CreatedPaths& created) {
  std::error_code failure;
  if (folder.empty() || fs::is_directory(folder, failure)) return;
  create_folders(folder.parent_path(), created);
  failure.clear();
  if (fs::create_directory(folder, failure)) created.add(folder);
  if (failure) throw_output_failure(folder, "cannot be created: " + failure.message());
}

}  // namespace

void check_new_folder(const fs::path& folder) {
  std::error_code failure;
  if (!fs::exists(fs::symlink_status(folder, failure))) return;
  if (!fs::is_directory(folder, failure))
    throw_output_failure(folder, "expected a folder, seen a file");
  std::string first_name;
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    const std::string name = entry.path().filename().string();
    // A folder with only hidden files, such as .git, counts as empty.
    if (name.starts_with('.')) continue;
    if (++files == 1 || name < first_name) first_name = name;
  }
  if (failure) throw_output_failure(folder, "cannot be read: " + failure.message());
  if (files > 0)
    throw_output_failure(
        folder, fmt::format("expected a new or empty folder, seen a folder with {}{}", first_name,
                            files > 1 ? fmt::format(" and {} more", files - 1) : ""));
}

void write_new_folder(const fs::path& folder, const std::vector<NewFile>& files) {
  check_new_folder(folder);
  CreatedPaths created;
  create_folders(folder.has_filename() ? folder : folder.parent_path(), created);
  for (const NewFile& file : files) {
    create_file(folder / file.name, file.text);
    created.add(folder / file.name);
  }
  created.keep();
}

}  // namespace abbe::sim
