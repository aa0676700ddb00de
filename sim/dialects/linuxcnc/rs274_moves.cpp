#include "sim/dialects/linuxcnc/rs274_commands.h"

namespace abbe::sim::dialects::linuxcnc {

/// Returns the end of a move. Throws BadInput if an axis that the machine does not have would move.
AxisVector Commands::end_of(const SixAxes& programmed) {
  AxisVector p = canon_.programmed();
  for (std::size_t k = 0; k < 6; ++k) {
    const int j = joint(k);
    const double value = k < 3 ? programmed[k] * unit_ : programmed[k];
    if (j >= 0) {
      p[j] = value * (canon_.is_linear(j) ? 1.0 : units::deg);
    } else if (const double position = value + g92_[k] + g5x_[k] + length_[k];
               // 1e-9 allows for rounding, as rs274 adds and subtracts offsets.
               std::abs(position - missing_axis_positions_[k]) > 1e-9) {
      missing_axis_positions_[k] = position;
      throw_input_error("an axis of this machine (" + canon_.letters() + ")",
                        fmt::format("{}{:.6g}", "XYZABC"[k], value));
    }
  }
  p = canon_.placed(std::move(p));
  constexpr double max_position_mm = 1e6, max_position_rad = 1e7;
  for (int j = 0; j < int(p.size()); ++j)
    if (!(std::abs(p[j]) <= (canon_.is_linear(j) ? max_position_mm : max_position_rad)))
      throw_input_error(
          canon_.is_linear(j) ? "a position within 1e6 mm" : "a position within 1e7 rad",
          fmt::format("{:.6g}", p[j]));
  return p;
}

/// Makes a line at feed. While synchronised with the spindle the feed is the pitch, whatever F is.
void Commands::feed(Straight move) {
  if (!pitch_) return canon_.straight_feed(std::move(move));
  const TemporaryFeed pitch_feed(canon_, FeedMode::PerRevolution, pitch_);
  canon_.straight_feed(std::move(move));
}

void Commands::straight(const SixAxes& programmed, bool rapid) {
  if (number_ == 0) return;  // the lead-in ends where the axes already are
  if (codes_.has({530}) || codes_.has_reference() || codes_.has_computed_code)
    check_length_unit(codes_.has({530}) ? "G53" : "G28 and G30");
  // G28 and G30 make two traverses: over a point that counts with offsets, then to the stored
  // position, which does not.
  const bool is_stored_position = codes_.has_reference() && ++reference_moves_ % 2 == 0;
  Straight move{.end = end_of(programmed),
                .cause = {0, program_.text_of(number_)},
                .without_offset = codes_.has({530}) || is_stored_position,
                .stated = ~std::uint32_t(0)};
  if (rapid)
    canon_.traverse(std::move(move));
  else
    feed(std::move(move));
}

void Commands::arc(const Numbers& n) {
  SixAxes end{}, centre{};
  const auto [first, second, third] = plane_;
  end[first] = n[0];
  end[second] = n[1];
  end[third] = n[5];
  std::copy_n(n.begin() + 6, 3, end.begin() + 3);
  centre = end;
  centre[first] = n[2];
  centre[second] = n[3];
  // The sign of the number of turns is the direction; a partial turn counts as one.
  const double turns = std::abs(n[4]);
  if (!(turns >= 1 && turns <= 1e6))
    throw_input_error("an arc of 1 to 1e6 full or partial turns", fmt::format("{}", n[4]));
  if (joint(first) < 0 || joint(second) < 0)
    throw_input_error(
        fmt::format("a machine with the axes {} {} of the plane", "XYZ"[first], "XYZ"[second]));
  program::ArcMove move{.first = joint(first),
                        .second = joint(second),
                        .end = end_of(end),
                        .clockwise = n[4] < 0,
                        .turns = int(turns),
                        .cause = {0, program_.text_of(number_)},
                        .named = {0, program_.text_of(number_)},
                        .stated = ~std::uint32_t(0)};
  // The frame applies to the centre as to the end.
  move.centre_with_offsets = end_of(centre);
  canon_.arc(std::move(move));
}

/// Makes a rigid tap: down and back at the pitch, with the spindle reversed at the bottom.
void Commands::tap(const Numbers& n) {
  if (!pitch_) throw_input_error("a pitch before a rigid tap", "none");
  const AxisVector start = canon_.position();
  AxisVector p = canon_.programmed();
  for (std::size_t k = 0; k < 3; ++k)
    if (const int j = joint(k); j >= 0) p[j] = n[k] * unit_;
  const program::Cause cause{0, program_.text_of(number_)};
  feed({.end = canon_.placed(std::move(p)), .cause = cause});
  AxisVector return_end = canon_.position();
  for (std::size_t k = 0; k < 3; ++k)
    if (const int j = joint(k); j >= 0) return_end[j] = start[j];
  const int direction = canon_.spindle_direction();
  canon_.turn_spindle(-direction);
  feed({.end = std::move(return_end), .cause = cause});
  canon_.turn_spindle(direction);
}

bool Commands::apply_motion(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "STRAIGHT_TRAVERSE" || name == "STRAIGHT_FEED") {
    straight(six_axes(parse_numbers(command, 6), 0), name == "STRAIGHT_TRAVERSE");
  } else if (name == "ARC_FEED") {
    arc(parse_numbers(command, 9));
  } else if (name == "RIGID_TAP") {
    tap(parse_numbers(command, 3));
  } else if (name == "DWELL") {
    canon_.dwell(parse_numbers(command, 1)[0], {0, program_.text_of(number_)});
  } else if (name == "START_SPEED_FEED_SYNC" || name == "START_SPEED_FEED_SYNCH") {
    // rs274 spells the command that ends it SYNCH, and the one that begins it with or without H.
    const double pitch = std::abs(parse_numbers(command, 1)[0]);
    if (!(pitch > 0)) throw_input_error("a pitch greater than zero", "0");
    pitch_ = Feed{pitch, unit_};
  } else if (name == "STOP_SPEED_FEED_SYNCH") {
    pitch_.reset();
  } else if (name == "STRAIGHT_PROBE") {
    throw_input_error("no probing: a virtual part is measured by instruments (abbe measure)");
  } else if (name.starts_with("NURBS") || name.starts_with("SPLINE")) {
    throw_input_error(
        "no G5, G5.1 and G5.2 with LinuxCNC's own interpreter: it prints no points of splines; "
        "interpreter = \"abbe\" reads them");
  } else {
    return false;
  }
  return true;
}

