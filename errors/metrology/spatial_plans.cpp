#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "errors/metrology/plans.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;

constexpr double path_arc = 5.0 * units::deg;    // between the points of a curved path
constexpr double search_arc = 1.0 * units::deg;  // of the search for the ends of a range

/// Returns the number of moves from one target of a curved path to the next.
int moves_to_target(const Instrument& instrument, const Range& range) {
  const double step = std::abs(range.to - range.from) / std::max(1, instrument.targets - 1);
  return std::max(1, int(std::ceil(step / path_arc)));
}

/// Returns the range without its end if the end coincides with the start after whole turns. The
/// targets on one turn are then distinct positions; n targets on k turns are n / gcd(n, k)
/// positions, each read gcd(n, k) times.
Range whole_turn_range(const Instrument& instrument, Range range) {
  const double turns = (range.to - range.from) / (2.0 * pi);
  if (turns > 0.5 && std::abs(turns - std::round(turns)) < 1e-9)
    range.to -= (range.to - range.from) / instrument.targets;
  return range;
}

/// Position of the ball at the tool that the slides maintain while one rotary axis turns.
struct BallPosition {
  Vector3d position_w;
  Vector3d radial_w;  ///< unit, from the axis to the ball; any direction across the axis if the
                      ///< ball is on it
  Range range;        ///< of the rotary axis
};

/// Returns the axis positions with which the slides hold the ball at a position. Throws if they
/// cannot reach it.
/// @param slides  joints that move; empty: all
AxisVector reach_with_slides(const Instrument& instrument, const Chain& nominal,
                             const AxisVector& q, const Vector3d& position_w,
                             const std::vector<int>& slides = {}) {
  const auto reached = axes_with_reflector_at(instrument, nominal, q, position_w, slides);
  if (!reached)
    throw_input_error(instrument, "expected slides that reach the ball position, seen too few");
  return *reached;
}

/// Returns the path on which one rotary axis turns and the slides hold the ball at a position.
Path following_path(const Instrument& instrument, const Chain& nominal, const ParkedMachine& parked,
                    const AxisDirection& rotary, const Vector3d& position_w) {
  return [&instrument, &nominal, &parked, joint = rotary.joint, position_w](double angle) {
    AxisVector q = parked.q;
    q[joint] = angle;
    return reach_with_slides(instrument, nominal, q, position_w);
  };
}

/// Returns the longest part of a range over which the slides can follow within their travel.
Range clip_to_slides(const Instrument& instrument, const Chain& nominal,
                     const AxisDirection& rotary, const Range& range, const Path& path) {
  const double first = range.from - range.overshoot, last = range.to + range.overshoot;
  // The ends are found to one search_arc. The margin is then subtracted at both ends.
  const int count = std::max(2, int(std::ceil((last - first) / search_arc))) + 1;
  const auto angle = [&](int i) { return first + (last - first) * i / (count - 1); };
  int longest_from = 0, longest = 0, from = 0;
  for (int i = 0; i <= count; ++i) {
    if (i < count && is_within_travel(nominal, path(angle(i)))) continue;
    if (i - from > longest) {
      longest = i - from;
      longest_from = from;
    }
    from = i + 1;
  }
  if (longest == count) return range;
  if (longest < 2)
    throw_input_error(instrument, fmt::format("expected slides that follow while {} turns, seen a "
                                              "position where they leave their travel at once",
                                              rotary.letter));
  const double low = angle(longest_from), high = angle(longest_from + longest - 1);
  const double clearance = instrument.margin * (high - low);
  return {low + clearance, high - clearance, 0.5 * clearance};
}

/// Returns the default position of a ball on a table: the instrument's radius above the workpiece's
/// zero and the same distance from the axis. If the slides do not reach it, the ball is at the
/// height of the parked tool.
Vector3d position_on_table(const Instrument& instrument, const Chain& nominal,
                           const ParkedMachine& parked, const AxisDirection& rotary,
                           const Vector3d& radial_w) {
  const Vector3d height_w = instrument.radius * nominal.tool_in_workpiece(parked.q).linear().col(2);
  const Vector3d axis_point_w = nearest_axis_point(nominal, parked.q, rotary.joint, height_w);
  const Vector3d position_w = axis_point_w + instrument.radius * radial_w;
  const auto reached = axes_with_reflector_at(instrument, nominal, parked.q, position_w);
  if (reached && is_within_travel(nominal, *reached)) return position_w;
  return nearest_axis_point(nominal, parked.q, rotary.joint,
                            reflector_w(instrument, nominal, parked.q)) +
         instrument.radius * radial_w;
}

