#pragma once

#include "sim/dialects/gcode.h"

/// Programs of LinuxCNC: their blocks and the state of the control.
namespace abbe::sim::dialects::linuxcnc {

using gcode::Block;
using gcode::Code;
using gcode::Group;
using gcode::Word;

/// Returns the operators and functions of RS274/NGC.
const ExpressionGrammar& grammar();

/// Returns the table entry of a code. `letter` is G or M.
const gcode::CodeProperties& find_entry(char letter, int tenths);

/// Parses a line without O word into `block`, whose memory is reused. `operands` evaluates
/// parameters and functions. Throws BadInput.
void read_block(Cursor cursor, ProgramRun& run, OperandParser& operands, Block& block);

/// Returns the integer from 0 to `max` that a computed value stands for, within 1e-4. Throws
/// BadInput at byte `from` of the line.
int whole_number(const Cursor& cursor, std::size_t from, double value, int max);

/// Parses the name in < > at the cursor, and returns it in lower case without blanks. Throws
/// BadInput.
std::string parse_name(Cursor& cursor);

/// A value for every axis letter, mm and degrees.
using NineAxes = std::array<double, 9>;

/// Returns the frame of a coordinate system in the order of LinuxCNC: the shift of G92 or G52, then
/// the rotation about Z, rad, then the origin. Values in the order of `axis_letters`, mm and
/// degrees. Throws BadInput at `cause` for a rotation on a machine without X Y Z.
program::Frame system_frame(const program::Canon& canon, std::span<const double> origin,
                            std::span<const double> shift, double rotation, const Cause& cause);

/// State of a LinuxCNC control: modes, coordinate systems and tools. Executes blocks and issues
/// their moves to the canon.
class Machine : public GCodeControl {
 public:
  explicit Machine(ProgramRun& run);

  /// Executes a block. Returns false at the end of the program.
  bool execute(const Block& block);
  /// Returns a function that restores the modes in force now, all except the motion mode (M70). It
  /// throws BadInput if tool length or cutter compensation differ from those saved.
  std::function<void(const Cause&)> saved_modes();
  /// Makes the moves that are still postponed at the end of the program.
  void finish() { compensation_.end(); }

  /// Returns a numbered parameter from 31 on, including those of the machine, or 0 if it has not
  /// been set.
  double parameter(int number) const;
  /// Sets a parameter. Returns false if it is read only.
  bool set_parameter(int number, double value);
  /// Returns a named parameter that the control itself defines, such as _x or _metric.
  std::optional<double> named_parameter(std::string_view name) const;

 private:
  // Words and modes.
  void check_words(const Block& block) const;
  void check_motion(const Block& block) const;
  void check_outputs(const Block& block) const;
  Block without_spindle(const Block& block) const;
  void note_start_modes(const Block& block);
  void set_modes(const Block& block);
  void set_feed(const Block& block);
  void set_spindle(const Block& block);
  void call_tools(const Block& block);
  void execute_one_block(const Block& block);
  void dwell(const Block& block);
  const Word* first_axis_word(const Block& block) const { return block.first_word("XYZABCUVW@^"); }
  /// Returns the value of an axis word, mm or degrees. X becomes a radius, also under G7.
  double axis_word(int k, const Word& word) const;
  Cause motion_cause(const Block& block) const;

  // Coordinate systems and tool offsets.
  void set_tool_length(const Block& block);
  double tool_length(int tool, const Cause& cause) const;
  void select_work_offset(int number);
  void load_origin(int number);
  void apply_frame();
  void store_data(const Block& block);
  void store_system(const Block& block, int number, bool by_position);
  void store_tool(const Block& block, int kind);
  void shift_origin(const Block& block);
  void move_to_reference(const Block& block);
  /// Returns the current position of an axis in program coordinates, mm or degrees.
  double programmed(int k) const;
  /// Returns the current position of an axis without any offset, mm or degrees.
  double axis_position(int k) const;
  /// Returns the current position of an axis from the origin of the work offsets, mm or degrees.
  double position_from_zero(int k) const;
  /// Returns the tool length in force along an axis, mm or degrees.
  double tool_shift(int k) const;
  void apply_length(const Cause& cause);

  // Motion.
  void move(const Block& block);
  Target block_target(const Block& block, bool in_machine_coordinates) const;
  /// Returns the X and Y of the end that @ and ^ state, mm, in program coordinates.
  Eigen::Vector2d polar_end(const Block& block, const Eigen::Vector2d& from) const;
  void straight(const Block& block, AxisVector end, std::uint32_t stated_axes,
                bool in_machine_coordinates);
  void arc(const Block& block, AxisVector end, std::uint32_t stated_axes);
  void make_synchronised_line(const Block& block, AxisVector end);
  void execute_spline(const Block& block);

  // Canned cycles.
  void execute_cycle(const Block& block);
  void read_cycle_words(const Block& block);
  void make_holes(const Block& block);
  /// A hole in program coordinates.
  struct Hole {
    AxisVector position;
    int depth_joint = 2;                                  ///< joint along the hole
    double r = 0.0, bottom = 0.0, clearance_level = 0.0;  ///< mm
  };
  void make_hole(const Hole& hole);
  int whole_number(const Word& word, int max) const;
  void move_to(const AxisVector& end, bool rapid);
  void execute_thread(const Block& block);

  // Cutter compensation.
  void set_compensation(const Block& block);

  friend class ThreadPasses;

  std::vector<double> parameters_;
  std::array<bool, 9> system_changed_{};   ///< changed from what the scene states
  int system_ = 1;                         ///< 1 .. 9
  std::array<double, 10> origin_{};        ///< of the system in force: nine axes, then rotation
  NineAxes g92_{};                         ///< shift of G92 in force
  std::map<int, double> length_, radius_;  ///< mm, by tool
  int motion_ = -1;                        ///< ten times the G number; -1: none
  AxisVector length_shift_;                ///< (axes) shift of G43 and similar codes; empty: none
  bool has_tip_length_ = false, has_tip_kinematics_ = false;  ///< G43.4; M428
  bool has_absolute_centre_ = false, is_diameter_mode_ = false;
  bool is_diameter_mode_known_ = false;  ///< G7 or G8, or the assumption has been reported
  bool returns_to_r_ = true;             ///< G99, LinuxCNC's initial state
  double speed_ = 0.0;                   ///< S as programmed; under G96 m/min
  int tool_ = 0, selected_ = -1;
  /// Canned cycle in force.
  struct Cycle {
    double r = 0.0, z = 0.0, q = 0.0, p = 0.0;
    std::optional<double> initial;  ///< level of G98
    bool has_begun = false;
  } cycle_;
  struct Pole {
    double x = 0.0, y = 0.0, weight = 1.0;
  };
  std::vector<Pole> poles_;  ///< poles of G5.2 so far
  int order_ = 3;
  std::optional<Eigen::Vector2d> spline_arm_;  ///< P Q of the previous G5, relative to its end
};

}  // namespace abbe::sim::dialects::linuxcnc
