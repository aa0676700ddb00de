#include "sim/files/output.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <mutex>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/hash.h"
#include "sim/files/atomic_output.h"
#include "sim/files/program_file.h"
#include "sim/files/progress.h"

namespace abbe::sim {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

/// Larger manifests are ignored; a line takes about 100 bytes.
constexpr std::size_t max_mark_bytes = std::size_t(64) << 20;

bool is_plain_file(const fs::path& file) {
  std::error_code none;
  return fs::symlink_status(file, none).type() == fs::file_type::regular;
}

std::string text_at(const json& line, const char* key) {
  const auto found = line.find(key);
  return found != line.end() && found->is_string() ? found->get<std::string>() : "";
}

/// Returns true if the file begins like an SQLite database: a journal that was killed early has no
/// application id yet.
bool is_database(const fs::path& file) {
  std::string head(16, '\0');
  return bool(std::ifstream(file, std::ios::binary).read(head.data(), 16)) &&
         head == std::string("SQLite format 3\0", 16);
}

/// Returns the checksum of a line. The sum is written as 16 hexadecimal digits, because many JSON
/// readers do not hold 64-bit integers.
std::optional<FileChecksum> print_in(const json& line) {
  const std::string sum = text_at(line, "sum");
  const auto size = line.find("size");
  if (size == line.end() || !size->is_number_unsigned() || sum.size() != 16 ||
      sum.find_first_not_of("0123456789abcdef") != std::string::npos)
    return std::nullopt;
  return FileChecksum{size->get<std::uintmax_t>(), std::stoull(sum, nullptr, 16)};
}

/// The manifest while it is written; other processes wait.
class LockedManifest {
 public:
  explicit LockedManifest(const fs::path& folder)
      : file_(folder / manifest_name),
        descriptor_(
            ::open(file_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) fail(errno);
    // On file systems without locks, lines are still appended as a whole by O_APPEND.
    while (::flock(descriptor_, LOCK_EX) != 0 && errno == EINTR) continue;
  }
  ~LockedManifest() { ::close(descriptor_); }
  LockedManifest(const LockedManifest&) = delete;
  LockedManifest& operator=(const LockedManifest&) = delete;

