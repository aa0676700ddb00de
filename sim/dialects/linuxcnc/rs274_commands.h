#pragma once

#include <array>
#include <deque>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/program_run.h"

/// Programs prepared for LinuxCNC's own interpreter, and its output. Of the block of a command it
/// prints only the line number (N word), so every line of the program and its subprograms gets a
/// unique number.
namespace abbe::sim::dialects::linuxcnc {

/// Marks a word whose number is an expression or a parameter.
inline constexpr int not_literal = -2;

/// Codes found in a line, comments excluded.
struct LineCodes {
  bool absolute = false;   ///< G53
  bool reference = false;  ///< G28 G28.1 G30 G30.1
  bool length = false;     ///< G43 without decimals
  bool no_length = false;  ///< G49
  bool radius = false;     ///< G41 G42 without decimals
  bool input = false;      ///< M66
  bool data = false;       ///< G10
  bool feed = false;       ///< F
  bool computed = false;   ///< a G or M whose number is computed
  bool assigns = false;    ///< #1 = 2
  bool system = false;     ///< #5221 to #5390: origins of the coordinate systems
  int h = -1, d = -1;      ///< H and D if they are literals; else `not_literal`
  int data_kind = -1;      ///< L if it is a literal
  int tool = -1;           ///< T if it is a literal; else Q of M61
};

/// Returns the codes of a line. Comments, and names between < and >, are skipped.
LineCodes parse_codes(std::string_view line);

/// A line of a program or of one of its subprograms.
struct SourceLine {
  int file = 0;  ///< file number in the canon
  int line = 0;
};

/// The program and the subprograms that it calls by a literal name, with numbered lines, written to
/// files.
class NumberedProgram {
 public:
  /// Writes the files into `folder`, which must exist. Subprograms in files of their own are
  /// searched as `Flow` does it, in `run.options().folder`. `file` is the name of the program;
  /// `before` holds lines without numbers that run before it, each with its line end. Throws
  /// BadInput for lines that rs274 cannot read completely, for Python in comments and paths in
  /// names, for M66, and beyond 1e9 lines.
  NumberedProgram(std::string_view text, const std::string& file, std::string before,
                  ProgramRun& run, const std::filesystem::path& folder);

  /// Returns the file name of the program in the folder.
  const std::string& name() const { return name_; }
  /// Returns the line of a number; the last line of the program if there is no such number.
  SourceLine place_of(int number) const;
  /// Returns the text of a line, without its end.
  std::string_view text_of(int number) const;
  /// Returns the largest number.
  int last() const { return files_.back().first + int(files_.back().lines.size()) - 1; }
  /// Returns the tool numbers that T words and M61 name.
  const std::set<int>& tools() const { return tools_; }

  /// Returns the number of a line of one of the files, as rs274 names it in an error.
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
  std::deque<File> files_;  ///< a deque, since lines refer to the texts
  std::set<int> tools_;
};

/// Length and radius, mm, that stand in the tool table for unknown values.
inline constexpr double unknown_length = 1e7, unknown_radius = 1e7;

/// A canonical command as rs274 prints it.
struct PrintedCommand {
  int number = 0;              ///< of the block; 0 if it has none
  std::string_view name;       ///< for example "STRAIGHT_FEED"
  std::string_view arguments;  ///< for example "1, 2.5, 0"
};

/// Parses a line of output. Returns nothing if it is no command.
std::optional<PrintedCommand> printed_command(std::string_view line);

/// Issues the output of rs274 as moves of the canon. Printed lengths are in the unit in force.
class Commands {
 public:
  /// `zero` is what the coordinate systems given to rs274 have on top of those of the scene, mm.
  Commands(ProgramRun& run, const NumberedProgram& program, const Eigen::Vector3d& zero);

  /// Processes a line of output. Returns false when the run should stop.
  bool take(std::string_view line);
  /// Completes the last tool call.
  void finish();
  /// Returns true once the program has reached its end.
  bool ended() const { return ended_; }

 private:
  using Six = std::array<double, 6>;
  using AxisVector = kinematics::AxisVector;
  using Numbers = std::vector<double>;

  [[noreturn]] void refuse(std::string expected, std::optional<std::string> seen = {}) const;
  void stand(const PrintedCommand& command);
  void apply(const PrintedCommand& command);
  bool apply_state(const PrintedCommand& command);
  bool apply_motion(const PrintedCommand& command);
  bool apply_spindle(const PrintedCommand& command);
  bool apply_tool(const PrintedCommand& command);
  bool apply_auxiliary_word(const PrintedCommand& command);

  int joint(std::size_t k) const { return canon_.joint_of("XYZABC"[k]); }
  Numbers numbers(const PrintedCommand& command, std::size_t least) const;
  Six six(const Numbers& numbers, std::size_t from) const;
  Six in_mm(Six lengths) const;
  void apply_frame();
  void set_units(bool inch);
  void set_tool_length(const Six& offset);
  /// Throws BadInput if rs274 has lost its axis positions: after a switch of units under a tool
  /// length.
  void check_length_unit(const char* word) const;
  AxisVector end_of(const Six& programmed);
  void straight(const Six& programmed, bool rapid);
  void arc(const Numbers& n);
  void tap(const Numbers& n);
  void feed(program::Straight move);
  void end_pending_tool();
  void comment(std::string_view text);

  ProgramRun& run_;
  program::Canon& canon_;
  const NumberedProgram& program_;
  Eigen::Vector3d zero_;
  int number_ = 0;     ///< number of the current block; 0 before the first
  LineCodes codes_;    ///< codes of its line
  int at_point_ = 0;   ///< traverses of a G28 so far
  double unit_ = 1.0;  ///< mm per unit
  bool inch_ = false, length_in_inch_ = false;
  int system_ = 1;
  Six g5x_{}, g92_{}, length_{};
  Six lacking_at_{};                           ///< positions of axes that the machine does not have
  double turned_ = 0.0;                        ///< rad
  std::array<std::size_t, 3> plane_{0, 1, 2};  ///< indices into Six
  std::optional<program::Feed> pitch_;   ///< feed per turn while synchronised with the spindle
  double speed_ = 0.0, most_rpm_ = 0.0;  ///< most_rpm_ > 0: G96
  bool speed_in_inch_ = false;
  int selected_ = 0, tool_ = 0, changed_in_ = -1, pending_in_ = -1;
  std::optional<int> pending_;  ///< T whose M6 may follow in the same block
  std::set<int> stored_;        ///< tools set by G10
  std::set<int> faulty_;        ///< blocks with an error
  bool ended_ = false, digits_checked_ = false;
};

}  // namespace abbe::sim::dialects::linuxcnc
