#pragma once

#include "sim/dialects/control.h"
#include "sim/dialects/control_table.h"

namespace abbe::sim::dialects {

/// Returns the word table of Klartext. Words of several parts, such as TOOL CALL, contain no-break
/// spaces.
std::span<const WordTableEntry> heidenhain_words();

/// Reads Klartext as a TNC 640 does.
void read_heidenhain(std::string_view text, ProgramRun& run);

}  // namespace abbe::sim::dialects

/// Programs in Klartext: their blocks, contours, and the state of the control.
namespace abbe::sim::dialects::heidenhain {

/// A block of Klartext as text, without block number and comments. It may have several lines, which
/// end in ~ except for the last one; they are joined by blanks.
struct Block {
  /// A line of the block; it begins at `offset` of the joined text.
  struct BlockLine {
    std::size_t offset = 0;
    int line = 0;
    int column = 0;  ///< column of its first byte, from 0
  };
  std::string_view text;     ///< refers to the line itself if there is only one
  std::string_view comment;  ///< after ;, or after * in a block without words
  std::size_t line_count = 1;
  bool is_skipped = false;  ///< begins with /
  std::vector<BlockLine> block_lines;
  std::string joined;
};

/// Reads the block that begins at line `at` (from 0) into `block`, whose memory is reused.
void read_block(const std::vector<std::string_view>& lines, std::size_t at, Block& block);

/// Returns the error with the line and column in the file instead of those in the joined text.
BadInput relocate_error(const Block& block, const BadInput& input_error);

/// Returns the operators and functions of Q formulas. A function takes the value that follows, with
/// or without brackets.
const ExpressionGrammar& grammar();
/// Parses the function of a formula at the cursor and its argument, and returns the value. Returns
/// nothing if no function begins there.
std::optional<double> parse_function(Cursor& cursor, OperandParser& parameters);

/// Parser of the words of a block, from left to right.
class WordReader {
 public:
  WordReader(Cursor cursor, OperandParser& parameters) : cursor(cursor), parameters_(parameters) {}

  bool at_end() {
    cursor.skip_blanks();
    return cursor.at_end();
  }
  /// Parses the letters at the cursor, without a Q parameter that follows them, and returns them in
  /// upper case. Returns an empty text if there are none.
  std::string read_name();
  /// Advances past a word if it follows. Returns false and stays otherwise.
  bool accept(std::string_view word) { return cursor.accept_word(word); }
  /// Advances past a text, or past a whole word. Throws BadInput with `expected` if it does not
  /// follow.
  void require(std::string_view text, std::string_view expected) {
    if (!cursor.accept(text)) throw_input_error(cursor.at, std::string(expected));
  }
  void require_word(std::string_view word, std::string_view expected) {
    if (!accept(word)) throw_input_error(cursor.at, std::string(expected));
  }
  /// Returns true if a number or a Q parameter follows.
  bool has_value() const;
  /// Parses the value that follows. Throws BadInput.
  double read_value();
  /// Parses an integer from 0 to `max`. Throws BadInput.
  int read_whole_number(int max);
  /// Parses a label: a number or a name in quotes. Throws BadInput.
  std::string read_label();
  /// Throws BadInput unless the block ends at the cursor.
  void expect_end();
  Cause cause(std::size_t from) const { return cursor.cause(from); }
  /// Throws BadInput at the word after byte `from` and blanks.
  [[noreturn]] void throw_input_error(std::size_t from, std::string expected) const {
    while (from < cursor.text.size() && is_blank(cursor.text[from])) ++from;
    cursor.throw_input_error(from, std::move(expected));
  }

  Cursor cursor;