  /// Appends a line of its own, also after an unfinished one.
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

std::optional<FileChecksum> file_checksum(const fs::path& file) {
  if (!is_plain_file(file)) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  if (!in) return std::nullopt;
  FileChecksum print{0, fnv_1a_basis};
  std::array<char, 1 << 16> buffer;
  while (in.read(buffer.data(), buffer.size()), in.gcount() > 0) {
    const std::string_view bytes(buffer.data(), std::size_t(in.gcount()));
    print.sum = fnv_1a(bytes, print.sum);
    print.size += bytes.size();
  }
  return in.bad() ? std::nullopt : std::optional(print);
}

Mark read_manifest(const fs::path& folder) {
  Mark mark;
  const fs::path file = folder / manifest_name;
  std::error_code none;
  if (!is_plain_file(file) || fs::file_size(file, none) > max_mark_bytes) return mark;
  std::ifstream in(file, std::ios::binary);
  for (std::string text; std::getline(in, text);) {
    const json line = json::parse(text, nullptr, false);
    // A damaged line, such as one that was cut off, is skipped.
    if (!line.is_object()) continue;
    if (line.contains("folder") && line["folder"] == true) mark.folder = true;
    if (line.contains("file") && line["file"].is_string())
      mark.files[line["file"].get<std::string>()].push_back({print_in(line), text_at(line, "by")});
  }
  return mark;
}

std::optional<std::string> writing_command(const Mark& mark, const fs::path& file) {
  const auto lines = mark.files.find(escaped(file.filename().string()));
  if (lines == mark.files.end()) return std::nullopt;
  const std::optional<FileChecksum> print = file_checksum(file);
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

std::string subcommand_name(const std::string& command_line) {
  std::istringstream words(command_line);
  std::string program, command;
  words >> program >> command;
  return command;
}

void append_to_manifest(const fs::path& folder,
                        const std::optional<FolderDeclaration>& folder_declaration,
                        const std::optional<Written>& written) {
  ordered_json line;
  if (folder_declaration) {
    if (folder_declaration->whole) line["folder"] = true;
    line["command"] = folder_declaration->command_line;
    line["version"] = versions()["abbe"];
  }
  if (written) {
    line["file"] = escaped(written->name);  // JSON holds UTF-8 only
    line["by"] = written->by;
    if (written->print) {
      line["size"] = written->print->size;
      line["sum"] = fmt::format("{:016x}", written->print->sum);
    }
  }
  const auto replace = ordered_json::error_handler_t::replace;
  LockedManifest(folder).append(escaped(line.dump(-1, ' ', false, replace)));
}

namespace {

[[noreturn]] void fail(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": cannot be written: " + escaped(reason));
}

[[noreturn]] void refuse(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": " + escaped(reason));
}

bool is_there(const fs::path& file) {
  std::error_code none;
  return fs::exists(fs::symlink_status(file, none));
}

fs::path plain(const fs::path& file) { return fs::absolute(file).lexically_normal(); }

/// Returns true if two paths lead to one file, whatever names, links or letter cases they use.
bool is_same(const fs::path& a, const fs::path& b) {
  std::error_code none;
  return fs::equivalent(a, b, none) || plain(a) == plain(b);
}

bool is_input(const fs::path& file, const Writer& writer) {
  return std::ranges::any_of(writer.inputs,
                             [&](const fs::path& input) { return is_same(file, input); });
}

bool is_below_folder(const fs::path& file, const fs::path& folder) {
  std::error_code none;
  for (fs::path at = file; at.has_relative_path(); at = at.parent_path())
    if (fs::equivalent(at.parent_path(), folder, none)) return true;
  return false;
}

/// Returns an input in the folder or below, by its own name or by the target of its link.
std::optional<fs::path> input_inside(const fs::path& folder, const Writer& writer) {
  std::error_code none;
  for (const fs::path& input : writer.inputs)
    if (is_below_folder(plain(input), folder) ||
        is_below_folder(fs::weakly_canonical(input, none), folder))
      return input;
  return std::nullopt;
}

/// Returns an --out for a subfolder that does not exist yet.
std::string another(const fs::path& folder) {
  fs::path name = (folder / "result").lexically_normal();
  for (int k = 2; is_there(name); ++k)
    name = (folder / fmt::format("result-{}", k)).lexically_normal();
  return "--out " + name.string();
}

/// Returns true for a journal of a study, which has the application id of abbe in its SQLite
/// header.
bool is_journal(const fs::path& file) {
  std::error_code none;
  if (fs::symlink_status(file, none).type() != fs::file_type::regular) return false;
  std::ifstream in(file, std::ios::binary);
  // The application id is at bytes 68 to 71 of the header.
  std::string head(72, '\0');
  in.read(head.data(), std::streamsize(head.size()));
  return in && head.starts_with("SQLite format 3") && head.ends_with("abbe");
}

/// Returns true for a journal, or for a file that SQLite and its lock keep beside it.
bool is_journal_file(const fs::path& file) {
  std::string name = file.string();
  for (const std::string_view ending : {"-lock", "-wal", "-shm"})
    if (name.ends_with(ending)) name.resize(name.size() - ending.size());
  return is_journal(name);
}

/// Returns true for files such as .gitkeep, which only keep a folder; abbe writes none and is not
/// hindered by them.
bool is_hidden(const fs::directory_entry& entry) {
  std::error_code none;
  const std::string name = entry.path().filename().string();
  return name.starts_with('.') && name != manifest_name && !entry.is_symlink(none) &&
         entry.is_regular_file(none);
}

bool has_foreign_files(const fs::path& folder);

/// Returns true if an entry of a folder with this manifest is not abbe's: neither listed as it is,
/// nor a journal, nor a folder in which everything is abbe's.
bool is_foreign_entry(const Mark& mark, const fs::directory_entry& entry) {
  std::error_code none;
  if (entry.path().filename() == manifest_name && !mark.files.empty()) return false;
  if (is_hidden(entry) || is_journal_file(entry.path())) return false;
  if (writing_command(mark, entry.path())) return false;
  return entry.is_symlink(none) || !entry.is_directory(none) || has_foreign_files(entry.path());
}

/// Returns true if a folder holds files that are not abbe's. A failed run may leave empty folders
/// without a manifest; they hold nothing that a later run could damage.
bool has_foreign_files(const fs::path& folder) {
  const Mark mark = read_manifest(folder);
  if (mark.folder) return false;
  std::error_code unreadable;
  const fs::directory_iterator entries(folder, unreadable);
  return unreadable || std::any_of(begin(entries), end(entries), [&](const auto& entry) {
           return is_foreign_entry(mark, entry);
         });
}

/// Entries of a folder that are not abbe's.
struct Others {
  std::size_t count = 0;
  std::string first;  ///< first by name
};

Others foreign_files(const fs::path& folder) {
  Others others;
  std::error_code none;
  const Mark mark = read_manifest(folder);
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    if (!is_foreign_entry(mark, entry)) continue;
    const std::string name = entry.path().filename().string();
    if (++others.count == 1 || name < others.first) others.first = name;
  }
  return others;
}

/// Returns the command under which files are listed: `run` and `compare` write the same files of a
/// case.
std::string canonical_command(const std::string& command) {
  return command == "compare" ? "run" : command;
}

[[noreturn]] void throw_errno(int reason) {
  throw std::system_error(reason, std::generic_category());
}

void write_text(const fs::path& file, std::string_view text) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  if (stream == nullptr) throw_errno(errno);
  const bool written = std::fwrite(text.data(), 1, text.size(), stream) == text.size();
  const int reason = errno;
  if (std::fclose(stream) != 0 || !written) throw_errno(written ? errno : reason);
}

