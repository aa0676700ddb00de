#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "sim/dialects/fanuc/block.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/dialects/tool_vectors.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects::fanuc {

inline constexpr std::string_view axis_letters = "XYZABCUVW";

/// A Fanuc control as its words command it: modes, coordinate systems, tools, and the moves that
/// they make on the canon.
class Machine {
 public:
  explicit Machine(ProgramRun& run);

  /// @return false at the end of the program
  bool execute(const Block& block);
  /// The block executed last moved axes, as G66 asks.
  bool moved() const { return moved_; }
  /// What is still to be put out, at the end of the program.
  void finish() {
    compensation_.finish();
    vector_lines_.finish();
  }

  /// A number of an address in program units, the decimal point in place.
  double argument(const Word& word);
  /// System variables. @return none where the control has no such variable that can be read
  std::optional<double> variable(int number);
  /// @return false where there is none that can be set
  bool set_variable(int number, double value);
  /// Sequence and program number, for variables that say them.
  void note_numbers(int sequence, int program);

 private:
  using AxisVector = kinematics::AxisVector;
  /// An axis word of a block.
  struct AxisWord {
    int joint = 0;
    const Word* word = nullptr;
    bool step = false;  ///< it counts from where the axis stands
  };
  using Words = std::vector<AxisWord>;
  struct Geometry {
    std::optional<double> value;  ///< mm; none where nobody has said it
    double wear = 0.0;            ///< mm
  };
  using Offsets = std::map<int, Geometry>;

  // fanuc_machine.cpp
  [[noreturn]] void refuse(const Cause& cause, std::string expected,
                           std::optional<std::string> seen = {}) const {
    canon_.refuse(cause, std::move(expected), std::move(seen));
  }
  void check_words(const Block& block) const;
  void check_owners(const Block& block) const;
  std::string letters_taken(const Block& block) const;
  void note_start_modes(const Block& block);
  void set_modes(const Block& block);
  void set_feed(const Block& block);
  void set_spindle(const Block& block);
  void call_tools(const Block& block);
  void end_cycle();
  void set_motion(const Block& block);
  void check_alone(const Block& block) const;
  void one_shot(const Block& block);
  void dwell(const Block& block);
  const Word* first_axis_word(const Block& block) const;
  Cause cause_of(const Block& block) const;
  double unit() const;
  double counted(const Word& word, double increment);
  int joint(int k) const { return canon_.joint_of(axis_letters[std::size_t(k)]); }
  /// Letters of axis words: a turning control has U V W H for increments of X Y Z C.
  std::string_view word_letters() const { return turning_ ? "XYZABCUVWH" : axis_letters; }
  bool is_increment(char letter) const;
  /// The joint that a letter of `word_letters` moves; -1 where the machine has none.
  int joint_of_word(char letter) const;
  /// mm, of an address that is a length; degrees, of one that is an angle.
  double length(const Word& word) { return argument(word) * unit(); }
  double angle_in_degrees(const Word& word);
  /// mm or rad of an axis word.
  double axis_word(int j, const Word& word);
  /// The axis words of a block with their joints.
  Words axis_words(const Block& block) const;

  // fanuc_offsets.cpp
  const AxisVector& system(int number) const;
  AxisVector base() const;
  void apply_frame();
  void choose_system(const Block& block);
  void set_rotation(const Block& block);
  void store_data(const Block& block);
  void store_origin(const Block& block, bool additional);
  void store_tool(const Block& block, int kind);
  void shift_origin(const Block& block);
  void set_tool_length(const Block& block);
  void apply_length(const Cause& cause);
  void compare_zeros(const Cause& cause);
  void note_turned_table(const Cause& cause);
  double length_of(int h, const Cause& cause) const;
  void set_compensation(const Block& block);
  void check_unique_names(const Cause& cause) const;

  // fanuc_lathe.cpp: what a turning control alone has
  void call_tool_and_offset(const Block& block);
  void apply_tool_offset(const Cause& cause);
  std::optional<double> nose_radius() const;  ///< mm
  AxisVector programmed_nose_offset() const;  ///< mm, from the point that X Z lead
  void store_wear(const Block& block);
  void set_nose_compensation(const Code& code);
  void turning_cycle(const Block& block);
  void check_corner_words(const Block& block) const;
  void note_turning_control();
  void note_uncalled_tool(const Cause& cause);
  int tool_in_use() const;

  // fanuc_tilted.cpp
  void tilt(const Block& block);
  void turn_to_plane(const Block& block);
  const kinematics::Chain& chain(const Cause& cause) const;
  /// Positions of the rotary axes, (axes), that give the direction, by Fanuc's rule of two.
  AxisVector rotary_positions(const Eigen::Vector3d& direction_w, const Cause& cause);
  AxisVector point_tool_along_direction(const Block& block, AxisVector end);
  void check_tilted(const Target& target, const Cause& cause) const;
  bool tip_words() const { return length_mode_ == 434 || length_mode_ == 435; }

