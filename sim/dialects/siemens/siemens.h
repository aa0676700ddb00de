#pragma once

#include "sim/dialects/flow.h"

/// Programs of a Siemens 840D: their blocks, the state of the control, and the flow of programs.
namespace abbe::sim::dialects::siemens {

/// Groups of words. A block may have at most one word of each group.
enum class Group {
  None,           ///< rejected, or without effect and not to be combined with axis words
  WithMotion,     ///< without effect; axis words of the block belong to the motion in force
  MasterSpindle,  ///< SETMS
  Motion,
  Plane,
  Units,
  Distance,
  FeedMode,
  SpeedMode,
  Diameters,
  CutterRadius,
  WorkOffset,
  WithoutOffset,
  Transformation,
  OrientationFrame,
  OrientationPath,
  Pole,
  Dwell,
  Frame,
  Limits,
  Stop,
  ToolChange,
  Spindle,
  Count
};

/// Returns true for groups whose words may share a block with axis words of a motion.
bool is_beside_motion(Group group);

/// An entry of the word table: a keyword or a G or M code.
struct WordEntry {
  std::string_view word;  ///< "G64", "TRAORI"
  Group group = Group::None;
  WordTreatment use = WordTreatment::Read;
  std::string_view sentence;
};
/// Returns the entry of a word, or null if the control does not have it.
/// @param word  upper case, a code without leading zeros
const WordEntry* find_entry(std::string_view word);

/// Names of the addresses to which a value is assigned. Those of axes, in the order of
/// `axis_letters`, and of centres come first.
inline constexpr std::string_view address_names[] = {
    "X",    "Y",   "Z",  "A",  "B",  "C",  "U",  "V",    "W",   "I",  "J",
    "K",    "I1",  "J1", "K1", "A3", "B3", "C3", "CR",   "AR",  "AP", "RP",
    "TURN", "RPL", "F",  "S",  "T",  "D",  "P",  "OFFN", "LIMS"};

/// An address, by its index among `address_names`.
struct Address {
  std::size_t index = 0;

  explicit constexpr Address(std::size_t i) : index(i) {}
  /// Does not compile for a name that is not in the list.
  consteval Address(const char* name)
      : index(std::size_t(std::ranges::find(address_names, name) - address_names)) {
    if (index == std::size(address_names)) throw std::invalid_argument(name);
  }
  constexpr Address operator+(int n) const { return Address(index + std::size_t(n)); }
};
using Addresses = std::initializer_list<Address>;

/// Meaning of the value of an axis word.
enum class PositionMode {
  Modal,        ///< G90 or G91
  Absolute,     ///< AC()
  Incremental,  ///< IC()
  Shortest,     ///< DC(): absolute, in the shorter direction of a rotary axis
  Positive,     ///< ACP(): absolute, rotary axis in positive direction
  Negative      ///< ACN(): absolute, rotary axis in negative direction
};

/// The programmed value of an address.
struct Value {
  double value = 0.0;
  Cause cause;
  PositionMode mode = PositionMode::Modal;
  bool is_programmed = false;
  explicit operator bool() const { return is_programmed; }
  operator Cause() const { return cause; }
};

/// The programmed word of a group.
struct Code {
  std::string_view word;  ///< as in `WordEntry`
  Cause cause;
  explicit operator bool() const { return !word.empty(); }
};

/// An argument of a cycle or subprogram.
struct Argument {
  std::optional<double> number;
  std::optional<std::string> text;
  Cause cause;
  bool empty() const { return !number && !text; }
};

/// A call of a cycle or subprogram by its name.
struct ProgramCall {
  std::string name;  ///< upper case
  std::vector<Argument> arguments;
  Cause cause;
};

/// S or M with a spindle number: S2=1000, M[2]=3.
struct SpindleWord {
  int spindle = 0;
  std::optional<double> speed;
  std::string_view direction;  ///< "M3", "M4" or "M5"; empty for S
  Cause cause;
};

/// The words of one block.
struct Block {
  std::array<Value, std::size(address_names)> values;
  std::array<Code, std::size_t(Group::Count)> codes;
  std::vector<std::string_view> coolant;  ///< M7 M8 M9
  std::optional<std::string> tool_name;   ///< T="..."
  std::vector<SpindleWord> spindles;      ///< S2=, M3=4
  int master_spindle = 1;                 ///< argument of SETMS
  Code code_forbidding_axis_words;  ///< a word without effect that must not be combined with axis
                                    ///< words
  std::optional<ProgramCall> call;
  bool is_modal = false;  ///< MCALL, with `call` or alone
  Cause modal_cause;