/// Flushes a file to disk: a full disk may be reported only here. EINVAL and EROFS mean that the
/// file cannot be flushed, such as a pipe.
void flush(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY);
  if (descriptor < 0) throw_errno(errno);
  const int failed = ::fsync(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  if (failed != 0 && failed != EINVAL && failed != EROFS) throw_errno(failed);
}

/// Creates the folder and tests that a file can be written in it.
void prepare_folder(const fs::path& folder) {
  try {
    fs::create_directories(folder);
    remove_abandoned_files(folder);
    write_text(UnfinishedFile(folder, "probe").path(), "probe\n");
  } catch (const std::system_error& failure) {
    fail(folder, failure.code().message());
  }
}

}  // namespace

/// A folder for files, with its state.
struct ResultFile::Place {
  fs::path folder;  ///< never empty
  Writer writer;
  bool whole = false;               ///< the folder as a whole becomes a result
  bool folder_declaration = false;  ///< the command is in the manifest already
};

fs::path ResultFile::path() const {
  return place_->folder == "." ? fs::path(name_) : place_->folder / name_;
}

void check_folder(const fs::path& folder, const Writer& writer) {
  if (!is_there(folder)) return;
  std::error_code none;
  if (!fs::is_directory(folder, none)) refuse(folder, "expected a folder for results, seen a file");
  if (writer.permissions.force) return;
  if (const auto input = writer.beside_inputs ? std::nullopt : input_inside(folder, writer))
    refuse(folder, fmt::format("expected a folder without anything that this run reads, seen {}; "
                               "choose another, such as {}",
                               input->string(), another(folder)));
  if (read_manifest(folder).folder) return;
  // Files of another run that appeared meanwhile are listed in the manifest before they appear.
  if (const Others others = foreign_files(folder);
      others.count > 0 && !read_manifest(folder).folder)
    refuse(folder,
           fmt::format("expected a new or empty folder, or one of results ({}), seen one "
                       "that abbe did not make, with {}{}; choose another, such as {}, or "
                       "say --force",
                       manifest_name, others.first,
                       others.count > 1 ? fmt::format(" and {} more", others.count - 1) : "",
                       another(folder)));
}

ResultFolder::ResultFolder(const fs::path& folder, const Writer& writer) {
  const fs::path named = folder.empty() ? fs::path(".") : folder;
  check_folder(named, writer);
  // A folder taken by --force remains the user's as a whole.
  const bool whole = read_manifest(named).folder || foreign_files(named).count == 0 ||
                     read_manifest(named).folder;  // another run may have written its manifest in
                                                   // between
  prepare_folder(named);
  place_ = std::make_shared<ResultFile::Place>(ResultFile::Place{named, writer, whole, false});
}

