#include "sim/program/canon.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_block.h"

namespace abbe::sim::program {

namespace {

using kinematics::AxisVector;

// At 1e6 mm the spacing of doubles is 1.2e-10 mm, which is still below the 1e-9 mm at which an axis
// counts as moved.
constexpr double max_position_mm = 1e6;
constexpr double max_position_rad = 1e7;
// mm or rad; smaller motion is the rounding of a change of coordinates
constexpr double min_motion = 1e-11;

}  // namespace

void Target::set_value(int joint, double value, const Cause& cause, bool step) {
  const std::uint32_t bit = 1u << joint;
  given_ |= bit;
  step_ = step ? step_ | bit : step_ & ~bit;
  decided_ &= ~bit;
  value_[std::size_t(joint)] = value;
  cause_[std::size_t(joint)] = cause;
}

// A control starts with G54 in force.
Canon::Canon(const std::string& file, const NcOptions& options)
    : options_(options),
      joint_of_(joints_by_letter(options.axes)),
      spindle_(find_spindle(options.axes)),
      xyz_{joint_of('X'), joint_of('Y'), joint_of('Z')},
      position_(initial_position(options)),
      chain_(options.control ? &*options.control : nullptr),
      zero_(program_zero(options)) {
  path_.file = file;
  for (const AxisVector& offset : options.work_offset)
    if (offset.size() != 0 && offset.size() != position_.size())
      throw std::invalid_argument("expected one work offset for every axis");
  frame_.shift = options.work_offset[0];
  for (std::size_t j = 0; j < options.axes.size(); ++j) rollover_[j] = options.axes[j].rollover;
}

int Canon::add_file(const std::string& file) {
  path_.subprogram_files.push_back(file);
  more_files_.push_back(file);
  return int(path_.subprogram_files.size());
}

void Canon::set_line(int line, int file) {
  line_ = line;
  file_ = file;
}

void Canon::set_frame(int number, Frame frame) {
  offset_number_ = number;
  frame_ = std::move(frame);
}

// An origin of slide positions is dropped, because it is not a point of the workpiece.
void Canon::refer_offsets_to_workpiece() {
  if (zero_) return;
  zero_ = workpiece_zero(options_);
  if (zero_ && !zero_->places) zero_.reset();
}

void Canon::set_tool_shift(AxisVector shift) { tool_shift_ = std::move(shift); }

// The axes do not move: the same position is expressed in the other coordinates.
void Canon::go_to(Coordinates coordinates, const Cause& cause) {
  if (coordinates == coordinates_) return;
  coordinates_ = coordinates;
  const auto [x, y, z] = xyz_;
  if (coordinates == Coordinates::Tip) {
    const Eigen::Vector3d tip_w = chain_->tool_in_workpiece(position_).translation();
    position_[x] = tip_w.x();
    position_[y] = tip_w.y();
    position_[z] = tip_w.z();
  } else {
    const auto q = solve_slides(*chain_, position_, {position_[x], position_[y], position_[z]});
    if (!q)
      throw_input_error(cause, "a tip within the travel of the linear axes", "a tip out of reach");
    position_ = *q;
  }
}

// The axes stay where they are while the tip changes, so the position is first converted to axis
// positions by the old chain.
void Canon::select_length(int number, const Cause& cause) {
  length_number_ = number;
  const auto tool_chain = options_.control_by_h.find(number);
  if (tool_chain == options_.control_by_h.end() || chain_ == &tool_chain->second) return;
  go_to(Coordinates::Axis, cause);
  chain_ = &tool_chain->second;
}

void Canon::set_tip_mode(bool on, const Cause& cause) {
  if (on) {
    const std::string tip_mode_name =
        std::string(cause.text.empty() ? "the tip mode" : shown(cause.text));
    for (const int joint : xyz_)
      if (joint < 0)
        throw_input_error(cause, "a machine with the axes X Y Z for " + tip_mode_name,
                          "one with " + letters());
    if (chain_ == nullptr)
      throw_input_error(cause, "a control that knows its kinematics with " + tip_mode_name);
  }
  tip_mode_ = on;
  go_to(on ? Coordinates::Tip : Coordinates::Axis, cause);
}

// Undoes the operations of `placed` in reverse order.
AxisVector Canon::without_offsets(AxisVector p) const {
  if (tool_shift_.size() > 0) p -= tool_shift_;
  const auto [x, y, z] = xyz_;
  if (zero_) {
    const Eigen::Vector3d correction = shift_correction();
    for (int k = 0; k < 3; ++k) p[xyz_[std::size_t(k)]] -= correction[k];
  }
  if (frame_.shift.size() > 0) p -= frame_.shift;
  if (!frame_.rotation) return p;
  const Eigen::Vector3d rotated = frame_.rotation->transpose() * Eigen::Vector3d(p[x], p[y], p[z]);
  p[x] = rotated.x();
  p[y] = rotated.y();
  p[z] = rotated.z();
  return p;
}

AxisVector Canon::placed(AxisVector p) const {
  if (frame_.rotation) {
    const auto [x, y, z] = xyz_;
    const Eigen::Vector3d rotated = *frame_.rotation * Eigen::Vector3d(p[x], p[y], p[z]);
    p[x] = rotated.x();
    p[y] = rotated.y();
    p[z] = rotated.z();
  }
  if (frame_.shift.size() > 0) p += frame_.shift;
  if (zero_) {
    const Eigen::Vector3d correction = shift_correction();
    for (int k = 0; k < 3; ++k) p[xyz_[std::size_t(k)]] += correction[k];
  }
  if (tool_shift_.size() > 0) p += tool_shift_;
  return p;
}

// Only an axis whose travel exceeds two turns rolls over; any other has to unwind.
bool Canon::is_endless(int joint) const {
  constexpr double two_turns = 4 * pi * (1 + 1e-9);  // limits of +-360 deg are exactly two turns
  if (!options_.control || options_.axes[std::size_t(joint)].motion != kinematics::Motion::Rotary)
    return false;
  const kinematics::Joint& axis = options_.control->joints()[std::size_t(joint)];
  return axis.side == kinematics::Side::Workpiece && axis.max - axis.min > two_turns;
}

void Canon::enable_table_rollover() {
  for (int j = 0; j < int(options_.axes.size()); ++j)
    if (rollover_[std::size_t(j)] == Rollover::ByControl && is_endless(j))
      rollover_[std::size_t(j)] = Rollover::Shortest;
}

// Subtracts a whole number of turns, so that a position that needs no change keeps its bits.
double Canon::apply_rollover(int joint, double from, const Target& target, double to) {
  constexpr double turn = 2 * pi, rounding = 1e-9;  // rad, rounding of a position given in degrees
  const Rollover rule = rollover_[std::size_t(joint)];
  const bool by_control = options_.axes[std::size_t(joint)].rollover == Rollover::ByControl;
  if (rule == Rollover::None || (rule == Rollover::ByControl && !is_endless(joint))) return to;
  const double turns = (to - from) / turn;
  // Half a turn is rounded towards zero: if both directions are equally long, that of the
  // difference of positions is kept.
  double whole_turns = std::copysign(std::ceil(std::abs(turns) - 0.5 - rounding), turns);
  if (rule == Rollover::Sign)
    // The sign of -0 counts: it states a direction as well.
    whole_turns = std::signbit(target.value(joint)) ? std::ceil(turns - rounding)
                                                    : std::floor(turns + rounding);
  if (whole_turns == 0.0) return to;
  const double rolled = to - whole_turns * turn;
  // Reported once for each axis, and only if the machine leaves the rule to the control.
  if (by_control && !((rollover_reported_ >> joint) & 1u)) {
    rollover_reported_ |= 1u << joint;
    const char axis = options_.axes[std::size_t(joint)].name;
    const double direct_deg = (to - from) / units::deg, rolled_deg = (rolled - from) / units::deg;
    assume(rule == Rollover::ByControl
               ? Assumption{fmt::format("{} turns by the difference of its positions, {:.6g} deg; "
                                        "a control with roll-over turns it by {:.6g}",
                                        axis, direct_deg, rolled_deg + 0.0),
                            fmt::format("machine.axis.{}.rollover", axis)}
               : Assumption{fmt::format("{} rolls over and takes the shortest way, {:.6g} deg; a "
                                        "control without roll-over turns it by {:.6g}",
                                        axis, rolled_deg + 0.0, direct_deg),
                            fmt::format("machine.axis.{}.rollover", axis)});
  }
  return rule == Rollover::ByControl ? to : rolled;
}

// Without a stated zero, machine coordinates count from the zero of each axis. That is reported
// once for each axis.
void Canon::record_machine_zero_assumption(const Target& target) {
  if (options_.machine_zero.size() > 0) return;
  for (int j = 0; j < int(options_.axes.size()); ++j) {
    if (!target.has(j) || !is_linear(j)) continue;
    std::string travel;
    if (options_.control) {
      const kinematics::Joint& axis = options_.control->joints()[std::size_t(j)];
      // Wider limits stand for an axis without stated travel.
      if (axis.max - axis.min < 1e6)
        travel = fmt::format(", which travels {:.6g} to {:.6g} mm", axis.min, axis.max);
    }
    assume({fmt::format("machine coordinates are counted from the zero of axis {}{}",
                        options_.axes[std::size_t(j)].name, travel),
            "machine.machine_zero"});
  }
}

// Joints that are neither programmed nor rotated keep their bits, and the sum of offsets is always
// formed in the same order; otherwise equal programs would differ in the last digit.
AxisVector Canon::target_position_from(const AxisVector& start, const Target& target,
                                       bool machine) {
  if (machine) record_machine_zero_assumption(target);
  AxisVector end = start;
  const bool is_rotated = frame_.rotation && !machine &&
                          (target.has(xyz_[0]) || target.has(xyz_[1]) || target.has(xyz_[2]));
  if (is_rotated) {
    AxisVector p = without_offsets(start);
    for (const int j : xyz_)
      if (target.has(j)) p[j] = target.is_step(j) ? p[j] + target.value(j) : target.value(j);
    p = placed(std::move(p));
    for (const int j : xyz_) end[j] = p[j];
  }
  const Eigen::Vector3d correction = shift_correction();
  const auto origin_shift = [&](int j) {
    return j == xyz_[0]   ? correction.x()
           : j == xyz_[1] ? correction.y()
           : j == xyz_[2] ? correction.z()
                          : 0.0;
  };
  for (int j = 0; j < int(end.size()); ++j) {
    if (!target.has(j)) continue;
    const double value = target.value(j);
    if (is_rotated && (j == xyz_[0] || j == xyz_[1] || j == xyz_[2])) {
    } else if (machine) {
      end[j] = value + (options_.machine_zero.size() > 0 ? options_.machine_zero[j] : 0.0);
    } else if (target.is_step(j)) {
      end[j] += value;
    } else {
      end[j] = value + (frame_.shift.size() > 0 ? frame_.shift[j] : 0.0) + origin_shift(j) +
               (tool_shift_.size() > 0 ? tool_shift_[j] : 0.0);
    }
    if (!is_linear(j) && !target.is_step(j) && !target.is_decided(j))
      end[j] = apply_rollover(j, start[j], target, end[j]);
    if (!(std::abs(end[j]) <= (is_linear(j) ? max_position_mm : max_position_rad)))
      throw_input_error(target.cause(j),
                        is_linear(j) ? "a position within 1e6 mm" : "a position within 1e7 rad");
  }
  return end;
}

std::size_t Canon::kept_bytes() const {
  return path_.blocks.size() * sizeof(Block) + path_.arcs.size() * sizeof(Arc);
}

void Canon::throw_limit_exceeded(double moves, const Cause& cause,
                                 const std::string& expected) const {
  throw ProgramLimitExceeded(
      file_name(), line_, cause.column, expected,
      fmt::format("{:.4g} moves: pecks, repeats or an infinite loop", moves));
}

void Canon::check_moves(double more_moves, const Cause& cause) const {
  const double moves = double(blocks()) + more_moves;
  if (moves > double(options_.max_moves))
    throw_limit_exceeded(moves, cause,
                         fmt::format("at most {} moves (max_moves)", options_.max_moves));
}

void Canon::check_memory(double more_moves, const Cause& cause) const {
  if (double(kept_bytes()) + more_moves * sizeof(Block) > double(options_.max_move_bytes))
    throw_limit_exceeded(double(blocks()) + more_moves, cause,
                         fmt::format("moves of at most {} MB, the available memory",
                                     options_.max_move_bytes / 1'000'000));
}

// The limits are checked before memory is allocated.
void Canon::append(Block block, double seconds) {
  check_moves(1.0, {});
  check_memory(1.0, {});
  block.line = line_;
  block.file = std::uint16_t(file_);
  block.inch = inch_;
  block.inverse_time = feed_mode_ == FeedMode::InverseTime;
  // -1 marks a block that no work offset moves (G53), so it must not get the number of the offset
  // in force.
  if (block.work_offset >= 0) block.work_offset = std::int16_t(offset_number_);
  block.tool_length = length_number_;
  block.start_s = time_s_;
  block.end_s = time_s_ + seconds;
  // The spindle turns on in every block, dwells and rapids included.
  if (spindle_ >= 0) {
    const double speed = spindle_turns_ * spindle_rpm_ * units::rpm;
    block.start[spindle_] = position_[spindle_];
    block.end[spindle_] = position_[spindle_] + speed * seconds;
  }
  time_s_ = block.end_s;
  position_ = block.end;
  if (block.interpolation != Interpolation::Dwell) ++path_.motion_blocks;
  path_.blocks.push_back(std::move(block));
}

void Canon::dwell(double seconds, const Cause& cause) {
  if (!(seconds >= 0.0 && seconds <= max_dwell_s)) throw_input_error(cause, "0 to 1e6 seconds");
  if (seconds == 0.0) return;
  Block dwell_block;
  dwell_block.interpolation = Interpolation::Dwell;
  dwell_block.coordinates = coordinates_;
  dwell_block.start = dwell_block.end = position_;
  append(std::move(dwell_block), seconds);
}

// A rapid takes the length of its path divided by the rapid speed. At feed, inverse time is 1/F
// minutes whatever the length, and a feed in degrees per minute is not scaled by inches.
double Canon::duration(const Block& block, const Cause& cause) const {
  if (block.interpolation == Interpolation::Rapid) {
    const SquaredDistance distance = squared_distances(options_.axes, block.start, block.end);
    const double mm = std::sqrt(distance.xyz + distance.uvw);
    return mm > 0.0 ? mm / options_.rapid_speed
                    : std::sqrt(distance.rotation) / options_.rapid_rotation_speed;
  }
  const auto throw_error = [&](bool is_consequence, const char* expected, const char* seen) {
    if (!is_consequence) throw_input_error(cause, expected, seen);
    throw FollowingError(file_name(), line_, cause.column, expected, seen);
  };
  if (!feed_)
    // Under G93 every block needs its own F, so an earlier error cannot be the cause of a missing
    // one.
    throw_error(feed_is_uncertain_ && feed_mode_ != FeedMode::InverseTime,
                feed_mode_ == FeedMode::InverseTime ? "F in every motion block under G93"
                                                    : "F in the first feed block or before it",
                "none");
  if (feed_mode_ == FeedMode::InverseTime) return 60.0 / feed_->word;
  const Arc* arc = block.interpolation == Interpolation::Arc ? &path_.arcs[block.shape] : nullptr;
  const bool is_rotated = arc != nullptr && arc->plane_rotation >= 0;
  const FeedLength distance =
      feed_length(options_.axes, block.start, block.end, arc,
                  is_rotated ? &path_.plane_rotations[std::size_t(arc->plane_rotation)] : nullptr);
  const double unit = distance.linear ? feed_->unit : 1.0;
  if (feed_mode_ == FeedMode::PerMinute) return distance.length * 60.0 / (feed_->word * unit);
  if (spindle_turns_ == 0 || !(spindle_rpm_ > 0.0))
    throw_error(spindle_is_uncertain_, "a running spindle under a feed per revolution",
                "a stopped spindle");
  return distance.length * 60.0 / (feed_->word * unit * spindle_rpm_);
}

// After an error the axes are set to the programmed end. Errors of arcs that may follow from an
// earlier error are marked.
template <typename Compute>
auto Canon::with_end_on_error(const AxisVector& end, const Compute& compute) {
  try {
    return compute();
  } catch (BadGeometry& error) {
    error.is_uncertain = uncertain_joints_ != 0;
    position_ = end;
    throw;
  } catch (const BadInput&) {
    position_ = end;
    throw;
  }
}

// Under constant surface speed a block has one spindle speed, see `mean_spindle_speed`.
void Canon::turn_at_surface_speed(const Block& block, bool feed) {
  if (!surface_speed_) return;
  constexpr double max_finite_rpm = 1e6;  // keeps every speed finite, on the axis too
  const int x = xyz_[0];
  const double from = programmed()[x];
  RadialMove move{from, from + block.end[x] - position_[x]};
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block.shape];
    const bool first = arc.first == x;
    if (arc.plane_rotation < 0 && (first || arc.second == x))
      // Only an arc of the XZ plane changes the radius along a circle. In a rotated plane the
      // change is taken as linear.
      move.arc = RadialMove::Arc{from + arc.centre[first ? 0 : 1] - position_[x],
                                 arc.radius + 0.5 * arc.growth,
                                 // Angles of RadialMove::Arc count from the direction of X; if X is
                                 // the second axis of the plane, that is a quarter turn later.
                                 arc.start_angle - (first ? 0.0 : 0.5 * pi), arc.sweep};
  }
  const auto& stated = surface_speed_->max_rpm;
  const auto& machine_max_rpm = options_.max_spindle_rpm;
  const double limit =
      std::min(stated.value_or(max_finite_rpm), machine_max_rpm.value_or(max_finite_rpm));
  spindle_rpm_ = mean_spindle_speed(move, surface_speed_->m_per_min, limit);
  const double radius = min_radius(move);
  // Recorded for the warning that such a program needs a speed limit. Rapids cut nothing.
  if (feed && !stated && !machine_max_rpm &&
      (!unlimited_speed_ || radius < unlimited_speed_->radius))
    unlimited_speed_ = UnlimitedSpeed{radius, line_, file_};
}

