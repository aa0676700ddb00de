#pragma once

#include "sim/dialects/gcode.h"

/// Programs of Fanuc controls: their blocks and the state of the control.
namespace abbe::sim::dialects::fanuc {

using gcode::Block;
using gcode::Code;
using gcode::Group;
using gcode::Word;

/// Value of a variable that has not been set: it counts as zero in arithmetic, but is not EQ zero.
inline constexpr double vacant = 4.9406564584124654e-324;  // smallest positive double
inline bool is_vacant(double value) { return value == vacant || value == -vacant; }
/// Returns the value that arithmetic uses: zero for a vacant variable.
inline double zero_if_vacant(double value) { return is_vacant(value) ? 0.0 : value; }

/// Parser of the operands of macro expressions: variables and functions. ROUND in a word rounds to
/// the resolution of its address.
class MacroOperands : public OperandParser {
 public:
  double resolution = 1.0;  ///< increment that ROUND rounds to
};

/// Returns the operators and functions of custom macro B.
const ExpressionGrammar& grammar();

/// Returns the table entry of a code. `letter` is G or M.
const gcode::CodeProperties& find_entry(char letter, int tenths);
/// Same as `find_entry` for a turning control, G-code system A.
const gcode::CodeProperties& find_lathe_entry(char letter, int tenths);

/// Returns the description of a word that is no code, such as "SETVN", which must be in the table.
std::string_view word_sentence(std::string_view word);

/// Returns the least input increment of an address, system IS-B: 0.001 mm or degree, 0.0001 inch.
double min_increment(char letter, bool inch);

/// Parses a block into `block`, whose memory is reused. Words with a vacant value are ignored.
/// Throws BadInput.
void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block);

/// Advances past blanks and comments, and appends the comments to `comments`.
void collect_comments(Cursor& cursor, std::vector<std::string_view>& comments);

/// Returns the block skip level at the cursor, 2 for /2 and 1 for /, and advances past it.
int read_skip_level(Cursor& cursor);

/// Returns the value of a word as an integer from 0 to `max`, rounded if it comes from an
/// expression. Throws BadInput.
int whole_number(const program::Canon& canon, const Word& word, int max);

/// State of a Fanuc control: modes, coordinate systems and tools. Executes blocks and issues their
/// moves to the canon.
class Machine : public GCodeControl {
 public:
  explicit Machine(ProgramRun& run);

  /// Executes a block. Returns false at the end of the program.
  bool execute(const Block& block);
  /// Returns true if the last block moved axes, which triggers the call of G66.
  bool has_moved() const { return has_moved_; }
  /// Issues the moves still pending at the end of the program.
  void finish() {
    compensation_.end();
    vector_lines_.finish();
  }

  /// Returns the value of a word in program units. A value without a decimal point is a number of
  /// increments.
  double word_value(const Word& word);
  /// Returns the value of a system variable; empty if it cannot be read.
  std::optional<double> variable(int number);
  /// Sets a system variable. Returns false if it cannot be set.
  bool set_variable(int number, double value);
  /// Records sequence and program number for the system variables #4114 and #4115.
  void note_numbers(int sequence, int program);

 private:
  /// An axis word of a block.
  struct AxisWord {
    int joint = 0;
    const Word* word = nullptr;
    bool is_incremental = false;  ///< the value is added to the current position
  };
  using Words = std::vector<AxisWord>;
  /// A tool offset and its wear.
  struct OffsetEntry {
    std::optional<double> value;  ///< mm; empty if unknown
    double wear = 0.0;            ///< mm
  };
  using Offsets = std::map<int, OffsetEntry>;

