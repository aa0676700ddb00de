#include "errors/metrology/plans.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "errors/metrology/instrument.h"
#include "kinematics/jacobian.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using kinematics::Chain;
using kinematics::Motion;

/// An instrument kind: its name, the function that plans it, and the types of axis that it can
/// measure.
struct Entry {
  Kind kind;
  const char* word;
  Plan (*plan)(const Instrument&, const Chain&);
  bool slides;
  bool rotary;
  bool spindles;
};
constexpr std::array<Entry, 17> entries = {{
    {Kind::Laser, "laser", laser, true, false, false},
    {Kind::Straightness, "straightness", straightness, true, false, false},
    {Kind::AngleOptics, "angle_optics", angle_optics, true, true, false},
    {Kind::Square, "square", square, true, false, false},
    {Kind::Diagonals, "diagonals", diagonals, true, false, false},
    {Kind::StepDiagonal, "step_diagonal", step_diagonal, true, false, false},
    {Kind::BallBar, "ball_bar", ball_bar, true, false, false},
    {Kind::BallBarRotary, "ball_bar_rotary", ball_bar_rotary, false, true, false},
    {Kind::RTest, "r_test", r_test, false, true, false},
    {Kind::Sphere, "sphere", sphere, false, true, false},
    {Kind::Tracker, "tracker", tracker, true, false, false},
    {Kind::Multilateration, "multilateration", multilateration, true, false, false},
    {Kind::Level, "level", level, true, false, false},
    {Kind::RollLines, "roll_lines", roll_lines, true, false, false},
    {Kind::Spindle, "spindle", spindle, false, false, true},
    {Kind::Drift, "drift", drift, true, true, true},
    {Kind::Temperature, "temperature", temperature, true, true, true},
}};

const Entry& entry_of(Kind kind) { return entries[std::size_t(kind)]; }

// The conditions are written so that NaN fails them.
void check_numbers(const Instrument& i) {
  const auto expect = [&](bool holds, const char* what, double seen) {
    if (!holds) refuse(i, fmt::format("expected {}, seen {}", what, seen));
  };
  const std::pair<const char*, double> not_negative[] = {
      {"a noise of 0 or more", i.noise},
      {"a noise of angles of 0 or more", i.noise_rad},
      {"a resolution of 0 or more", i.resolution},
      {"a resolution of angles of 0 or more", i.resolution_rad},
      {"a sigma of rotation of 0 or more", i.rotation_sigma},
      {"a sigma of position of 0 or more", i.position_sigma},
      {"a sigma of scale of 0 or more", i.scale_sigma},
      {"a sigma of drift of 0 or more", i.drift_sigma},
      {"a duration of 0 s or more", i.duration_s},
      {"a dwell of 0 s or more", i.dwell_s},
      {"a time of set-up of 0 s or more", i.set_up_s},
      {"a spindle speed of 0 or more", i.spindle_speed}};
  // 1e12 excludes infinity and numbers whose squares would overflow.
  for (const auto& [what, seen] : not_negative) expect(seen >= 0.0 && seen < 1e12, what, seen);
  const std::pair<const char*, double> positive[] = {{"a radius above 0 mm", i.radius},
                                                     {"a lever above 0 mm", i.lever},
                                                     {"an interval above 0 s", i.interval_s},
                                                     {"a speed above 0 mm/s", i.speed}};
  for (const auto& [what, seen] : positive) expect(seen > 0.0 && seen < 1e12, what, seen);
  expect(i.runs >= 1 && i.runs <= 10000, "1 to 10000 runs", i.runs);
  expect(i.targets >= 2 && i.targets <= 100000, "2 to 100000 targets", i.targets);
  // Below 0.45 of the spacing targets keep their order.
  expect(i.scatter >= 0.0 && i.scatter < 0.45, "a scatter of targets of at least 0 and below 0.45",
         i.scatter);
  expect(i.margin > 0.0 && i.margin < 0.4, "a margin above 0 and below 0.4 of the travel",
         i.margin);
  expect(std::isfinite(i.from_rad) && i.to_rad - i.from_rad > 0.0 &&
             i.to_rad - i.from_rad <= 200.0 * pi,
         "an arc that rises, of at most 100 turns, in deg", (i.to_rad - i.from_rad) / units::deg);
  expect(i.duration_s / i.interval_s <= 1e5, "at most 100000 intervals",
         i.duration_s / i.interval_s);
  expect(std::isfinite(i.start_s), "a finite start", i.start_s);
  expect(i.reflector_t.allFinite(), "a finite place of the reflector", i.reflector_t.norm());
  if (i.at_w) expect(i.at_w->allFinite(), "a finite place in the workpiece", i.at_w->norm());
  expect(std::abs(i.up_b.norm() - 1.0) <= 1e-12, "a unit direction up, of length", i.up_b.norm());
}

