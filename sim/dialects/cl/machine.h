#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "kinematics/text.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_vectors.h"

/// APT statements, `MAJOR / item, item, ...`, which $ continues on the next line, and the machine
/// that executes them.
namespace abbe::sim::dialects::cl {

using program::Cause;

/// A number or a word after the slash.
struct Item {
  std::string_view text;
  std::optional<double> number;  ///< empty for a word
  int line = 0, column = 0;      ///< from 1

  Cause cause() const { return {column, text}; }
  /// Returns true if the item is this word, ignoring case.
  bool is(std::string_view word) const;
};

/// A statement: a line, or several joined by $, without comments.
struct Statement {
  std::string major;  ///< major word, upper case; may be empty
  Cause cause;        ///< where the major word is
  int line = 0;
  /// After "$$->", where Creo writes statements that postprocessors may ignore.
  bool in_comment = false;
  std::vector<Item> items;  ///< filled by `read_items`

  struct Piece {
    std::string_view text;
    int line = 0;
    std::size_t from = 0;  ///< byte at which the items begin
  };
  std::vector<Piece> pieces;
};

/// Iterates over the statements of a program.
class Statements {
 public:
  explicit Statements(std::string_view text) : lines_(text) {}
  /// Reads the next statement that is not blank, but not its items. Returns false at the end of the
  /// text.
  bool next(Statement& statement);

 private:
  Lines lines_;
};

/// Splits the items of a statement at commas and blanks. Throws BadInput for an empty item between
/// commas, more than 1000 items, or more than 200 lines.
void read_items(Statement& statement, const program::Canon& canon);

/// Throws BadInput at an item, which may be on a continuation line.
[[noreturn]] void refuse(const program::Canon& canon, const Item& item, std::string expected,
                         std::optional<std::string> seen = {});

class Machine;

/// Major words with the same treatment and handler. The word table is made of these entries.
struct WordEntry {
  std::string_view words;
  Use use = Use::Read;
  std::string_view sentence;
  void (Machine::*does)(const Statement&) = nullptr;
};

/// Returns the entry of a major word, or null if the dialect does not have it.
const WordEntry* find_entry(std::string_view major);

/// A programmed position of the tip and direction of the tool axis.
struct Location {
  Eigen::Vector3d tip;        ///< mm
  Eigen::Vector3d direction;  ///< unit, from the tip to the spindle
};

/// The machine that executes statements: its modes, tools, cycles and moves of the tip.
class Machine {
 public:
  explicit Machine(ProgramRun& run) : run_(run), canon_(run.canon), vector_lines_(run) {}

  /// Executes a statement whose items have not been read yet. Throws BadInput.
  void execute(Statement& statement);
  bool ended() const { return ended_; }
  /// Issues warnings that concern the whole program.
  void finish();

  // Used by the reader of tables of locations.
  void set_feed(const program::Feed& feed) { canon_.set_feed(feed); }
  /// Moves to a location as the modes require: straight, along a stated arc, or through a hole
  /// cycle.
  /// @param stated  the location is absolute, so that no axis is uncertain any more
  void go_to(const Location& to, const Cause& cause, bool stated);
  void rapid_next() { rapid_ = true; }
  void assume_mm() { units_stated_ = true; }
  /// Returns a normalised tool axis. Throws BadInput unless its length is 1 within a thousandth.
  Eigen::Vector3d direction_of(const Item& first, const Eigen::Vector3d& ijk) const;
  const Eigen::Vector3d& direction() const { return direction_; }

  // Statements without motion.
  void fini(const Statement& s);
  void units(const Statement& s);
  void multax(const Statement& s);
  void rapid(const Statement& s);
  void feedrate(const Statement& s);
  void delay(const Statement& s);
  void stop(const Statement& s);
  void msys(const Statement& s);
  void origin(const Statement& s);
  void require_off(const Statement& s);
  void auxiliary(const Statement& s);
  // Straight motion.
  void go_to(const Statement& s);
  void go_delta(const Statement& s);
  void from(const Statement& s);
  void go_home(const Statement& s);
  void tool_axis(const Statement& s);
  // Arcs.
  void circle(const Statement& s);
  void moving_arc(const Statement& s);
  // Holes.
  void cycle(const Statement& s);
  // Tools and spindle.
  void load_tool(const Statement& s);
  void load(const Statement& s);
  void select(const Statement& s);
  void spindle(const Statement& s);
  void coolant(const Statement& s);
  void cutter(const Statement& s);
  void tool_data(const Statement& s);

