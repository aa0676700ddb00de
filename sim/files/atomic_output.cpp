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

/// Returns true for ".unfinished-", a number, a dash and more: no one else's hidden file.
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

/// Returns false if another process holds the lock. Without locks in the file system no one does.
bool lock_unfinished(int descriptor) {
  return ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

/// Paths of the unfinished files of this process.
struct OwnFiles {
  std::mutex mutex;
  std::set<fs::path> paths;
};

OwnFiles& own_files() {
  static auto& files = *new OwnFiles;  // never destroyed: the thread that removes the files may
                                       // outlive static objects
  return files;
}

[[noreturn]] void throw_write_failure(const fs::path& file, int reason) {
  throw OutputFailure(escaped(file.string()) + ": cannot be written: " + std::strerror(reason));
}

}  // namespace

UnfinishedFile::UnfinishedFile(const fs::path& folder, const std::string& name) {
  // Another process may use the same number in a shared folder, so numbers are tried in turn.
  for (int k = 0;; ++k) {
    path_ = folder / fmt::format("{}{}-{}-{}", unfinished_prefix, ::getpid(), k, name);
    lock_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (lock_ < 0 && errno != EEXIST) throw_write_failure(folder / name, errno);
    if (lock_ < 0) continue;
    // Another process may have taken the file for abandoned and removed it before it was locked.
    if (lock_unfinished(lock_) && has_same_inode(path_, lock_)) break;
    ::close(lock_);
  }
  const std::lock_guard lock(own_files().mutex);
  own_files().paths.insert(path_);
}

UnfinishedFile::~UnfinishedFile() {
  std::error_code ignored;
  const std::lock_guard lock(own_files().mutex);
  if (own_files().paths.erase(path_) > 0) fs::remove(path_, ignored);
  ::close(lock_);
}

void UnfinishedFile::rename(const fs::path& path) {
  std::error_code error;
  const std::lock_guard lock(own_files().mutex);
  fs::rename(path_, path, error);
  if (error)
    throw OutputFailure(escaped(path.string()) + ": cannot be written: " + error.message());
  own_files().paths.erase(path_);
}

void remove_own_unfinished_files() {
  std::error_code ignored;
  const std::lock_guard lock(own_files().mutex);
  for (const fs::path& path : own_files().paths) fs::remove(path, ignored);
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

[[noreturn]] void refuse_new(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": " + escaped(reason));
}

/// Creates a file that must not exist; a link of that name is not followed.
void create(const fs::path& file, const std::string& text) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW, 0666);
  if (descriptor < 0) refuse_new(file, "cannot be written: " + std::string(std::strerror(errno)));
  int failed = 0;
  // write may write less than requested, for example when a signal arrives.
  for (std::string_view rest = text; failed == 0 && !rest.empty();) {
    const ssize_t written = ::write(descriptor, rest.data(), rest.size());
    if (written < 0)
      failed = errno;
    else
      rest.remove_prefix(std::size_t(written));
  }
  // Network file systems report a full disk only at close.
  if (::close(descriptor) != 0 && failed == 0) failed = errno;
  if (failed == 0) return;
  std::error_code ignored;
  fs::remove(file, ignored);
  refuse_new(file, "cannot be written: " + std::string(std::strerror(failed)));
}

/// Files and folders made so far, removed again unless they are kept.
class Made {
 public:
  ~Made() {
    std::error_code ignored;
    // In reverse order, so that folders are empty when their turn comes.
    for (auto one = all_.rbegin(); one != all_.rend(); ++one) fs::remove(*one, ignored);
  }
  void add(const fs::path& one) { all_.push_back(one); }
  void keep() { all_.clear(); }

 private:
  std::vector<fs::path> all_;
};

void make_folders(const fs::path& folder, Made& made) {
  std::error_code failure;
  if (folder.empty() || fs::is_directory(folder, failure)) return;
  make_folders(folder.parent_path(), made);
  failure.clear();
  if (fs::create_directory(folder, failure)) made.add(folder);
  if (failure) refuse_new(folder, "cannot be made: " + failure.message());
}

}  // namespace

void check_new_folder(const fs::path& folder) {
  std::error_code failure;
  if (!fs::exists(fs::symlink_status(folder, failure))) return;
  if (!fs::is_directory(folder, failure)) refuse_new(folder, "expected a folder, seen a file");
  std::string first;
  int others = 0;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    const std::string name = entry.path().filename().string();
    // Hidden files such as .git do not make a folder a used one.
    if (name.starts_with('.')) continue;
    if (++others == 1 || name < first) first = name;
  }
  if (failure) refuse_new(folder, "cannot be read: " + failure.message());
  if (others > 0)
    refuse_new(folder, fmt::format("expected a new or empty folder, seen one with {}{}", first,
                                   others > 1 ? fmt::format(" and {} more", others - 1) : ""));
}

void write_new_folder(const fs::path& folder, const std::vector<NewFile>& files) {
  check_new_folder(folder);
  Made made;
  make_folders(folder.has_filename() ? folder : folder.parent_path(), made);
  for (const NewFile& one : files) {
    create(folder / one.name, one.text);
    made.add(folder / one.name);
  }
  made.keep();
}

}  // namespace abbe::sim