void Canon::add_straight(Straight move, Interpolation interpolation) {
  Block straight;
  straight.interpolation = interpolation;
  straight.coordinates = coordinates_;
  straight.start = position_;
  straight.end = std::move(move.end);
  if (move.without_offset) straight.work_offset = -1;
  turn_at_surface_speed(straight, interpolation != Interpolation::Rapid);
  uncertain_joints_ &= ~move.stated;
  record_known_positions(straight, move.stated);
  const double seconds =
      with_end_on_error(straight.end, [&] { return duration(straight, move.cause); });
  // Blocks without motion take no time and would be samples at one instant, so they are dropped.
  if ((straight.end - straight.start).cwiseAbs().maxCoeff() > min_motion)
    append(std::move(straight), seconds);
}

// The position of a rotary axis that moves without being programmed counts as known: the control
// moved it, for example to swivel to a plane.
void Canon::record_known_positions(const Block& block, std::uint32_t stated) {
  known_ |= stated;
  std::string positions;
  for (std::size_t j = 0; j < options_.axes.size(); ++j) {
    const ControlledAxis& axis = options_.axes[j];
    const auto at = Eigen::Index(j);
    if (axis.motion == kinematics::Motion::Rotary && block.end[at] != block.start[at])
      known_ |= 1u << j;
    if ((known_ >> j) & 1u || joint_of(axis.name) < 0) continue;
    positions +=
        fmt::format(" {}{:.6g}", axis.name,
                    initial_position(options_)[at] / (is_linear(int(j)) ? 1.0 : units::deg) + 0.0);
  }
  // Rapids before the first feed may still bring the axes to known positions.
  if (has_fed_ || block.interpolation == Interpolation::Rapid) return;
  has_fed_ = true;
  if (!positions.empty())
    assume(
        {"no word before this first feed states the positions of these axes; start positions "
         "assumed:" +
             positions,
         "machine.home", "", line_});
}

