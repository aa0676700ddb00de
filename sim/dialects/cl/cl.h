#pragma once

#include "sim/dialects/control.h"

/// APT statements, `MAJOR / item, item, ...`, which $ continues on the next line, and the machine
/// that executes them.
namespace abbe::sim::dialects::cl {

/// A number or a word after the slash.
struct Item {
  std::string_view text;
  std::optional<double> number;  ///< empty for a word
  int line = 0, column = 0;      ///< from 1

  Cause cause() const { return {column, text}; }
  /// Returns true if the item is the word, in either case.
  bool is_word(std::string_view word) const;
};

/// A statement: one line, or several lines joined by $, without comments.
struct Statement {
  std::string major;  ///< major word, upper case; may be empty
  Cause cause;        ///< the major word
  int line = 0;
  /// True after "$$->", where Creo writes statements that postprocessors may ignore.
  bool in_comment = false;
  std::vector<Item> items;  ///< filled by `read_items`

  struct StatementLine {
    std::string_view text;
    int line = 0;
    std::size_t from = 0;  ///< byte at which the items begin
  };
  std::vector<StatementLine> lines;
};

/// Iterator over the statements of a program.
class Statements {
 public:
  explicit Statements(std::string_view text) : lines_(text) {}
  /// Reads the next statement that is not blank, without its items. Returns false at the end of the
  /// text.
  bool next(Statement& statement);

 private:
  LineReader lines_;
};

/// Splits the items of a statement at commas and blanks. Throws BadInput for an empty item between
/// commas, more than 1000 items, or more than 200 lines.
void read_items(Statement& statement, const program::Canon& canon);

/// Throws BadInput at an item, which may be on a continuation line.
[[noreturn]] void throw_input_error(const program::Canon& canon, const Item& item,
                                    std::string expected, std::optional<std::string> seen = {});

class Machine;

/// Major words with the same treatment and handler: an entry of the word table.
struct WordEntry {
  std::string_view words;
  WordTreatment use = WordTreatment::Read;
  std::string_view sentence;
  void (Machine::*handler)(const Statement&) = nullptr;
};

/// Returns the entry of a major word, or null if the dialect does not have it.
const WordEntry* find_entry(std::string_view major);

/// A programmed position of the tip and direction of the tool axis.
struct Location {
  Eigen::Vector3d tip;        ///< mm
  Eigen::Vector3d direction;  ///< unit, from the tip to the spindle
};

/// State of a machine that follows cutter locations: modes, tools and cycles. Executes statements
/// and issues their moves to the canon.
class Machine : public Control {
 public:
  explicit Machine(ProgramRun& run) : Control(run), vector_lines_(run) {}

  /// Executes a statement whose items have not been read yet. Throws BadInput.
  void execute(Statement& statement);
  bool has_ended() const { return has_ended_; }
  /// Issues warnings that concern the whole program.
  void finish();

  // For the reader of tables of locations.
  void set_feed(const Feed& feed) { canon_.set_feed(feed); }
  /// Moves to a location as the modes require: straight, along a stated arc, or by a drill cycle.
  /// If the location is `stated`, i.e. absolute, no axis is uncertain any more.
  void go_to(const Location& to, const Cause& cause, bool stated);
  void request_rapid() { is_next_rapid_ = true; }
  void assume_mm() { are_units_stated_ = true; }
  /// Returns the tool axis with length 1. Throws BadInput at `first` unless its length is 1 within
  /// a thousandth.
  Eigen::Vector3d unit_direction(const Item& first, const Eigen::Vector3d& ijk) const;
  const Eigen::Vector3d& direction() const { return direction_; }

  // Statements without motion.
  void fini(const Statement& statement);
  void units(const Statement& statement);
  void multax(const Statement& statement);
  void rapid(const Statement& statement);
  void feedrate(const Statement& statement);
  void delay(const Statement& statement);
  void stop(const Statement& statement);
  void msys(const Statement& statement);
  void origin(const Statement& statement);
  void require_off(const Statement& statement);
  void auxiliary(const Statement& statement);
  // Straight motion.
  void go_to(const Statement& statement);
  void go_delta(const Statement& statement);
  void from(const Statement& statement);
  void go_home(const Statement& statement);
  void tool_axis(const Statement& statement);
  // Arcs.
  void circle(const Statement& statement);
  void moving_arc(const Statement& statement);
  // Holes.
  void cycle(const Statement& statement);
  // Tools and spindle.
  void load_tool(const Statement& statement);
  void load(const Statement& statement);
  void select(const Statement& statement);
  void spindle(const Statement& statement);
  void coolant(const Statement& statement);
  void cutter(const Statement& statement);
  void tool_data(const Statement& statement);

