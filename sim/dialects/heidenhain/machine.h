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

/// The control of a TNC as its blocks command it: modes, datum, tilted planes, tools and cycles,
/// and the moves that they make on the canon. Program coordinates are mm and rad.
class Machine {
 public:
  explicit Machine(ProgramRun& run);

  /// Runs a block that is not of the flow. @param before_corner  RND or CHF follows it
  void execute(const std::string& keyword, std::size_t from, Words& words, bool before_corner);
  void set_inch(bool inch);
  bool inch() const { return canon_.inch(); }
  /// M2 or M30 has run.
  bool ended() const { return ended_; }
  /// END PGM: what a program leaves in force ends with it.
  void end_of_program();
  /// What is still to be put out.
  void finish();

  /// A Q parameter that the control sets itself, as Q108, the radius of the tool.
  std::optional<double> preset_parameter(int number) const;
  bool has_cycle() const { return cycle_.number > 0; }
  /// Called for parameters that CYCL DEF sets.
  std::function<void(int, double)> on_parameter;

 private:
  static constexpr const char* the_cycle = "CYCL DEF of a hole";
  static constexpr unsigned turn_bit = 8;
  static unsigned shift_bit(char letter) { return 1u << (letter - 'X'); }

  using AxisVector = kinematics::AxisVector;
  using Vector3d = Eigen::Vector3d;

  enum class FeedWord { None, Number, PerTurn, Rapid, OfTool };
  struct FeedValue {
    FeedWord word = FeedWord::None;
    double value = 0.0;  ///< of all but Rapid
  };
  struct M {
    int number = 0;
    Cause cause;
    std::optional<double> mb;  ///< of M140
    bool mb_max = false;
    std::optional<double> feed;  ///< F behind M128 and M140
    bool rapid = false;
    char axis = '\0';  ///< behind M94
  };
  struct WordValue {
    double value = 0.0;
    bool step = false;  ///< I before it
    Cause cause;
  };
  /// The words of a block of motion.
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
  /// How rotary axes go to a plane.
  struct Positioning {
    enum class Kind { Stay, Turn, Move } kind = Kind::Stay;
    bool rapid = false;
    double feed = 0.0;  ///< as programmed, where it is not rapid
    std::optional<double> distance, retract;
    bool retract_to_end = false;
    int sign = 0;  ///< of the master axis, SEQ or SYM
    bool table = false;
    Cause cause;
  };

  // heidenhain_machine.cpp
  [[noreturn]] void refuse(const Cause& cause, std::string expected,
                           std::optional<std::string> seen = {}) const {
    canon_.refuse(cause, std::move(expected), std::move(seen));
  }
  void refuse_if_named(const std::string& word, const Cause& cause) const;
  double unit() const;  ///< mm
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

  // heidenhain_functions.cpp
  void read_function(Words& words, std::size_t from, M& m);
  void apply_functions_before_motion(Move& move);
  void apply_functions_after_motion(const Move& move);
  void start_function(const M& m, Move& move);
  void end_function(const M& m);
  void reduce_turns(const M& m);
  void retract(const M& m, const Move& move);

  // heidenhain_motion.cpp
  Move read_move(const std::string& keyword, std::size_t from, Words& words);
  bool read_axis(const std::string& name, Words& words, std::size_t from, Move& move);
  bool read_polar(const std::string& name, Words& words, std::size_t from, Move& move);
  /// A feed as a TNC writes it: FMAX, F MAX, FAUTO, FU0.2, F500; in a cycle also without F.
  /// @param kind  letters behind F
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

  // heidenhain_plane.cpp
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

  // heidenhain_frame.cpp
  void set_tcpm(bool on, const Cause& cause);
  void apply_frame(const Cause& cause);
  void update_tip_mode(const Cause& cause);
  AxisVector axis_shift(const Cause& cause);
  const kinematics::Chain* known_chain() const;
  const kinematics::Chain& chain(const Cause& cause) const;
  const kinematics::Chain& free_chain(const Cause& cause);
  bool is_rotary(int joint) const;
  /// Program coordinates to the workpiece.
  Eigen::Matrix3d rotation() const;
  AxisVector axes_now(const Cause& cause) const;
  kinematics::InverseSolution solve(const Vector3d& direction, const AxisVector& previous,
                                    const Cause& cause);
  AxisVector axes_for(const Eigen::Matrix3d& R, const Positioning& how);
  AxisVector with_free_axis(AxisVector q, const Eigen::Matrix3d& R, const Positioning& how);
  AxisVector nearest_axes(const Vector3d& direction, const Cause& cause);
  void retract_by(double distance, bool to_end, bool rapid, const Cause& cause);

  // heidenhain_cycles.cpp
  void cycle_definition(Words& words);
  void old_cycle(int number, int part, std::size_t from, Words& words);
  void require_whole_cycle(const Cause& cause);
  void datum_shift(Words& words);
  void shift_axis(char letter, double value, bool step, const Cause& cause);
  void cycle_rotation(Words& words);
  void cycle_plane(Words& words);
  void trans(Words& words);
  void choose_preset(int number, const Cause& cause);

  // heidenhain_drilling.cpp
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
  std::optional<program::Feed> feed_;  ///< of the last F
  bool per_turn_ = false, feed_per_turn_ = false;
  bool ended_ = false, tool_called_ = false;
  std::map<int, double> length_, radius_;  ///< mm, of TOOL DEF
  int tool_ = -1;
  double delta_ = 0.0;  ///< mm by which the believed length exceeds that of the chain: DL, TOOL DEF
  double delta_radius_ = 0.0, tool_feed_ = 0.0, delta_length_ = 0.0;
  int preset_ = 0;                           ///< of the offsets, counted from 0: G54
  AxisVector datum_shift_;                   ///< of cycle 7 in force, of the plane if there is one
  Vector3d outer_shift_ = Vector3d::Zero();  ///< of cycle 7 before the plane
  double turn_ = 0.0;                        ///< rad, of cycle 10
  unsigned shift_doubt_ = 0;  ///< bits of X Y Z, and of the rotation: where they count from is not
                              ///< known until a plane ends or it is stated again
  AxisVector turns_;          ///< rad, whole turns that M94 took off
  std::optional<Eigen::Matrix3d> plane_;  ///< in the workpiece
  std::array<double, 3> plane_axes_{};    ///< deg, Q120 to Q122
  bool tcpm_ = false, short_way_ = false, modal_cycle_ = false;
  std::optional<std::pair<int, int>> old_cycle_;  ///< of the block before, CYCL DEF 7.1: 7 and 1
  std::optional<std::array<double, 3>> pole_;
  std::array<int, 2> pole_plane_{0, 1};
  std::optional<Vector3d> tangent_;  ///< in which the last move arrived, program coordinates
  struct Cycle {
    int number = 0;
    int line = 0;
    std::map<int, double> values;  ///< as the words have them; a feed of 99999 and more is FMAX
    std::set<int> per_turn = {};   ///< feeds that are per turn of the spindle
  } cycle_;
  std::map<int, kinematics::Chain> free_chains_;  ///< of tools, their slides without limits
};

}  // namespace abbe::sim::dialects::heidenhain