  const Value& operator[](Address address) const { return values[address.index]; }
  /// Returns the word of the k-th axis of `axis_letters`.
  const Value& axis_word(int k) const { return values[std::size_t(k)]; }
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  std::string_view word(Group group) const { return codes[std::size_t(group)].word; }
  void clear();
};

/// Returns the operators and functions in expressions of this control.
const ExpressionGrammar& grammar();

/// Parser of the variables of a program in expressions and assignments.
class VariableParser : public OperandParser {
 public:
  /// Executes an assignment at the cursor, R1=..., COUNT=... or FIELD[2]=..., and advances past it.
  /// Returns false if none begins there.
  virtual bool assign_variable(Cursor& cursor) = 0;
  /// Returns the text of the string variable at the cursor and advances past it. Returns nothing if
  /// no string variable begins there.
  virtual std::optional<std::string> parse_text_variable(Cursor& cursor) = 0;
};

/// Evaluates the expression at the cursor. It ends before a word that only begins like an operator
/// (ORIWKS, DIVON).
double parse_number(Cursor& cursor, VariableParser& variables);

/// Returns true for a letter, a digit and _.
bool is_name_char(char c);

/// Returns the name at the cursor in upper case and advances past it. Returns an empty text if no
/// name begins there.
std::string parse_name(Cursor& cursor);

/// Returns true if a single = follows; == is a comparison.
bool is_before_assignment(const Cursor& cursor);

/// Returns the text in quotes at the cursor. Throws BadInput if the closing quote is missing.
std::string parse_quoted_text(Cursor& cursor);

/// Parses (a, b, ...) at the cursor. Throws BadInput.
std::vector<Argument> parse_arguments(Cursor& cursor, VariableParser& variables);

/// The block of a line and its comment.
struct CommentSplit {
  std::string_view block;
  std::optional<std::string_view> comment;  ///< without the semicolon
};

/// Splits a line at the semicolon that begins its comment.
CommentSplit split_comment(std::string_view line);

/// Parses the words from the cursor to the end of the line into `block`, whose memory is reused.
/// Throws BadInput.
void read_block(Cursor cursor, ProgramRun& run, VariableParser& variables, Block& block);

/// Returns the right-handed rotation about X (0), Y (1) or Z (2) by an angle in degrees. Multiples
/// of 90 deg have sines and cosines of exactly 0 and 1.
Eigen::Matrix3d rotation_about(int axis, double angle_deg);

/// A frame of X Y Z, mm: p' = rotation p + shift.
struct CoordinateFrame {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();

