#pragma once

#include <array>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/linuxcnc_numbered.h"
#include "sim/dialects/program_run.h"

namespace abbe::sim::dialects::linuxcnc {

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
  bool apply_aside(const PrintedCommand& command);

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
