#include "sim/dialects/cl/cl.h"

#include "kinematics/pose.h"
#include "sim/dialects/read_program.h"

namespace abbe::sim::dialects {

namespace cl {
namespace {

// Short names, so that an entry fits its line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The word table in the README, the messages and the dispatch of statements are made from it.
const WordEntry entries[] = {
    {"GOTO", read,
     "x,y,z or x,y,z,i,j,k: moves the tip there with the tool axis along i,j,k (otherwise as "
     "before). Straight at feed unless a preceding RAPID, CIRCLE, MOVARC or CYCLE says otherwise. "
     "The slash may be missing",
     static_cast<void (Machine::*)(const Statement&)>(&Machine::go_to)},
    {"GODLTA", read, "dx,dy,dz, or one step along the tool axis", &Machine::go_delta},
    {"FROM", read,
     "position of the tool; if the tool is elsewhere, it moves there at rapid, with a warning",
     &Machine::from},
    {"GOHOME", read, "rapid to the point of FROM, otherwise to the start positions of the axes",
     &Machine::go_home},
    {"RAPID", read, "the next point is approached at rapid", &Machine::rapid},
    {"FEDRAT", read,
     "feed of the tip with MMPM, IPM or PERMIN, per revolution with MMPR, IPR or PERREV, inverse "
     "time per minute with INVERS, before or after the number; degrees per minute where only "
     "rotary axes move",
     &Machine::feedrate},
    {"TLAXIS", read, "i,j,k: the tool axis of points without one of their own",
     &Machine::tool_axis},
    {"MULTAX", read, "ON or nothing: points have tool vectors; OFF: the tool axis is 0,0,1",
     &Machine::multax},
    {"CIRCLE", read,
     "x,y,z,i,j,k,r: centre, vector, radius; the following points on the circle end arcs that run "
     "counter-clockwise about the vector. With t,f,d,e appended, as in NX: one point, clockwise",
     &Machine::circle},
    {"MOVARC", read, "x,y,z,i,j,k,r,ANGLE,a: one arc of a degrees, counter-clockwise about i,j,k",
     &Machine::moving_arc},
    {"CYCLE", read,
     "DRILL with DEPTH or FEDTO, CLEAR or RAPTO, RTRCTO or RETURN, DWELL in seconds and a feed; "
     "distances are measured from the point along the tool axis; executed at every point until "
     "CYCLE/OFF; other cycles are rejected",
     &Machine::cycle},
    {"UNITS", read, "MM or INCHES; mm if not stated, with a warning", &Machine::units},
    {"LOADTL", read, "n: the tool is changed; LENGTH, OSETNO, ADJUST move nothing",
     &Machine::load_tool},
    {"LOAD", read, "TOOL,n: the same", &Machine::load},
    {"SELECT SELCTL", read, "TOOL,n or n: the next tool", &Machine::select},
    {"CUTTER", read, "diameter and corner radius, compared with the tool of the scene",
     &Machine::cutter},
    {"TLDATA", read, "MILL, diameter, corner radius: the same", &Machine::tool_data},
    {"SPINDL", read, "speed with RPM, CLW, CCLW, ON, OFF; RANGE, MAXRPM and ORIENT have no effect",
     &Machine::spindle},
    {"COOLNT", read, "coolant, no effect on the cut", &Machine::coolant},
    {"DELAY", read, "seconds, or spindle revolutions with REV", &Machine::delay},
    {"STOP OPSTOP", read, "stops, which take no time", &Machine::stop},
    {"FINI END", read, "end of the program", &Machine::fini},
    {"MSYS", read, "the coordinate system of the points; a second one is rejected", &Machine::msys},
    {"ORIGIN", read, "0,0,0 only: the work offset sets the program zero", &Machine::origin},
    {"CUTCOM OPSKIP", read, "OFF only: paths are those of the tip, and no statement is left out",
     &Machine::require_off},
    {"PARTNO PPRINT REMARK TITLES LETTER PRINT TPRINT", none, "texts"},
    {"TOOL PATH END-OF-PATH CATPROCESS CATMAT", none, "names for the CAM system"},
    {"PAINT DISPLY", none, "colours and display of the CAM system"},
    {"MACHIN", none, "name of a postprocessor"},
    {"LINTOL INTOL OUTTOL TOLER MCHTOL", none,
     "tolerances for postprocessors: abbe runs straight between the given points"},
    {"CHECK", none, "limits that a postprocessor checks"},
    {"SEQNO LEADER REWIND BREAK NOPOST CLPRNT", none, "output format of a postprocessor"},
    {"CLAMP", none, "clamping and unclamping of rotary axes"},
    {"TRNTYP TOOLNO", none, "turning direction and tool numbering of the control"},
    {"CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH", none, "tool lengths"},
    // Reported once by its handler, since M codes may change the motion on a real control.
    {"AUXFUN", none, "an M code of the control", &Machine::auxiliary},
    {"INSERT PREFUN", refused,
     "statements: control words are not supported within cutter locations"},
    {"TRANS TRACUT COPY ROTATE MATRIX", refused, "points as cut: transformations are not applied"},
    {"ROTABL ROTHED ROTREF HEAD TURRET", refused,
     "tool vectors, from which the machine computes its rotary axes"},
    {"HELIX NURBS SPLINE MOVCRV", refused, "points, CIRCLE/ or MOVARC/"},
    {"INDIRV INDIRP TLON TLLFT TLRGT GOFWD GOLFT GORGT GOBACK GOUP GODOWN GO PSIS DNTCUT CUT",
     refused, "CIRCLE/ and GOTO/: contours along surfaces require an APT processor"},
    {"POINT LINE PLANE VECTOR SCAN MACRO CALL CALSUB TERMAC LOOPST LOOPND IF JUMPTO", refused,
     "processed statements: an APT source must be processed first"},
    {"THREAD PITCH", refused, "points with the feed of the thread: threads are not expanded"},
    {"RETRCT CLRSRF", refused, "points: retract planes are not applied"},
};

}  // namespace

const WordEntry* find_entry(std::string_view major) {
  // An index, because every statement of a program is looked up.
  static const std::unordered_map<std::string_view, const WordEntry*> index = [] {
    std::unordered_map<std::string_view, const WordEntry*> entries_by_word;
    for (const WordEntry& entry : entries)
      each_word(entry.words, [&](std::string_view word) { entries_by_word.emplace(word, &entry); });
    return entries_by_word;
  }();
  const auto entry = index.find(major);
  return entry == index.end() ? nullptr : entry->second;
}

}  // namespace cl

std::span<const WordTableEntry> cl_words() {
  static const std::vector<WordTableEntry> table = [] {
    std::vector<WordTableEntry> words;
    for (const cl::WordEntry& entry : cl::entries)
      words.push_back({entry.words, entry.use, entry.sentence});
    words.push_back(
        {"$ $$", WordTreatment::Read,
         "the statement continues on the next line; the rest of the line is a comment"});
    words.push_back({"x y z i j k feed", WordTreatment::Read,
                     "header of a table (CSV): columns separated by commas, semicolons or blanks; "
                     "feed mm/min, or rapid; lines starting with # are comments. Without a header: "
                     "3, 4, 6 or 7 columns in this order. The first row is approached at rapid"});
    return words;
  }();
  return table;
}

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::cl {

using Eigen::Vector3d;
using kinematics::Reachability;

namespace {

constexpr double max_position = 1e6;  // mm, the limit of the canon
// From 1; the length of vectors with three decimals stays within it.
constexpr double max_length_deviation = 1e-3;
constexpr double upright_tolerance = 1e-6;  // rad, rounding of a vector with seven digits
// A stated point determines every axis.
constexpr std::uint32_t every_joint = ~std::uint32_t(0);

std::string vector_text(const Eigen::Vector3d& v) {
  return fmt::format("{:.6g} {:.6g} {:.6g}", v.x(), v.y(), v.z());
}

}  // namespace

Eigen::Vector3d Machine::unit_direction(const Item& first, const Eigen::Vector3d& ijk) const {
  const double length = ijk.norm();
  if (!(std::abs(length - 1.0) <= max_length_deviation))
    throw_input_error(first, "a tool vector of length 1 within 0.001",
                      fmt::format("{}, of length {:.6g}", vector_text(ijk), length));
  return ijk / length;
}

// Returns the programmed zero in the coordinates of the tip, which the work offset displaces.
Eigen::Vector3d Machine::offset_origin() const {
  const AxisVector zero = canon_.placed(AxisVector::Zero(canon_.position().size()));
  return {zero[canon_.joint_of('X')], zero[canon_.joint_of('Y')], zero[canon_.joint_of('Z')]};
}

/// Parses x,y,z or x,y,z,i,j,k. Without a vector the current one stays.
Location Machine::parse_location(const Statement& statement) {
  const std::size_t count = statement.items.size();
  if (count != 3 && count != 6)
    throw_input_error(count > 6 ? statement.items[6].cause() : statement.cause,
                      "x,y,z or x,y,z,i,j,k after " + statement.major,
                      fmt::format("{} values", count));
  Location to{vector(statement, 0, "a coordinate") * unit(), direction_};
  if (count == 6)
    to.direction = unit_direction(statement.items[3], vector(statement, 3, "a tool vector"));
  // A tilted vector contradicts MULTAX/OFF.
  if (is_upright_ &&
      kinematics::angle_between(to.direction, Eigen::Vector3d::UnitZ()) > upright_tolerance)
    throw_input_error(statement.items[3], "MULTAX/ON before a tool vector other than 0,0,1",
                      vector_text(to.direction));
  return to;
}

Location Machine::current_location() const {
  const AxisVector& q = canon_.position();
  const Eigen::Vector3d tip_w(q[canon_.joint_of('X')], q[canon_.joint_of('Y')],
                              q[canon_.joint_of('Z')]);
  return {tip_w - offset_origin(), direction_};
}

/// Switches to tip mode with the current tool. Throws BadInput if the control does not know it.
void Machine::enter_tip_mode(const Cause& cause) {
  if (canon_.tip_mode() && canon_.coordinates() == program::Coordinates::Tip) return;
  if (tool_ < 0) {
    if (!canon_.options().tool_length.empty()) tool_ = run_.assume_only_tool(cause, "no LOADTL");
    canon_.select_length(tool_, cause);
  }
  canon_.set_tip_mode(true, cause);
  const AxisVector& offset = canon_.frame().shift;
  for (int j = 0; j < int(offset.size()); ++j)
    if (!canon_.is_linear(j) && offset[j] != 0.0)
      run_.warn_once(
          "the work offset of a rotary axis has no effect on cutter locations: their vectors give "
          "the tool axis in the workpiece frame");
}

// Solves with travel limits first, so that a direction that is reachable only beyond them has a
// message of its own.
kinematics::AxisVector Machine::solve_axes(const Location& to, const Eigen::Vector3d& tip_w,
                                           const Cause& cause) {
  kinematics::NearestPose pose;
  try {
    pose = kinematics::solve_nearest_pose(canon_.chain(), {tip_w, to.direction}, canon_.position());
  } catch (const std::invalid_argument& error) {
    throw_input_error(
        cause, "a machine with three linear axes and at most two rotary axes for cutter locations",
        error.what());
  }
  if (pose.reach == Reachability::Unreachable)
    throw_input_error(cause,
                      "a tool vector within reach of the machine axes (" + canon_.letters() + ")",
                      vector_text(to.direction));
  if (pose.q.size() == 0)
    throw_input_error(
        cause, "a location within the travel of the axes",
        fmt::format("{} with the tool vector {}", vector_text(to.tip), vector_text(to.direction)));
  // Fanuc's rule compares the travel axis by axis, not the total travel.
  if (vector_lines_.rule() == PoleRule::Fanuc)
    return vector_lines_.fanuc_rotary_axes(canon_.chain(), to.direction, cause);
  return std::move(pose.q);
}

/// Returns the axes for a location. The rotary axes stay if the vector is the same, so that
/// rounding of the inverse does not move them.
kinematics::AxisVector Machine::axes_for(const Location& to, const Cause& cause) {
  if (!(to.tip.cwiseAbs().maxCoeff() <= max_position))
    throw_input_error(cause, "a position within 1e6 mm");
  enter_tip_mode(cause);
  const Eigen::Vector3d tip_w = to.tip + offset_origin();
  AxisVector end = canon_.position();
  if (solved_direction_ != to.direction) end = solve_axes(to, tip_w, cause);
  end[canon_.joint_of('X')] = tip_w.x();
  end[canon_.joint_of('Y')] = tip_w.y();
  end[canon_.joint_of('Z')] = tip_w.z();
  solved_direction_ = to.direction;
  return end;
}

void Machine::check_feed(const Cause& cause) const {
  if (!canon_.feed()) throw_input_error(cause, "FEDRAT/ before the first move at feed", "none");
}

/// Records the deviation of the tool axis from the great circle in the middle of the next move. The
/// second derivatives of the path of the axis and of the circle are at most t^2 for rotations of t
/// rad in total, so the deviation is at most t^2 / 4; most moves are too short to need the exact
/// value.
void Machine::record_axis_deviation(const AxisVector& end, const Eigen::Vector3d& direction) {
  const AxisVector& start = canon_.position();
  double rotation = 0.0;
  for (int j = 0; j < int(end.size()); ++j)
    if (!canon_.is_linear(j)) rotation += std::abs(end[j] - start[j]);
  if (0.25 * rotation * rotation <= std::max(axis_deviation_.angle, min_axis_deviation)) return;
  const auto tool_axis = [&](const AxisVector& q) -> Eigen::Vector3d {
    return canon_.chain().tool_in_workpiece(q).linear().col(2);
  };
  const Eigen::Vector3d circle_point =
      kinematics::great_circle_point(tool_axis(start), direction, 0.5);
  const double angle = kinematics::angle_between(tool_axis(0.5 * (start + end)), circle_point);
  if (angle > axis_deviation_.angle) axis_deviation_ = {angle, canon_.line()};
}

void Machine::straight(const Location& to, const Cause& cause, bool stated, bool rapid) {
  AxisVector end = axes_for(to, cause);
  direction_ = to.direction;
  const std::uint32_t joints = stated ? every_joint : 0;
  if (rapid) return canon_.traverse({.end = std::move(end), .cause = cause, .stated = joints});
  check_feed(cause);
  if (vector_lines_.is_active()) {
    // A block led through a pole does not end with its vector, so the next point solves the rotary
    // axes again.
    if (!vector_lines_.straight_feed(canon_.chain(), {std::move(end), cause, false, joints}))
      solved_direction_.setZero();
    return;
  }
  record_axis_deviation(end, to.direction);
  canon_.straight_feed({.end = std::move(end), .cause = cause, .stated = joints});
}

void Machine::go_to(const Location& to, const Cause& cause, bool stated) {
  const bool rapid = is_next_rapid_;
  is_next_rapid_ = false;
  if (drill_cycle_) return make_hole(to, cause);
  // Behind the first arc RAPID ends the circle; before it RAPID is an error.
  if (circle_ && rapid && circle_->arcs == 0)
    throw_input_error(cause, "a point at feed after " + std::string(circle_->word), "a rapid");
  if (circle_ && !rapid && is_on_circle(to)) return arc(to, cause, stated);
  circle_.reset();
  straight(to, cause, stated, rapid);
}

void Machine::go_to(const Statement& statement) {
  go_to(parse_location(statement), statement.cause, true);
}

/// Moves by steps of x y z, or by a step along the tool axis.
void Machine::go_delta(const Statement& statement) {
  enter_tip_mode(statement.cause);
  Location to = current_location();
  if (statement.items.size() == 1)
    to.tip += direction_ * number(statement, 0, "a step along the tool axis") * unit();
  else if (statement.items.size() == 3)
    to.tip += vector(statement, 0, "a step") * unit();
  else
    throw_input_error(statement.cause, "dx,dy,dz or one step along the tool axis after GODLTA/",
                      fmt::format("{} values", statement.items.size()));
  circle_.reset();
  go_to(to, statement.cause, false);
}

/// Executes FROM, which states the position of the tool. If the axes are elsewhere, they move there
/// at rapid.
void Machine::from(const Statement& statement) {
  const Location to = parse_location(statement);
  circle_.reset();
  const std::size_t blocks_before = canon_.blocks();
  straight(to, statement.cause, true, true);
  home_ = to;
  if (canon_.blocks() > blocks_before)
    run_.warn_once(fmt::format(
        "FROM on line {} is not the current position of the axes: they move there at rapid",
        statement.line));
}

/// Moves to the point of FROM, or to the initial axis positions.
void Machine::go_home(const Statement& statement) {
  for (const Item& item : statement.items) throw_input_error(item, "nothing after GOHOME");
  circle_.reset();
  if (home_) return straight(*home_, statement.cause, true, true);
  enter_tip_mode(statement.cause);
  // Without FROM home is a position of the axes, not of the tip.
  canon_.go_to(program::Coordinates::Axis, statement.cause);
  canon_.traverse(
      {.end = initial_position(canon_.options()), .cause = statement.cause, .stated = every_joint});
  canon_.go_to(program::Coordinates::Tip, statement.cause);
  direction_ = canon_.chain().tool_in_workpiece(canon_.position()).linear().col(2);
  solved_direction_ = direction_;
}

/// Sets the tool axis for points without a vector.
void Machine::tool_axis(const Statement& statement) {
  if (statement.items.size() != 3) throw_input_error(statement.cause, "i,j,k after TLAXIS/");
  if (is_upright_) throw_input_error(statement.cause, "MULTAX/ON before TLAXIS/");
  direction_ = unit_direction(statement.items.front(), vector(statement, 0, "a tool vector"));
}

namespace {

// Tolerances of the canon for the radii at the ends of an arc, see the README of sim/program.
constexpr double min_radius_tolerance = 0.005, max_radius_tolerance = 0.5;  // mm
constexpr double relative_radius_tolerance = 1e-3;
constexpr double point_tolerance = 1e-8;   // mm, between the ends of a closed circle
constexpr double sweep_tolerance = 0.002;  // rad, of a stated sweep, from rounding of the points
constexpr double angle_tolerance = 1e-6;   // rad, rounding of a sweep
constexpr double min_reported_sagitta = 0.01;  // mm
constexpr double axis_tolerance = 1e-9;  // rad, an axis this close to X, Y or Z needs no rotation

double radius_tolerance(double radius) {
  return std::max(min_radius_tolerance,
                  std::min(max_radius_tolerance, relative_radius_tolerance * radius));
}

// Returns the component perpendicular to an axis.
Vector3d perpendicular_part(const Vector3d& v, const Vector3d& axis) {
  return v - axis * axis.dot(v);
}

/// Returns a rotation that maps z to the axis. X or Y, whichever is at least 45 deg from the axis,
/// determines its x.
Eigen::Matrix3d frame_about(const Vector3d& axis) {
  Eigen::Matrix3d R;
  R.col(2) = axis;
  R.col(0) = (std::abs(axis.x()) < 0.7 ? Vector3d::UnitX() : Vector3d::UnitY()).cross(axis);
  R.col(0).normalize();
  R.col(1) = axis.cross(R.col(0));
  return R;
}

}  // namespace

/// Parses centre, vector and radius of a circle.
Machine::Circle Machine::parse_circle(const Statement& statement, std::string_view word) const {
  Circle circle;
  circle.line = statement.line;
  circle.word = word;
  circle.centre = vector(statement, 0, "the centre of a circle") * unit();
  circle.axis =
      unit_direction(statement.items.size() > 3 ? statement.items[3] : statement.items.front(),
                     vector(statement, 3, "the vector of a circle"));
  circle.radius = number(statement, 6, "the radius of a circle") * unit();
  if (!(circle.radius > 0)) throw_input_error(statement.items[6], "a radius greater than zero");
  return circle;
}

/// Executes CIRCLE/x,y,z,i,j,k,r: counter-clockwise about the vector, for all points on the circle.
/// With t,f,d,e after (NX) it is clockwise about the vector, for one point.
void Machine::circle(const Statement& statement) {
  const std::size_t count = statement.items.size();
  if (count != 7 && count < 11)
    throw_input_error(statement.cause, "x,y,z,i,j,k,r or x,y,z,i,j,k,r,t,f,d,e after CIRCLE/",
                      fmt::format("{} values", count));
  Circle circle = parse_circle(statement, "CIRCLE/");
  circle.for_next_point_only = count > 7;
  circle.is_sense_ambiguous = count == 7;
  // A clockwise arc is counter-clockwise about the opposite vector.
  if (count > 7) circle.axis = -circle.axis;
  for (std::size_t i = 7; i < count; ++i) {
    if (i < 11) {
      number(statement, i, "tolerance, its fraction, diameter and corner radius");
    } else if (!statement.items[i].is_word("TIMES") &&
               statement.items[i].number.value_or(2.0) > 1.0) {
      throw_input_error(statement.items[i],
                        "arcs of at most one full turn: TIMES is not supported");
    }
  }
  circle_ = circle;
}

/// Executes MOVARC/x,y,z,i,j,k,r,ANGLE,degrees: counter-clockwise about the vector, to the next
/// point.
void Machine::moving_arc(const Statement& statement) {
  Circle circle = parse_circle(statement, "MOVARC/");
  std::size_t i = 7;
  if (i < statement.items.size() && statement.items[i].is_word("ANGLE")) ++i;
  circle.sweep = number(statement, i, "the angle of an arc in degrees") * units::deg;
  // 1e6 rad keeps the number of turns within int.
  if (!(*circle.sweep > 0 && *circle.sweep < 1e6))
    throw_input_error(statement.items[i], "an angle from 0 to 5.7e7 deg");
  if (i + 1 < statement.items.size())
    throw_input_error(statement.items[i + 1], "nothing after the angle");
  circle_ = circle;
}

/// Returns the sweep from the current position to a point, rad, counter-clockwise about the axis,
/// above 0 and up to a whole turn.
double Machine::sweep_to(const Vector3d& to) const {
  const Vector3d& axis = circle_->axis;
  const Vector3d a = perpendicular_part(current_location().tip - circle_->centre, axis);
  const Vector3d b = perpendicular_part(to - circle_->centre, axis);
  // Coinciding ends are a full circle.
  if ((a - b).norm() < point_tolerance) return 2 * pi;
  const double angle = std::atan2(axis.dot(a.cross(b)), a.dot(b));
  return angle > 0 ? angle : angle + 2 * pi;
}

/// Returns true if a point is the end of an arc of the stated circle. Behind the first arc of a
/// circle for several points, a line to a point off the circle ends the circle.
bool Machine::is_on_circle(const Location& to) {
  if (circle_->for_next_point_only || circle_->arcs == 0) return true;
  const Vector3d from_centre = perpendicular_part(to.tip - circle_->centre, circle_->axis);
  if (std::abs(from_centre.norm() - circle_->radius) > min_radius_tolerance) return false;
  // The sagitta is the error if a line was intended.
  const double sagitta = circle_->radius * (1 - std::cos(0.5 * sweep_to(to.tip)));
  if (sagitta > min_reported_sagitta)
    run_.warn_once(
        fmt::format("the point on line {} also lies on the CIRCLE/ of line {} and is taken as the "
                    "end of another arc of it: a straight line would deviate by up to {:.3g} mm",
                    canon_.line(), circle_->line, sagitta));
  return true;
}

void Machine::check_radii(const Vector3d& to, const Cause& cause) const {
  const Circle& circle = *circle_;
  for (const auto& [point, name] :
       {std::pair{current_location().tip, "start"}, std::pair{to, "end"}}) {
    const double radius = perpendicular_part(point - circle.centre, circle.axis).norm();
    if (std::abs(radius - circle.radius) > radius_tolerance(circle.radius))
      throw_input_error(cause,
                        fmt::format("the {} of the arc {:.6g} mm from the axis of {} of line {}",
                                    name, circle.radius, circle.word, circle.line),
                        fmt::format("{:.6g} mm", radius));
  }
}

/// Checks the sweep against the angle of MOVARC, modulo whole turns, and the total sweep of a
/// circle against one turn.
void Machine::check_sense(double sweep, const Cause& cause) {
  Circle& circle = *circle_;
  if (circle.sweep) {
    const double turns = (*circle.sweep - sweep) / (2 * pi);
    if (std::abs(turns - std::round(turns)) * 2 * pi > sweep_tolerance)
      throw_input_error(
          cause,
          fmt::format("the end of an arc of {:.6g} deg, as stated by MOVARC/ on line {}",
                      *circle.sweep / units::deg, circle.line),
          fmt::format("an arc of {:.6g} deg", sweep / units::deg));
  }
  circle.total_sweep += sweep;
  // Points that exceed one turn in total show that the vector has the other sign.
  if (circle.total_sweep > 2 * pi + angle_tolerance && circle.arcs > 0)
    throw_input_error(cause,
                      fmt::format("points that go around the CIRCLE/ of line {} at most once, "
                                  "counter-clockwise about its vector",
                                  circle.line),
                      fmt::format("{:.4g} deg: the vector seems to point the other way",
                                  circle.total_sweep / units::deg));
  const bool is_full_circle = sweep > 2 * pi - angle_tolerance;
  // A sweep of more than half a turn suggests a vector of the opposite convention.
  if (circle.is_sense_ambiguous && sweep > pi - angle_tolerance && !is_full_circle)
    run_.warn_once(fmt::format(
        "the arc of line {} is taken counter-clockwise about the vector of its CIRCLE/, {:.5g} "
        "deg; if the CAM system means clockwise, it is {:.5g} deg the other way",
        canon_.line(), sweep / units::deg, 360 - sweep / units::deg));
}

void Machine::arc(const Location& to, const Cause& cause, bool stated) {
  check_feed(cause);
  enter_tip_mode(cause);
  check_radii(to.tip, cause);
  const double sweep = sweep_to(to.tip);
  check_sense(sweep, cause);
  const Circle circle = *circle_;
  if (circle.for_next_point_only)
    circle_.reset();
  else
    ++circle_->arcs;

  program::ArcMove move;
  move.end = axes_for(to, cause);
  direction_ = to.direction;
  record_axis_deviation(move.end, to.direction);
  move.cause = move.named = cause;
  move.stated = stated ? ~std::uint32_t(0) : 0;
  // Whole turns beyond the sweep between the ends are turns of a helix.
  if (circle.sweep) move.turns = 1 + int(std::lround((*circle.sweep - sweep) / (2 * pi)));
  const int x = canon_.joint_of('X'), y = canon_.joint_of('Y'), z = canon_.joint_of('Z');
  const Vector3d centre = circle.centre + offset_origin();
  move.centre_with_offsets = canon_.position();
  move.centre_with_offsets[x] = centre.x();
  move.centre_with_offsets[y] = centre.y();
  move.centre_with_offsets[z] = centre.z();
  // A circle about X, Y or Z lies in the plane of two axes, which needs no rotation.
  const std::array<std::array<int, 3>, 3> planes{{{y, z, x}, {z, x, y}, {x, y, z}}};
  for (int k = 0; k < 3; ++k)
    if (std::abs(circle.axis[k]) > std::cos(axis_tolerance)) {
      move.first = planes[std::size_t(k)][0];
      move.second = planes[std::size_t(k)][1];
      move.clockwise = circle.axis[k] < 0;
      return canon_.arc(std::move(move));
    }
  move.first = x;
  move.second = y;
  // Otherwise the frame is rotated for this arc.
  const TemporaryFrame frame(canon_, 0, {canon_.frame().shift, frame_about(circle.axis)});
  canon_.arc(std::move(move));
}

namespace {

/// Levels of CYCLE/DRILL, mm from the point along the tool axis.
struct DrillLevels {
  std::optional<double> bottom, clearance, return_level;
};

}  // namespace

/// Parses CYCLE/DRILL, whose pairs of word and number may be in any order.
Machine::DrillCycle Machine::parse_drill_cycle(const Statement& statement) {
  DrillLevels levels;
  DrillCycle cycle;
  const auto set_once = [&](std::optional<double>& level, const Item& word, double value) {
    if (level)
      throw_input_error(word, "only one distance of this kind",
                        std::string(word.text) + " as well");
    level = value;
  };
  for (std::size_t i = 1; i < statement.items.size(); ++i) {
    const Item& word = statement.items[i];
    // A number directly after DRILL is the depth.
    if (word.number && i == 1) {
      levels.bottom = -*word.number * unit();
      continue;
    }
    if (word.number) throw_input_error(word, "a word before the number");
    const bool is_feed_unit = word.is_word("MMPM") || word.is_word("IPM") ||
                              word.is_word("PERMIN") || word.is_word("MMPR") ||
                              word.is_word("IPR") || word.is_word("PERREV");
    const bool is_known = is_feed_unit || word.is_word("DEPTH") || word.is_word("FEDTO") ||
                          word.is_word("CLEAR") || word.is_word("RAPTO") ||
                          word.is_word("RTRCTO") || word.is_word("RETURN") || word.is_word("DWELL");
    if (!is_known) {
      handle_unknown_item(statement, word,
                          "DEPTH, FEDTO, CLEAR, RAPTO, RTRCTO, RETURN, DWELL or a feed unit");
      // The numbers of an unknown word belong to it.
      while (i + 1 < statement.items.size() && statement.items[i + 1].number) ++i;
      continue;
    }
    // A word without a number is a level that only the control knows.
    if (i + 1 < statement.items.size() && !statement.items[i + 1].number)
      throw_input_error(
          statement.items[i + 1],
          fmt::format("a number after {}: levels chosen by the control are unknown", word.text));
    const double value = number(statement, ++i, "a number");
    if (is_feed_unit) {
      if (!(value > 0)) throw_input_error(statement.items[i], "a feed greater than zero");
      const bool is_inch = word.is_word("IPM") || word.is_word("IPR");
      const bool has_program_unit = word.is_word("PERMIN") || word.is_word("PERREV");
      cycle.feed = Feed{value, has_program_unit ? unit() : is_inch ? units::inch : 1.0};
      if (word.is_word("MMPR") || word.is_word("IPR") || word.is_word("PERREV"))
        cycle.mode = FeedMode::PerRevolution;
    } else if (word.is_word("DEPTH") || word.is_word("FEDTO")) {
      // DEPTH counts downwards, FEDTO is a position along the tool axis.
      set_once(levels.bottom, word, (word.is_word("DEPTH") ? -value : value) * unit());
    } else if (word.is_word("CLEAR") || word.is_word("RAPTO")) {
      set_once(levels.clearance, word, value * unit());
    } else if (word.is_word("DWELL")) {
      cycle.dwell_s = value;
    } else {
      set_once(levels.return_level, word, value * unit());
    }
  }
  if (!levels.bottom)
    throw_input_error(statement.cause, "DEPTH or FEDTO and a distance after CYCLE/DRILL", "none");
  if (!levels.clearance)
    throw_input_error(statement.cause, "CLEAR or RAPTO and a distance after CYCLE/DRILL", "none");
  cycle.depth = -*levels.bottom;
  cycle.clearance = *levels.clearance;
  cycle.return_level = levels.return_level.value_or(cycle.clearance);
  // The moves need the levels in this order.
  if (!(cycle.clearance > -cycle.depth) || cycle.return_level < cycle.clearance)
    throw_input_error(statement.cause,
                      "the bottom below the clearance, and the clearance not above the return",
                      fmt::format("{:.6g}, {:.6g} and {:.6g} mm above the point", -cycle.depth,
                                  cycle.clearance, cycle.return_level));
  return cycle;
}

void Machine::cycle(const Statement& statement) {
  circle_.reset();
  if (statement.items.empty()) throw_input_error(statement.cause, "DRILL or OFF after CYCLE/");
  if (statement.items.front().is_word("OFF")) {
    drill_cycle_.reset();
    return;
  }
  if (!statement.items.front().is_word("DRILL"))
    throw_input_error(statement.items.front(),
                      "CYCLE/DRILL or explicit moves: other cycles are not expanded");
  drill_cycle_ = parse_drill_cycle(statement);
}

void Machine::move_to(const Location& to, const Cause& cause, bool rapid) {
  straight(to, cause, true, rapid);
}

/// Makes a hole. The tool moves above it at the current level or, if that is below the clearance,
/// first up to the clearance; then down at feed and back at rapid.
void Machine::make_hole(const Location& point, const Cause& cause) {
  const DrillCycle& cycle = *drill_cycle_;
  enter_tip_mode(cause);
  const auto above = [&](double height) {
    return Location{point.tip + point.direction * height, point.direction};
  };
  // The current level is known only if the tool axis does not change.
  if (point.direction == solved_direction_) {
    const Location current = current_location();
    const double level = point.direction.dot(current.tip - point.tip);
    if (level >= cycle.clearance)
      move_to(above(level), cause, true);
    else
      move_to({current.tip + point.direction * (cycle.clearance - level), point.direction}, cause,
              true);
  }
  move_to(above(cycle.clearance), cause, true);
  // The feed of the cycle holds only for the hole.
  const auto feed = canon_.feed();
  const FeedMode mode = canon_.feed_mode();
  if (cycle.feed) {
    canon_.set_feed_mode(cycle.mode);
    canon_.set_feed(cycle.feed);
  }
  move_to(above(-cycle.depth), cause, false);
  canon_.dwell(cycle.dwell_s, cause);
  move_to(above(cycle.return_level), cause, true);
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
}

}  // namespace abbe::sim::dialects::cl