 private:
  OperandParser& parameters_;
};

/// A contour element: a straight or circular move as programmed.
struct ContourElement {
  bool is_rapid = false, is_arc = false;
  AxisVector end;                     ///< (axes), offsets included
  int first = 0, second = 1;          ///< joints of the plane of an arc
  AxisVector centre = {};             ///< as `Canon::placed` returns it
  std::optional<double> radius = {};  ///< alternative to the centre, as in `ArcMove`
  bool is_clockwise = false;
  int turn_count = 1;  ///< as `ArcMove::turns`
  Cause cause = {};
  std::uint32_t stated = 0;
  std::optional<Feed> feed = {};
  int line = 0, file = 0;
};

/// Processes moves before the canon makes them: rounds (RND) and bevels (CHF) corners, and
/// compensates the tool radius (RL, RR). A move waits for the next one if that determines its end.
///
/// RL and RR begin with a straight move, which ends perpendicular to the beginning of the next move
/// in the plane; R0 ends compensation perpendicular to the end of the last move. Corners are made
/// as in `CutterCompensation`.
class Contour {
 public:
  explicit Contour(ProgramRun& run) : run_(run), canon_(run.canon), compensation_(run) {}

  /// Returns the programmed position, offsets included. The axes may be offset from it or may not
  /// have reached it.
  const AxisVector& position() const { return is_ahead_ ? position_ : canon_.position(); }
  /// Returns the programmed position in program coordinates.
  AxisVector programmed() const { return canon_.without_offsets(position()); }

  /// Adds a move. `plane` holds the joints of the working plane; `before_corner` is true if
  /// RND or CHF follows. Throws BadInput for moves too short for a corner, and for moves that RL
  /// and RR cannot have.
  void add(ContourElement element, const std::array<int, 2>& plane, bool before_corner);
  /// Adds a corner at the end of the previous move. `size` is the radius or the length of the
  /// bevel, mm.
  void add_corner(bool is_round, double size, std::optional<Feed> feed, const Cause& cause);
  /// Sets compensation left or right of the path from the next move on, or ends it. `radius` in mm.
  void set_side(std::optional<bool> left, double radius, const Cause& cause);
  bool is_compensated() const { return is_left_.has_value(); }
  bool is_waiting() const { return waiting_corner_ || waiting_element_; }
  /// Runs an action after the waiting move of the compensation, or at once if no move waits.
  void run_after_move(std::function<void()> action);
  /// Makes all waiting moves at their programmed ends.
  void finish();

 private:
  /// A corner that waits for the move after it.
  struct Corner {
    bool is_round = true;
    double size = 0.0;
    std::optional<Feed> feed;
    Cause cause;
    int line = 0, file = 0;
  };
  Eigen::Vector2d in_plane(const AxisVector& q) const { return {q[plane_[0]], q[plane_[1]]}; }
  AxisVector make_corner(const ContourElement& next);
  void process(ContourElement element);
  void enter_contour(const ContourElement& next);
  Eigen::Vector2d start_direction(const ContourElement& element, const AxisVector& start) const;
  void compensate(const ContourElement& element);
  void issue(const ContourElement& element);
  void issue_entry_moves();

  ProgramRun& run_;
  program::Canon& canon_;
  CutterCompensation compensation_;
  std::array<int, 2> plane_{0, 1};
  bool is_ahead_ = false;  ///< the programmed position is ahead of the axes
  AxisVector position_;
  std::optional<ContourElement> waiting_element_;  ///< line before a corner
  AxisVector waiting_start_;
  std::optional<Corner> waiting_corner_;
  std::optional<bool> is_left_;  ///< side of the compensation; empty: none
  double radius_ = 0.0;
  /// The first move under RL or RR, and moves of other axes after it.
  std::vector<ContourElement> entry_elements_;
};

/// State of a TNC: modes, datum, tilted planes, tools and cycles. Executes blocks and issues their
/// moves to the canon. Program coordinates are in mm and rad.
class Machine : public Control {
 public:
  explicit Machine(ProgramRun& run);