  bool is_identity() const { return shift.isZero(0.0) && rotation.isIdentity(0.0); }
};
/// Returns the frame that results from `second` given in the coordinates of `first`.
CoordinateFrame compose(const CoordinateFrame& first, const CoordinateFrame& second);

/// Meaning of the angles of CYCLE800.
enum class SwivelMode { AxisByAxis, SolidAngle };

/// Returns the rotation of a swivelled plane: axis by axis about the axes in `order` (0 X, 1 Y, 2
/// Z), each as rotated by the previous ones; by solid angle about Z, then about the rotated Y.
Eigen::Matrix3d swivel_rotation(SwivelMode mode, const Eigen::Vector3i& order,
                                const Eigen::Vector3d& angles_deg);

// Depths of drilling cycles.

/// Levels along a hole, mm.
struct HoleLevels {
  double retract = 0.0, reference = 0.0, start = 0.0, bottom = 0.0;
};

/// Depths of CYCLE83, mm.
struct PeckParameters {
  double first = 0.0;  ///< first depth from the reference plane, > 0, at most the total depth
  /// > 0: amount by which each peck is shorter; < 0: the negative factor of each peck; 0: none.
  double degression = 0.0;
  double min_peck = 0.0;  ///< shortest peck if degression is a factor
};

/// Returns the depths below the reference plane at the end of each peck; the last one is `total`.
/// Each peck is shorter than the previous one by the degression, but not shorter than the
/// degression. Once at most twice the degression remains, the remainder is halved. Returns an empty
/// list for more than 1e5 pecks.
std::vector<double> peck_depths(double total, const PeckParameters& parameters);

/// Returns the distance above the last depth at which a drill continues at feed after clearing its
/// chips: 0.6 mm up to a depth of 30 mm, then a fiftieth of the depth, at most 7 mm.
double peck_stop_distance(double total);

/// Returns the pitch of a metric coarse thread M3 to M48 in whole millimetres (ISO 261), mm; 0 for
/// other sizes.
double coarse_pitch(double size);

/// Result of a block.
struct BlockResult {
  bool has_moved = false;       ///< it had words of motion, so a modal call follows
  bool is_program_end = false;  ///< end of the program or subprogram
};

/// State of a Siemens control: modes, frames and tools. Executes blocks and issues their moves to
/// the canon.
class Machine : public GCodeControl {
 public:
  /// `tool_changes_by_m6`: M6 changes to the tool of T; otherwise T itself does.
  Machine(ProgramRun& run, bool tool_changes_by_m6);

  BlockResult execute(const Block& block);
  /// Makes the moves that are still postponed at the end of the program.
  void finish() { compensation_.end(); }
  /// Executes a drilling cycle or CYCLE800. Returns false if the control has no cycle of that name.
  bool execute_cycle(const ProgramCall& call);
  static bool is_cycle(std::string_view name);

  /// Returns the position of an axis in the workpiece ($AA_IW) or as an axis ($AA_IM), in mm or
  /// inch and degrees. Returns nothing if the machine has no axis of that letter.
  std::optional<double> position(char letter, bool in_machine) const;

 private:
  // Words and modes.
  void check_words(const Block& block) const;
  void select_work_offset(const Code& code);
  void note_start_modes(const Block& block);
  void set_modes(const Block& block);
  void set_feed(const Block& block);
  void set_spindle(const Block& block);
  void select_master_spindle(int spindle, const Cause& cause);
  void set_speed(double speed, const Cause& cause);
  void set_numbered_spindles(const Block& block);
  void call_tools(const Block& block);
  void note_coolant(const Block& block) const;
  void dwell(const Block& block);
  const Value* first_axis_word(const Block& block) const;
  Cause motion_cause(const Block& block) const;

  void check_compensated_block(const Block& block) const;

  // Tools.
  void set_compensation(const Code& code);
  int tool_number(const Block& block) const;
  bool has_single_length() const;
  bool is_known_tool() const { return tool_ >= 0 || has_single_length(); }
  double active_tool_length(const Cause& cause) const;
  void apply_tool();
  /// Returns the shift, (axes), of the tool length in force in axis coordinates; empty: none.
  AxisVector active_tool_shift() const;

  // Frames.
  bool is_tip_mode() const { return is_traori_ || (swivel_ && swivel_->is_aligned); }
  void apply_frame();
  void change_transformation(const Code& code);
  void execute_frame(const Block& block);
  CoordinateFrame programmed_frame(const Block& block) const;
  void execute_cycle800(const ProgramCall& call);
  void end_swivel();
  void retract(int mode, double distance, const Cause& cause);
  void swivel_tool(const Eigen::Vector3d& direction_w, int preference, bool keeps_tip,
                   const Cause& cause);
  Eigen::Matrix3d total_rotation() const;

  void note_diameters(const Block& block);
  /// Returns the factor from an X value to a radius.
  double x_radius_factor(bool absolute) const;
  void require_radius_words(const Value& word) const;
  std::optional<double> nose_radius(int tool) const;
  AxisVector programmed_nose_offset() const;

