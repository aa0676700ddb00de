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
constexpr std::size_t max_manifest_bytes = std::size_t(64) << 20;

bool is_plain_file(const fs::path& file) {
  std::error_code ignored_error;
  return fs::symlink_status(file, ignored_error).type() == fs::file_type::regular;
}

/// Returns the text under a key; an empty one if there is none.
std::string text_at(const json& line, const char* key) {
  const auto value = line.find(key);
  return value != line.end() && value->is_string() ? value->get<std::string>() : "";
}

/// Returns true if the file begins like an SQLite database: a journal that was killed early has no
/// application id yet.
bool is_database(const fs::path& file) {
  std::string head(16, '\0');
  return bool(std::ifstream(file, std::ios::binary).read(head.data(), 16)) &&
         head == std::string("SQLite format 3\0", 16);
}

/// Returns the checksum in a line of the manifest. The sum is written as 16 hexadecimal digits,
/// because many JSON readers cannot represent 64-bit integers.
std::optional<FileChecksum> checksum_in(const json& line) {
  const std::string sum = text_at(line, "sum");
  const auto size = line.find("size");
  if (size == line.end() || !size->is_number_unsigned() || sum.size() != 16 ||
      sum.find_first_not_of("0123456789abcdef") != std::string::npos)
    return std::nullopt;
  return FileChecksum{size->get<std::uintmax_t>(), std::stoull(sum, nullptr, 16)};
}

/// The manifest of a folder, open and locked for writing; other processes wait for the lock.
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

  /// Appends a line. Starts a new line first if a killed process left an unfinished one.
  void append(std::string line) const {
    char last_char = '\n';
    const ::off_t end = ::lseek(descriptor_, 0, SEEK_END);
    if (end > 0 && ::pread(descriptor_, &last_char, 1, end - 1) == 1 && last_char != '\n')
      line = "\n" + line;
    line += "\n";
    const auto bytes_written = ::write(descriptor_, line.data(), line.size());
    if (bytes_written != ::ssize_t(line.size())) fail(bytes_written < 0 ? errno : ENOSPC);
  }

 private:
  [[noreturn]] void fail(int reason) const {
    throw_output_failure(file_, std::string("cannot be written: ") + std::strerror(reason));
  }

  fs::path file_;
  int descriptor_ = -1;
};

}  // namespace

std::optional<FileChecksum> file_checksum(const fs::path& file) {
  if (!is_plain_file(file)) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  if (!in) return std::nullopt;
  FileChecksum checksum{0, fnv_1a_basis};
  std::array<char, 1 << 16> buffer;
  while (in.read(buffer.data(), buffer.size()), in.gcount() > 0) {
    const std::string_view bytes(buffer.data(), std::size_t(in.gcount()));
    checksum.sum = fnv_1a(bytes, checksum.sum);
    checksum.size += bytes.size();
  }
  return in.bad() ? std::nullopt : std::optional(checksum);
}

Manifest read_manifest(const fs::path& folder) {
  Manifest manifest;
  const fs::path file = folder / manifest_name;
  std::error_code ignored_error;
  if (!is_plain_file(file) || fs::file_size(file, ignored_error) > max_manifest_bytes)
    return manifest;
  std::ifstream in(file, std::ios::binary);
  for (std::string text; std::getline(in, text);) {
    const json line = json::parse(text, nullptr, false);
    // A damaged line, such as one that was cut off, is skipped.
    if (!line.is_object()) continue;
    if (line.contains("folder") && line["folder"] == true) manifest.is_whole_result = true;
    if (line.contains("file") && line["file"].is_string())
      manifest.files[line["file"].get<std::string>()].push_back(
          {checksum_in(line), text_at(line, "by")});
  }
  return manifest;
}

std::optional<std::string> writing_command(const Manifest& manifest, const fs::path& file) {
  const auto entries = manifest.files.find(escaped(file.filename().string()));
  if (entries == manifest.files.end()) return std::nullopt;
  const std::optional<FileChecksum> checksum = file_checksum(file);
  if (!checksum) return std::nullopt;
  const auto latest = std::find_if(
      entries->second.rbegin(), entries->second.rend(), [&](const Manifest::Entry& candidate) {
        return candidate.checksum ? *candidate.checksum == *checksum
                                  : checksum->size == 0 || is_database(file);
      });
  return latest == entries->second.rend() ? std::nullopt : std::optional(latest->by);
}

bool is_latest_entry(const Manifest& manifest, const FileEntry& entry) {
  const auto entries = manifest.files.find(escaped(entry.name));
  if (entries == manifest.files.end()) return false;
  const auto latest = std::find_if(
      entries->second.rbegin(), entries->second.rend(),
      [&](const Manifest::Entry& candidate) { return candidate.checksum == entry.checksum; });
  return latest != entries->second.rend() && latest->by == entry.by;
}

