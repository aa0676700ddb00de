#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kinematics/chain.h"
#include "kinematics/inverse_kinematics.h"
#include "sim/dialects/heidenhain/block.h"
#include "sim/dialects/heidenhain/contour.h"
#include "sim/dialects/program_run.h"

namespace abbe::sim::dialects::heidenhain {

/// State of a TNC as its blocks command it: modes, datum, tilted planes, tools and cycles, and the
/// moves that they make on the canon. Program coordinates are in mm and rad.
class Machine {
 public:
  explicit Machine(ProgramRun& run);

  /// Executes a block that is not part of the flow. `before_corner` is true if RND or CHF follows.
  void execute(const std::string& keyword, std::size_t from, Words& words, bool before_corner);
  void set_inch(bool inch);
  bool inch() const { return canon_.inch(); }
  /// Returns true after M2 or M30.
  bool ended() const { return ended_; }
  /// Ends a program (END PGM): compensation and corners in force end with it.
  void end_of_program();
  /// Makes the moves that still wait.
  void finish();

  /// Returns a Q parameter that the control sets itself, for example Q108, the radius of the tool.
  std::optional<double> preset_parameter(int number) const;
  bool has_cycle() const { return cycle_.number > 0; }
  /// Called for the parameters that CYCL DEF sets.
  std::function<void(int, double)> on_parameter;

 private:
  static constexpr const char* the_cycle = "CYCL DEF of a hole";
  static constexpr unsigned turn_bit = 8;
  static unsigned shift_bit(char letter) { return 1u << (letter - 'X'); }

  using AxisVector = kinematics::AxisVector;
  using Vector3d = Eigen::Vector3d;

  /// Kinds of F values.
  enum class FeedWord { None, Number, PerTurn, Rapid, OfTool };
  struct FeedValue {
    FeedWord word = FeedWord::None;
    double value = 0.0;  ///< not used by Rapid
  };
  /// An M function and the values behind it.
  struct M {
    int number = 0;
    Cause cause;
    std::optional<double> mb;  ///< of M140
    bool mb_max = false;
    std::optional<double> feed;  ///< F behind M128 and M140
    bool rapid = false;
    char axis = '\0';  ///< axis behind M94
  };
  /// A value of a word.
  struct WordValue {
    double value = 0.0;
    bool step = false;  ///< preceded by I
    Cause cause;
  };
  /// The words of a motion block.
  struct Move {
    std::string keyword;
    Cause cause;
    std::array<std::optional<WordValue>, 26> axes;  ///< by letter, mm and rad
    std::optional<WordValue> pr, pa, radius;
    std::optional<bool> clockwise;  ///< DR
    std::array<std::optional<double>, 3> normal, direction;
    std::optional<char> side;  ///< '0', 'L' or 'R'
    Cause side_cause;
    FeedWord feed_word = FeedWord::None;
    double feed = 0.0;
    std::vector<M> functions;
    bool machine = false;  ///< M91
    bool before_corner = false;
  };
  /// The way rotary axes are moved to a plane.
  struct Positioning {
    enum class Kind { Stay, Turn, Move } kind = Kind::Stay;
    bool rapid = false;
    double feed = 0.0;  ///< as programmed, if not rapid
    std::optional<double> distance, retract;
    bool retract_to_end = false;
    int sign = 0;  ///< of the master axis, SEQ or SYM
    bool table = false;
    Cause cause;
  };

  // Tools and definitions.
  [[noreturn]] void refuse(const Cause& cause, std::string expected,
                           std::optional<std::string> seen = {}) const {
    canon_.refuse(cause, std::move(expected), std::move(seen));
  }
  void refuse_if_named(const std::string& word, const Cause& cause) const;
  double unit() const;  ///< mm per unit
  int joint_of(char letter, const Cause& cause) const;
  bool execute_motion(const std::string& keyword, std::size_t from, Words& words,
                      bool before_corner);
  bool execute_definition(const std::string& keyword, std::size_t from, Words& words);
  void lone_function(std::size_t from, Words& words);
  int tool_of_name(Words& words);
  void tool_call(Words& words);
  void tool_def(Words& words);
  void select_tool(int number, const Cause& cause);
  double length_of(int number, const Cause& cause);
  void stop(Words& words);
  void function_block(Words& words);
  void preset(Words& words);

  // M functions.
  void read_function(Words& words, std::size_t from, M& m);
  void apply_functions_before_motion(Move& move);
  void apply_functions_after_motion(const Move& move);
  void start_function(const M& m, Move& move);
  void end_function(const M& m);
  void reduce_turns(const M& m);
  void retract(const M& m, const Move& move);

  // Motion.
  Move read_move(const std::string& keyword, std::size_t from, Words& words);
  bool read_axis(const std::string& name, Words& words, std::size_t from, Move& move);
  bool read_polar(const std::string& name, Words& words, std::size_t from, Move& move);
  /// Parses a feed: FMAX, F MAX, FAUTO, FU0.2 or F500; in a cycle also without F. `kind` holds the
  /// letters behind F.
  FeedValue feed_value(std::string kind, Words& words, std::size_t from) const;
  void read_side(const std::string& name, Words& words, std::size_t from, Move& move);
  void set_feed(const Move& move);
  void set_side(const Move& move);
  Target block_target(const Move& move) const;
  void pole(Words& words);
  void move(Move move);
  void line(const Move& move, const Target& target);
  void machine_line(const Move& move, const Target& target);
  void turn_in_plane(const Move& move, const Target& target, bool rapid);
  void vector_line(const Move& move);
  Target polar_target(const Move& move, double& sweep) const;
  void arc(const Move& move, const Target& target, double sweep);
  void tangent_arc(const Move& move, const Target& target);
  void radius_arc(const Move& move, const Target& target);
  void arrive(const std::array<int, 2>& plane, const Eigen::Vector2d& out, bool clockwise);
  void corner(const std::string& keyword, Words& words);
  void element(Element element, const Move& move, std::uint32_t stated);
  double nearest_rotary_position(int joint, double end, double from) const;
  void require_pole(const Cause& cause) const;
  std::array<int, 2> working_plane(const Cause& cause) const;

