#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "errors/metrology/plans.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;

constexpr double finest_arc = 5.0 * units::deg;  // between places that a curved path is moved over
constexpr double shortest_arc = 1.0 * units::deg;

int pieces(const Instrument& instrument, const Range& range) {
  const double step = std::abs(range.to - range.from) / std::max(1, instrument.targets - 1);
  return std::max(1, int(std::ceil(step / finest_arc)));
}

/// A range whose end is its first place again, after whole turns, without that end. Of one turn the
/// targets are as many places; of several they follow each other evenly, and n of them on k turns
/// are n / gcd(n, k) places, each read gcd(n, k) times.
Range once_round(const Instrument& instrument, Range range) {
  const double turns = (range.to - range.from) / (2.0 * pi);
  if (turns > 0.5 && std::abs(turns - std::round(turns)) < 1e-9)
    range.to -= (range.to - range.from) / instrument.targets;
  return range;
}

/// A place of the ball at the tool that the slides keep while one rotary axis turns.
struct Kept {
  Vector3d place_w;
  Vector3d radial_w;  ///< unit, from the axis to the place; across the axis where it is on it
  Range range;
};

/// @param slides  that move; empty: all
AxisVector followed(const Instrument& instrument, const Chain& nominal, const AxisVector& q,
                    const Vector3d& place_w, const std::vector<int>& slides = {}) {
  const auto there = slides_for_reflector(instrument, nominal, q, place_w, slides);
  if (!there) refuse(instrument, "expected slides that reach the ball's place, seen too few");
  return *there;
}

Path following(const Instrument& instrument, const Chain& nominal, const Stand& stand,
               const StandAxis& rotary, const Vector3d& place_w) {
  return [&instrument, &nominal, &stand, joint = rotary.joint, place_w](double angle) {
    AxisVector q = stand.q;
    q[joint] = angle;
    return followed(instrument, nominal, q, place_w);
  };
}