  /// Executes a block that is not part of the flow. `before_corner` is true if RND or CHF follows.
  void execute(const std::string& keyword, std::size_t from, WordReader& words, bool before_corner);
  void set_inch(bool inch) { canon_.set_inch(inch); }
  bool inch() const { return canon_.inch(); }
  /// Returns true after M2 or M30.
  bool has_ended() const { return has_ended_; }
  /// Ends a program (END PGM) together with compensation and corners in force.
  void end_of_program();
  /// Makes all waiting moves.
  void finish() { contour_.finish(); }

  /// Returns a Q parameter that the control sets itself, for example Q108, the radius of the tool.
  std::optional<double> preset_parameter(int number) const;
  bool has_cycle() const { return cycle_.number > 0; }
  /// Called with number and value of each parameter that CYCL DEF sets.
  std::function<void(int, double)> on_parameter;

 private:
  static constexpr const char* cycle_name = "CYCL DEF of a hole";
  static constexpr unsigned rotation_bit = 8;
  static unsigned shift_bit(char letter) { return 1u << (letter - 'X'); }

  using Vector3d = Eigen::Vector3d;

  /// Kinds of F values.
  enum class FeedKind { None, Number, PerRevolution, Rapid, OfTool };
  struct FeedValue {
    FeedKind kind = FeedKind::None;
    double value = 0.0;  ///< not used by Rapid
  };
  /// An M function and the values that belong to it.
  struct MFunction {
    int number = 0;
    Cause cause;
    std::optional<double> retraction;  ///< MB of M140, mm
    bool retracts_to_limit = false;    ///< MB MAX
    std::optional<double> feed;        ///< F after M128 and M140
    bool is_rapid = false;
    char axis = '\0';  ///< axis after M94
  };
  /// The value of a word.
  struct WordValue {
    double value = 0.0;
    bool is_incremental = false;  ///< preceded by I
    Cause cause;
  };
  /// The words of a motion block.
  struct MotionBlock {
    std::string keyword;
    Cause cause;
    std::array<std::optional<WordValue>, 26> axes;  ///< by letter, mm and rad
    std::optional<WordValue> pr, pa, radius;
    std::optional<bool> is_clockwise;  ///< DR
    std::array<std::optional<double>, 3> normal, direction;
    std::optional<char> side;  ///< '0', 'L' or 'R'
    Cause side_cause;
    FeedKind feed_kind = FeedKind::None;
    double feed = 0.0;
    std::vector<MFunction> functions;
    bool in_machine_coordinates = false;  ///< M91
    bool before_corner = false;
  };
  /// How rotary axes move to a plane.
  struct RotaryPositioning {
    enum class Kind { Stay, Turn, Move } kind = Kind::Stay;
    bool is_rapid = false;
    double feed = 0.0;  ///< as programmed, if not rapid
    std::optional<double> distance, retract;
    bool retract_to_end = false;
    int sign = 0;                ///< sign of the master axis, SEQ or SYM
    bool rotates_table = false;  ///< TABLE ROT
    Cause cause;
  };

  // Tools and definitions.
  void reject_unsupported(const std::string& word, const Cause& cause) const;
  int joint_of(char letter, const Cause& cause) const;
  bool execute_motion(const std::string& keyword, std::size_t from, WordReader& words,
                      bool before_corner);
  bool execute_definition(const std::string& keyword, std::size_t from, WordReader& words);
  void execute_m_block(std::size_t from, WordReader& words);
  int read_tool_name(WordReader& words);
  void tool_call(WordReader& words);
  void tool_def(WordReader& words);
  void select_tool(int number, const Cause& cause);
  double tool_length(int number, const Cause& cause);
  void stop(WordReader& words);
  void execute_function(WordReader& words);
  void execute_preset(WordReader& words);

  // M functions.
  void read_m_function(WordReader& words, std::size_t from, MFunction& m);
  void apply_functions_before_motion(MotionBlock& move);
  void apply_functions_after_motion(const MotionBlock& move);
  void start_m_function(const MFunction& m, MotionBlock& move);
  void end_m_function(const MFunction& m);
  void remove_whole_turns(const MFunction& m);
  void execute_m140(const MFunction& m, const MotionBlock& move);

