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

constexpr double path_arc = 5.0 * units::deg;  // between the points of a curved path that the plan
                                               // moves through
constexpr double search_arc = 1.0 * units::deg;

int pieces(const Instrument& instrument, const Range& range) {
  const double step = std::abs(range.to - range.from) / std::max(1, instrument.targets - 1);
  return std::max(1, int(std::ceil(step / path_arc)));
}

/// Returns the range without its end if that coincides with its start after whole turns. On one
/// turn the targets are then distinct positions; n targets on k turns are n / gcd(n, k) positions,
/// each read gcd(n, k) times.
Range whole_turn_range(const Instrument& instrument, Range range) {
  const double turns = (range.to - range.from) / (2.0 * pi);
  if (turns > 0.5 && std::abs(turns - std::round(turns)) < 1e-9)
    range.to -= (range.to - range.from) / instrument.targets;
  return range;
}

/// A position of the ball at the tool that the slides maintain while one rotary axis turns.
struct BallPlace {
  Vector3d place_w;
  Vector3d radial_w;  ///< unit, from the axis to the ball; any direction across the axis if the
                      ///< ball is on it
  Range range;
};

/// @param slides  joints that move; empty: all
AxisVector followed(const Instrument& instrument, const Chain& nominal, const AxisVector& q,
                    const Vector3d& place_w, const std::vector<int>& slides = {}) {
  const auto there = slides_for_reflector(instrument, nominal, q, place_w, slides);
  if (!there) refuse(instrument, "expected slides that reach the ball's place, seen too few");
  return *there;
}

Path following(const Instrument& instrument, const Chain& nominal, const ParkedMachine& stand,
               const AxisDirection& rotary, const Vector3d& place_w) {
  return [&instrument, &nominal, &stand, joint = rotary.joint, place_w](double angle) {
    AxisVector q = stand.q;
    q[joint] = angle;
    return followed(instrument, nominal, q, place_w);
  };
}

/// Returns the part of a range over which the slides can follow, the longest if there are several.
Range clip_to_slides(const Instrument& instrument, const Chain& nominal,
                     const AxisDirection& rotary, const Range& range, const Path& path) {
  const double first = range.from - range.overshoot, last = range.to + range.overshoot;
  // The ends are found to one search_arc; the margin is then taken off the part found.
  const int count = std::max(2, int(std::ceil((last - first) / search_arc))) + 1;
  const auto angle = [&](int i) { return first + (last - first) * i / (count - 1); };
  int best_from = 0, best_length = 0, from = 0;
  for (int i = 0; i <= count; ++i) {
    if (i < count && within_travel(nominal, path(angle(i)))) continue;
    if (i - from > best_length) {
      best_length = i - from;
      best_from = from;
    }
    from = i + 1;
  }
  if (best_length == count) return range;
  if (best_length < 2)
    refuse(instrument, fmt::format("expected slides that follow while {} turns, seen a place that "
                                   "they leave at once",
                                   rotary.name));
  const double low = angle(best_from), high = angle(best_from + best_length - 1);
  const double room = instrument.margin * (high - low);
  return {low + room, high - room, 0.5 * room};
}

/// Returns the default position of a ball on a table: the instrument's radius above the workpiece's
/// zero and as far from the axis; level with the waiting tool where the slides do not reach that.
Vector3d place_on_table(const Instrument& instrument, const Chain& nominal,
                        const ParkedMachine& stand, const AxisDirection& rotary,
                        const Vector3d& radial_w) {
  const Vector3d above_w = instrument.radius * nominal.tool_in_workpiece(stand.q).linear().col(2);
  const Vector3d foot_w = on_axis(nominal, stand.q, rotary.joint, above_w);
  const Vector3d place_w = foot_w + instrument.radius * radial_w;
  const auto there = slides_for_reflector(instrument, nominal, stand.q, place_w);
  if (there && within_travel(nominal, *there)) return place_w;
  return on_axis(nominal, stand.q, rotary.joint, reflector_w(instrument, nominal, stand.q)) +
         instrument.radius * radial_w;
}

