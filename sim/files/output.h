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

/// Result folders and files, and the manifests that state which files belong to abbe.
namespace abbe::sim {

/// Permissions that the user gives on the command line.
struct Permissions {
  std::string command = {};  ///< command line, for the manifests of results
  bool force = false;  ///< --force: allows writing into folders and over files that abbe did not
                       ///< make
  bool trust = false;  ///< --trust: allows running the programs that scenes and studies name
};

// The manifest of a result folder is a file of JSON lines, to which abbe only appends. A line is
// {"folder": true, "command": ..., "version": ...} if the whole folder is a result, or {"file":
// NAME, "by": ..., "size": ..., "sum": ...} for every content that was written under a name. A file
// is abbe's as long as its bytes match one of these entries; a file that was changed or replaced is
// the user's. An entry is added before its file gets the name, so that a process killed in between
// leaves an entry for a missing file, never a file of abbe's without an entry.

/// Size and checksum of a file.
struct FileChecksum {
  std::uintmax_t size = 0;
  std::uint64_t sum = 0;
  friend bool operator==(const FileChecksum&, const FileChecksum&) = default;
};
/// Returns the checksum of a regular file; nothing if the file is a link or cannot be read.
std::optional<FileChecksum> file_checksum(const std::filesystem::path& file);

/// The contents of the manifest of a folder.
struct Manifest {
  struct Entry {
    std::optional<FileChecksum> checksum;  ///< empty for the journal of a study, which grows
    std::string by;                        ///< command that wrote the file
  };
  bool is_whole_result = false;                     ///< the folder as a whole is a result
  std::map<std::string, std::vector<Entry>> files;  ///< by escaped name, in the order of writing
};
/// Returns the manifest of a folder; an empty one if there is none, or if it is a link, which could
/// lead to any file.
Manifest read_manifest(const std::filesystem::path& folder);

/// Returns the command that wrote `file` in its present state; nothing if abbe did not write it. A
/// file listed without a checksum counts as abbe's while it is empty or a database; the reader of
/// the database checks further.
std::optional<std::string> writing_command(const Manifest& manifest,
                                           const std::filesystem::path& file);

/// Returns the subcommand of a command line, for example "run" for "abbe run scene.toml".
std::string subcommand_name(const std::string& command_line);

/// An entry of a manifest for one file.
struct FileEntry {
  std::string name, by;
  std::optional<FileChecksum> checksum;
};
/// Returns true if `entry` is the latest entry of the manifest for a file of this name and content.
bool is_latest_entry(const Manifest& manifest, const FileEntry& entry);

/// An entry of a manifest for the folder.
struct FolderDeclaration {
  bool is_whole_result = false;  ///< the folder as a whole is a result
  std::string command_line;      ///< of the run that writes
};
/// Adds one line to the manifest while other processes that write to it wait.
/// @throws OutputFailure
void append_to_manifest(const std::filesystem::path& folder,
                        const std::optional<FolderDeclaration>& folder_declaration,
                        const std::optional<FileEntry>& entry);

// The functions below are the only ones that write results to disk. They never change a file that
// abbe did not make, nor, with any permission, a file that the run reads. Files of abbe are listed
// with a checksum in the manifest of their folder; a file that was changed since is the user's.

/// Permissions of a command that writes, and the files that it must not touch.
struct Writer {
  Permissions permissions = {};
  std::vector<std::filesystem::path> inputs = {};  ///< all files that the run reads
  bool beside_inputs = false;  ///< the folder may hold inputs, as when a result is drawn again
};

/// A file that may be written. It is obtained from `folder / name` or `result_file` only, which
/// check the path.
class ResultFile {
 public:
  std::filesystem::path path() const;

 private:
  struct Directory;
  friend class ResultFolder;
  friend ResultFile result_file(const std::filesystem::path& file, const Writer& writer);
  friend void check_file(const std::filesystem::path& file, const Writer& writer);
  friend void reserve_file(const ResultFile& file);
  friend void check_file(const ResultFile& file);
  friend void write_file(const ResultFile& file,
                         const std::function<void(const std::filesystem::path&)>& write);
  friend void remove_file(const ResultFile& file);
  static ResultFile unchecked_file(const std::filesystem::path& file, const Writer& writer);
  void add_to_manifest(const std::optional<FileChecksum>& checksum) const;
  ResultFile(std::shared_ptr<Directory> directory, std::string name)
      : directory_(std::move(directory)), name_(std::move(name)) {}

  std::shared_ptr<Directory> directory_;
  std::string name_;
};

/// A folder for results that was checked before writing: it is new or empty, holds only files of
/// abbe, or has the manifest of a result folder, and no input of the run is in it or below. With
/// --force any folder is accepted, but a folder with other files does not become a result as a
/// whole. The manifest is written with the first file.
class ResultFolder {
 public:
  /// @throws OutputFailure naming the obstacle and a remedy, or the reason of the system
  ResultFolder(const std::filesystem::path& folder, const Writer& writer);

  /// Returns the file of that name in the folder.
  /// @param name  file name without folders
  ResultFile operator/(const std::filesystem::path& name) const;
  /// Returns a folder inside, checked by the same rules; this folder for an empty name.
  /// @throws OutputFailure
  ResultFolder inside(const std::string& name) const;
  const std::filesystem::path& path() const;

 private:
  std::shared_ptr<ResultFile::Directory> directory_;
};

/// Performs the checks of ResultFolder and creates nothing.
/// @throws OutputFailure
void check_folder(const std::filesystem::path& folder, const Writer& writer);

/// Returns a single file in any folder, which is created if it does not exist.
/// @throws OutputFailure if `file` exists and is not abbe's, unless forced; or if it is an input
ResultFile result_file(const std::filesystem::path& file, const Writer& writer);

/// Performs the checks of result_file and creates nothing.
/// @throws OutputFailure
void check_file(const std::filesystem::path& file, const Writer& writer);

/// Adds the file to the manifest, before SQLite creates a journal of that name.
/// @throws OutputFailure if a file of that name exists that abbe did not make, unless forced; or if
/// it is an input
void reserve_file(const ResultFile& file);

/// Performs the checks of `reserve_file` without writing, so that a long run fails at its start.
/// @throws OutputFailure
void check_file(const ResultFile& file);

/// Calls `write` with a temporary path next to the file, flushes what it wrote, adds the checksum
/// to the manifest and renames the temporary file. On failure the temporary file is removed and an
/// older `file` stays unchanged.
/// @throws OutputFailure
void write_file(const ResultFile& file,
                const std::function<void(const std::filesystem::path&)>& write);

/// Writes a text in the same way, byte by byte.
void write_file(const ResultFile& file, std::string_view text);
/// Writes a table or a report in the same way; control characters are escaped.
void write_table(const ResultFile& file, std::string_view text);
/// Writes JSON in the same way, formatted by `json_text`.
void write_json(const ResultFile& file, const nlohmann::ordered_json& json);

/// Removes a file that the same command wrote earlier (`run` and `compare` count as one); any other
/// file stays.
/// @throws OutputFailure if it cannot be removed
void remove_file(const ResultFile& file);

/// Returns JSON as abbe prints and writes it: indented and ending with a newline, with control
/// characters escaped and bytes that are not UTF-8 replaced.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace abbe::sim
