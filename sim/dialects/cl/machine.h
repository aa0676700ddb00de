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

/// APT statements as text: `MAJOR / item, item, ...`, over several lines with $.
namespace abbe::sim::dialects::cl {

using program::Cause;

/// A number or a word behind the slash.
struct Item {
  std::string_view text;
  std::optional<double> number;  ///< none: it is a word
  int line = 0, column = 0;      ///< from 1

  Cause cause() const { return {column, text}; }
  /// It is this word, letters of either case.
  bool is(std::string_view word) const;
};

/// A line, or as many as $ joins, without comments.
struct Statement {
  std::string major;  ///< first word, upper case; empty where there is none
  Cause cause;        ///< of the major word
  int line = 0;
  bool in_comment = false;  ///< it stands behind "$$->", as Creo writes what no processor needs
  std::vector<Item> items;  ///< once `read_items` has read them

  struct Piece {
    std::string_view text;
    int line = 0;
    std::size_t from = 0;  ///< byte at which the items begin
  };
  std::vector<Piece> pieces;
};

/// Walks through the statements of a program.
class Statements {
 public:
  explicit Statements(std::string_view text) : lines_(text) {}
  /// The next one that says something, its items not yet read.
  /// @return false at the end of the text
  bool next(Statement& statement);

 private:
  Lines lines_;
};

/// Takes the items apart: between commas, or blanks.
/// @throws BadInput for nothing between commas, 1000 items, 200 lines of one statement
void read_items(Statement& statement, const program::Canon& canon);

/// Refuses an item at its own line.
[[noreturn]] void refuse(const program::Canon& canon, const Item& item, std::string expected,
                         std::optional<std::string> seen = {});

class Machine;

/// A major word, what is done with it, and by what. The table of words is made of these.
struct WordEntry {
  std::string_view words;
  Use use = Use::Read;
  std::string_view sentence;
  void (Machine::*does)(const Statement&) = nullptr;
};

/// The fact of a major word, null where the dialect has none.
const WordEntry* find_entry(std::string_view major);

/// A point of the tip with the tool axis there, both as programmed, mm.
struct Location {
  Eigen::Vector3d tip;
  Eigen::Vector3d direction;  ///< unit, from the tip to the spindle
};

/// The machine as statements command it: modes, tools, cycles, and the moves of the tip.
class Machine {
 public:
  explicit Machine(ProgramRun& run) : run_(run), canon_(run.canon), vector_lines_(run) {}

  /// Runs a statement whose items are not yet read. @throws BadInput
  void execute(Statement& statement);
  bool ended() const { return ended_; }
  /// Warnings of the whole program.
  void finish();

  // For tables of locations.
  void set_feed(const program::Feed& feed) { canon_.set_feed(feed); }
  /// Goes there as its modes say: straight, by an arc that was stated, or down a hole.
  void go_to(const Location& to, const Cause& cause, bool stated);
  void rapid_next() { rapid_ = true; }
  void assume_mm() { units_stated_ = true; }
  /// A unit vector. @throws BadInput unless its length is 1 within a thousandth
  Eigen::Vector3d direction_of(const Item& first, const Eigen::Vector3d& ijk) const;
  const Eigen::Vector3d& direction() const { return direction_; }

  // cl_machine.cpp
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
  // cl_motion.cpp
  void go_to(const Statement& s);
  void go_delta(const Statement& s);
  void from(const Statement& s);
  void go_home(const Statement& s);
  void tool_axis(const Statement& s);
  // cl_arcs.cpp
  void circle(const Statement& s);
  void moving_arc(const Statement& s);
  // cl_cycles.cpp
  void cycle(const Statement& s);
  // cl_tools.cpp
  void load_tool(const Statement& s);
  void load(const Statement& s);
  void select(const Statement& s);
  void spindle(const Statement& s);
  void coolant(const Statement& s);
  void cutter(const Statement& s);
  void tool_data(const Statement& s);

 private:
  using AxisVector = kinematics::AxisVector;

  /// A circle that was stated for the points behind it.
  struct Circle {
    Eigen::Vector3d centre, axis;  ///< as programmed, mm; the tool goes about the axis by the
                                   ///< right-hand rule
    double radius = 0.0;
    std::optional<double> sweep;      ///< rad, where it was stated
    bool for_next_point_only = true;  ///< the next point alone; else all that lie on it
    bool sense_in_doubt = false;      ///< CAM systems do not agree on the sense of the vector
    int line = 0;
    std::string_view word;  ///< "CIRCLE/"
    int arcs = 0;           ///< so far
    double turned = 0.0;    ///< rad, by them
  };
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
  double unit() const;  ///< mm per unit of length
  double number(const Statement& s, std::size_t i, const char* what) const;
  Eigen::Vector3d vector(const Statement& s, std::size_t i, const char* what) const;
  int whole(const Item& item, int most, const char* what) const;

  // cl_motion.cpp
  Location location(const Statement& s);
  Location here() const;
  void enter_tip_mode(const Cause& cause);
  AxisVector axes_at(const Location& to, const Cause& cause);
  AxisVector turned_axes(const Location& to, const Eigen::Vector3d& tip_w, const Cause& cause);
  void note_turn(const AxisVector& end, const Eigen::Vector3d& direction);
  void straight(const Location& to, const Cause& cause, bool stated, bool rapid);
  void check_feed(const Cause& cause) const;
  Eigen::Vector3d shift() const;

  // cl_arcs.cpp
  Circle stated_circle(const Statement& s, std::string_view word) const;
  bool continues_arc(const Location& to);
  void arc(const Location& to, const Cause& cause, bool stated);
  double sweep_to(const Eigen::Vector3d& to) const;
  void check_radii(const Eigen::Vector3d& to, const Cause& cause) const;
  void check_sense(double sweep, const Cause& cause);

  // cl_cycles.cpp
  void hole(const Location& at, const Cause& cause);
  Hole parse_hole(const Statement& s);
  void go(const Location& to, const Cause& cause, bool rapid);

  ProgramRun& run_;
  program::Canon& canon_;
  VectorLines vector_lines_;
  bool inch_ = false, units_stated_ = false, inches_seen_ = false;
  bool ended_ = false, rapid_ = false, upright_ = false;
  Eigen::Vector3d direction_ = Eigen::Vector3d::UnitZ();  ///< of the point that the tool is at
  Eigen::Vector3d turned_to_ = Eigen::Vector3d::Zero();   ///< for which the rotary axes stand
  std::optional<Location> home_;
  std::optional<Circle> circle_;
  std::optional<Hole> hole_;
  std::optional<std::string> system_;  ///< of MSYS
  int tool_ = -1;                      ///< that was loaded
  double speed_rpm_ = 0.0;
  int spindle_turns_ = 1;
  static constexpr double min_bulge = 1e-4;  ///< rad, 2 um at 20 mm above the tip
  struct AxisDeviation {
    double angle =
        0.0;  ///< rad between the tool axis and the great circle, in the middle of a move
    int line = 0;
  } axis_deviation_;
};

/// Whether the first line that says something is of numbers, or the head of a table.
bool is_table(std::string_view text);

/// Reads cutter locations of a table.
void read_table(std::string_view text, ProgramRun& run);

}  // namespace abbe::sim::dialects::cl