/// Returns the direction across a rotary axis nearest to the axis of the parked tool.
Vector3d radial_direction(const Chain& nominal, const ParkedMachine& parked,
                          const AxisDirection& rotary) {
  const Vector3d& axis_w = rotary.direction_w;
  const Vector3d tool_axis_w = nominal.tool_in_workpiece(parked.q).linear().col(2);
  const Vector3d across_axis_w = tool_axis_w - tool_axis_w.dot(axis_w) * axis_w;
  // 0.5: sine of 30 degrees; a tool within this angle of the axis has no usable direction across
  // it.
  return across_axis_w.norm() > 0.5 ? across_axis_w.normalized()
                                    : cross_directions(nominal, parked.q, axis_w).direction_w[0];
}

bool is_table(const Chain& nominal, const AxisDirection& rotary) {
  return nominal.joints()[std::size_t(rotary.joint)].side == kinematics::Side::Workpiece;
}

/// Returns the position of the ball for the test of a rotary axis. For a rotary head it is the
/// position at which the parked tool holds the ball.
BallPosition ball_position(const Instrument& instrument, const Chain& nominal,
                           const ParkedMachine& parked, const AxisDirection& rotary) {
  BallPosition ball;
  ball.radial_w = radial_direction(nominal, parked, rotary);
  if (instrument.location_w) {
    ball.position_w = *instrument.location_w;
    const Vector3d arm_w =
        ball.position_w - nearest_axis_point(nominal, parked.q, rotary.joint, ball.position_w);
    if (is_table(nominal, rotary) && arm_w.norm() > 1e-3) ball.radial_w = arm_w.normalized();
  } else {
    ball.position_w = is_table(nominal, rotary)
                          ? position_on_table(instrument, nominal, parked, rotary, ball.radial_w)
                          : reflector_w(instrument, nominal, parked.q);
  }
  const Joint& joint = nominal.joints()[std::size_t(rotary.joint)];
  ball.range = whole_turn_range(
      instrument,
      clip_to_slides(instrument, nominal, rotary, arc(instrument, joint),
                     following_path(instrument, nominal, parked, rotary, ball.position_w)));
  return ball;
}

/// Returns the axis positions of a grid over all rotary axes at which the slides can hold the ball
/// at its position.
std::vector<AxisVector> rotary_grid(const Instrument& instrument, const Chain& nominal,
                                    const ParkedMachine& parked, const Vector3d& position_w) {
  std::vector<GridAxis> axes;
  for (const AxisDirection& rotary : parked.rotary_axes) {
    const Range range =
        whole_turn_range(instrument, arc(instrument, nominal.joints()[std::size_t(rotary.joint)]));
    axes.push_back({rotary.joint, targets(range, instrument.targets)});
  }
  std::vector<AxisVector> positions;
  for (const AxisVector& rotary_q : grid(instrument, parked.q, axes)) {
    const AxisVector q = reach_with_slides(instrument, nominal, rotary_q, position_w);
    if (is_within_travel(nominal, q)) positions.push_back(q);
  }
  if (positions.size() < 3)
    throw_input_error(instrument,
                      fmt::format("expected at least 3 rotary positions within the travel of the "
                                  "slides, seen {}",
                                  positions.size()));
  return positions;
}

/// Returns the channels of three sensors along X, Y and Z around the ball.
std::vector<Channel> sensor_nest(const Instrument& instrument, const Vector3d& position_w) {
  std::vector<Channel> channels;
  for (int k = 0; k < 3; ++k) {
    channels.push_back(channel(instrument, fmt::format("{} of the ball", char('X' + k)),
                               Quantity::Displacement, Vector3d::Unit(k)));
    channels.back().point_in = position_w;
  }
  return channels;
}

/// Returns a circular path of two slides about a point. The other slides stay where they hold the
/// ball at the centre.
Path circle(const Instrument& instrument, const Chain& nominal, const AxisVector& at_centre,
            const Vector3d& centre_w, const std::array<AxisDirection, 2>& pair) {
  const Vector3d& first = pair[0].direction_w;
  const Vector3d& other = pair[1].direction_w;
  const Vector3d second = (other - other.dot(first) * first).normalized();
  return [&instrument, &nominal, at_centre, centre_w, first, second,
          slides = std::vector{pair[0].joint, pair[1].joint}](double angle) {
    return reach_with_slides(
        instrument, nominal, at_centre,
        centre_w + instrument.radius * (std::cos(angle) * first + std::sin(angle) * second),
        slides);
  };
}

}  // namespace