void check_axes(const Instrument& instrument, const Chain& nominal) {
  const Entry& entry = entry_of(instrument.kind);
  for (const char axis : instrument.axes) {
    const auto joint = nominal.find(axis);
    if (!joint) refuse(instrument, fmt::format("expected an axis of the machine, seen {}", axis));
    const Motion motion = nominal.joints()[std::size_t(*joint)].motion;
    const bool turns_work = axis == 'S' && motion == Motion::Rotary;
    const bool may = motion == Motion::Spindle || turns_work ? entry.spindles
                     : motion == Motion::Rotary              ? entry.rotary
                                                             : entry.slides;
    if (!may) refuse(instrument, fmt::format("expected axes that it can measure, seen {}", axis));
  }
}

}  // namespace

std::string to_string(Kind kind) { return entry_of(kind).word; }

std::optional<Kind> kind_of(std::string_view word) {
  for (const Entry& entry : entries)
    if (word == entry.word) return entry.kind;
  return std::nullopt;
}

std::span<const Kind> all_kinds() {
  static constexpr auto kinds = [] {
    std::array<Kind, entries.size()> result{};
    for (std::size_t i = 0; i < entries.size(); ++i) result[i] = entries[i].kind;
    return result;
  }();
  return kinds;
}

Plan plan(const Instrument& instrument, const Chain& nominal) {
  check_numbers(instrument);
  check_axes(instrument, nominal);
  return entry_of(instrument.kind).plan(instrument, nominal);
}

Channel channel(const Instrument& instrument, const std::string& name, Quantity quantity,
                const Eigen::Vector3d& direction_w) {
  Channel c;
  c.name = name;
  c.quantity = quantity;
  c.point_of = instrument.reflector_t;
  c.direction_in = direction_w;
  c.noise = c.is_angle() ? instrument.noise_rad : instrument.noise;
  c.resolution = c.is_angle() ? instrument.resolution_rad : instrument.resolution;
  return c;
}

SetUp set_up(const Instrument& instrument, const std::string& name, std::vector<Channel> channels) {
  SetUp result;
  result.name = name;
  const bool has_direction = std::any_of(channels.begin(), channels.end(), [](const Channel& c) {
    return c.quantity != Quantity::Length;
  });
  result.channels = std::move(channels);
  result.rotation_sigma = has_direction ? instrument.rotation_sigma : 0.0;
  result.scale_sigma = instrument.scale_sigma;
  result.drift_sigma = instrument.drift_sigma;
  return result;
}

Path along(const kinematics::AxisVector& q, int joint) {
  return [q, joint](double position) {
    kinematics::AxisVector there = q;
    there[joint] = position;
    return there;
  };
}

namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Joint;

const Joint& joint_of(const AxisDirection& axis, const Chain& nominal) {
  return nominal.joints()[std::size_t(axis.joint)];
}

AxisVector middle(const ParkedMachine& stand, const AxisDirection& slide, const Range& range) {
  AxisVector q = stand.q;
  q[slide.joint] = 0.5 * (range.from + range.to);
  return q;
}

/// Returns the channel for the straightness of one slide in the direction of another.
Channel straightness_across(const Instrument& instrument, const Chain& nominal,
                            const ParkedMachine& stand, const AxisDirection& line,
                            const AxisDirection& other) {
  const double lean = line.direction_w.dot(other.direction_w);
  Channel c =
      channel(instrument, fmt::format("{} along {}", other.name, line.name), Quantity::Displacement,
              (other.direction_w - lean * line.direction_w).normalized());
  const Range range = travel(instrument, joint_of(line, nominal));
  c.point_in = reflector_w(instrument, nominal, middle(stand, line, range));
  return c;
}

}  // namespace