std::string subcommand_name(const std::string& command_line) {
  std::istringstream in(command_line);
  std::string program, command;
  in >> program >> command;
  return command;
}

void append_to_manifest(const fs::path& folder,
                        const std::optional<FolderDeclaration>& folder_declaration,
                        const std::optional<FileEntry>& entry) {
  ordered_json line;
  if (folder_declaration) {
    if (folder_declaration->is_whole_result) line["folder"] = true;
    line["command"] = folder_declaration->command_line;
    line["version"] = versions()["abbe"];
  }
  if (entry) {
    line["file"] = escaped(entry->name);  // JSON holds UTF-8 only
    line["by"] = entry->by;
    if (entry->checksum) {
      line["size"] = entry->checksum->size;
      line["sum"] = fmt::format("{:016x}", entry->checksum->sum);
    }
  }
  const auto replace = ordered_json::error_handler_t::replace;
  LockedManifest(folder).append(escaped(line.dump(-1, ' ', false, replace)));
}

namespace {

bool path_exists(const fs::path& file) {
  std::error_code ignored_error;
  return fs::exists(fs::symlink_status(file, ignored_error));
}

fs::path normalized(const fs::path& file) { return fs::absolute(file).lexically_normal(); }

/// Returns true if two paths lead to one file, whatever names, links or letter cases they use.
bool is_same(const fs::path& a, const fs::path& b) {
  std::error_code ignored_error;
  return fs::equivalent(a, b, ignored_error) || normalized(a) == normalized(b);
}

bool is_input(const fs::path& file, const Writer& writer) {
  return std::ranges::any_of(writer.inputs,
                             [&](const fs::path& input) { return is_same(file, input); });
}

/// Returns true if a file is in a folder or in one of its subfolders.
bool is_below_folder(const fs::path& file, const fs::path& folder) {
  std::error_code ignored_error;
  for (fs::path path = file; path.has_relative_path(); path = path.parent_path())
    if (fs::equivalent(path.parent_path(), folder, ignored_error)) return true;
  return false;
}

/// Returns an input in the folder or below, by its own name or by the target of its link.
std::optional<fs::path> input_inside(const fs::path& folder, const Writer& writer) {
  std::error_code ignored_error;
  for (const fs::path& input : writer.inputs)
    if (is_below_folder(normalized(input), folder) ||
        is_below_folder(fs::weakly_canonical(input, ignored_error), folder))
      return input;
  return std::nullopt;
}

/// Returns an option such as "--out out/result-2" with a path that does not exist, for messages.
std::string unused_out_option(const fs::path& folder) {
  fs::path name = (folder / "result").lexically_normal();
  for (int k = 2; path_exists(name); ++k)
    name = (folder / fmt::format("result-{}", k)).lexically_normal();
  return "--out " + name.string();
}

/// Returns true for a journal of a study, which has the application id of abbe in its SQLite
/// header.
bool is_journal(const fs::path& file) {
  std::error_code ignored_error;
  if (fs::symlink_status(file, ignored_error).type() != fs::file_type::regular) return false;
  std::ifstream in(file, std::ios::binary);
  // The application id is at bytes 68 to 71 of the header.
  std::string head(72, '\0');
  in.read(head.data(), std::streamsize(head.size()));
  return in && head.starts_with("SQLite format 3") && head.ends_with("abbe");
}

/// Returns true for a journal and for the files that SQLite and its lock create next to one.
bool is_journal_file(const fs::path& file) {
  std::string name = file.string();
  for (const std::string_view ending : {"-lock", "-wal", "-shm"})
    if (name.ends_with(ending)) name.resize(name.size() - ending.size());
  return is_journal(name);
}

/// Returns true for hidden files such as .gitkeep. They do not count as foreign: abbe never writes
/// a file of such a name.
bool is_hidden(const fs::directory_entry& entry) {
  std::error_code ignored_error;
  const std::string name = entry.path().filename().string();
  return name.starts_with('.') && name != manifest_name && !entry.is_symlink(ignored_error) &&
         entry.is_regular_file(ignored_error);
}

bool has_foreign_files(const fs::path& folder);

/// Returns true if an entry of a folder with this manifest is not abbe's. Files listed with their
/// present checksum, journals, and folders whose files are all abbe's belong to abbe.
bool is_foreign_entry(const Manifest& manifest, const fs::directory_entry& entry) {
  std::error_code ignored_error;
  if (entry.path().filename() == manifest_name && !manifest.files.empty()) return false;
  if (is_hidden(entry) || is_journal_file(entry.path())) return false;
  if (writing_command(manifest, entry.path())) return false;
  return entry.is_symlink(ignored_error) || !entry.is_directory(ignored_error) ||
         has_foreign_files(entry.path());
}

/// Returns true if a folder holds files that are not abbe's. A failed run may leave empty folders
/// without a manifest; they hold nothing that a later run could damage.
bool has_foreign_files(const fs::path& folder) {
  const Manifest manifest = read_manifest(folder);
  if (manifest.is_whole_result) return false;
  std::error_code read_error;
  const fs::directory_iterator entries(folder, read_error);
  return read_error || std::any_of(begin(entries), end(entries), [&](const auto& entry) {
           return is_foreign_entry(manifest, entry);
         });
}

/// The entries of a folder that are not abbe's.
struct ForeignFiles {
  std::size_t count = 0;
  std::string first;  ///< first by name
};

ForeignFiles find_foreign_files(const fs::path& folder) {
  ForeignFiles foreign;
  std::error_code ignored_error;
  const Manifest manifest = read_manifest(folder);
  for (const auto& entry : fs::directory_iterator(folder, ignored_error)) {
    if (!is_foreign_entry(manifest, entry)) continue;
    const std::string name = entry.path().filename().string();
    if (++foreign.count == 1 || name < foreign.first) foreign.first = name;
  }
  return foreign;
}

/// Returns the command that owns the files written by `command`: `run` owns those of `compare` too,
/// because both write the same files of a case.
std::string canonical_command(const std::string& command) {
  return command == "compare" ? "run" : command;
}

[[noreturn]] void throw_errno(int reason) {
  throw std::system_error(reason, std::generic_category());
}

void write_text(const fs::path& file, std::string_view text) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  if (stream == nullptr) throw_errno(errno);
  const bool is_written = std::fwrite(text.data(), 1, text.size(), stream) == text.size();
  const int write_errno = errno;
  if (std::fclose(stream) != 0 || !is_written) throw_errno(is_written ? errno : write_errno);
}