void Canon::straight(Straight move, bool rapid) {
  add_straight(std::move(move), rapid ? Interpolation::Rapid : Interpolation::Line);
}

void Canon::traverse(Straight move) { add_straight(std::move(move), Interpolation::Rapid); }

void Canon::straight_feed(Straight move) { add_straight(std::move(move), Interpolation::Line); }

// The rotation of the frame is permuted into the order of the joints of the arc.
std::optional<Eigen::Matrix3d> Canon::arc_plane_rotation(const ArcMove& move, int third) const {
  const bool turns = move.radius || move.centre_with_offsets.size() > 0;
  if (!frame_.rotation || !turns) return std::nullopt;
  const std::array<int, 3> order{move.first, move.second, third};
  Eigen::Matrix3d R;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = [&](int joint) {
        return std::find(xyz_.begin(), xyz_.end(), joint) - xyz_.begin();
      };
      R(Eigen::Index(i), Eigen::Index(k)) = (*frame_.rotation)(at(order[i]), at(order[k]));
    }
  // A smaller tilt than 1.4e-7 rad (1 - cos = tilt^2 / 2) is a rotation about the normal only.
  constexpr double min_one_minus_cosine = 1e-14;
  if (R(2, 2) > 1.0 - min_one_minus_cosine) return std::nullopt;
  return R;
}