Vector3d radial(const Chain& nominal, const ParkedMachine& stand, const AxisDirection& rotary) {
  const Vector3d& axis_w = rotary.direction_w;
  const Vector3d standing_w = nominal.tool_in_workpiece(stand.q).linear().col(2);
  const Vector3d upright_w = standing_w - standing_w.dot(axis_w) * axis_w;
  // 0.5: sine of 30 degrees; a tool closer to the axis has no usable direction across it.
  return upright_w.norm() > 0.5 ? upright_w.normalized()
                                : across(nominal, stand.q, axis_w).direction_w[0];
}

bool has_rotary_table(const Chain& nominal, const AxisDirection& rotary) {
  return nominal.joints()[std::size_t(rotary.joint)].side == kinematics::Side::Workpiece;
}

// A head is turned about the position at which the waiting tool holds its ball.
BallPlace ball_place(const Instrument& instrument, const Chain& nominal, const ParkedMachine& stand,
                     const AxisDirection& rotary) {
  BallPlace kept;
  kept.radial_w = radial(nominal, stand, rotary);
  if (instrument.at_w) {
    kept.place_w = *instrument.at_w;
    const Vector3d arm_w = kept.place_w - on_axis(nominal, stand.q, rotary.joint, kept.place_w);
    if (has_rotary_table(nominal, rotary) && arm_w.norm() > 1e-3)
      kept.radial_w = arm_w.normalized();
  } else {
    kept.place_w = has_rotary_table(nominal, rotary)
                       ? place_on_table(instrument, nominal, stand, rotary, kept.radial_w)
                       : reflector_w(instrument, nominal, stand.q);
  }
  const Joint& joint = nominal.joints()[std::size_t(rotary.joint)];
  kept.range = whole_turn_range(
      instrument, clip_to_slides(instrument, nominal, rotary, arc(instrument, joint),
                                 following(instrument, nominal, stand, rotary, kept.place_w)));
  return kept;
}

/// Returns the positions of all rotary axes together at which the slides can hold the ball in
/// place.
std::vector<AxisVector> rotary_grid(const Instrument& instrument, const Chain& nominal,
                                    const ParkedMachine& stand, const Vector3d& place_w) {
  std::vector<GridLine> lines;
  for (const AxisDirection& rotary : stand.rotary) {
    const Range range =
        whole_turn_range(instrument, arc(instrument, nominal.joints()[std::size_t(rotary.joint)]));
    lines.push_back({rotary.joint, targets(range, instrument.targets)});
  }
  std::vector<AxisVector> places;
  for (const AxisVector& turned : grid(instrument, stand.q, lines)) {
    const AxisVector q = followed(instrument, nominal, turned, place_w);
    if (within_travel(nominal, q)) places.push_back(q);
  }
  if (places.size() < 3)
    refuse(instrument, fmt::format("expected at least 3 rotary positions within the travel of the "
                                   "slides, seen {}",
                                   places.size()));
  return places;
}

std::vector<Channel> nest(const Instrument& instrument, const Vector3d& place_w) {
  std::vector<Channel> channels;
  for (int k = 0; k < 3; ++k) {
    channels.push_back(channel(instrument, fmt::format("{} of the ball", char('X' + k)),
                               Quantity::Displacement, Vector3d::Unit(k)));
    channels.back().point_in = place_w;
  }
  return channels;
}

/// Returns a circle about a point by two slides; the others stay where they put the ball at its
/// centre.
Path circle(const Instrument& instrument, const Chain& nominal, const AxisVector& at_centre,
            const Vector3d& centre_w, const std::array<AxisDirection, 2>& pair) {
  const Vector3d& first = pair[0].direction_w;
  const Vector3d& other = pair[1].direction_w;
  const Vector3d second = (other - other.dot(first) * first).normalized();
  return [&instrument, &nominal, at_centre, centre_w, first, second,
          slides = std::vector{pair[0].joint, pair[1].joint}](double angle) {
    return followed(
        instrument, nominal, at_centre,
        centre_w + instrument.radius * (std::cos(angle) * first + std::sin(angle) * second),
        slides);
  };
}

}  // namespace