Plan ball_bar(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_slides(instrument, parked, 2);
  const Vector3d centre_w =
      instrument.location_w ? *instrument.location_w : reflector_w(instrument, nominal, parked.q);
  const AxisVector at_centre = reach_with_slides(instrument, nominal, parked.q, centre_w);
  const Range range = whole_turn_range(
      instrument, {instrument.from_rad, instrument.to_rad,
                   0.5 * instrument.margin * (instrument.to_rad - instrument.from_rad)});
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const std::array<AxisDirection, 2>& pair : crossing_slides(instrument, parked)) {
    Channel c = channel(instrument, "length of the bar", Quantity::Length, pair[0].direction_w);
    c.point_in = centre_w;
    SetUp bar = set_up(instrument, fmt::format("{}{} circle", pair[0].letter, pair[1].letter), {c});
    bar.point_in_sigma = instrument.position_sigma;
    bar.is_zero_unknown = false;  // its length is calibrated to the sigma of the scale
    builder.set_up(bar);
    builder.read_both_directions(circle(instrument, nominal, at_centre, centre_w, pair), range,
                                 moves_to_target(instrument, range));
  }
  return std::move(builder).finish();
}

Plan ball_bar_rotary(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_rotary_axis(instrument, parked);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const AxisDirection& rotary : parked.rotary_axes) {
    const BallPosition ball = ball_position(instrument, nominal, parked, rotary);
    const std::pair<const char*, Vector3d> bar_directions[] = {
        {"radial", ball.radial_w},
        {"tangential", rotary.direction_w.cross(ball.radial_w)},
        {"axial", rotary.direction_w}};
    for (const auto& [direction_name, bar_w] : bar_directions) {
      Channel c = channel(instrument, fmt::format("{} to {}", direction_name, rotary.letter),
                          Quantity::Length, bar_w);
      c.point_in = ball.position_w - instrument.radius * bar_w;
      SetUp bar = set_up(instrument, fmt::format("{} {}", rotary.letter, direction_name), {c});
      bar.point_of_sigma = bar.point_in_sigma = instrument.position_sigma;
      builder.set_up(bar);
      builder.read_both_directions(
          following_path(instrument, nominal, parked, rotary, ball.position_w), ball.range,
          moves_to_target(instrument, ball.range));
    }
  }
  return std::move(builder).finish();
}

Plan r_test(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_rotary_axis(instrument, parked);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const AxisDirection& rotary : parked.rotary_axes) {
    const BallPosition ball = ball_position(instrument, nominal, parked, rotary);
    SetUp sensors = set_up(instrument, fmt::format("{} R-test", rotary.letter),
                           sensor_nest(instrument, ball.position_w));
    sensors.point_of_sigma = instrument.position_sigma;
    builder.set_up(sensors);
    builder.read_both_directions(
        following_path(instrument, nominal, parked, rotary, ball.position_w), ball.range,
        moves_to_target(instrument, ball.range));
  }
  return std::move(builder).finish();
}

// The control reports its axis positions at contact with the sphere. With the opposite sign that is
// the deviation of the probe from the sphere's centre at the commanded position. The two differ by
// the change of the errors over the deviation, less than 1e-3 of it.
Plan sphere(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_rotary_axis(instrument, parked);
  // The sphere is off the axis that is nearest to it in the chain; on that axis it would not move.
  const AxisDirection& nearest = *std::min_element(
      parked.rotary_axes.begin(), parked.rotary_axes.end(),
      [](const AxisDirection& a, const AxisDirection& b) { return a.joint < b.joint; });
  const Vector3d position_w = ball_position(instrument, nominal, parked, nearest).position_w;
  PlanBuilder builder(instrument, nominal, parked.q);
  SetUp sphere_set_up = set_up(instrument, "sphere", sensor_nest(instrument, position_w));
  sphere_set_up.point_of_sigma = instrument.position_sigma;
  builder.set_up(sphere_set_up);
  builder.visit(rotary_grid(instrument, nominal, parked, position_w));
  return std::move(builder).finish();
}