  // Motion.
  MotionBlock read_move(const std::string& keyword, std::size_t from, WordReader& words);
  bool read_axis(const std::string& name, WordReader& words, std::size_t from, MotionBlock& move);
  bool read_polar(const std::string& name, WordReader& words, std::size_t from, MotionBlock& move);
  /// Parses a feed: FMAX, F MAX, FAUTO, FU0.2 or F500; in a cycle also without F. `letters` are
  /// those after F.
  FeedValue read_feed(std::string letters, WordReader& words, std::size_t from) const;
  void read_compensation_side(const std::string& name, WordReader& words, std::size_t from,
                              MotionBlock& move);
  void set_feed(const MotionBlock& move);
  void set_side(const MotionBlock& move);
  Target block_target(const MotionBlock& move) const;
  void set_pole(WordReader& words);
  void move(MotionBlock move);
  void make_line(const MotionBlock& move, const Target& target);
  void move_in_machine_coordinates(const MotionBlock& move, const Target& target);
  void rotate_axes_in_plane(const MotionBlock& move, const Target& target, bool rapid);
  void make_vector_line(const MotionBlock& move);
  /// End of a move in polar coordinates.
  struct PolarEnd {
    Target target;
    double sweep = 0.0;  ///< rad, of CP
  };
  PolarEnd polar_end(const MotionBlock& move) const;
  void make_arc(const MotionBlock& move, const Target& target, double sweep);
  void make_tangent_arc(const MotionBlock& move, const Target& target);
  void make_radius_arc(const MotionBlock& move, const Target& target);
  void store_arrival_direction(const std::array<int, 2>& plane, const Eigen::Vector2d& radial,
                               bool clockwise);
  void execute_corner(const std::string& keyword, WordReader& words);
  void add_element(ContourElement element, const MotionBlock& move, std::uint32_t stated);
  double nearest_rotary_position(int joint, double end, double from) const;
  void require_pole(const Cause& cause) const;
  std::array<int, 2> working_plane(const Cause& cause) const;

  // Tilted planes.
  void execute_plane(WordReader& words);
  Eigen::Matrix3d plane_matrix(const std::string& kind, std::size_t from, WordReader& words);
  double read_word(WordReader& words, std::string_view name) const;
  RotaryPositioning read_positioning(WordReader& words);
  bool read_positioning_word(const std::string& name, WordReader& words,
                             RotaryPositioning& positioning);
  void set_plane(const Eigen::Matrix3d& R, const RotaryPositioning& positioning);
  void reset_plane(const RotaryPositioning& positioning);
  void check_plane_change(const Cause& cause) const;
  void require_certain_shift(const Cause& cause) const;
  void move_to_plane(const Eigen::Matrix3d& R, const RotaryPositioning& positioning);
  void execute_tcpm(WordReader& words);

  // Frames and rotary axes.
  void set_tcpm(bool on, const Cause& cause);
  void apply_frame(const Cause& cause);
  void update_tip_mode(const Cause& cause);
  AxisVector axis_shift(const Cause& cause);
  const kinematics::Chain& chain(const Cause& cause) const;
  const kinematics::Chain& free_chain(const Cause& cause);
  bool is_rotary(int joint) const;
  /// Returns the rotation from program coordinates to the workpiece.
  Eigen::Matrix3d rotation() const;
  AxisVector axis_position(const Cause& cause) const;
  kinematics::InverseSolution solve_direction(const Vector3d& direction, const AxisVector& previous,
                                              const Cause& cause);
  AxisVector axes_for_plane(const Eigen::Matrix3d& R, const RotaryPositioning& positioning);
  AxisVector fix_free_axis(AxisVector q, const Eigen::Matrix3d& R,
                           const RotaryPositioning& positioning);
  AxisVector nearest_axes(const Vector3d& direction, const Cause& cause);
  void retract_by(double distance, bool to_end, bool rapid, const Cause& cause);

