#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/linuxcnc/rs274_commands.h"

namespace abbe::sim::dialects::linuxcnc {

using program::Feed;
using program::FeedMode;
using program::Straight;

/// Returns the end of a move. Axes that the machine does not have must stay where they are.
Commands::AxisVector Commands::end_of(const Six& programmed) {
  AxisVector p = canon_.programmed();
  for (std::size_t k = 0; k < 6; ++k) {
    const int j = joint(k);
    const double value = k < 3 ? programmed[k] * unit_ : programmed[k];
    if (j >= 0) {
      p[j] = value * (canon_.is_linear(j) ? 1.0 : units::deg);
    } else if (const double at = value + g92_[k] + g5x_[k] + length_[k];
               // 1e-9: rs274 adds and subtracts offsets, which leaves rounding.
               std::abs(at - lacking_at_[k]) > 1e-9) {
      lacking_at_[k] = at;
      refuse("an axis of this machine (" + canon_.letters() + ")",
             fmt::format("{}{:.6g}", "XYZABC"[k], value));
    }
  }
  p = canon_.placed(std::move(p));
  constexpr double max_position_mm = 1e6, max_position_rad = 1e7;
  for (int j = 0; j < int(p.size()); ++j)
    if (!(std::abs(p[j]) <= (canon_.is_linear(j) ? max_position_mm : max_position_rad)))
      refuse(canon_.is_linear(j) ? "a position within 1e6 mm" : "a position within 1e7 rad",
             fmt::format("{:.6g}", p[j]));
  return p;
}

// Under synchronisation the feed is the pitch, whatever F is.
void Commands::feed(Straight move) {
  if (!pitch_) return canon_.straight_feed(std::move(move));
  const FeedMode mode = canon_.feed_mode();
  const auto before = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  canon_.set_feed(pitch_);
  const auto again = [&] {
    canon_.set_feed_mode(mode);
    canon_.set_feed(before);
  };
  try {
    canon_.straight_feed(std::move(move));
  } catch (const BadInput&) {
    again();
    throw;
  }
  again();
}

void Commands::straight(const Six& programmed, bool rapid) {
  if (number_ == 0) return;  // the lead-in: the axes are there already
  if (codes_.absolute || codes_.reference || codes_.computed)
    check_length_unit(codes_.absolute ? "G53" : "G28 and G30");
  // G28 and G30 make two traverses: over a point under the offset, then to the stored position,
  // which is independent of offsets.
  const bool stored = codes_.reference && ++at_point_ % 2 == 0;
  Straight move{.end = end_of(programmed),
                .cause = {0, program_.text_of(number_)},
                .without_offset = codes_.absolute || stored,
                .stated = ~std::uint32_t(0)};
  if (rapid)
    canon_.traverse(std::move(move));
  else
    feed(std::move(move));
}

void Commands::arc(const Numbers& n) {
  Six end{}, centre{};
  const auto [first, second, third] = plane_;
  end[first] = n[0];
  end[second] = n[1];
  end[third] = n[5];
  std::copy_n(n.begin() + 6, 3, end.begin() + 3);
  centre = end;
  centre[first] = n[2];
  centre[second] = n[3];
  // The sign of the turns is the direction, their number counts a partial turn as one.
  const double turns = std::abs(n[4]);
  if (!(turns >= 1 && turns <= 1e6))
    refuse("an arc of 1 to 1e6 turns that are begun", fmt::format("{}", n[4]));
  if (joint(first) < 0 || joint(second) < 0)
    refuse(fmt::format("a machine with the axes {} {} of the plane", "XYZ"[first], "XYZ"[second]));
  program::ArcMove move{.first = joint(first),
                        .second = joint(second),
                        .end = end_of(end),
                        .clockwise = n[4] < 0,
                        .turns = int(turns),
                        .cause = {0, program_.text_of(number_)},
                        .named = {0, program_.text_of(number_)},
                        .stated = ~std::uint32_t(0)};
  // The centre passes through the frame as the end does.
  move.placed_centre = end_of(centre);
  canon_.arc(std::move(move));
}

/// Rigid tapping: down and back at the pitch, with the spindle reversed at the bottom.
void Commands::tap(const Numbers& n) {
  if (!pitch_) refuse("a pitch before a rigid tap", "none");
  const AxisVector start = canon_.position();
  AxisVector p = canon_.programmed();
  for (std::size_t k = 0; k < 3; ++k)
    if (const int j = joint(k); j >= 0) p[j] = n[k] * unit_;
  const program::Cause cause{0, program_.text_of(number_)};
  feed({.end = canon_.placed(std::move(p)), .cause = cause});
  AxisVector back = canon_.position();
  for (std::size_t k = 0; k < 3; ++k)
    if (const int j = joint(k); j >= 0) back[j] = start[j];
  const int direction = canon_.spindle_direction();
  canon_.turn_spindle(-direction);
  feed({.end = std::move(back), .cause = cause});
  canon_.turn_spindle(direction);
}

bool Commands::apply_motion(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "STRAIGHT_TRAVERSE" || name == "STRAIGHT_FEED") {
    straight(six(numbers(command, 6), 0), name == "STRAIGHT_TRAVERSE");
  } else if (name == "ARC_FEED") {
    arc(numbers(command, 9));
  } else if (name == "RIGID_TAP") {
    tap(numbers(command, 3));
  } else if (name == "DWELL") {
    canon_.dwell(numbers(command, 1)[0], {0, program_.text_of(number_)});
  } else if (name == "START_SPEED_FEED_SYNC" || name == "START_SPEED_FEED_SYNCH") {
    // The command that ends it is spelled SYNCH; the one that begins it comes with and without H.
    const double pitch = std::abs(numbers(command, 1)[0]);
    if (!(pitch > 0)) refuse("a pitch above zero", "0");
    pitch_ = Feed{pitch, unit_};
  } else if (name == "STOP_SPEED_FEED_SYNCH") {
    pitch_.reset();
  } else if (name == "STRAIGHT_PROBE") {
    refuse("no probing: a virtual part is read by instruments (abbe measure)");
  } else if (name.starts_with("NURBS") || name.starts_with("SPLINE")) {
    refuse(
        "no G5, G5.1 and G5.2 beside LinuxCNC's own interpreter: it prints no points of "
        "splines; interpreter = \"abbe\" reads them");
  } else {
    return false;
  }
  return true;
}