Plan ball_bar(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 2);
  const Vector3d centre_w =
      instrument.at_w ? *instrument.at_w : reflector_w(instrument, nominal, stand.q);
  const AxisVector at_centre = followed(instrument, nominal, stand.q, centre_w);
  const Range range = whole_turn_range(
      instrument, {instrument.from_rad, instrument.to_rad,
                   0.5 * instrument.margin * (instrument.to_rad - instrument.from_rad)});
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const std::array<AxisDirection, 2>& pair : crossing_slides(instrument, stand)) {
    Channel c = channel(instrument, "length of the bar", Quantity::Length, pair[0].direction_w);
    c.point_in = centre_w;
    SetUp bar = set_up(instrument, fmt::format("{}{} circle", pair[0].name, pair[1].name), {c});
    bar.point_in_sigma = instrument.position_sigma;
    bar.zero_unknown = false;  // its length is calibrated, to the sigma of the scale
    walk.set_up(bar);
    walk.read_both_directions(circle(instrument, nominal, at_centre, centre_w, pair), range,
                              pieces(instrument, range));
  }
  return std::move(walk).finish();
}

Plan ball_bar_rotary(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_rotary(instrument, stand);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const AxisDirection& rotary : stand.rotary) {
    const BallPlace kept = ball_place(instrument, nominal, stand, rotary);
    const std::pair<const char*, Vector3d> ways[] = {
        {"radial", kept.radial_w},
        {"tangential", rotary.direction_w.cross(kept.radial_w)},
        {"axial", rotary.direction_w}};
    for (const auto& [word, bar_w] : ways) {
      Channel c =
          channel(instrument, fmt::format("{} to {}", word, rotary.name), Quantity::Length, bar_w);
      c.point_in = kept.place_w - instrument.radius * bar_w;
      SetUp bar = set_up(instrument, fmt::format("{} {}", rotary.name, word), {c});
      bar.point_of_sigma = bar.point_in_sigma = instrument.position_sigma;
      walk.set_up(bar);
      walk.read_both_directions(following(instrument, nominal, stand, rotary, kept.place_w),
                                kept.range, pieces(instrument, kept.range));
    }
  }
  return std::move(walk).finish();
}

Plan r_test(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_rotary(instrument, stand);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const AxisDirection& rotary : stand.rotary) {
    const BallPlace kept = ball_place(instrument, nominal, stand, rotary);
    SetUp sensors =
        set_up(instrument, fmt::format("{} R-test", rotary.name), nest(instrument, kept.place_w));
    sensors.point_of_sigma = instrument.position_sigma;
    walk.set_up(sensors);
    walk.read_both_directions(following(instrument, nominal, stand, rotary, kept.place_w),
                              kept.range, pieces(instrument, kept.range));
  }
  return std::move(walk).finish();
}

// The control reports its axis positions at contact with the sphere; reversed, that is the
// deviation of the probe from the sphere's centre at the commanded position. The two differ by the
// change of the errors over the deviation itself, below 1e-3 of it.
Plan sphere(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_rotary(instrument, stand);
  // The sphere stands beside the axis nearest to it, otherwise it would not move with that axis.
  const AxisDirection& nearest = *std::min_element(
      stand.rotary.begin(), stand.rotary.end(),
      [](const AxisDirection& a, const AxisDirection& b) { return a.joint < b.joint; });
  const Vector3d place_w = ball_place(instrument, nominal, stand, nearest).place_w;
  PlanBuilder walk(instrument, nominal, stand.q);
  SetUp probing = set_up(instrument, "sphere", nest(instrument, place_w));
  probing.point_of_sigma = instrument.position_sigma;
  walk.set_up(probing);
  walk.visit(rotary_grid(instrument, nominal, stand, place_w));
  return std::move(walk).finish();
}