bool Commands::apply_spindle(const PrintedCommand& command) {
  const std::string_view name = command.name;
  const auto is_first_spindle = [&](const Numbers& n) { return n[0] == 0; };
  if (name == "SET_SPINDLE_MODE") {
    const Numbers n = parse_numbers(command, 2);
    if (!is_first_spindle(n)) return true;
    // 1e6 rpm means no limit, as in the canon.
    max_rpm_ = std::min(n[1], 1e6);
  } else if (name == "SET_SPINDLE_SPEED") {
    const Numbers n = parse_numbers(command, 2);
    if (!is_first_spindle(n)) return true;
    speed_ = n[1];
    is_speed_in_inch_ = is_inch_;
    if (!(speed_ >= 0 && speed_ <= 1e7)) throw_input_error("a spindle speed from 0 to 1e7");
  } else if (name == "START_SPINDLE_CLOCKWISE" || name == "START_SPINDLE_COUNTERCLOCKWISE" ||
             name == "STOP_SPINDLE_TURNING") {
    if (is_first_spindle(parse_numbers(command, 1)))
      canon_.turn_spindle(name == "STOP_SPINDLE_TURNING"      ? 0
                          : name == "START_SPINDLE_CLOCKWISE" ? 1
                                                              : -1);
    return true;
  } else {
    return false;
  }
  if (max_rpm_ > 0) {
    if (joint(0) < 0) throw_input_error("a machine with an X axis for G96");
    // A surface speed is in m/min, or under G20 in ft/min.
    canon_.set_surface_speed(
        program::SurfaceSpeed{is_speed_in_inch_ ? speed_ * 0.3048 : speed_, max_rpm_});
  } else {
    canon_.set_surface_speed({});
    canon_.set_spindle_speed(speed_);
  }
  return true;
}