namespace {

/// Returns the grid of the instrument's targets over the travel of all slides.
std::vector<AxisVector> travel_grid(const Instrument& instrument, const Chain& nominal,
                                    const ParkedMachine& parked) {
  std::vector<GridAxis> axes;
  for (const AxisDirection& slide : parked.slides) {
    const Range range = travel(instrument, nominal.joints()[std::size_t(slide.joint)]);
    axes.push_back({slide.joint, targets(range, instrument.targets)});
  }
  return grid(instrument, parked.q, axes);
}

/// Box that the reflector covers. With two slides its third edge is across both.
struct Box {
  Vector3d centre_w;
  std::array<Vector3d, 3> half_edge_w;  ///< vectors of half an edge
};

/// Returns the box over the travel of the slides.
Box box(const Instrument& instrument, const Chain& nominal, const ParkedMachine& parked) {
  Box b{reflector_w(instrument, nominal, parked.q), {}};
  for (std::size_t k = 0; k < 3; ++k) {
    if (k < parked.slides.size()) {
      const AxisDirection& slide = parked.slides[k];
      const Range range = travel(instrument, nominal.joints()[std::size_t(slide.joint)]);
      b.half_edge_w[k] = 0.5 * (range.to - range.from) * slide.direction_w;
    } else {
      b.half_edge_w[k] =
          b.half_edge_w[0].norm() * b.half_edge_w[0].cross(b.half_edge_w[1]).normalized();
    }
  }
  return b;
}

/// Returns a point by its coordinates relative to the half edges of the box.
Vector3d box_point(const Box& box, double a, double b, double c) {
  return box.centre_w + a * box.half_edge_w[0] + b * box.half_edge_w[1] + c * box.half_edge_w[2];
}

void check(const Instrument& instrument, const ParkedMachine& parked) {
  expect_slides(instrument, parked, 2);
  if (parked.slides.size() > 3)
    throw_input_error(instrument,
                      fmt::format("expected at most 3 slides, seen {}", parked.slides.size()));
}

}  // namespace

// The two angles of a tracker are modelled as displacements across its beam. Every position has two
// channels of its own, with the noise of the angle times the range; the range has one channel for
// all positions.
Plan tracker(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  check(instrument, parked);
  const std::vector<AxisVector> positions = travel_grid(instrument, nominal, parked);
  const Vector3d station_w = instrument.location_w
                                 ? *instrument.location_w
                                 : box_point(box(instrument, nominal, parked), -2.5, -2.0, 0.4);
  std::vector<Channel> channels = {
      channel(instrument, "range", Quantity::Length, Vector3d::UnitX())};
  channels[0].point_in = station_w;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vector3d beam_w = reflector_w(instrument, nominal, positions[i]) - station_w;
    // A beam has a direction only if the reflector is away from the station.
    if (!(beam_w.norm() > 1.0))
      throw_input_error(instrument, "expected a station away from its measured points");
    const CrossDirections across = cross_directions(nominal, parked.q, beam_w.normalized());
    for (int k = 0; k < 2; ++k) {
      Channel c = channel(instrument, fmt::format("{} of place {}", across.letter[k], i),
                          Quantity::Displacement, across.direction_w[k]);
      c.point_in = station_w;
      c.noise = instrument.noise_rad * beam_w.norm();
      c.resolution = instrument.resolution_rad * beam_w.norm();
      channels.push_back(c);
    }
  }
  SetUp station = set_up(instrument, "station", std::move(channels));
  station.is_zero_unknown = false;  // the range counts from the centre of the station
  station.point_in_sigma = instrument.position_sigma;
  PlanBuilder builder(instrument, nominal, parked.q);
  builder.set_up(station);
  builder.visit(positions, [](int target) {
    return std::vector<int>{0, 2 * target + 1, 2 * target + 2};
  });
  return std::move(builder).finish();
}

// One instrument is moved from station to station, and the whole grid is measured from each. Three
// stations are low and the fourth is high, so that no plane contains all four.
Plan multilateration(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  check(instrument, parked);
  const std::vector<AxisVector> positions = travel_grid(instrument, nominal, parked);
  const Box b = box(instrument, nominal, parked);
  const std::array<Vector3d, 4> stations_w = {
      box_point(b, -1.3, -1.3, -1.3), box_point(b, 1.3, -1.3, -1.3), box_point(b, -1.3, 1.3, -1.3),
      box_point(b, 1.3, 1.3, 1.3)};
  PlanBuilder builder(instrument, nominal, parked.q);
  for (std::size_t k = 0; k < stations_w.size(); ++k) {
    Channel c = channel(instrument, "length", Quantity::Length, Vector3d::UnitX());
    c.point_in = stations_w[k];
    SetUp station = set_up(instrument, fmt::format("station {}", k + 1), {c});
    station.rotation_sigma = 0.0;  // a length has no direction
    station.point_in_sigma = instrument.position_sigma;
    builder.set_up(station);
    builder.visit(positions);
  }
  return std::move(builder).finish();
}

}  // namespace abbe::errors::metrology