// The counter shows the axis position, so p_in is the position of the reflector at its zero.
Plan laser(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const AxisDirection& slide : stand.slides) {
    Channel c = channel(instrument, fmt::format("along {}", slide.name), Quantity::Displacement,
                        slide.direction_w);
    c.point_in =
        reflector_w(instrument, nominal, stand.q) - stand.q[slide.joint] * slide.direction_w;
    walk.set_up(set_up(instrument, fmt::format("{} positioning", slide.name), {c}));
    walk.read_both_directions(along(stand.q, slide.joint),
                              travel(instrument, joint_of(slide, nominal)));
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

// The optics are turned for the second direction, which is a separate set-up.
Plan straightness(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const AxisDirection& slide : stand.slides) {
    const Range range = travel(instrument, joint_of(slide, nominal));
    const Across across = metrology::across(nominal, stand.q, slide.direction_w);
    for (int k = 0; k < 2; ++k) {
      Channel c = channel(instrument, fmt::format("{} along {}", across.letter[k], slide.name),
                          Quantity::Displacement, across.direction_w[k]);
      c.point_in = reflector_w(instrument, nominal, middle(stand, slide, range));
      walk.set_up(set_up(instrument,
                         fmt::format("{} straightness in {}", slide.name, across.letter[k]), {c}));
      walk.read_both_directions(along(stand.q, slide.joint), range);
      walk.move(stand.q);
    }
  }
  return std::move(walk).finish();
}

Plan angle_optics(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  if (stand.rotary.empty()) expect_slides(instrument, stand, 1);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const AxisDirection& slide : stand.slides) {
    const Across across = metrology::across(nominal, stand.q, slide.direction_w);
    std::vector<Channel> channels;
    for (int k = 0; k < 2; ++k)
      channels.push_back(
          channel(instrument,
                  fmt::format("about {} along {}", char(across.letter[k] - 'X' + 'A'), slide.name),
                  Quantity::Angle, across.direction_w[k]));
    walk.set_up(set_up(instrument, fmt::format("{} pitch and yaw", slide.name), channels));
    walk.read_both_directions(along(stand.q, slide.joint),
                              travel(instrument, joint_of(slide, nominal)));
    walk.move(stand.q);
  }
  for (const AxisDirection& rotary : stand.rotary) {
    const Channel c = channel(instrument, fmt::format("about {}", rotary.name), Quantity::Angle,
                              rotary.direction_w);
    walk.set_up(set_up(instrument, fmt::format("{} positions", rotary.name), {c}));
    walk.read_both_directions(along(stand.q, rotary.joint),
                              arc(instrument, joint_of(rotary, nominal)));
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

// One artefact serves both lines, so its position and rotation are common to the two channels, and
// only the angle between the lines remains as the machine's.
Plan square(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 2);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const std::array<AxisDirection, 2>& pair : crossing_slides(instrument, stand)) {
    std::vector<Channel> channels;
    for (std::size_t k = 0; k < 2; ++k)
      channels.push_back(straightness_across(instrument, nominal, stand, pair[k], pair[1 - k]));
    walk.set_up(
        set_up(instrument, fmt::format("{}{} square", pair[0].name, pair[1].name), channels));
    for (std::size_t k = 0; k < 2; ++k) {
      walk.read_both_directions(along(stand.q, pair[k].joint),
                                travel(instrument, joint_of(pair[k], nominal)), 1, {int(k)});
      walk.move(stand.q);
    }
  }
  return std::move(walk).finish();
}