/// Flushes a file to disk, because a full disk may be reported only then. EINVAL and EROFS are
/// ignored: they mean that the file, such as a pipe, cannot be flushed.
void flush(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY);
  if (descriptor < 0) throw_errno(errno);
  const int sync_errno = ::fsync(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  if (sync_errno != 0 && sync_errno != EINVAL && sync_errno != EROFS) throw_errno(sync_errno);
}

/// Creates the folder and tests that a file can be written in it.
void prepare_folder(const fs::path& folder) {
  try {
    fs::create_directories(folder);
    remove_abandoned_files(folder);
    write_text(UnfinishedFile(folder, "probe").path(), "probe\n");
  } catch (const std::system_error& failure) {
    throw_output_failure(folder, "cannot be written: " + failure.code().message());
  }
}

}  // namespace

/// A folder for result files, and its declarations so far.
struct ResultFile::Directory {
  fs::path folder;  ///< never empty
  Writer writer;
  bool is_whole_result = false;  ///< the folder as a whole becomes a result
  bool is_declared = false;      ///< the manifest has the entry for the folder
};

fs::path ResultFile::path() const {
  return directory_->folder == "." ? fs::path(name_) : directory_->folder / name_;
}

void check_folder(const fs::path& folder, const Writer& writer) {
  if (!path_exists(folder)) return;
  std::error_code ignored_error;
  if (!fs::is_directory(folder, ignored_error))
    throw_output_failure(folder, "expected a folder for results, seen a file");
  if (writer.permissions.force) return;
  if (const auto input = writer.beside_inputs ? std::nullopt : input_inside(folder, writer))
    throw_output_failure(folder, fmt::format("expected a folder without input files of this run, "
                                             "seen {}; choose another, such as {}",
                                             input->string(), unused_out_option(folder)));
  if (read_manifest(folder).is_whole_result) return;
  // The manifest is read again: another run lists its files there before it creates them.
  if (const ForeignFiles foreign = find_foreign_files(folder);
      foreign.count > 0 && !read_manifest(folder).is_whole_result)
    throw_output_failure(
        folder,
        fmt::format("expected a new or empty folder, or a result folder ({}), seen a folder not "
                    "made by abbe, with {}{}; choose another, such as {}, or use --force",
                    manifest_name, foreign.first,
                    foreign.count > 1 ? fmt::format(" and {} more", foreign.count - 1) : "",
                    unused_out_option(folder)));
}

ResultFolder::ResultFolder(const fs::path& folder, const Writer& writer) {
  const fs::path result_folder = folder.empty() ? fs::path(".") : folder;
  check_folder(result_folder, writer);
  // A folder with the user's files, accepted by --force, does not become abbe's as a whole.
  const bool is_whole_result =
      read_manifest(result_folder).is_whole_result ||
      find_foreign_files(result_folder).count == 0 ||
      read_manifest(result_folder).is_whole_result;  // another run may have written
                                                     // its manifest in between
  prepare_folder(result_folder);
  directory_ = std::make_shared<ResultFile::Directory>(
      ResultFile::Directory{result_folder, writer, is_whole_result, false});
}

