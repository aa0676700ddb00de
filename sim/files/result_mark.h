#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

/// The mark of a folder of results: JSON lines, to which abbe only ever appends. {"folder": true,
/// "command": ..., "version": ...} where the whole folder is a result; {"file": NAME, "by": ...,
/// "size": ..., "sum": ...} for every text that was written under a name. A file is abbe's as long
/// as it is one of these texts, byte for byte: one that was changed, or put in its place, is the
/// user's. A line is added before its file takes the name, so that a process killed in between
/// leaves a line for a file that is not there, never a file of abbe's without a line.
namespace abbe::sim {

/// What a file holds, in brief.
struct Print {
  std::uintmax_t size = 0;
  std::uint64_t sum = 0;
  friend bool operator==(const Print&, const Print&) = default;
};
/// @return none unless it is a plain file that can be read; a link is none
std::optional<Print> print_of(const std::filesystem::path& file);

struct Mark {
  struct Line {
    std::optional<Print> print;  ///< none for the journal of a study, which grows
    std::string by;              ///< the command that wrote it
  };
  bool folder = false;                             ///< the folder as a whole is a result
  std::map<std::string, std::vector<Line>> files;  ///< by escaped name, in the order of writing
};
/// @return an empty one where there is none, or a link, which could lead to a list of anybody's
Mark read_mark(const std::filesystem::path& folder);

/// The command that wrote `file` as it is now; none if abbe did not. A file without a print is its
/// own while it is empty or a database, whose reader looks further.
std::optional<std::string> writer_in(const Mark& mark, const std::filesystem::path& file);

/// The command of a whole command line: "run" of "abbe run scene.toml".
std::string command_of(const std::string& command_line);

/// What a line of a mark says of one file.
struct Written {
  std::string name, by;
  std::optional<Print> print;
};
/// Whether the mark says so already, and says it last.
bool says(const Mark& mark, const Written& written);

/// What it says of the folder, and who writes.
struct Announced {
  bool whole = false;
  std::string command_line;
};
/// Adds one line, in turn with other processes that write there.
/// @throws OutputFailure
void append_to_mark(const std::filesystem::path& folder, const std::optional<Announced>& announced,
                    const std::optional<Written>& written);

}  // namespace abbe::sim