bool Commands::apply_spindle(const PrintedCommand& command) {
  const std::string_view name = command.name;
  const auto is_first = [&](const Numbers& n) { return n[0] == 0; };
  if (name == "SET_SPINDLE_MODE") {
    const Numbers n = numbers(command, 2);
    if (!is_first(n)) return true;
    // 1e6 rpm stands for no limit, as in the canon.
    most_rpm_ = std::min(n[1], 1e6);
  } else if (name == "SET_SPINDLE_SPEED") {
    const Numbers n = numbers(command, 2);
    if (!is_first(n)) return true;
    speed_ = n[1];
    speed_in_inch_ = inch_;
    if (!(speed_ >= 0 && speed_ <= 1e7)) refuse("a spindle speed of 0 to 1e7");
  } else if (name == "START_SPINDLE_CLOCKWISE" || name == "START_SPINDLE_COUNTERCLOCKWISE" ||
             name == "STOP_SPINDLE_TURNING") {
    if (is_first(numbers(command, 1)))
      canon_.turn_spindle(name == "STOP_SPINDLE_TURNING"      ? 0
                          : name == "START_SPINDLE_CLOCKWISE" ? 1
                                                              : -1);
    return true;
  } else {
    return false;
  }
  if (most_rpm_ > 0) {
    if (joint(0) < 0) refuse("a machine with an X axis beside G96");
    // Surface speed is in m/min in mm, in ft/min in inches.
    canon_.set_surface_speed(
        program::SurfaceSpeed{speed_in_inch_ ? speed_ * 0.3048 : speed_, most_rpm_});
  } else {
    canon_.set_surface_speed({});
    canon_.set_spindle_speed(speed_);
  }
  return true;
}