ResultFile ResultFolder::operator/(const fs::path& name) const {
  if (name.empty() || name.has_parent_path())
    throw std::invalid_argument("expected a single file name, seen " + name.string());
  return {directory_, name.string()};
}

ResultFolder ResultFolder::inside(const std::string& name) const {
  return name.empty() ? *this : ResultFolder(directory_->folder / name, directory_->writer);
}

const fs::path& ResultFolder::path() const { return directory_->folder; }

ResultFile ResultFile::unchecked_file(const fs::path& file, const Writer& writer) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  std::error_code ignored_error;
  if (fs::is_directory(file, ignored_error))
    throw_output_failure(file, "expected a file to write to, seen a folder");
  if (path_exists(folder) && !fs::is_directory(folder, ignored_error))
    throw_output_failure(folder, "expected a folder, seen a file");
  ResultFile result(std::make_shared<Directory>(Directory{folder, writer, false, false}),
                    file.filename().string());
  check_file(result);
  return result;
}

ResultFile result_file(const fs::path& file, const Writer& writer) {
  ResultFile result = ResultFile::unchecked_file(file, writer);
  prepare_folder(result.directory_->folder);
  return result;
}

void check_file(const fs::path& file, const Writer& writer) {
  ResultFile::unchecked_file(file, writer);
}

void check_file(const ResultFile& file) {
  const ResultFile::Directory& directory = *file.directory_;
  const fs::path path = file.path();
  if (!path_exists(path)) return;
  if (is_input(path, directory.writer))
    throw_output_failure(
        path, "this run reads it, and input files are never overwritten; choose another --out");
  if (directory.writer.permissions.force || is_journal(path)) return;
  const Manifest manifest =
      read_manifest(directory.folder);  // read again: other processes may have changed it
  if (writing_command(manifest, path)) return;
  throw_output_failure(
      path,
      fmt::format("there is already a file that {}; move it, choose another --out, or use --force",
                  manifest.files.contains(escaped(file.name_)) ? "was changed since abbe wrote it"
                                                               : "abbe did not make"));
}

void ResultFile::add_to_manifest(const std::optional<FileChecksum>& checksum) const {
  static std::mutex manifest_mutex;  // several threads write files of one folder
  const std::lock_guard lock(manifest_mutex);
  const std::string& command_line = directory_->writer.permissions.command;
  const FileEntry entry{name_, subcommand_name(command_line), checksum};
  const bool is_listed = is_latest_entry(read_manifest(directory_->folder), entry);
  if (is_listed && directory_->is_declared) return;
  append_to_manifest(directory_->folder,
                     directory_->is_declared ? std::nullopt
                                             : std::optional(FolderDeclaration{
                                                   directory_->is_whole_result, command_line}),
                     is_listed ? std::nullopt : std::optional(entry));
  directory_->is_declared = true;
}

void reserve_file(const ResultFile& file) {
  check_file(file);
  file.add_to_manifest(std::nullopt);
}

void write_file(const ResultFile& file, const std::function<void(const fs::path&)>& write) {
  check_file(file);
  const fs::path path = file.path();
  UnfinishedFile unfinished(path.parent_path(), path.filename().string());
  try {
    write(unfinished.path());
    flush(unfinished.path());
    check_file(file);  // again, because writing took time
    file.add_to_manifest(file_checksum(unfinished.path()));
    unfinished.rename(path);
  } catch (const OutputFailure&) {
    throw;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::system_error& failure) {
    throw_output_failure(
        path, "cannot be written: " +
                  failure.code().message());  // the text of the exception names the temporary file
  } catch (const std::exception& failure) {
    throw_output_failure(path, std::string("cannot be written: ") + failure.what());
  }
}

void write_file(const ResultFile& file, std::string_view text) {
  write_file(file, [&](const fs::path& temporary) { write_text(temporary, text); });
}

void write_table(const ResultFile& file, std::string_view text) {
  write_file(file, escape_keeping_lines(text));
}

void write_json(const ResultFile& file, const nlohmann::ordered_json& json) {
  write_file(file, json_text(json));
}

void remove_file(const ResultFile& file) {
  const fs::path path = file.path();
  const Writer& writer = file.directory_->writer;
  if (!path_exists(path) || is_input(path, writer)) return;
  const auto author = writing_command(read_manifest(file.directory_->folder), path);
  if (!author ||
      canonical_command(*author) != canonical_command(subcommand_name(writer.permissions.command)))
    return;
  std::error_code error;
  fs::remove(path, error);
  if (error) throw_output_failure(path, "cannot be removed: " + error.message());
}

std::string json_text(const nlohmann::ordered_json& json) {
  return escape_keeping_lines(
             json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

}  // namespace abbe::sim