 private:
  using AxisVector = kinematics::AxisVector;

  /// A circle that a statement defines for the points that follow.
  struct Circle {
    /// Programmed values; the tool moves about the axis by the right-hand rule.
    Eigen::Vector3d centre, axis;
    double radius = 0.0;
    std::optional<double> sweep;  ///< rad, if it was stated
    /// True: it applies to the next point only; false: to all following points that lie on it.
    bool for_next_point_only = true;
    bool sense_in_doubt = false;  ///< CAM systems disagree about the sign of the axis
    int line = 0;
    std::string_view word;  ///< "CIRCLE/"
    int arcs = 0;           ///< arcs made so far
    double turned = 0.0;    ///< rad, sum of the sweeps of these arcs
  };
  /// The hole cycle in force.
  struct Hole {
    double depth = 0.0, clear = 0.0, back = 0.0;  ///< mm, from the point along the tool axis
    double dwell_s = 0.0;
    std::optional<program::Feed> feed;
    program::FeedMode mode = program::FeedMode::PerMinute;
  };

  [[noreturn]] void refuse(const Item& item, std::string expected,
                           std::optional<std::string> seen = {}) const {
    cl::refuse(canon_, item, std::move(expected), std::move(seen));
  }
  [[noreturn]] void refuse(const Cause& cause, std::string expected,
                           std::optional<std::string> seen = {}) const {
    canon_.refuse(cause, std::move(expected), std::move(seen));
  }
  void unknown(const Statement& s, const Item& item, const std::string& expected);
  double unit() const;  ///< mm per programmed unit of length
  double number(const Statement& s, std::size_t i, const char* what) const;
  Eigen::Vector3d vector(const Statement& s, std::size_t i, const char* what) const;
  int whole(const Item& item, int most, const char* what) const;

  // Straight motion.
  Location location(const Statement& s);
  Location here() const;
  void enter_tip_mode(const Cause& cause);
  AxisVector axes_at(const Location& to, const Cause& cause);
  AxisVector turned_axes(const Location& to, const Eigen::Vector3d& tip_w, const Cause& cause);
  void note_turn(const AxisVector& end, const Eigen::Vector3d& direction);
  void straight(const Location& to, const Cause& cause, bool stated, bool rapid);
  void check_feed(const Cause& cause) const;
  Eigen::Vector3d shift() const;

  // Arcs.
  Circle stated_circle(const Statement& s, std::string_view word) const;
  bool continues_arc(const Location& to);
  void arc(const Location& to, const Cause& cause, bool stated);
  double sweep_to(const Eigen::Vector3d& to) const;
  void check_radii(const Eigen::Vector3d& to, const Cause& cause) const;
  void check_sense(double sweep, const Cause& cause);

  // Holes.
  void hole(const Location& at, const Cause& cause);
  Hole parse_hole(const Statement& s);
  void go(const Location& to, const Cause& cause, bool rapid);

  ProgramRun& run_;
  program::Canon& canon_;
  VectorLines vector_lines_;
  bool inch_ = false, units_stated_ = false, inches_seen_ = false;
  bool ended_ = false, rapid_ = false, upright_ = false;
  Eigen::Vector3d direction_ = Eigen::Vector3d::UnitZ();  ///< of the current point
  /// Tool vector to which the rotary axes were turned; zero: none.
  Eigen::Vector3d turned_to_ = Eigen::Vector3d::Zero();
  std::optional<Location> home_;
  std::optional<Circle> circle_;
  std::optional<Hole> hole_;
  std::optional<std::string> system_;  ///< text of MSYS
  int tool_ = -1;                      ///< tool that was loaded
  double speed_rpm_ = 0.0;
  int spindle_turns_ = 1;
  static constexpr double min_bulge = 1e-4;  ///< rad; smaller deviations are not reported: 2 um at
                                             ///< 20 mm above the tip
  /// Largest deviation of the tool axis from the great circle between its ends, in mid-move.
  struct AxisDeviation {
    double angle = 0.0;  ///< rad
    int line = 0;
  } axis_deviation_;
};

/// Returns true if the first line with content is a row of numbers or the header of a table.
bool is_table(std::string_view text);

/// Reads cutter locations from a table.
void read_table(std::string_view text, ProgramRun& run);

}  // namespace abbe::sim::dialects::cl
