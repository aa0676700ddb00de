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
LineCodes parse_codes(std::string_view line);

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
  std::string numbered_name(std::string_view line, int number, int file, int at) const;
  void refuse_escapes(std::string_view line) const;
  const File& file_of(int number) const;

  ProgramRun& run_;
  std::string name_, before_;
  std::deque<File> files_;  ///< lines point into the texts, so they stay
  std::set<int> tools_;
};

/// Length and radius, mm, of tools that the table has to have and of which neither is known.
inline constexpr double unknown_length = 1e7, unknown_radius = 1e7;

/// A canonical command as rs274 prints it.
struct PrintedCommand {
  int number = 0;              ///< of the block; 0 where it has none
  std::string_view name;       ///< "STRAIGHT_FEED"
  std::string_view arguments;  ///< "1, 2.5, 0"
};

/// @return none where the line is not a command
std::optional<PrintedCommand> printed_command(std::string_view line);

/// What rs274 puts out as moves of the canon. Lengths that it prints count in the unit in force.
class Commands {
 public:
  /// @param zero  what the systems that it was given have on top of those of the scene, mm
  Commands(ProgramRun& run, const NumberedProgram& program, const Eigen::Vector3d& zero);

  /// @return false at the end of the program
  bool take(std::string_view line);
  /// What is still to be put out, at the end.
  void finish();
  /// The program has reached its end.
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
  /// That rs274 knows where its axes stand: not where the unit was switched under a tool length.
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
  int number_ = 0;     ///< of the block that runs; 0 before the first
  LineCodes codes_;    ///< of its line
  int at_point_ = 0;   ///< traverses of a G28 so far
  double unit_ = 1.0;  ///< mm
  bool inch_ = false, length_in_inch_ = false;
  int system_ = 1;
  Six g5x_{}, g92_{}, length_{};
  Six lacking_at_{};                           ///< of letters that the machine lacks
  double turned_ = 0.0;                        ///< rad
  std::array<std::size_t, 3> plane_{0, 1, 2};  ///< of six
  std::optional<program::Feed> pitch_;         ///< synchronised with the spindle
  double speed_ = 0.0, most_rpm_ = 0.0;        ///< of G96 above zero
  bool speed_in_inch_ = false;
  int selected_ = 0, tool_ = 0, changed_in_ = -1, pending_in_ = -1;
  std::optional<int> pending_;  ///< T whose M6 may follow in its block
  std::set<int> stored_;        ///< tools that G10 has given
  std::set<int> faulty_;        ///< blocks that were refused
  bool ended_ = false, digits_checked_ = false;
};

}  // namespace abbe::sim::dialects::linuxcnc