// A level stands on the carriage and refers to the bed by gravity; it cannot measure a rotation
// about the plumb line.
Plan level(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  PlanBuilder walk(instrument, nominal, stand.q);
  int plumb = 0;
  instrument.up_b.cwiseAbs().maxCoeff(&plumb);
  for (const AxisDirection& slide : stand.slides) {
    const bool primed = joint_of(slide, nominal).side == kinematics::Side::Workpiece;
    std::vector<Channel> channels;
    for (int k = 0; k < 3; ++k) {
      if (k == plumb) continue;
      const Vector3d level_b =
          Vector3d::Unit(k) - Vector3d::Unit(k).dot(instrument.up_b) * instrument.up_b;
      channels.push_back(channel(instrument,
                                 fmt::format("about {} along {}", char('A' + k), slide.name),
                                 Quantity::Angle, level_b.normalized()));
      channels.back().of = primed ? Body::Workpiece : Body::Tool;
      channels.back().in = Body::Bed;
    }
    walk.set_up(set_up(instrument, fmt::format("{} level", slide.name), channels));
    walk.read_both_directions(along(stand.q, slide.joint),
                              travel(instrument, joint_of(slide, nominal)));
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

// Both lines are read against one flat straightedge: its rotation is common to both, so that their
// difference is the roll.
Plan roll_lines(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const AxisDirection& slide : stand.slides) {
    const Range range = travel(instrument, joint_of(slide, nominal));
    const AxisVector q = middle(stand, slide, range);
    const Across across = metrology::across(nominal, stand.q, slide.direction_w);
    const Vector3d arm_w = 0.5 * instrument.lever * across.direction_w[0];
    const kinematics::Pose T_wt = nominal.tool_in_workpiece(q);
    std::vector<Channel> channels;
    for (const double side : {-1.0, 1.0}) {
      Channel c = channel(instrument,
                          fmt::format("{} along {} at {}{}", across.letter[1], slide.name,
                                      side < 0.0 ? '-' : '+', across.letter[0]),
                          Quantity::Displacement, across.direction_w[1]);
      c.point_of += T_wt.linear().transpose() * (side * arm_w);
      c.point_in = T_wt * c.point_of;
      channels.push_back(c);
    }
    walk.set_up(set_up(instrument, fmt::format("{} roll lines", slide.name), channels));
    walk.read_both_directions(along(stand.q, slide.joint), range);
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

namespace {

/// A diagonal from one corner of the travel to the opposite one; its last axis moves upwards.
struct Diagonal {
  std::string name;        ///< "+X -Y +Z"
  std::vector<int> joint;  ///< of its axes, by letter
  AxisVector from;
  AxisVector to;
  AxisVector overshoot;  ///< on every axis, in the direction of the diagonal
};

/// Returns all diagonals of the box of some axes: half as many as it has corners.
std::vector<Diagonal> volume_diagonals(const Instrument& instrument, const Chain& nominal,
                                       const AxisVector& q,
                                       const std::vector<AxisDirection>& axes) {
  std::vector<Diagonal> result;
  const int count = int(axes.size());
  for (int signs = 0; signs < 1 << (count - 1); ++signs) {
    Diagonal d{"", {}, q, q, AxisVector::Zero(q.size())};
    for (int k = 0; k < count; ++k) {
      const AxisDirection& axis = axes[std::size_t(k)];
      const Range range = travel(instrument, nominal.joints()[std::size_t(axis.joint)]);
      const bool down = signs >> k & 1;
      d.name += fmt::format("{}{}{}", k == 0 ? "" : " ", down ? '-' : '+', axis.name);
      d.joint.push_back(axis.joint);
      d.from[axis.joint] = down ? range.to : range.from;
      d.to[axis.joint] = down ? range.from : range.to;
      d.overshoot[axis.joint] = down ? -range.overshoot : range.overshoot;
    }
    result.push_back(d);
  }
  return result;
}

/// Returns the channel along a diagonal; it counts from the reflector's position at the start.
Channel along_diagonal(const Instrument& instrument, const Chain& nominal, const Diagonal& d,
                       Quantity quantity) {
  const Vector3d start_w = reflector_w(instrument, nominal, d.from);
  const Vector3d direction_w = (reflector_w(instrument, nominal, d.to) - start_w).normalized();
  Channel c = channel(instrument, "along " + d.name, quantity, direction_w);
  c.point_in = start_w;
  return c;
}

void check_slides(const Instrument& instrument, const ParkedMachine& stand, std::size_t count) {
  expect_slides(instrument, stand, int(count));
  if (stand.slides.size() > 3)
    refuse(instrument, fmt::format("expected at most 3 slides, seen {}", stand.slides.size()));
  for (std::size_t a = 0; a < stand.slides.size(); ++a)
    for (std::size_t b = a + 1; b < stand.slides.size(); ++b)
      if (!cross(stand.slides[a], stand.slides[b]))
        refuse(instrument, fmt::format("expected slides across each other, seen {} along {}",
                                       stand.slides[a].name, stand.slides[b].name));
}

}  // namespace

Plan diagonals(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  check_slides(instrument, stand, 2);
  std::vector<Diagonal> list;
  const auto add = [&](const std::string& kind, const std::vector<AxisDirection>& axes) {
    for (Diagonal& d : volume_diagonals(instrument, nominal, stand.q, axes)) {
      d.name = kind + " diagonal " + d.name;
      list.push_back(d);
    }
  };
  const std::vector<AxisDirection>& s = stand.slides;
  if (s.size() == 3) add("body", s);
  for (std::size_t a = 0; a < s.size(); ++a)
    for (std::size_t b = a + 1; b < s.size(); ++b) add("face", {s[a], s[b]});

  PlanBuilder walk(instrument, nominal, stand.q);
  for (const Diagonal& d : list) {
    walk.set_up(set_up(instrument, d.name,
                       {along_diagonal(instrument, nominal, d, Quantity::Displacement)}));
    const double overshoot = d.overshoot.cwiseAbs().sum() / (d.to - d.from).cwiseAbs().sum();
    walk.read_both_directions(
        [&](double part) { return AxisVector(d.from + part * (d.to - d.from)); },
        {0.0, 1.0, overshoot});
  }
  walk.move(stand.q);
  return std::move(walk).finish();
}

// Reading 0 of a run is at the start; reading 3 k + leg is after leg X (1), Y (2) or Z (3) of step
// k. Every leg follows the diagonal's direction of its axis, so that no axis reverses within a run.
Plan step_diagonal(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  check_slides(instrument, stand, 3);
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const Diagonal& d : volume_diagonals(instrument, nominal, stand.q, stand.slides)) {
    Channel c = along_diagonal(instrument, nominal, d, Quantity::Mirror);
    c.normal_of = nominal.tool_in_workpiece(d.from).linear().transpose() * c.direction_in;
    SetUp optics = set_up(instrument, "step diagonal " + d.name, {c});
    optics.normal_sigma = instrument.rotation_sigma;
    walk.set_up(optics);
    const auto read = [&](int run, int target) {
      walk.wait(instrument.dwell_s);
      walk.read(run, target);
    };
    for (int run = 0; run < instrument.runs; ++run) {
      walk.move(d.from - d.overshoot);
      walk.move(d.from);
      read(run, 0);
      for (int step = 1; step <= instrument.targets; ++step) {
        for (int leg = 0; leg < 3; ++leg) {
          const int joint = d.joint[std::size_t(leg)];
          AxisVector q = walk.q();
          q[joint] = d.from[joint] + (d.to[joint] - d.from[joint]) * step / instrument.targets;
          walk.move(q);
          read(run, 3 * (step - 1) + leg + 1);
        }
      }
    }
  }
  walk.move(stand.q);
  return std::move(walk).finish();
}

namespace {

/// A spindle with its axis in the workpiece and the side that carries the artefact.
struct Turning {
  AxisDirection axis;
  bool carries_tool = true;
};

std::vector<Turning> spindles(const Instrument& instrument, const Chain& nominal,
                              const AxisVector& q) {
  std::vector<Turning> result;
  for (int j = 0; j < nominal.size(); ++j) {
    const kinematics::Joint& joint = nominal.joints()[std::size_t(j)];
    const bool carries_tool = joint.motion == Motion::Spindle;
    if (!carries_tool && joint.name != 'S') continue;
    const std::vector<char>& axes = instrument.axes;
    if (!axes.empty() && std::find(axes.begin(), axes.end(), joint.name) == axes.end()) continue;
    const Vector3d direction_w =
        carries_tool ? Vector3d(nominal.tool_in_workpiece(q).linear().col(2))
                     : Vector3d(kinematics::axis_jacobian(nominal, q).col(j).tail<3>());
    result.push_back({{j, joint.name, direction_w.normalized()}, carries_tool});
  }
  return result;
}

/// Returns a channel of the artefact's ball, with its sensors on the side that does not turn.
Channel sensor(const Instrument& instrument, const Turning& spindle, const kinematics::Pose& T_wt,
               const Vector3d& ball_w) {
  Channel c = channel(instrument, "", Quantity::Displacement, Vector3d::UnitX());
  const Vector3d ball_t = T_wt.inverse() * ball_w;
  c.of = spindle.carries_tool ? Body::Tool : Body::Workpiece;
  c.in = spindle.carries_tool ? Body::Workpiece : Body::Tool;
  c.point_of = spindle.carries_tool ? ball_t : ball_w;
  c.point_in = spindle.carries_tool ? ball_w : ball_t;
  return c;
}

/// Returns the set-up of two balls on the spindle axis: X1 and Y1 at the first, X2 and Y2 a lever
/// further on, Z at the first.
SetUp artefact(const Instrument& instrument, const Chain& nominal, const AxisVector& q,
               const Turning& spindle) {
  const kinematics::Pose T_wt = nominal.tool_in_workpiece(q);
  const Vector3d& axis_w = spindle.axis.direction_w;
  const Vector3d tip_w = reflector_w(instrument, nominal, q);
  const Vector3d first_w =
      spindle.carries_tool ? tip_w : on_axis(nominal, q, spindle.axis.joint, tip_w);
  const Across across = metrology::across(nominal, q, axis_w);
  std::vector<Channel> channels;
  const auto add = [&](const std::string& name, const Vector3d& ball_w, const Vector3d& sees_w) {
    Channel c = sensor(instrument, spindle, T_wt, ball_w);
    c.name = name;
    c.direction_in = spindle.carries_tool ? sees_w : T_wt.linear().transpose() * sees_w;
    channels.push_back(c);
  };
  for (int ball = 0; ball < 2; ++ball)
    for (int k = 0; k < 2; ++k)
      add(fmt::format("{}{}", across.letter[k], ball + 1),
          first_w + ball * instrument.lever * axis_w, across.direction_w[k]);
  add("along the spindle", first_w, axis_w);

  SetUp result =
      set_up(instrument, fmt::format("spindle {}", spindle.axis.name), std::move(channels));
  // On a turning workpiece the position of the ball itself rotates.
  (spindle.carries_tool ? result.eccentricity_sigma : result.point_of_sigma) =
      instrument.position_sigma;
  return result;
}

int readings_over_time(const Instrument& instrument) {
  // 1e-9: a duration that is a whole number of intervals includes its end in spite of rounding.
  return int(std::floor(instrument.duration_s / instrument.interval_s + 1e-9)) + 1;
}

}  // namespace

Plan spindle(const Instrument& instrument, const Chain& nominal) {
  if (!(instrument.spindle_speed > 0.0))
    refuse(instrument, fmt::format("expected a spindle speed above 0, seen {} rpm",
                                   instrument.spindle_speed / units::rpm));
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  const std::vector<Turning> list = spindles(instrument, nominal, stand.q);
  if (list.empty()) refuse(instrument, "expected a spindle to measure, seen none");
  PlanBuilder walk(instrument, nominal, stand.q);
  for (const Turning& turning : list) {
    walk.set_up(artefact(instrument, nominal, stand.q, turning));
    for (int run = 0; run < instrument.runs; ++run) {
      for (int i = 0; i < instrument.targets; ++i) {
        walk.spin(turning.axis.joint, 2.0 * pi * (run + double(i) / instrument.targets));
        walk.read(run, i);
      }
    }
    walk.spin(turning.axis.joint, 2.0 * pi * instrument.runs);
    walk.stop_spindle(turning.axis.joint);
  }
  return std::move(walk).finish();
}

// The machine is at rest, its spindle turning if commanded; the sensors are read at always the same
// angle.
Plan drift(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  AxisVector q = stand.q;
  if (instrument.at_w) {
    const auto there = slides_for_reflector(instrument, nominal, q, *instrument.at_w);
    if (!there) refuse(instrument, "expected a place that the slides reach");
    q = *there;
  }
  const Vector3d place_w = reflector_w(instrument, nominal, q);
  const Eigen::Matrix3d R_wb = nominal.workpiece_in_bed(q).linear().transpose();
  std::vector<Channel> channels;
  for (int k = 0; k < 3; ++k) {
    channels.push_back(
        channel(instrument, std::string(1, char('X' + k)), Quantity::Displacement, R_wb.col(k)));
    channels.back().point_in = place_w;
  }
  const Across across = metrology::across(nominal, q, nominal.tool_in_workpiece(q).linear().col(2));
  for (int k = 0; k < 2; ++k)
    channels.push_back(channel(instrument, std::string(1, char(across.letter[k] - 'X' + 'A')),
                               Quantity::Angle, across.direction_w[k]));
  PlanBuilder walk(instrument, nominal, stand.q);
  walk.set_up(set_up(instrument, "drift", channels));
  walk.move(q);
  if (instrument.spindle_speed > 0.0) walk.run_spindle();
  for (int i = 0; i < readings_over_time(instrument); ++i) {
    if (i > 0) walk.wait(instrument.interval_s);
    walk.read(0, i);
  }
  return std::move(walk).finish();
}

Plan temperature(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine stand = metrology::stand(instrument, nominal);
  PlanBuilder walk(instrument, nominal, stand.q);
  SetUp log;
  log.name = "temperatures";
  log.zero_unknown = false;
  walk.set_up(log);
  for (int i = 0; i < readings_over_time(instrument); ++i) {
    if (i > 0) walk.wait(instrument.interval_s);
    walk.read(0, i);
  }
  return std::move(walk).finish();
}

}  // namespace abbe::errors::metrology