ResultFile ResultFolder::operator/(const fs::path& name) const {
  if (name.empty() || name.has_parent_path())
    throw std::invalid_argument("expected the name of one file, seen " + name.string());
  return {place_, name.string()};
}

ResultFolder ResultFolder::inside(const std::string& name) const {
  return name.empty() ? *this : ResultFolder(place_->folder / name, place_->writer);
}

const fs::path& ResultFolder::path() const { return place_->folder; }

ResultFile ResultFile::unchecked_file(const fs::path& file, const Writer& writer) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  std::error_code none;
  if (fs::is_directory(file, none)) refuse(file, "expected a file to write to, seen a folder");
  if (is_there(folder) && !fs::is_directory(folder, none))
    refuse(folder, "expected a folder, seen a file");
  ResultFile result(std::make_shared<Place>(Place{folder, writer, false, false}),
                    file.filename().string());
  check_file(result);
  return result;
}

ResultFile result_file(const fs::path& file, const Writer& writer) {
  ResultFile result = ResultFile::unchecked_file(file, writer);
  prepare_folder(result.place_->folder);
  return result;
}

void check_file(const fs::path& file, const Writer& writer) {
  ResultFile::unchecked_file(file, writer);
}

void check_file(const ResultFile& file) {
  const ResultFile::Place& place = *file.place_;
  const fs::path path = file.path();
  if (!is_there(path)) return;
  if (is_input(path, place.writer))
    refuse(path, "this run reads it, and what is read is never written over; choose another --out");
  if (place.writer.permissions.force || is_journal(path)) return;
  const Mark mark = read_manifest(place.folder);  // read again: other processes may have changed it
  if (writing_command(mark, path)) return;
  refuse(path,
         fmt::format("a file that {} stands there; move it, choose another --out, or say "
                     "--force",
                     mark.files.contains(escaped(file.name_)) ? "was changed since abbe wrote it"
                                                              : "abbe did not make"));
}

void ResultFile::note(const std::optional<FileChecksum>& print) const {
  static std::mutex noting;  // several threads write files of one folder
  const std::lock_guard lock(noting);
  const std::string& command_line = place_->writer.permissions.command;
  const Written written{name_, subcommand_name(command_line), print};
  const bool known = says(read_manifest(place_->folder), written);
  if (known && place_->folder_declaration) return;
  append_to_manifest(place_->folder,
                     place_->folder_declaration
                         ? std::nullopt
                         : std::optional(FolderDeclaration{place_->whole, command_line}),
                     known ? std::nullopt : std::optional(written));
  place_->folder_declaration = true;
}

void reserve_file(const ResultFile& file) {
  check_file(file);
  file.note(std::nullopt);
}

void write_file(const ResultFile& file, const std::function<void(const fs::path&)>& write) {
  check_file(file);
  const fs::path path = file.path();
  UnfinishedFile unfinished(path.parent_path(), path.filename().string());
  try {
    write(unfinished.path());
    flush(unfinished.path());
    check_file(file);  // again, because writing took time
    file.note(file_checksum(unfinished.path()));
    unfinished.rename(path);
  } catch (const OutputFailure&) {
    throw;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::system_error& failure) {
    fail(path, failure.code().message());  // the text of the exception names the temporary file
  } catch (const std::exception& failure) {
    fail(path, failure.what());
  }
}

void write_file(const ResultFile& file, std::string_view text) {
  write_file(file, [&](const fs::path& temporary) { write_text(temporary, text); });
}

void write_table(const ResultFile& file, std::string_view text) {
  write_file(file, escaped_lines(text));
}

void write_json(const ResultFile& file, const nlohmann::ordered_json& json) {
  write_file(file, json_text(json));
}

void remove_file(const ResultFile& file) {
  const fs::path path = file.path();
  const Writer& writer = file.place_->writer;
  if (!is_there(path) || is_input(path, writer)) return;
  const auto wrote = writing_command(read_manifest(file.place_->folder), path);
  if (!wrote ||
      canonical_command(*wrote) != canonical_command(subcommand_name(writer.permissions.command)))
    return;
  std::error_code error;
  fs::remove(path, error);
  if (error)
    throw OutputFailure(escaped(path.string()) + ": cannot be removed: " + error.message());
}

std::string json_text(const nlohmann::ordered_json& json) {
  return escaped_lines(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

}  // namespace abbe::sim