/// Part of a range over which the slides can follow, about `here` if they can there.
Range cut_to_slides(const Instrument& instrument, const Chain& nominal, const StandAxis& rotary,
                    const Range& range, const Path& path) {
  const double first = range.from - range.overshoot, last = range.to + range.overshoot;
  const int count = std::max(2, int(std::ceil((last - first) / shortest_arc))) + 1;
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

/// Where a ball stands on a table if nobody says: the instrument's radius above the workpiece's
/// zero and as far from the axis; where the slides do not reach that, level with the waiting tool.
Vector3d on_table(const Instrument& instrument, const Chain& nominal, const Stand& stand,
                  const StandAxis& rotary, const Vector3d& radial_w) {
  const Vector3d above_w = instrument.radius * nominal.tool_in_workpiece(stand.q).linear().col(2);
  const Vector3d foot_w = on_axis(nominal, stand.q, rotary.joint, above_w);
  const Vector3d place_w = foot_w + instrument.radius * radial_w;
  const auto there = slides_for_reflector(instrument, nominal, stand.q, place_w);
  if (there && within_travel(nominal, *there)) return place_w;
  return on_axis(nominal, stand.q, rotary.joint, reflector_w(instrument, nominal, stand.q)) +
         instrument.radius * radial_w;
}

Vector3d radial(const Chain& nominal, const Stand& stand, const StandAxis& rotary) {
  const Vector3d& axis_w = rotary.direction_w;
  const Vector3d standing_w = nominal.tool_in_workpiece(stand.q).linear().col(2);
  const Vector3d upright_w = standing_w - standing_w.dot(axis_w) * axis_w;
  return upright_w.norm() > 0.5 ? upright_w.normalized()
                                : across(nominal, stand.q, axis_w).direction_w[0];
}

bool turns_table(const Chain& nominal, const StandAxis& rotary) {
  return nominal.joints()[std::size_t(rotary.joint)].side == kinematics::Side::Workpiece;
}

// A head is turned about wherever the waiting tool holds its ball.
Kept keep(const Instrument& instrument, const Chain& nominal, const Stand& stand,
          const StandAxis& rotary) {
  Kept kept;
  kept.radial_w = radial(nominal, stand, rotary);
  if (instrument.at_w) {
    kept.place_w = *instrument.at_w;
    const Vector3d arm_w = kept.place_w - on_axis(nominal, stand.q, rotary.joint, kept.place_w);
    if (turns_table(nominal, rotary) && arm_w.norm() > 1e-3) kept.radial_w = arm_w.normalized();
  } else {
    kept.place_w = turns_table(nominal, rotary)
                       ? on_table(instrument, nominal, stand, rotary, kept.radial_w)
                       : reflector_w(instrument, nominal, stand.q);
  }
  const Joint& joint = nominal.joints()[std::size_t(rotary.joint)];
  kept.range = once_round(
      instrument, cut_to_slides(instrument, nominal, rotary, arc(instrument, joint),
                                following(instrument, nominal, stand, rotary, kept.place_w)));
  return kept;
}

/// Positions of all rotary axes together at which the slides can hold the ball at its place.
std::vector<AxisVector> rotary_grid(const Instrument& instrument, const Chain& nominal,
                                    const Stand& stand, const Vector3d& place_w) {
  std::vector<GridLine> lines;
  for (const StandAxis& rotary : stand.rotary) {
    const Range range =
        once_round(instrument, arc(instrument, nominal.joints()[std::size_t(rotary.joint)]));
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

}  // namespace

namespace {

/// A circle about a place by two slides; the others stay where they put the ball at its centre.
Path circle(const Instrument& instrument, const Chain& nominal, const AxisVector& at_centre,
            const Vector3d& centre_w, const std::array<StandAxis, 2>& pair) {
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
  const Stand stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 2);
  const Vector3d centre_w =
      instrument.at_w ? *instrument.at_w : reflector_w(instrument, nominal, stand.q);
  const AxisVector at_centre = followed(instrument, nominal, stand.q, centre_w);
  const Range range =
      once_round(instrument, {instrument.from_rad, instrument.to_rad,
                              0.5 * instrument.margin * (instrument.to_rad - instrument.from_rad)});
  Walk walk(instrument, nominal, stand.q);
  for (const std::array<StandAxis, 2>& pair : pairs_across(instrument, stand)) {
    Channel c = channel(instrument, "length of the bar", Quantity::Length, pair[0].direction_w);
    c.point_in = centre_w;
    SetUp bar = set_up(instrument, fmt::format("{}{} circle", pair[0].name, pair[1].name), {c});
    bar.point_in_sigma = instrument.position_sigma;
    bar.zero_unknown = false;  // its length is calibrated, to the scale's sigma
    walk.set_up(bar);
    walk.back_and_forth(circle(instrument, nominal, at_centre, centre_w, pair), range,
                        pieces(instrument, range));
  }
  return std::move(walk).finish();
}

Plan ball_bar_rotary(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_rotary(instrument, stand);
  Walk walk(instrument, nominal, stand.q);
  for (const StandAxis& rotary : stand.rotary) {
    const Kept kept = keep(instrument, nominal, stand, rotary);
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
      walk.back_and_forth(following(instrument, nominal, stand, rotary, kept.place_w), kept.range,
                          pieces(instrument, kept.range));
    }
  }
  return std::move(walk).finish();
}

Plan r_test(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_rotary(instrument, stand);
  Walk walk(instrument, nominal, stand.q);
  for (const StandAxis& rotary : stand.rotary) {
    const Kept kept = keep(instrument, nominal, stand, rotary);
    SetUp sensors =
        set_up(instrument, fmt::format("{} R-test", rotary.name), nest(instrument, kept.place_w));
    sensors.point_of_sigma = instrument.position_sigma;
    walk.set_up(sensors);
    walk.back_and_forth(following(instrument, nominal, stand, rotary, kept.place_w), kept.range,
                        pieces(instrument, kept.range));
  }
  return std::move(walk).finish();
}

// The control reports where its axes stood when the probe met the sphere; turned round, that is the
// deviation of the probe from the sphere's centre where the machine is commanded to be on it. The
// two differ by the change of the errors over the deviation itself, below 1e-3 of it.
Plan sphere(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_rotary(instrument, stand);
  // It stands beside the axis nearest to it, or it would not feel that axis turn.
  const StandAxis& nearest =
      *std::min_element(stand.rotary.begin(), stand.rotary.end(),
                        [](const StandAxis& a, const StandAxis& b) { return a.joint < b.joint; });
  const Vector3d place_w = keep(instrument, nominal, stand, nearest).place_w;
  Walk walk(instrument, nominal, stand.q);
  SetUp probing = set_up(instrument, "sphere", nest(instrument, place_w));
  probing.point_of_sigma = instrument.position_sigma;
  walk.set_up(probing);
  walk.visit(rotary_grid(instrument, nominal, stand, place_w));
  return std::move(walk).finish();
}

}  // namespace abbe::errors::metrology