 private:
  /// A circle that a statement defines for the points that follow.
  struct Circle {
    /// Programmed values; the tool moves about the axis by the right-hand rule.
    Eigen::Vector3d centre, axis;
    double radius = 0.0;
    std::optional<double> sweep;  ///< rad, if it was stated
    /// True: it applies to the next point only; false: to all following points that lie on it.
    bool for_next_point_only = true;
    bool is_sense_ambiguous = false;  ///< CAM systems disagree about the sign of the axis
    int line = 0;
    std::string_view word;     ///< "CIRCLE/"
    int arcs = 0;              ///< arcs made so far
    double total_sweep = 0.0;  ///< rad, of these arcs
  };
  /// The drill cycle in force.
  struct DrillCycle {
    /// Levels, mm from the point along the tool axis; the depth counts downwards.
    double depth = 0.0, clearance = 0.0, return_level = 0.0;
    double dwell_s = 0.0;
    std::optional<Feed> feed;
    FeedMode mode = FeedMode::PerMinute;
  };

  [[noreturn]] void throw_input_error(const Item& item, std::string expected,
                                      std::optional<std::string> seen = {}) const {
    cl::throw_input_error(canon_, item, std::move(expected), std::move(seen));
  }
  using Control::throw_input_error;
  void handle_unknown_item(const Statement& statement, const Item& item,
                           const std::string& expected);
  double unit() const;  ///< mm per programmed unit of length
  double number(const Statement& statement, std::size_t i, const char* what) const;
  Eigen::Vector3d vector(const Statement& statement, std::size_t i, const char* what) const;
  int whole_number(const Item& item, int max, const char* what) const;

  // Straight motion.
  Location parse_location(const Statement& statement);
  Location current_location() const;
  void enter_tip_mode(const Cause& cause);
  AxisVector axes_for(const Location& to, const Cause& cause);
  AxisVector solve_axes(const Location& to, const Eigen::Vector3d& tip_w, const Cause& cause);
  void record_axis_deviation(const AxisVector& end, const Eigen::Vector3d& direction);
  void straight(const Location& to, const Cause& cause, bool stated, bool rapid);
  void check_feed(const Cause& cause) const;
  Eigen::Vector3d offset_origin() const;

  // Arcs.
  Circle parse_circle(const Statement& statement, std::string_view word) const;
  bool is_on_circle(const Location& to);
  void arc(const Location& to, const Cause& cause, bool stated);
  double sweep_to(const Eigen::Vector3d& to) const;
  void check_radii(const Eigen::Vector3d& to, const Cause& cause) const;
  void check_sense(double sweep, const Cause& cause);

  // Holes.
  void make_hole(const Location& at, const Cause& cause);
  DrillCycle parse_drill_cycle(const Statement& statement);
  void move_to(const Location& to, const Cause& cause, bool rapid);

  VectorLines vector_lines_;
  bool is_inch_ = false, are_units_stated_ = false, has_inch_feed_ = false;
  bool has_ended_ = false, is_next_rapid_ = false, is_upright_ = false;
  Eigen::Vector3d direction_ = Eigen::Vector3d::UnitZ();  ///< tool axis at the current point
  /// Tool vector for which the rotary axes have been solved; zero: none.
  Eigen::Vector3d solved_direction_ = Eigen::Vector3d::Zero();
  std::optional<Location> home_;
  std::optional<Circle> circle_;
  std::optional<DrillCycle> drill_cycle_;
  std::optional<std::string> msys_text_;  ///< text of MSYS
  int tool_ = -1;                         ///< tool that was loaded
  double speed_rpm_ = 0.0;
  int spindle_direction_ = 1;
  /// rad; smaller deviations, below 2 um at 20 mm above the tip, are not reported.
  static constexpr double min_axis_deviation = 1e-4;
  /// Largest deviation of the tool axis from the great circle of a move, in the middle of the move.
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