  // Tilted planes.
  void plane(Words& words);
  Eigen::Matrix3d plane_matrix(const std::string& kind, std::size_t from, Words& words);
  double word_value(Words& words, std::string_view name) const;
  Positioning read_positioning(Words& words);
  bool read_positioning_word(const std::string& name, Words& words, Positioning& how);
  void tilt(const Eigen::Matrix3d& R, const Positioning& how);
  void untilt(const Positioning& how);
  void check_plane_is_free(const Cause& cause) const;
  void require_certain_shift(const Cause& cause) const;
  void position_axes(const Eigen::Matrix3d& R, const Positioning& how);
  void tcpm(Words& words);

  // Frames and rotary axes.
  void set_tcpm(bool on, const Cause& cause);
  void apply_frame(const Cause& cause);
  void update_tip_mode(const Cause& cause);
  AxisVector axis_shift(const Cause& cause);
  const kinematics::Chain* known_chain() const;
  const kinematics::Chain& chain(const Cause& cause) const;
  const kinematics::Chain& free_chain(const Cause& cause);
  bool is_rotary(int joint) const;
  /// Returns the rotation from program coordinates to the workpiece.
  Eigen::Matrix3d rotation() const;
  AxisVector axes_now(const Cause& cause) const;
  kinematics::InverseSolution solve(const Vector3d& direction, const AxisVector& previous,
                                    const Cause& cause);
  AxisVector axes_for(const Eigen::Matrix3d& R, const Positioning& how);
  AxisVector with_free_axis(AxisVector q, const Eigen::Matrix3d& R, const Positioning& how);
  AxisVector nearest_axes(const Vector3d& direction, const Cause& cause);
  void retract_by(double distance, bool to_end, bool rapid, const Cause& cause);

  // Cycles of coordinates.
  void cycle_definition(Words& words);
  void old_cycle(int number, int part, std::size_t from, Words& words);
  void require_whole_cycle(const Cause& cause);
  void datum_shift(Words& words);
  void shift_axis(char letter, double value, bool step, const Cause& cause);
  void cycle_rotation(Words& words);
  void cycle_plane(Words& words);
  void trans(Words& words);
  void choose_preset(int number, const Cause& cause);

  // Cycles of holes.
  void new_cycle(int number, std::size_t from, Words& words);
  double cycle_word(int q, std::set<int>& per_turn, Words& words) const;
  void check_cycle(const Cause& cause);
  void check_pecks(double pecks) const;
  void check_infeeds(double depth, double step) const;
  void require_cycle(const Cause& cause) const;
  double cycle_value(int number) const;
  double cycle_value(int number, double otherwise) const;
  void cycle_call(Words& words);
  void run_cycle(double surface, const Cause& cause);
  void drill(double surface, double bottom);
  void peck_universal(double surface, double bottom);
  void peck_deep(double surface, double bottom);
  void ream(double surface, double bottom);
  void bore(double surface, double bottom);
  void tap(double surface, double bottom);
  void to_depth(double z, bool rapid);
  void feed_to(double z, int parameter, int otherwise);
  void wait(int parameter);

  ProgramRun& run_;
  program::Canon& canon_;
  Contour contour_;
  std::optional<program::Feed> feed_;  ///< the last F
  bool per_turn_ = false, feed_per_turn_ = false;
  bool ended_ = false, tool_called_ = false;
  std::map<int, double> length_, radius_;  ///< mm, of TOOL DEF
  int tool_ = -1;
  /// mm by which the length in the control exceeds that of the chain: DL, TOOL DEF
  double delta_ = 0.0;
  double delta_radius_ = 0.0, tool_feed_ = 0.0, delta_length_ = 0.0;
  int preset_ = 0;                           ///< index of the work offset: 0 is G54
  AxisVector datum_shift_;                   ///< cycle 7 in force, inside the plane if there is one
  Vector3d outer_shift_ = Vector3d::Zero();  ///< cycle 7 from before the plane
  double turn_ = 0.0;                        ///< rad, cycle 10
  /// Bits of X Y Z and of the rotation: their origin is unknown until the plane ends or they are
  /// programmed again.
  unsigned shift_doubt_ = 0;
  AxisVector turns_;                      ///< rad, whole turns removed by M94
  std::optional<Eigen::Matrix3d> plane_;  ///< rotation in the workpiece
  std::array<double, 3> plane_axes_{};    ///< deg, Q120 to Q122
  bool tcpm_ = false, short_way_ = false, modal_cycle_ = false;
  std::optional<std::pair<int, int>> old_cycle_;  ///< previous block, CYCL DEF 7.1: 7 and 1
  std::optional<std::array<double, 3>> pole_;
  std::array<int, 2> pole_plane_{0, 1};
  /// Direction in which the last move arrived, program coordinates.
  std::optional<Vector3d> tangent_;
  struct Cycle {
    int number = 0;
    int line = 0;
    std::map<int, double> values;  ///< as programmed; a feed of 99999 or more is FMAX
    std::set<int> per_turn = {};   ///< feeds that are per spindle turn
  } cycle_;
  std::map<int, kinematics::Chain> free_chains_;  ///< by tool, with unlimited slides
};

}  // namespace abbe::sim::dialects::heidenhain
