#include "sim/output.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <optional>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/versions.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_mark_bytes = std::size_t(64) << 20;

[[noreturn]] void fail(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": cannot be written: " + escaped(reason));
}

[[noreturn]] void refuse(const fs::path& file, const std::string& reason) {
  throw OutputFailure(escaped(file.string()) + ": " + escaped(reason));
}

// ---- what is abbe's

/// What the mark of a folder says.
struct Mark {
  bool folder = false;          ///< the folder as a whole is a result
  bool torn = false;            ///< its last line was not finished
  std::set<std::string> files;  ///< that abbe wrote
};

Mark read_mark(const fs::path& folder) {
  Mark mark;
  const fs::path file = folder / mark_name;
  std::error_code none;
  // a link could lead to a list of anybody's
  if (fs::symlink_status(file, none).type() != fs::file_type::regular) return mark;
  if (fs::file_size(file, none) > most_mark_bytes) return mark;
  std::ifstream in(file, std::ios::binary);
  std::string line;
  while (std::getline(in, line)) {
    mark.torn = in.eof();
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (!json.is_object()) continue;
    if (json.contains("folder") && json["folder"] == true) mark.folder = true;
    if (json.contains("file") && json["file"].is_string())
      mark.files.insert(json["file"].get<std::string>());
  }
  return mark;
}

bool is_there(const fs::path& file) {
  std::error_code none;
  return fs::exists(fs::symlink_status(file, none));
}

fs::path plain(const fs::path& file) { return fs::absolute(file).lexically_normal(); }

/// Whether two paths lead to one file, by whatever names, links or cases of letters.
bool is_same(const fs::path& a, const fs::path& b) {
  std::error_code none;
  return fs::equivalent(a, b, none) || plain(a) == plain(b);
}

bool is_input(const fs::path& file, const Writer& writer) {
  return std::ranges::any_of(writer.inputs,
                             [&](const fs::path& input) { return is_same(file, input); });
}

bool lies_below(const fs::path& file, const fs::path& folder) {
  std::error_code none;
  for (fs::path at = file; at.has_relative_path(); at = at.parent_path())
    if (fs::equivalent(at.parent_path(), folder, none)) return true;
  return false;
}

/// An input in the folder or below, by its own name or by what it is a link to.
std::optional<fs::path> input_below(const fs::path& folder, const Writer& writer) {
  std::error_code none;
  for (const fs::path& input : writer.inputs)
    if (lies_below(plain(input), folder) || lies_below(fs::weakly_canonical(input, none), folder))
      return input;
  return std::nullopt;
}

/// A folder below that is not there yet.
std::string another(const fs::path& folder) {
  fs::path name = (folder / "result").lexically_normal();
  for (int k = 2; is_there(name); ++k) name = (folder / fmt::format("result-{}", k)).lexically_normal();
  return "--out " + name.string();
}

void append(const fs::path& folder, const std::string& lines) {
  const fs::path file = folder / mark_name;
  const int descriptor =
      ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (descriptor < 0) fail(file, std::strerror(errno));
  const auto written = ::write(descriptor, lines.data(), lines.size());
  const int reason = written < 0 ? errno : ENOSPC;
  ::close(descriptor);
  if (written != ::ssize_t(lines.size())) fail(file, std::strerror(reason));
}

/// A journal of a study says in its own head whose it is: SQLite's application id.
bool is_journal(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string head(72, '\0');
  in.read(head.data(), std::streamsize(head.size()));
  return in && head.starts_with("SQLite format 3") && head.ends_with("abbe");
}

/// A journal, or what SQLite and its lock put beside it.
bool belongs_to_journal(const fs::path& file) {
  std::string name = file.string();
  for (const std::string_view ending : {"-lock", "-wal", "-shm"})
    if (name.ends_with(ending)) name.resize(name.size() - ending.size());
  return is_journal(name);
}

/// What a process that works beside this one, or that was killed, has not finished.
bool is_unfinished(const fs::directory_entry& entry) {
  constexpr std::string_view begins = ".unfinished-";
  const std::string name = entry.path().filename().string();
  std::error_code none;
  return name.starts_with(begins) && name.size() > begins.size() &&
         std::isdigit(static_cast<unsigned char>(name[begins.size()])) &&
         !entry.is_symlink(none) && entry.is_regular_file(none);
}

/// What in a folder is not abbe's: neither in its mark, nor a result itself, nor a journal.
struct Others {
  std::size_t count = 0;
  std::string first;  ///< by name
};

Others others_in(const fs::path& folder) {
  Others others;
  std::error_code none;
  const Mark mark = read_mark(folder);
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    const std::string name = entry.path().filename().string();
    const bool listed = mark.files.contains(name) || (name == mark_name && !mark.files.empty());
    if (listed || belongs_to_journal(entry.path()) || is_unfinished(entry)) continue;
    if (!entry.is_symlink(none) && entry.is_directory(none) && read_mark(entry.path()).folder)
      continue;
    if (++others.count == 1 || name < others.first) others.first = name;
  }
  return others;
}

// ---- writing

void write_text(const fs::path& file, std::string_view text) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  if (stream == nullptr) fail(file, std::strerror(errno));
  const bool written = std::fwrite(text.data(), 1, text.size(), stream) == text.size();
  const int reason = errno;
  if (std::fclose(stream) != 0 || !written) fail(file, std::strerror(written ? errno : reason));
}

/// A full disk may show only here.
void flush(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY);
  if (descriptor < 0) fail(file, std::strerror(errno));
  const int failed = ::fsync(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  if (failed != 0 && failed != EINVAL && failed != EROFS) fail(file, std::strerror(failed));
}

