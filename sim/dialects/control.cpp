#include "sim/dialects/control.h"

namespace abbe::sim::dialects {

std::array<int, 2> GCodeControl::plane_joints(const Cause& cause) const {
  const std::string_view plane = plane_letters();
  const int first = canon_.joint_of(plane[0]), second = canon_.joint_of(plane[1]);
  if (first < 0 || second < 0)
    throw_input_error(
        cause, fmt::format("a machine with the axes {} {} of the plane", plane[0], plane[1]));
  return {first, second};
}

void GCodeControl::change_feed_mode(FeedMode mode) {
  if (mode != canon_.feed_mode()) canon_.set_feed({});
  canon_.set_feed_mode(mode);
}

void GCodeControl::assume_plane_and_feed(bool is_arc, bool is_at_feed, std::string_view per_minute,
                                         std::string_view per_revolution) {
  if (is_arc)
    run_.assume_mode(StartMode::Plane, plane_ == 18   ? "plane Z X (G18)"
                                       : plane_ == 19 ? "plane Y Z (G19)"
                                                      : "plane X Y (G17)");
  if (is_at_feed)
    run_.assume_mode(StartMode::Feed,
                     canon_.feed_mode() == FeedMode::PerRevolution ? per_revolution : per_minute);
}

void GCodeControl::apply_surface_speed(double m_per_min) {
  canon_.set_surface_speed(has_surface_speed_
                               ? std::optional(program::SurfaceSpeed{m_per_min, max_rpm_})
                               : std::nullopt);
}

void GCodeControl::dwell_after_move(double seconds, const Cause& cause) {
  compensation_.run_after_move(
      [this, seconds, cause = Cause{cause.column, {}}] { canon_.dwell(seconds, cause); });
}

}  // namespace abbe::sim::dialects