Arc Canon::compute_arc(const ArcMove& move) {
  const int third = xyz_[0] + xyz_[1] + xyz_[2] - move.first - move.second;
  const auto turn = arc_plane_rotation(move, third);
  const auto in_plane = [&](const AxisVector& q) -> Eigen::Vector2d {
    if (!turn) return {q[move.first], q[move.second]};
    return (turn->transpose() * Eigen::Vector3d(q[move.first], q[move.second], q[third])).head<2>();
  };
  ArcGeometry geometry{in_plane(position_), in_plane(move.end), move.centre, move.clockwise};
  if (move.radius)
    geometry.centre = centre_by_radius(geometry, *move.radius, place(), move.named);
  else if (move.centre_with_offsets.size() > 0)
    geometry.centre = in_plane(move.centre_with_offsets);
  Arc arc = validated_arc(geometry, move.turns, place(), move.named);
  arc.first = move.first;
  arc.second = move.second;
  if (!turn) return arc;
  arc.third = third;
  // Consecutive arcs of one tilted plane share their rotation.
  if (path_.plane_rotations.empty() || path_.plane_rotations.back() != *turn)
    path_.plane_rotations.push_back(*turn);
  arc.plane_rotation = int(path_.plane_rotations.size()) - 1;
  return arc;
}