  // Cycles of coordinates.
  void execute_cycle_definition(WordReader& words);
  void execute_numbered_cycle(int number, int part, std::size_t from, WordReader& words);
  void require_complete_cycle(const Cause& cause);
  void execute_datum_shift(WordReader& words);
  void set_axis_shift(char letter, double value, bool is_incremental, const Cause& cause);
  void execute_rotation_cycle(WordReader& words);
  void execute_plane_cycle(WordReader& words);
  void execute_trans(WordReader& words);
  void select_preset(int number, const Cause& cause);

  // Cycles of holes.
  void define_q_cycle(int number, std::size_t from, WordReader& words);
  double read_cycle_value(int q, std::set<int>& per_revolution, WordReader& words) const;
  void check_cycle(const Cause& cause);
  void check_pecks(double pecks) const;
  void check_infeeds(double depth, double infeed) const;
  double next_infeed(double infeed) const;
  void require_cycle(const Cause& cause) const;
  double cycle_value(int number) const;
  double cycle_value(int number, double default_value) const;
  void call_cycle(WordReader& words);
  void run_cycle(double surface, const Cause& cause);
  void drill(double surface, double bottom);
  void peck_universal(double surface, double bottom);
  void peck_deep(double surface, double bottom);
  void ream(double surface, double bottom);
  void bore(double surface, double bottom);
  void tap(double surface, double bottom);
  void move_to_depth(double z, bool rapid);
  void feed_to_depth(double z, int parameter, int default_parameter);
  void dwell(int parameter);

  Contour contour_;
  std::optional<Feed> feed_;            ///< the last F
  bool is_feed_per_turn_ = false;       ///< M136
  bool is_last_feed_per_turn_ = false;  ///< unit of the last F
  bool has_ended_ = false, is_tool_called_ = false;
  std::map<int, double> length_, radius_;  ///< mm, of TOOL DEF
  int tool_ = -1;
  /// mm by which the length in the control exceeds that of the chain, from DL and TOOL DEF
  double extra_length_ = 0.0;
  double delta_radius_ = 0.0, tool_feed_ = 0.0, delta_length_ = 0.0;
  int preset_ = 0;                           ///< index of the work offset: 0 is G54
  AxisVector datum_shift_;                   ///< cycle 7 in force, within the plane if there is one
  Vector3d outer_shift_ = Vector3d::Zero();  ///< cycle 7 from before the plane
  double rotation_ = 0.0;                    ///< rad, cycle 10
  /// Bits of X Y Z and of the rotation whose origin is unknown until the plane ends or they are
  /// programmed again.
  unsigned uncertain_shifts_ = 0;
  AxisVector removed_turns_;              ///< rad, whole turns removed by M94
  std::optional<Eigen::Matrix3d> plane_;  ///< rotation in the workpiece
  std::array<double, 3> plane_axes_{};    ///< deg, Q120 to Q122
  bool is_tcpm_ = false, takes_shortest_rotation_ = false, is_cycle_modal_ = false;
  /// A block of a numbered cycle, CYCL DEF 7.1: 7 and 1.
  struct NumberedCycleBlock {
    int cycle, part;
  };
  std::optional<NumberedCycleBlock>
      previous_cycle_block_;  ///< previous block, if of a numbered cycle
  std::optional<std::array<double, 3>> pole_;
  std::array<int, 2> pole_plane_{0, 1};
  /// Direction in which the last move arrived, program coordinates.
  std::optional<Vector3d> tangent_;
  struct Cycle {
    int number = 0;
    int line = 0;
    std::map<int, double> values;       ///< as programmed; a feed of 99999 or more is FMAX
    std::set<int> per_revolution = {};  ///< parameters that are feeds per revolution
  } cycle_;
  std::map<int, kinematics::Chain> free_chains_;  ///< by tool, with unlimited slides
};

}  // namespace abbe::sim::dialects::heidenhain
