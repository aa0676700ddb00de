#include "sim/files/new_folder.h"

#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "sim/files/output_failure.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_new(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": " + escaped(reason));
}

/// Writes a file where none is; a link of that name is not followed.
void create(const fs::path& file, const std::string& text) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW, 0666);
  if (descriptor < 0) refuse_new(file, "cannot be written: " + std::string(std::strerror(errno)));
  int failed = 0;
  for (std::string_view rest = text; failed == 0 && !rest.empty();) {
    const ssize_t written = ::write(descriptor, rest.data(), rest.size());
    if (written < 0)
      failed = errno;
    else
      rest.remove_prefix(std::size_t(written));
  }
  if (::close(descriptor) != 0 && failed == 0) failed = errno;
  if (failed == 0) return;
  std::error_code ignored;
  fs::remove(file, ignored);
  refuse_new(file, "cannot be written: " + std::string(std::strerror(failed)));
}

/// What has been made so far, taken away again unless it is kept.
class Made {
 public:
  ~Made() {
    std::error_code ignored;
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
