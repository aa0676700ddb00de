#pragma once

#include <deque>

#include "sim/dialects/linuxcnc/linuxcnc.h"

/// Programs prepared for LinuxCNC's own interpreter, and its output. The interpreter prints only
/// the line number (N word) of the block of a command, so every line of the program and its
/// subprograms gets a unique number.
namespace abbe::sim::dialects::linuxcnc {

/// Value of a word whose number is an expression or a parameter.
inline constexpr int not_literal = -2;

/// Codes of a line, comments excluded.
struct LineCodes {
  std::vector<int> codes;  ///< in tenths, G43.1 as 431; M codes plus `m_code`
  bool has_f = false;
  bool has_computed_code = false;     ///< a G or M whose number is computed
  bool has_assignment = false;        ///< #1 = 2
  bool has_system_parameter = false;  ///< #5221 to #5390: origins of the coordinate systems
  int h = -1, d = -1;          ///< H and D if they are literals, else `not_literal`; -1: none
  int l = -1, p = -1, q = -1;  ///< L P Q if they are literals; -1: none
  int tool = -1;               ///< T if it is a literal, else Q of M61; -1: none

  static constexpr int m_code = 100000;
  /// Returns true if the line has one of the codes.
  bool has(std::initializer_list<int> wanted) const {
    return std::ranges::find_first_of(codes, wanted) != codes.end();
  }
  bool has_reference() const { return has({280, 281, 300, 301}); }
};

/// Returns the codes of a line without those in comments and in names between < and >.
LineCodes parse_codes(std::string_view line);

/// Location of a line of a program or of one of its subprograms.
struct SourceLine {
  int file = 0;  ///< file number in the canon
  int line = 0;
};

/// The program and the subprograms that it calls by a literal name, with numbered lines, written to
/// files.
class NumberedProgram {
 public:
  /// Writes the files into `folder`, which must exist. Searches subprograms in files of their own
  /// in `run.options().subprogram_folder`, as `Flow` does. `file` is the name of the program;
  /// `before` holds lines without numbers that run before it, each with its line end. Throws
  /// BadInput for lines that rs274 cannot read completely, for Python in comments and paths in
  /// names, for M66, and beyond 1e9 lines.
  NumberedProgram(std::string_view text, const std::string& file, std::string before,
                  ProgramRun& run, const std::filesystem::path& folder);

  /// Returns the file name of the program in the folder.
  const std::string& name() const { return name_; }
  /// Returns the location of a numbered line, or of the last line of the program if there is no
  /// such number.
  SourceLine location_of(int number) const;
  /// Returns the text of a numbered line without its line end.
  std::string_view text_of(int number) const;
  /// Returns the largest line number.
  int max_number() const { return files_.back().first + int(files_.back().lines.size()) - 1; }
  /// Returns the tool numbers that T words and M61 name.
  const std::set<int>& tools() const { return tools_; }

  /// Returns the number of a line of one of the files, as rs274 names it in an error.
  int number_of(const std::string& name, int line) const;

 private:
  struct File {
    std::string name;  ///< in the folder
    int canon_file = 0;
    std::string text;
    std::vector<std::string_view> lines;
    int first = 1;  ///< number of its first line
  };
  void add(const std::string& name, int canon_file, std::string text);
  void write(const File& file, const std::filesystem::path& folder);
  std::string numbered_line(std::string_view line, int number, int file, int at) const;
  void check_escapes(std::string_view line) const;
  const File& file_of(int number) const;

  ProgramRun& run_;
  std::string name_, before_;
  std::deque<File> files_;  ///< a deque, because lines refer to the texts
  std::set<int> tools_;
};

/// Length and radius, mm, that the tool table has in place of unknown values.
inline constexpr double unknown_length = 1e7, unknown_radius = 1e7;

/// A canonical command as rs274 prints it.
struct PrintedCommand {
  int number = 0;              ///< line number of the block; 0 if it has none
  std::string_view name;       ///< for example "STRAIGHT_FEED"
  std::string_view arguments;  ///< for example "1, 2.5, 0"
};

/// Parses a line of output. Returns nothing if it is no command.
std::optional<PrintedCommand> parse_command(std::string_view line);

/// Executes the commands that rs274 prints, as moves of the canon. Printed lengths are in the unit
/// in force.
class Commands {
 public:
  /// `zero`, mm, is added to the coordinate systems of the scene in those that rs274 is given.
  Commands(ProgramRun& run, const NumberedProgram& program, const Eigen::Vector3d& zero);

  /// Processes a line of output. Returns false when the run should stop.
  bool process(std::string_view line);
  /// Completes the last tool call.
  void finish();
  /// Returns true once the program has reached its end.
  bool has_ended() const { return has_ended_; }

 private:
  using SixAxes = std::array<double, 6>;
  using Numbers = std::vector<double>;

  [[noreturn]] void throw_input_error(std::string expected,
                                      std::optional<std::string> seen = {}) const;
  void set_location(const PrintedCommand& command);
  void apply(const PrintedCommand& command);
  bool apply_state(const PrintedCommand& command);
  bool apply_motion(const PrintedCommand& command);
  bool apply_spindle(const PrintedCommand& command);
  bool apply_tool(const PrintedCommand& command);
  bool apply_auxiliary_word(const PrintedCommand& command);

  int joint(std::size_t k) const { return canon_.joint_of("XYZABC"[k]); }
  Numbers parse_numbers(const PrintedCommand& command, std::size_t min_count) const;
  SixAxes six_axes(const Numbers& numbers, std::size_t from) const;
  SixAxes in_mm(SixAxes lengths) const;
  void apply_frame();
  void set_units(bool inch);
  void set_tool_length(const SixAxes& offset);
  /// Throws BadInput if the unit was switched under a tool length, after which rs274 has wrong axis
  /// positions.
  void check_length_unit(const char* word) const;
  AxisVector end_of(const SixAxes& programmed);
  void straight(const SixAxes& programmed, bool rapid);
  void arc(const Numbers& n);
  void tap(const Numbers& n);
  void feed(Straight move);
  void end_pending_tool();
  void comment(std::string_view text);

  ProgramRun& run_;
  program::Canon& canon_;
  const NumberedProgram& program_;
  Eigen::Vector3d zero_;
  int number_ = 0;           ///< number of the current block; 0 before the first
  LineCodes codes_;          ///< codes of its line
  int reference_moves_ = 0;  ///< traverses of a G28 or G30 so far
  double unit_ = 1.0;        ///< mm per unit
  bool is_inch_ = false, is_length_in_inch_ = false;
  int system_ = 1;
  SixAxes g5x_{}, g92_{}, length_{};
  SixAxes missing_axis_positions_{};           ///< positions of axes that the machine does not have
  double rotation_ = 0.0;                      ///< rad, rotation of the coordinate system
  std::array<std::size_t, 3> plane_{0, 1, 2};  ///< indices into Six
  std::optional<Feed> pitch_;                  ///< feed per revolution while synchronised
  double speed_ = 0.0, max_rpm_ = 0.0;         ///< most_rpm_ > 0: G96
  bool is_speed_in_inch_ = false;
  int selected_ = 0, tool_ = 0, tool_change_block_ = -1, pending_block_ = -1;
  std::optional<int> pending_tool_;  ///< tool of a T whose M6 may follow in the same block
  std::set<int> stored_tools_;       ///< tools set by G10
  std::set<int> faulty_blocks_;      ///< numbers of the blocks with an error
  bool has_ended_ = false, are_digits_checked_ = false;
};

}  // namespace abbe::sim::dialects::linuxcnc