  // Straight motion.
  bool move(const Block& block);
  Target block_target(const Block& block, bool machine) const;
  void add_axis_word(Target& target, int j, const Value& word, bool machine) const;
  void add_polar_words(Target& target, const Block& block);
  void set_pole(const Block& block);
  void check_motion(const Block& block) const;
  void make_straight(program::Straight move, bool rapid);
  void move_in_machine_coordinates(const Block& block);
  void cut_thread(const Block& block, AxisVector end);
  /// Sets the rotary axes of `end` by the vector A3 B3 C3.
  void apply_tool_vector(const Block& block, AxisVector& end) const;
  /// Makes a line along which the tool direction follows a great circle.
  void move_on_great_circle(program::Straight move);

  // Arcs.

  /// The plane of arcs.
  struct ArcPlane {
    std::array<char, 3> letters;  ///< of the first axis, the second, the normal
    int first = 0, second = 1;    ///< joints of the plane
    int normal = 2;               ///< joint across the plane
  };
  ArcPlane arc_plane(const Cause& cause) const;
  void arc(const Block& block, const Target& target);
  void make_arc_through_point(const Block& block, const Target& target);
  void make_arc(const Block& block, program::ArcMove move);
  AxisVector arc_centre(const Block& block, const ArcPlane& plane, const Cause& cause) const;

  // Cycles.
  friend class Hole;

  const OrientationKinematics orientation_;
  bool m6_changes_tool_;
  std::string_view motion_ = "G1";
  bool is_feed_in_inches_ = false;
  enum class Diameters { Off, On, Absolute } diameter_mode_ = Diameters::Off;
  bool is_diameter_mode_known_ = false;
  double speed_ = 0.0;
  struct Spindle {
    double rpm = 0.0;
    int direction = 0;
  };
  int master_spindle_ = 1;           ///< carries the tool; S and M without a number belong to it
  std::map<int, Spindle> spindles_;  ///< states of the other spindles
  int selected_ = -1, tool_ = -1;    ///< tool of the last T; tool in the spindle
  bool has_tool_length_ = true;      ///< D1
  int system_ = 0;                   ///< index of the work offset: 0 is G54; -1 is G500
  bool is_traori_ = false;           ///< TRAORI
  bool turns_in_workpiece_ = true;   ///< ORIWKS
  std::optional<bool> on_great_circle_;  ///< true: ORIVECT; false: ORIAXES; empty: not programmed
  CoordinateFrame programmable_frame_;
  AxisVector programmable_axis_shift_;  ///< (axes) of rotary and additional linear axes, rad, mm
  struct Swivel {
    CoordinateFrame frame;
    bool is_aligned = false;  ///< the rotary axes hold the tool along z of the frame
  };
  std::optional<Swivel> swivel_;
  struct Pole {
    Eigen::Vector2d position = {0, 0};
    double radius = 0.0, angle_deg = 0.0;
  } pole_;
};

/// Beginning of a line.
struct LineHead {
  std::string_view number;        ///< digits after N
  std::string label;              ///< upper case, without :
  std::string keyword;            ///< upper case; a word of program flow, or empty
  std::size_t at = 0;             ///< first byte of the keyword, or of the words
  std::size_t end = 0;            ///< first byte after the keyword
  std::optional<int> skip_level;  ///< level of the / at the beginning
};

/// Parses the beginning of a line without its comment.
LineHead parse_line_head(std::string_view line);

/// A program or subprogram.
struct Program : Source {
  std::string name;  ///< upper case