  // Words and modes.
  void check_words(const Block& block) const;
  void check_axis_word_owners(const Block& block) const;
  std::string allowed_letters(const Block& block) const;
  void note_start_modes(const Block& block);
  void set_modes(const Block& block);
  void set_feed(const Block& block);
  void set_spindle(const Block& block);
  void call_tools(const Block& block);
  void end_cycle();
  void set_motion(const Block& block);
  void check_whole_block_code(const Block& block) const;
  void execute_one_shot(const Block& block);
  void dwell(const Block& block);
  const Word* first_axis_word(const Block& block) const { return block.first_word(word_letters()); }
  Cause motion_cause(const Block& block) const;
  double apply_increment(const Word& word, double increment);
  /// Returns the letters of axis words. On a turning control U V W H are increments of X Y Z C.
  std::string_view word_letters() const { return is_turning_ ? "XYZABCUVWH" : axis_letters; }
  bool is_increment(char letter) const;
  /// Returns the joint that a letter of `word_letters` moves; -1 if the machine has none.
  int joint_of_word(char letter) const;
  /// Returns the value of a word that is a length, mm.
  double length(const Word& word) { return word_value(word) * unit(); }
  double angle_in_degrees(const Word& word);
  /// Returns the value of an axis word, mm or rad.
  double axis_word_value(int j, const Word& word);
  /// Returns the axis words of a block with their joints.
  Words axis_words(const Block& block) const;

  // Coordinate systems and tool offsets.
  const AxisVector& work_offset(int number) const;
  AxisVector total_offset() const;
  void apply_frame();
  void select_work_offset(const Block& block);
  void set_rotation(const Block& block);
  void store_data(const Block& block);
  void store_origin(const Block& block, bool additional);
  void store_tool(const Block& block, int kind);
  void shift_origin(const Block& block);
  void set_tool_length(const Block& block);
  void apply_length(const Cause& cause);
  void compare_zero_points(const Cause& cause);
  void warn_of_rotated_table(const Cause& cause);
  double tool_length(int h, const Cause& cause) const;
  void set_compensation(const Block& block);
  void check_frame_change(const Cause& cause) const;

  // Turning controls only.
  void call_tool_and_offset(const Block& block);
  void apply_tool_offset(const Cause& cause);
  std::optional<double> nose_radius() const;  ///< mm
  AxisVector programmed_nose_offset() const;  ///< mm, from the point that X and Z position
  void store_wear(const Block& block);
  void set_nose_compensation(const Code& code);
  void turning_cycle(const Block& block);
  void check_corner_words(const Block& block) const;
  void note_turning_control();
  void note_uncalled_tool(const Cause& cause);
  int tool_in_use() const;

  // Tilted planes and tool directions.
  void set_tilted_plane(const Block& block);
  void align_tool_with_plane(const Block& block);
  const kinematics::Chain& chain(const Cause& cause) const;
  /// Returns the position, (axes), whose rotary axes give the direction. If two solutions exist,
  /// the one that Fanuc's output judgement condition selects is returned (see motion.cpp).
  AxisVector rotary_positions(const Eigen::Vector3d& direction_w, const Cause& cause);
  AxisVector point_tool_along_direction(const Block& block, AxisVector end);
  void check_tilted_move(const Target& target, const Cause& cause) const;
  bool has_tip_length_mode() const { return length_mode_ == 434 || length_mode_ == 435; }

  // Motion.
  void move(const Block& block);
  Target block_target(const Block& block, bool in_machine_coordinates);
  void polar_words(const Block& block, Target& target);
  void straight(const Block& block, AxisVector end, std::uint32_t stated);
  void arc(const Block& block, AxisVector end, std::uint32_t stated);
  void move_to_reference(const Block& block);
  void move_in_machine_coordinates(const Block& block);

  // Canned cycles.
  void execute_cycle(const Block& block);
  void read_cycle_words(const Block& block);
  void warn_low_start();
  void make_holes(const Block& block);
  void make_hole(const AxisVector& position);
  void make_pecks();
  void move_to_level(double level, bool rapid);
  void shift_tool(double distance);