// The arc is computed before its joints count as stated: from an uncertain position it may fail
// because of an earlier error.
void Canon::arc(ArcMove move) {
  Block arc_block;
  arc_block.interpolation = Interpolation::Arc;
  arc_block.coordinates = coordinates_;
  arc_block.shape = std::uint32_t(path_.arcs.size());
  arc_block.start = position_;
  arc_block.end = move.end;
  const double seconds = with_end_on_error(arc_block.end, [&] {
    path_.arcs.push_back(compute_arc(move));
    turn_at_surface_speed(arc_block, true);
    return duration(arc_block, move.cause);
  });
  uncertain_joints_ &= ~move.stated;
  record_known_positions(arc_block, move.stated);
  append(std::move(arc_block), seconds);
}

namespace {

CutterData in_mm(CutterData data, double unit_mm) {
  data.diameter *= unit_mm;
  if (data.corner_radius) *data.corner_radius *= unit_mm;
  data.unit_mm = unit_mm;
  return data;
}

double unit_of(const UnitWord& unit_word) { return unit_word.inch ? units::inch : 1.0; }

}  // namespace

void Canon::comment(std::string_view text) {
  auto data = parse_cutter_comment(text);
  if (!data) return;
  // A comment without a unit is in the unit of the program. Before any G20 or G21 that unit is
  // unknown, and `set_inch` adds it later.
  if (!data->unit_mm && !path_.unit_words.empty()) data->unit_mm = unit_of(path_.unit_words.back());
  if (data->unit_mm) data = in_mm(*data, *data->unit_mm);
  path_.tool_comments.push_back({line_, std::string(text), *data, blocks()});
}