  /// The other end of a structure: of IF the line of ENDIF and maybe of ELSE, of ELSE that of
  /// ENDIF, of a loop the line at its other end.
  struct Counterpart {
    std::size_t line = 0, else_line = 0;
    bool has_else = false;
  };
  /// Counterparts by line. Built at the first use.
  std::optional<std::unordered_map<std::size_t, Counterpart>> counterparts;
  /// Lines by label or by line number, ascending. Built at the first use.
  std::optional<std::unordered_map<std::string, std::vector<std::size_t>>> labels;
};

enum class VariableKind { Real, Integer, Boolean, Text };
/// Type of a variable.
struct Variable {
  VariableKind kind = VariableKind::Real;
  std::vector<int> sizes;  ///< of an array; empty for a simple variable
};

/// A running program, or a section of it that is repeated.
struct Call {
  Program* program = nullptr;
  std::size_t return_line = 0;  ///< line of the caller to continue with
  /// True for a repeated section, which uses the variables of the program around it.
  bool is_repeated_section = false;
  std::size_t begin = 0, end = 0;
  long long remaining_repeats = 0;
  std::vector<Argument> arguments = {};
  std::map<std::string, Variable, std::less<>> variables = {};
  std::map<std::string, std::string, std::less<>> texts = {};
};

/// Flow of a program: executes variables, expressions, conditions, loops, jumps and subprograms,
/// and passes all other blocks to the machine.
class Flow : public ProgramFlow<Program, Call, VariableParser> {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;
  bool assign_variable(Cursor& cursor) override;
  std::optional<std::string> parse_text_variable(Cursor& cursor) override;

 private:
  // Program flow.
  const Source& source() const override { return *calls_.back().program; }
  bool is_call_at_end() const override {
    return is_section_at_end() || ProgramFlow::is_call_at_end();
  }
  bool is_section_at_end() const {
    return calls_.back().is_repeated_section && line_index_ == calls_.back().end;
  }
  void end_call() override;
  bool execute_line() override;
  bool execute_block(Cursor cursor) override;
  bool execute_keyword(const LineHead& head, Cursor cursor);
  void execute_if(const LineHead& head, Cursor& cursor);
  void execute_loop(const LineHead& head, Cursor& cursor);
  void execute_for(Cursor& cursor, bool first);
  void execute_case(Cursor& cursor);
  bool evaluate_condition(Cursor& cursor);
  void execute_jump(Cursor& cursor, const std::string& keyword);
  static bool is_jump(std::string_view word);
  const Program::Counterpart& counterpart(const Cursor& cursor, std::size_t at);
  std::size_t line_of(const std::string& label, const std::string& keyword, const Cause& cause);
  void expect_end(Cursor& cursor) const;
  Cursor cursor_of_line(std::size_t line) const;

  // Subprograms.
  bool uses_m6() const;
  Program* find_program(const std::string& name);
  Program* load_program_file(const std::filesystem::path& file, const std::string& name);
  void call_program(const ProgramCall& program_call, long long count);
  void enter_program(Program& program, const ProgramCall& program_call, long long count);
  void bind_parameters(Program& program, const std::vector<Argument>& arguments,
                       const Cause& cause);
  void repeat_section(Cursor& cursor, bool one_block);
  long long parse_repeat_count(Cursor& cursor);
  void finish_repeated_section();
  void warn_unread();
  void leave_program();
  void call_by_name(Cursor& cursor);

  // Variables.
  void execute_definition(Cursor& cursor);
  void define_variable(Cursor& cursor, VariableKind kind);
  static std::optional<VariableKind> find_kind(std::string_view type);
  Call& local_scope();
  double parse_r_parameter(Cursor& cursor, std::size_t from);
  std::string parse_element(Cursor& cursor, const std::string& name, const Variable& variable);
  void store_value(const std::string& name, VariableKind kind, double value, const Cursor& cursor,
                   std::size_t from);
  std::optional<double> parse_system_variable(Cursor& cursor);
  std::optional<double> parse_multi_argument_function(Cursor& cursor, const std::string& name);
  double parse_quoted_number(Cursor& cursor);

  std::map<std::string, Program*> programs_by_name_;
  std::optional<ProgramCall> modal_call_;
  std::size_t modal_depth_ = 0;  ///< call depth of the modal subprogram; 0: none runs
  /// First line of the main program whose comment has not been recorded.
  std::size_t first_unrecorded_comment_ = 0;
  Block block_;
  std::optional<Machine> machine_;
};

}  // namespace abbe::sim::dialects::siemens