  // System variables.
  std::optional<double> modal_variable(int number) const;
  struct OffsetVariable {
    Offsets* offsets = nullptr;
    int number = 0;
    bool is_wear = false;
  };
  OffsetVariable offset_variable(int number);
  struct OriginVariable {
    AxisVector* origin = nullptr;
    int axis = 0;  ///< index as the control counts axes
  };
  OriginVariable origin_variable(int number);
  int joint_of_index(int k) const;
  double program_value(int j, const AxisVector& q) const;

  const bool is_turning_;     ///< a turning control, G-code system A
  const bool has_diameters_;  ///< X and U words are diameters
  VectorLines vector_lines_;
  bool has_moved_ = false, has_warned_of_missing_decimal_point_ = false;

  // G codes times ten in force: G80, G49, G40; 434 is G43.4.
  int motion_ = 0, cycle_code_ = 800, length_mode_ = 490, cutter_code_ = 400;
  int start_side_ = 400;  ///< G41 or G42 that started the compensation
  bool returns_to_r_ = false, is_rigid_tapping_ = false;
  double speed_word_ = 0.0;                        ///< S as programmed
  std::optional<double> surface_speed_m_per_min_;  ///< S of G96
  int tool_ = 0, preselected_tool_ = -1, h_ = 0, d_ = 0, last_m_ = 0, sequence_ = 0, program_ = 0;

  Offsets lengths_, radii_;
  int system_ = 1;                     ///< 1 to 6: G54 to G59; 100 + P: G54.1
  std::map<int, AxisVector> systems_;  ///< (axes)
  AxisVector external_, g92_, g52_, zero_offset_;
  std::optional<Eigen::Matrix3d> rotation_;  ///< of G68 or G68.2
  Eigen::Vector3d centre_{0, 0, 0};          ///< fixed point of G68, or origin of G68.2
  bool is_tilted_ = false;
  bool is_h_stated_ = false,
       is_d_stated_ = false;  ///< an H has been read since G49; a D has been read
  bool had_axis_length_ = false, had_tip_length_ = false;
  std::optional<kinematics::Chain> free_slides_;  ///< `chain_of_free_slides_` with unlimited slides
  const kinematics::Chain* chain_of_free_slides_ =
      nullptr;  ///< chain from which `free_slides_` was made; another chain rebuilds it
  std::vector<int> rotary_order_;  ///< rotary joints of `free_slides_`

  /// Tool offset in force on a turning control, and the wear of all offsets.
  struct ToolOffset {
    int number = 0;       ///< last two digits of T
    bool called = false;  ///< a T word has been read
    struct Wear {
      double x = 0.0, z = 0.0, radius = 0.0;  ///< mm
    };
    std::map<int, Wear> wear;  ///< by offset number
  } tool_offset_;
  /// Modal words of G90 and G94 of a turning control.
  struct TurningCycle {
    double x = 0.0, z = 0.0, taper = 0.0;  ///< mm, program coordinates, X as a radius
    bool has_x = false, has_z = false;
  } turning_cycle_;

  /// State of polar coordinates (G16).
  struct Polar {
    bool is_on = false;
    double radius = 0.0, angle = 0.0;  ///< mm, degrees
    Eigen::Vector2d centre{0, 0};
  } polar_;

  /// State of the canned cycle in force.
  struct Cycle {
    /// Levels in program coordinates.
    double r = 0.0, bottom = 0.0, initial = 0.0, q = 0.0, dwell_s = 0.0;
    bool has_begun = false;
    AxisVector position;  ///< tool position in program coordinates
    Cause cause;
  } cycle_;
};

/// Evidence that a program is made for a turning control: its text and its location.
struct TurningEvidence {
  std::string words;  ///< for example "G50 with S, the largest speed of a turning control"
  int line = 0, column = 0;
};

/// Returns the first evidence, outside comments, that a program is made for a turning control: G50
/// with S; on a machine without axes U and W also G28 with U or W, or G70 to G73 with P and Q; or
/// four-digit tools together with G96 and without M6.
std::optional<TurningEvidence> find_turning_evidence(std::string_view text,
                                                     const program::Canon& canon);

}  // namespace abbe::sim::dialects::fanuc