void Commands::end_pending_tool() {
  canon_.record_tool_call(*pending_tool_, false);
  canon_.record_auxiliary_word(fmt::format("T{}", *pending_tool_));
  pending_tool_.reset();
}

void Commands::finish() {
  if (pending_tool_) end_pending_tool();
}

void Commands::set_tool_length(const SixAxes& offset) {
  if (codes_.has({430}) && codes_.h == -1 && tool_ <= 0)
    throw_input_error("T and M6 before G43", "no tool called");
  // An entry of 1e7 mm marks an unknown length; half of it allows for other offsets on top.
  if (offset[2] > 0.5 * unknown_length)
    throw_input_error("a known tool length (" +
                      known_numbers(run_.options().control.tool_length, "H") + ")");
  if (offset != length_) {
    check_length_unit("G43 and G49");
    // In the block of M6 rs274 misreads a change of length, which a computed code may be.
    if (tool_change_block_ == number_ && (codes_.has_computed_code || codes_.has_assignment))
      throw_input_error(
          "M6 in a separate block before a change of the tool length: without the rest of the "
          "control, rs274 omits the length from the current position");
  }
  length_ = offset;
  is_length_in_inch_ = is_inch_;
  AxisVector shift;
  if (std::any_of(offset.begin(), offset.end(), [](double v) { return v != 0.0; })) {
    shift = AxisVector::Zero(canon_.position().size());
    for (std::size_t k = 0; k < 6; ++k) {
      const int j = joint(k);
      if (j < 0 && offset[k] != 0.0)
        throw_input_error("an axis of this machine (" + canon_.letters() + ")",
                          fmt::format("a tool offset in {}", "XYZABC"[k]));
      if (j >= 0) shift[j] = offset[k] * (canon_.is_linear(j) ? 1.0 : units::deg);
    }
  }
  const program::Cause cause{0, program_.text_of(number_)};
  if (codes_.has({490})) canon_.select_length(-1, cause);
  if (codes_.has({430}) && codes_.h != not_literal)
    canon_.select_length(codes_.h >= 0 ? codes_.h : tool_, cause);
  canon_.set_tool_shift(std::move(shift));
}

bool Commands::apply_tool(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "SELECT_TOOL") {
    selected_ = int(std::clamp(parse_numbers(command, 1)[0], -1.0, 1e9));
    // M6 may follow in the same block; until then T is pending.
    pending_tool_ = selected_;
    pending_block_ = number_;
  } else if (name == "CHANGE_TOOL") {
    canon_.record_tool_call(pending_tool_ ? *pending_tool_ : -1, true);
    canon_.record_auxiliary_word(pending_tool_ ? fmt::format("T{} M6", *pending_tool_) : "M6");
    pending_tool_.reset();
    tool_ = selected_;
    tool_change_block_ = number_;
  } else if (name == "CHANGE_TOOL_NUMBER") {
    // The command states the pocket in the table; the words of the block state the tool.
    if (codes_.tool >= 0) selected_ = codes_.tool;
    tool_ = selected_;
    canon_.record_tool_call(tool_, true);
  } else if (name == "USE_TOOL_LENGTH_OFFSET") {
    set_tool_length(in_mm(six_axes(parse_numbers(command, 6), 0)));
  } else if (name == "SET_TOOL_TABLE_ENTRY") {
    stored_tools_.insert(int(std::clamp(parse_numbers(command, 2)[1], -1.0, 1e9)));
    // G10 L1 states the length itself; L10 and L11 derive it from axis positions.
    if (codes_.l != 1) check_length_unit("G10");
  } else {
    return false;
  }
  return true;
}

}  // namespace abbe::sim::dialects::linuxcnc
