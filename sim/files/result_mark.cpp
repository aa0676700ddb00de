#include "sim/files/result_mark.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/hash.h"
#include "sim/files/output_failure.h"
#include "sim/files/versions.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t most_mark_bytes = std::size_t(64) << 20;

bool is_plain_file(const fs::path& file) {
  std::error_code none;
  return fs::symlink_status(file, none).type() == fs::file_type::regular;
}

std::string text_at(const json& line, const char* key) {
  const auto found = line.find(key);
  return found != line.end() && found->is_string() ? found->get<std::string>() : "";
}

/// As SQLite begins every file: a journal that was killed early has no name of its own yet.
bool is_database(const fs::path& file) {
  std::string head(16, '\0');
  return bool(std::ifstream(file, std::ios::binary).read(head.data(), 16)) &&
         head == std::string("SQLite format 3\0", 16);
}

/// A sum is written as 16 hexadecimal digits: not every reader of JSON holds 64 bits.
std::optional<Print> print_in(const json& line) {
  const std::string sum = text_at(line, "sum");
  const auto size = line.find("size");
  if (size == line.end() || !size->is_number_unsigned() || sum.size() != 16 ||
      sum.find_first_not_of("0123456789abcdef") != std::string::npos)
    return std::nullopt;
  return Print{size->get<std::uintmax_t>(), std::stoull(sum, nullptr, 16)};
}

/// The mark while it is written; other processes wait.
class OpenMark {
 public:
  explicit OpenMark(const fs::path& folder)
      : file_(folder / mark_name),
        descriptor_(
            ::open(file_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) fail(errno);
    // where a file system has no locks, lines are still appended whole
    while (::flock(descriptor_, LOCK_EX) != 0 && errno == EINTR) continue;
  }
  ~OpenMark() { ::close(descriptor_); }
  OpenMark(const OpenMark&) = delete;
  OpenMark& operator=(const OpenMark&) = delete;

  /// On a line of its own, also behind one that was not finished.
  void append(std::string line) const {
    char last = '\n';
    const ::off_t end = ::lseek(descriptor_, 0, SEEK_END);
    if (end > 0 && ::pread(descriptor_, &last, 1, end - 1) == 1 && last != '\n') line = "\n" + line;
    line += "\n";
    const auto written = ::write(descriptor_, line.data(), line.size());
    if (written != ::ssize_t(line.size())) fail(written < 0 ? errno : ENOSPC);
  }

 private:
  [[noreturn]] void fail(int reason) const {
    throw OutputFailure(escaped(file_.string()) + ": cannot be written: " + std::strerror(reason));
  }

  fs::path file_;
  int descriptor_ = -1;
};

}  // namespace

std::optional<Print> print_of(const fs::path& file) {
  if (!is_plain_file(file)) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  if (!in) return std::nullopt;
  Print print{0, fnv_1a_basis};
  std::array<char, 1 << 16> buffer;
  while (in.read(buffer.data(), buffer.size()), in.gcount() > 0) {
    const std::string_view bytes(buffer.data(), std::size_t(in.gcount()));
    print.sum = fnv_1a(bytes, print.sum);
    print.size += bytes.size();
  }
  return in.bad() ? std::nullopt : std::optional(print);
}

Mark read_mark(const fs::path& folder) {
  Mark mark;
  const fs::path file = folder / mark_name;
  std::error_code none;
  if (!is_plain_file(file) || fs::file_size(file, none) > most_mark_bytes) return mark;
  std::ifstream in(file, std::ios::binary);
  for (std::string text; std::getline(in, text);) {
    const json line = json::parse(text, nullptr, false);
    if (!line.is_object()) continue;
    if (line.contains("folder") && line["folder"] == true) mark.folder = true;
    if (line.contains("file") && line["file"].is_string())
      mark.files[line["file"].get<std::string>()].push_back({print_in(line), text_at(line, "by")});
  }
  return mark;
}

std::optional<std::string> writer_in(const Mark& mark, const fs::path& file) {
  const auto lines = mark.files.find(escaped(file.filename().string()));
  if (lines == mark.files.end()) return std::nullopt;
  const std::optional<Print> print = print_of(file);
  if (!print) return std::nullopt;
  const auto last =
      std::find_if(lines->second.rbegin(), lines->second.rend(), [&](const Mark::Line& line) {
        return line.print ? *line.print == *print : print->size == 0 || is_database(file);
      });
  return last == lines->second.rend() ? std::nullopt : std::optional(last->by);
}

bool says(const Mark& mark, const Written& written) {
  const auto lines = mark.files.find(escaped(written.name));
  if (lines == mark.files.end()) return false;
  const auto last =
      std::find_if(lines->second.rbegin(), lines->second.rend(),
                   [&](const Mark::Line& line) { return line.print == written.print; });
  return last != lines->second.rend() && last->by == written.by;
}

std::string command_of(const std::string& command_line) {
  std::istringstream words(command_line);
  std::string program, command;
  words >> program >> command;
  return command;
}

void append_to_mark(const fs::path& folder, const std::optional<Announced>& announced,
                    const std::optional<Written>& written) {
  ordered_json line;
  if (announced) {
    if (announced->whole) line["folder"] = true;
    line["command"] = announced->command_line;
    line["version"] = versions()["abbe"];
  }
  if (written) {
    line["file"] = escaped(written->name);  // JSON holds no other bytes than UTF-8
    line["by"] = written->by;
    if (written->print) {
      line["size"] = written->print->size;
      line["sum"] = fmt::format("{:016x}", written->print->sum);
    }
  }
  const auto replace = ordered_json::error_handler_t::replace;
  OpenMark(folder).append(escaped(line.dump(-1, ' ', false, replace)));
}

}  // namespace abbe::sim