void Commands::end_pending_tool() {
  canon_.call_tool(*pending_, false);
  canon_.aside(fmt::format("T{}", *pending_));
  pending_.reset();
}

void Commands::finish() {
  if (pending_) end_pending_tool();
}

void Commands::set_tool_length(const Six& offset) {
  if (codes_.length && codes_.h == -1 && tool_ <= 0)
    refuse("T and M6 before G43", "no tool called");
  // An entry of 1e7 mm marks an unknown length; half of it allows for other offsets on top.
  if (offset[2] > 0.5 * unknown_length) {
    std::string known;
    for (const auto& [number, mm] : run_.options().control.tool_length)
      known += fmt::format(" H{}", number);
    refuse("a tool length that is known (" + (known.empty() ? "none is" : known.substr(1)) + ")");
  }
  if (offset != length_) {
    check_length_unit("G43 and G49");
    // A computed code may have changed the length in the block of M6, where rs274 goes wrong.
    if (changed_in_ == number_ && (codes_.computed || codes_.assigns))
      refuse(
          "M6 in a block of its own before another tool length: rs274 alone, without the rest "
          "of the control, leaves the length out of where the axes stand then");
  }
  length_ = offset;
  length_in_inch_ = inch_;
  AxisVector shift;
  if (std::any_of(offset.begin(), offset.end(), [](double v) { return v != 0.0; })) {
    shift = AxisVector::Zero(canon_.position().size());
    for (std::size_t k = 0; k < 6; ++k) {
      const int j = joint(k);
      if (j < 0 && offset[k] != 0.0)
        refuse("an axis of this machine (" + canon_.letters() + ")",
               fmt::format("a tool offset in {}", "XYZABC"[k]));
      if (j >= 0) shift[j] = offset[k] * (canon_.is_linear(j) ? 1.0 : units::deg);
    }
  }
  const program::Cause cause{0, program_.text_of(number_)};
  if (codes_.no_length) canon_.select_length(-1, cause);
  if (codes_.length && codes_.h != not_literal)
    canon_.select_length(codes_.h >= 0 ? codes_.h : tool_, cause);
  canon_.set_tool_shift(std::move(shift));
}

bool Commands::apply_tool(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "SELECT_TOOL") {
    selected_ = int(std::clamp(numbers(command, 1)[0], -1.0, 1e9));
    // M6 may follow in the same block; until then T is pending.
    pending_ = selected_;
    pending_in_ = number_;
  } else if (name == "CHANGE_TOOL") {
    canon_.call_tool(pending_ ? *pending_ : -1, true);
    canon_.aside(pending_ ? fmt::format("T{} M6", *pending_) : "M6");
    pending_.reset();
    tool_ = selected_;
    changed_in_ = number_;
  } else if (name == "CHANGE_TOOL_NUMBER") {
    // The command names the pocket in the table; the words of the block name the tool.
    if (codes_.tool >= 0) selected_ = codes_.tool;
    tool_ = selected_;
    canon_.call_tool(tool_, true);
  } else if (name == "USE_TOOL_LENGTH_OFFSET") {
    set_tool_length(in_mm(six(numbers(command, 6), 0)));
  } else if (name == "SET_TOOL_TABLE_ENTRY") {
    stored_.insert(int(std::clamp(numbers(command, 2)[1], -1.0, 1e9)));
    // G10 L1 states the length itself; L10 and L11 derive it from axis positions.
    if (codes_.data_kind != 1) check_length_unit("G10");
  } else {
    return false;
  }
  return true;
}

}  // namespace abbe::sim::dialects::linuxcnc
