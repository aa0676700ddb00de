#pragma once

#include <deque>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/program_run.h"

/// Programs for LinuxCNC's own interpreter, which says of a command only the line number (N word)
/// of its block: every line of the program and of its subprograms gets a number of its own.
namespace abbe::sim::dialects::linuxcnc {

/// A word whose number is worked out.
inline constexpr int not_literal = -2;

/// Codes that stand in a line, comments left out.
struct LineCodes {
  bool absolute = false;   ///< G53
  bool reference = false;  ///< G28 G28.1 G30 G30.1
  bool length = false;     ///< G43 without a point
  bool no_length = false;  ///< G49
  bool radius = false;     ///< G41 G42 without a point
  bool input = false;      ///< M66
  bool data = false;       ///< G10
  bool feed = false;       ///< F
  bool computed = false;   ///< a G or M whose number is worked out
  bool assigns = false;    ///< #1 = 2
  bool system = false;     ///< #5221 to #5390: origins of the coordinate systems
  int h = -1, d = -1;      ///< words H and D, if they are numbers; `not_literal`
  int data_kind = -1;      ///< L, if it is a number
  int tool = -1;           ///< T, if it is a number; else M61 Q
};

/// What is in the line. Comments, and names between < and >, are passed over.
LineCodes codes_of(std::string_view line);

/// A line of a program, or of one of its subprograms.
struct SourceLine {
  int file = 0;  ///< of the canon
  int line = 0;
};

/// The program and the subprograms that it calls by a literal name, numbered and written down.
class NumberedProgram {
 public:
  /// Writes them into `folder`, which exists. Subprograms that stand in files of their own are
  /// looked for as `Flow` does it, in `run.options().folder`.
  /// @param file  of the program
  /// @param before  lines without numbers that run before it, each with its end
  /// @throws BadInput for lines that rs274 cannot read whole, for Python in comments and paths in
  ///         names, for M66, and beyond 1e9 lines
  NumberedProgram(std::string_view text, const std::string& file, std::string before,
                  ProgramRun& run, const std::filesystem::path& folder);

  /// Of the program in the folder.
  const std::string& name() const { return name_; }
  /// Where a number leads; the last line of the program where there is no such number.
  SourceLine place_of(int number) const;
  /// The text of the line, without its end.
  std::string_view text_of(int number) const;
  /// The largest number.
  int last() const { return files_.back().first + int(files_.back().lines.size()) - 1; }
  /// Numbers of tools that T words and M61 name.
  const std::set<int>& tools() const { return tools_; }

  /// Where an error stands that names a line of one of the files.
  int number_of(const std::string& name, int line) const;

 private:
  struct File {
    std::string name;  ///< in the folder
    int of_canon = 0;
    std::string text;
    std::vector<std::string_view> lines;
    int first = 1;  ///< number of its first line
  };
  void add(const std::string& name, int of_canon, std::string text);
  void write(const File& file, const std::filesystem::path& folder);
  std::string numbered(std::string_view line, int number, int file, int at) const;
  void refuse_escapes(std::string_view line) const;
  const File& file_of(int number) const;

  ProgramRun& run_;
  std::string name_, before_;
  std::deque<File> files_;  ///< lines point into the texts, so they stay
  std::set<int> tools_;
};

}  // namespace abbe::sim::dialects::linuxcnc