namespace {

std::vector<AxisVector> travel_grid(const Instrument& instrument, const Chain& nominal,
                                    const ParkedMachine& stand) {
  std::vector<GridLine> lines;
  for (const AxisDirection& slide : stand.slides) {
    const Range range = travel(instrument, nominal.joints()[std::size_t(slide.joint)]);
    lines.push_back({slide.joint, targets(range, instrument.targets)});
  }
  return grid(instrument, stand.q, lines);
}

/// The box that the reflector covers: its centre and half its edges; with two slides the third is
/// across both.
struct Box {
  Vector3d centre_w;
  std::array<Vector3d, 3> half_w;
};

Box box(const Instrument& instrument, const Chain& nominal, const ParkedMachine& stand) {
  Box b{reflector_w(instrument, nominal, stand.q), {}};
  for (std::size_t k = 0; k < 3; ++k) {
    if (k < stand.slides.size()) {
      const AxisDirection& slide = stand.slides[k];
      const Range range = travel(instrument, nominal.joints()[std::size_t(slide.joint)]);
      b.half_w[k] = 0.5 * (range.to - range.from) * slide.direction_w;
    } else {
      b.half_w[k] = b.half_w[0].norm() * b.half_w[0].cross(b.half_w[1]).normalized();
    }
  }
  return b;
}

Vector3d place(const Box& box, double a, double b, double c) {
  return box.centre_w + a * box.half_w[0] + b * box.half_w[1] + c * box.half_w[2];
}

void check(const Instrument& instrument, const ParkedMachine& stand) {
  expect_slides(instrument, stand, 2);
  if (stand.slides.size() > 3)
    refuse(instrument, fmt::format("expected at most 3 slides, seen {}", stand.slides.size()));
}

}  // namespace

// The two angles of a tracker are modelled as displacements across its beam, so that every position
// has two channels of its own, with the noise of the angle times the range; the range has one
// channel.
Plan tracker(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  check(instrument, stand);
  const std::vector<AxisVector> places = travel_grid(instrument, nominal, stand);
  const Vector3d station_w =
      instrument.at_w ? *instrument.at_w : place(box(instrument, nominal, stand), -2.5, -2.0, 0.4);
  std::vector<Channel> channels = {
      channel(instrument, "range", Quantity::Length, Vector3d::UnitX())};
  channels[0].point_in = station_w;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vector3d beam_w = reflector_w(instrument, nominal, places[i]) - station_w;
    // The reflector must be away from the station: its beam needs a direction.
    if (!(beam_w.norm() > 1.0))
      refuse(instrument, "expected a station off the places that it looks at");
    const Across across = metrology::across(nominal, stand.q, beam_w.normalized());
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
  station.zero_unknown = false;  // the range counts from the centre of the station
  station.point_in_sigma = instrument.position_sigma;
  PlanBuilder walk(instrument, nominal, stand.q);
  walk.set_up(station);
  walk.visit(places, [](int target) {
    return std::vector<int>{0, 2 * target + 1, 2 * target + 2};
  });
  return std::move(walk).finish();
}

// One instrument is moved from station to station and the whole grid is measured from each; three
// stations are low and the fourth is high, so that no plane contains all four.
Plan multilateration(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  check(instrument, stand);
  const std::vector<AxisVector> places = travel_grid(instrument, nominal, stand);
  const Box b = box(instrument, nominal, stand);
  const std::array<Vector3d, 4> stations_w = {place(b, -1.3, -1.3, -1.3), place(b, 1.3, -1.3, -1.3),
                                              place(b, -1.3, 1.3, -1.3), place(b, 1.3, 1.3, 1.3)};
  PlanBuilder walk(instrument, nominal, stand.q);
  for (std::size_t k = 0; k < stations_w.size(); ++k) {
    Channel c = channel(instrument, "length", Quantity::Length, Vector3d::UnitX());
    c.point_in = stations_w[k];
    SetUp station = set_up(instrument, fmt::format("station {}", k + 1), {c});
    station.rotation_sigma = 0.0;  // a length has no direction
    station.point_in_sigma = instrument.position_sigma;
    walk.set_up(station);
    walk.visit(places);
  }
  return std::move(walk).finish();
}

}  // namespace abbe::errors::metrology
