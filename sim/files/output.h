#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/files/atomic_output.h"

namespace abbe::sim {

/// What the user says of a run beside the scene.
struct Permissions {
  std::string command = {};  ///< as it was typed, for the marks of results
  bool force = false;        ///< --force: write into folders and over files that abbe did not make
  bool trust = false;        ///< --trust: run the programs that scenes and studies name
};

// The mark of a folder of results: JSON lines, to which abbe only ever appends. {"folder": true,
// "command": ..., "version": ...} where the whole folder is a result; {"file": NAME, "by": ...,
// "size": ..., "sum": ...} for every text that was written under a name. A file is abbe's as long
// as it is one of these texts, byte for byte: one that was changed, or put in its place, is the
// user's. A line is added before its file takes the name, so that a process killed in between
// leaves a line for a file that is not there, never a file of abbe's without a line.

/// What a file holds, in brief.
struct FileChecksum {
  std::uintmax_t size = 0;
  std::uint64_t sum = 0;
  friend bool operator==(const FileChecksum&, const FileChecksum&) = default;
};
/// @return none unless it is a plain file that can be read; a link is none
std::optional<FileChecksum> file_checksum(const std::filesystem::path& file);

struct Mark {
  struct Line {
    std::optional<FileChecksum> print;  ///< none for the journal of a study, which grows
    std::string by;                     ///< the command that wrote it
  };
  bool folder = false;                             ///< the folder as a whole is a result
  std::map<std::string, std::vector<Line>> files;  ///< by escaped name, in the order of writing
};
/// @return an empty one where there is none, or a link, which could lead to a list of anybody's
Mark read_manifest(const std::filesystem::path& folder);

/// The command that wrote `file` as it is now; none if abbe did not. A file without a print is its
/// own while it is empty or a database, whose reader looks further.
std::optional<std::string> writing_command(const Mark& mark, const std::filesystem::path& file);

/// The command of a whole command line: "run" of "abbe run scene.toml".
std::string subcommand_name(const std::string& command_line);

/// What a line of a mark says of one file.
struct Written {
  std::string name, by;
  std::optional<FileChecksum> print;
};
/// Whether the mark says so already, and says it last.
bool says(const Mark& mark, const Written& written);

/// What it says of the folder, and who writes.
struct FolderDeclaration {
  bool whole = false;
  std::string command_line;
};
/// Adds one line, in turn with other processes that write there.
/// @throws OutputFailure
void append_to_manifest(const std::filesystem::path& folder,
                        const std::optional<FolderDeclaration>& folder_declaration,
                        const std::optional<Written>& written);

// The one door by which results reach the disk. Outputs never touch a file that abbe did not make,
// nor, whatever the user permits, a file that the run reads. What abbe made stands in the mark of
// its folder (sim/files/output.h), with a check sum: a file that was changed since is the
// user's.

/// Who writes, and what it may not touch.
struct Writer {
  Permissions permissions = {};
  std::vector<std::filesystem::path> inputs = {};  ///< every file that the run reads
  bool beside_inputs = false;  ///< an input may lie in the folder: it is drawn there again
};

/// A file that may be written; it comes from `folder / name` or `result_file`, never from a path.
class ResultFile {
 public:
  std::filesystem::path path() const;

 private:
  struct Place;
  friend class ResultFolder;
  friend ResultFile result_file(const std::filesystem::path& file, const Writer& writer);
  friend void check_file(const std::filesystem::path& file, const Writer& writer);
  friend void reserve_file(const ResultFile& file);
  friend void check_file(const ResultFile& file);
  friend void write_file(const ResultFile& file,
                         const std::function<void(const std::filesystem::path&)>& write);
  friend void remove_file(const ResultFile& file);
  static ResultFile unchecked_file(const std::filesystem::path& file, const Writer& writer);
  void note(const std::optional<FileChecksum>& print) const;
  ResultFile(std::shared_ptr<Place> place, std::string name)
      : place_(std::move(place)), name_(std::move(name)) {}

  std::shared_ptr<Place> place_;
  std::string name_;
};

/// A folder for results, proved fit for writing: new, empty, with nothing but what abbe made, or
/// one that bears the mark of a result folder; and no input of the run lies in it or below. With
/// --force any folder, which then stays unmarked as a whole. The mark is written with the first
/// file.
class ResultFolder {
 public:
  /// @throws OutputFailure naming what stands in the way and what to do, or the system's reason
  ResultFolder(const std::filesystem::path& folder, const Writer& writer);

  /// @param name  of one file, without folders
  ResultFile operator/(const std::filesystem::path& name) const;
  /// A folder in it, taken by the same rules; itself for an empty name.
  /// @throws OutputFailure
  ResultFolder inside(const std::string& name) const;
  const std::filesystem::path& path() const;

 private:
  std::shared_ptr<ResultFile::Place> place_;
};

/// Refuses what ResultFolder would refuse, and makes nothing.
/// @throws OutputFailure
void check_folder(const std::filesystem::path& folder, const Writer& writer);

/// A single file in any folder, which is made where there is none.
/// @throws OutputFailure if `file` is there and is not abbe's, unless forced; or is an input
ResultFile result_file(const std::filesystem::path& file, const Writer& writer);

/// Refuses what result_file would refuse, and makes nothing.
/// @throws OutputFailure
void check_file(const std::filesystem::path& file, const Writer& writer);

/// Notes in the mark that the file is abbe's, before SQLite makes a journal of it.
/// @throws OutputFailure if a file stands there that abbe did not make, unless forced; or an input
void reserve_file(const ResultFile& file);

/// Refuses what `reserve_file` would refuse, and notes nothing: before an hour's work.
/// @throws OutputFailure
void check_file(const ResultFile& file);

/// Runs `write` on a temporary name beside it, flushes, notes what it wrote in the mark and renames
/// it; on failure nothing is left of it and an older `file` stands as it was.
/// @throws OutputFailure
void write_file(const ResultFile& file,
                const std::function<void(const std::filesystem::path&)>& write);

/// The same for a text, byte by byte.
void write_file(const ResultFile& file, std::string_view text);
/// The same for a table or a report: what would act on a terminal is escaped.
void write_table(const ResultFile& file, std::string_view text);
/// The same for JSON as `json_text` has it.
void write_json(const ResultFile& file, const nlohmann::ordered_json& json);

/// Removes a file that the same command wrote earlier (`run` and `compare` are one); any other
/// stays.
/// @throws OutputFailure if it cannot be removed
void remove_file(const ResultFile& file);

/// JSON as it is printed and written: indented, with a line end; what is no letter is escaped,
/// bytes that are not UTF-8 are replaced.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace abbe::sim