  // fanuc_motion.cpp
  void move(const Block& block);
  Target block_target(const Block& block, bool machine);
  void polar_words(const Block& block, Target& target);
  void straight(const Block& block, AxisVector end, std::uint32_t stated);
  void arc(const Block& block, AxisVector end, std::uint32_t stated);
  void reference(const Block& block);
  void to_axes(const Block& block);
  std::string_view plane_letters() const {
    return plane_ == 170 ? "XY" : plane_ == 180 ? "ZX" : "YZ";
  }

  // fanuc_cycles.cpp
  void cycle(const Block& block);
  void take_cycle_words(const Block& block);
  void warn_low_start();
  void cycle_holes(const Block& block);
  void hole(const AxisVector& place);
  void bottom_of_hole();
  void pecks();
  void bore_from_behind();
  void turn_for_tap(int direction);
  void to_level(double level, bool rapid);
  void shift_tool(double by);

  // fanuc_variables.cpp
  std::optional<double> mode(int group) const;
  std::optional<double> modal_word(int number) const;
  struct OffsetVariable {
    Offsets* of = nullptr;
    int number = 0;
    bool wear = false;
  };
  OffsetVariable offset(int number);
  AxisVector* origin(int number, int& k);
  int axis_of(int k) const;
  double shown_value(int j, const AxisVector& q) const;

  ProgramRun& run_;
  program::Canon& canon_;
  const bool turning_;    ///< a turning control, G-code system A
  const bool diameters_;  ///< X and U words are diameters
  Compensation compensation_;
  VectorLines vector_lines_;
  bool moved_ = false, warned_of_point_ = false;

  int motion_ = 0, plane_ = 170, cycle_code_ = 800, length_mode_ = 490, cutter_ = 400;
  int side_ = 400;  ///< G41 or G42 as compensation began
  bool incremental_ = false, to_r_ = false, surface_speed_ = false, rigid_ = false;
  double speed_ = 0.0;                       ///< S as it stands
  std::optional<double> surface_m_per_min_;  ///< S of G96
  std::optional<double> max_rpm_;            ///< of G96
  int tool_ = 0, selected_ = -1, h_ = 0, d_ = 0, last_m_ = 0, sequence_ = 0, program_ = 0;

  Offsets lengths_, radii_;
  int system_ = 1;                     ///< 1 to 6: G54 to G59; 100 + P: G54.1
  std::map<int, AxisVector> systems_;  ///< (axes)
  AxisVector external_, g92_, g52_, zero_;
  std::optional<Eigen::Matrix3d> rotation_;  ///< of G68 or G68.2
  Eigen::Vector3d centre_{0, 0, 0};          ///< of G68: what stays; of G68.2: the origin
  bool tilted_ = false;
  bool h_stated_ = false, d_stated_ = false;  ///< H since G49; D
  bool seen_axis_length_ = false, seen_tip_length_ = false;
  std::optional<kinematics::Chain> free_slides_;  ///< of the chain in use
  const kinematics::Chain* free_slides_of_ = nullptr;
  std::vector<int> ranks_;  ///< its rotary joints

  struct ToolOffset {
    int number = 0;       ///< the last two digits of T
    bool called = false;  ///< a T word has been read
    struct Wear {
      double x = 0.0, z = 0.0, radius = 0.0;  ///< mm
    };
    std::map<int, Wear> wear;  ///< by number
  } tool_offset_;
  struct TurningCycle {
    double x = 0.0, z = 0.0, taper = 0.0;  ///< mm, program coordinates, X a radius
    bool has_x = false, has_z = false;
  } turning_cycle_;

  struct Polar {
    bool on = false;
    double radius = 0.0, angle = 0.0;  ///< mm, degrees
    Eigen::Vector2d centre{0, 0};
  } polar_;

  struct Cycle {
    double r = 0.0, bottom = 0.0, initial = 0.0, q = 0.0, dwell_s = 0.0;  ///< levels: program
    bool begun = false;
    AxisVector at;  ///< where the tool is, in program coordinates
    Cause cause;
  } cycle_;
};

/// What only a program of a turning control says, and where.
struct TurningSign {
  std::string words;  ///< "G50 with S, the largest speed of a turning control"
  int line = 0, column = 0;
};

/// Returns the first sign that a program is one of a turning control: G50 with S; G28 with U or W
/// and G70 to G73 with P and Q on a machine without such axes; tools of four digits beside G96 and
/// without M6. Comments are left out.
std::optional<TurningSign> find_turning_sign(std::string_view text, const program::Canon& canon);

}  // namespace abbe::sim::dialects::fanuc