void Canon::assume(Assumption assumption) {
  const auto has_same_text = [&](const Assumption& known) { return known.text == assumption.text; };
  if (std::any_of(path_.assumptions.begin(), path_.assumptions.end(), has_same_text)) return;
  if (assumption.line == 0) {
    assumption.line = line_;
    if (file_ > 0) assumption.file = file_name();
  }
  path_.assumptions.push_back(std::move(assumption));
}

void Canon::cutter(std::string_view text, const CutterData& cutter_data) {
  path_.tool_comments.push_back({line_, std::string(text), cutter_data, blocks()});
}

// A unit is recorded only where it changes. The first one also applies to comments above it.
void Canon::set_inch(bool inch) {
  inch_ = inch;
  if (!path_.unit_words.empty() && path_.unit_words.back().inch == inch) return;
  const UnitWord unit_word{line_, inch};
  path_.unit_words.push_back(unit_word);
  for (ToolComment& comment : path_.tool_comments)
    if (!comment.words.unit_mm) comment.words = in_mm(comment.words, unit_of(unit_word));
}

void Canon::record_tool_call(double number, bool changes) {
  if (number >= 0) tool_ = int(std::min(number, 1e9));  // keeps the conversion to int defined
  path_.tool_calls.push_back({line_, tool_, changes, blocks()});
}

// Block numbers of auxiliary words count within the path that is handed over.
Path Canon::take_kept_blocks() {
  Path segment;
  segment.file = path_.file;
  segment.subprogram_files = path_.subprogram_files;
  segment.motion_blocks = std::exchange(path_.motion_blocks, 0);
  segment.auxiliary_words.swap(path_.auxiliary_words);
  for (AuxiliaryWord& auxiliary_word : segment.auxiliary_words)
    auxiliary_word.before -= handed_over_;
  handed_over_ += path_.blocks.size();
  segment.blocks.swap(path_.blocks);
  segment.arcs.swap(path_.arcs);
  segment.plane_rotations.swap(path_.plane_rotations);
  return segment;
}

void Canon::record_auxiliary_word(std::string text) {
  path_.auxiliary_words.push_back({blocks(), std::move(text)});
}

}  // namespace abbe::sim::program