/// Makes the folder and proves that a file can be written in it.
void prove(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) fail(folder, error.message());
  // a link of that name, which an unpacked folder may hold, is not followed
  const fs::path probe = folder / (".unfinished-" + std::to_string(::getpid()));
  fs::remove(probe, error);
  const int descriptor = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW, 0666);
  if (descriptor < 0) fail(folder, std::strerror(errno));
  const bool written = ::write(descriptor, "probe\n", 6) == 6;
  const int reason = errno;
  ::close(descriptor);
  fs::remove(probe, error);
  if (!written) fail(folder, std::strerror(reason));
}

}  // namespace

/// A folder in which files are written, and what is known of it.
struct ResultFile::Place {
  fs::path folder;  ///< never empty
  Writer writer;
  Mark mark;
  bool whole = false;      ///< the folder as a whole becomes a result
  bool announced = false;  ///< the command stands in the mark
};

fs::path ResultFile::path() const {
  return place_->folder == "." ? fs::path(name_) : place_->folder / name_;
}

void check_folder(const fs::path& folder, const Writer& writer) {
  if (!is_there(folder)) return;
  std::error_code none;
  if (!fs::is_directory(folder, none)) refuse(folder, "expected a folder for results, seen a file");
  if (writer.permissions.force) return;
  if (const auto input = writer.beside_inputs ? std::nullopt : input_below(folder, writer))
    refuse(folder, fmt::format("expected a folder without anything that this run reads, seen {}; "
                               "choose another, such as {}, or say --force",
                               input->string(), another(folder)));
  if (read_mark(folder).folder) return;
  if (const Others others = others_in(folder); others.count > 0)
    refuse(folder, fmt::format("expected a new or empty folder, or one of results ({}), seen one "
                               "that abbe did not make, with {}{}; choose another, such as {}, or "
                               "say --force",
                               mark_name, others.first,
                               others.count > 1 ? fmt::format(" and {} more", others.count - 1) : "",
                               another(folder)));
}

ResultFolder::ResultFolder(const fs::path& folder, const Writer& writer) {
  const fs::path named = folder.empty() ? fs::path(".") : folder;
  check_folder(named, writer);
  // a folder taken by force stays the user's as a whole
  const bool whole = others_in(named).count == 0 || read_mark(named).folder;
  prove(named);
  Mark mark = read_mark(named);
  place_ = std::make_shared<ResultFile::Place>(
      ResultFile::Place{named, writer, std::move(mark), whole, false});
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

ResultFile result_file(const fs::path& file, const Writer& writer) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  std::error_code none;
  if (fs::is_directory(file, none)) refuse(file, "expected a file to write to, seen a folder");
  if (is_there(folder) && !fs::is_directory(folder, none))
    refuse(folder, "expected a folder, seen a file");
  const ResultFile result(
      std::make_shared<ResultFile::Place>(
          ResultFile::Place{folder, writer, read_mark(folder), false, false}),
      file.filename().string());
  const bool ours = result.place_->mark.files.contains(result.name_);
  if (is_there(file) && is_input(file, writer))
    refuse(file, "expected another file than one that this run reads");
  if (is_there(file) && !ours && !writer.permissions.force)
    refuse(file, "a file that abbe did not make stands there; choose another --out, or say --force");
  prove(folder);
  return result;
}

void check_file(const ResultFile& file) {
  const ResultFile::Place& place = *file.place_;
  const fs::path path = file.path();
  if (!is_there(path)) return;
  if (is_input(path, place.writer))
    refuse(path, "this run reads it, and what is read is never written over; choose another --out");
  const bool ours = place.mark.files.contains(file.name_) || is_journal(path);
  if (!ours && !place.writer.permissions.force)
    refuse(path,
           "a file that abbe did not make stands there; move it, choose another --out, or say "
           "--force");
}

void claim(const ResultFile& file) {
  check_file(file);
  ResultFile::Place& place = *file.place_;
  const bool ours = place.mark.files.contains(file.name_);
  if (ours && place.announced) return;
  std::string lines = place.mark.torn ? "\n" : "";
  nlohmann::ordered_json about;
  if (!place.announced) {
    if (place.whole) about["folder"] = true;
    about["command"] = place.writer.permissions.command;
    about["version"] = versions()["abbe"];
  }
  if (!ours) about["file"] = file.name_;
  const auto replace = nlohmann::ordered_json::error_handler_t::replace;
  append(place.folder, lines + escaped(about.dump(-1, ' ', false, replace)) + "\n");
  place.announced = true;
  place.mark.torn = false;
  place.mark.files.insert(file.name_);
}

void write_file(const ResultFile& file, const std::function<void(const fs::path&)>& write) {
  check_file(file);
  const fs::path path = file.path();
  // the ending stays last: writers choose the format by it
  const fs::path temporary =
      path.parent_path() /
      (".unfinished-" + std::to_string(::getpid()) + "-" + path.filename().string());
  std::error_code ignored;
  fs::remove(temporary, ignored);  // a link of that name would be followed
  try {
    write(temporary);
    flush(temporary);
    claim(file);
    std::error_code error;
    fs::rename(temporary, path, error);
    if (error) fail(path, error.message());
  } catch (const OutputFailure& failure) {
    fs::remove(temporary, ignored);
    throw;
  } catch (const std::exception& failure) {
    fs::remove(temporary, ignored);
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
  std::error_code none;
  if (!file.place_->mark.files.contains(file.name_) || is_input(path, file.place_->writer)) return;
  fs::remove(path, none);
}

std::string json_text(const nlohmann::ordered_json& json) {
  return escaped_lines(
             json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

}  // namespace abbe::sim
