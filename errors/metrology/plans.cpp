#include "errors/metrology/plans.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "errors/metrology/instrument.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using kinematics::Chain;
using kinematics::Motion;

/// Kind of instrument: its name, the function that plans it, and the types of axis that it can
/// measure.
struct KindEntry {
  Kind kind;
  const char* name;
  Plan (*plan)(const Instrument&, const Chain&);
  bool slides;
  bool rotary;
  bool spindles;
};
constexpr std::array<KindEntry, 17> entries = {{
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

const KindEntry& kind_entry(Kind kind) { return entries[std::size_t(kind)]; }

// The conditions are such that NaN fails them.
void check_numbers(const Instrument& i) {
  const auto expect = [&](bool holds, const char* what, double seen) {
    if (!holds) throw_input_error(i, fmt::format("expected {}, seen {}", what, seen));
  };
  const std::pair<const char*, double> not_negative[] = {
      {"a noise of at least 0", i.noise},
      {"an angular noise of at least 0", i.noise_rad},
      {"a resolution of at least 0", i.resolution},
      {"an angular resolution of at least 0", i.resolution_rad},
      {"a rotation sigma of at least 0", i.rotation_sigma},
      {"a position sigma of at least 0", i.position_sigma},
      {"a scale sigma of at least 0", i.scale_sigma},
      {"a drift sigma of at least 0", i.drift_sigma},
      {"a duration of at least 0 s", i.duration_s},
      {"a dwell of at least 0 s", i.dwell_s},
      {"a set-up time of at least 0 s", i.set_up_s},
      {"a spindle speed of at least 0", i.spindle_speed}};
  // 1e12 excludes infinity and values whose squares would overflow.
  for (const auto& [what, seen] : not_negative) expect(seen >= 0.0 && seen < 1e12, what, seen);
  const std::pair<const char*, double> positive[] = {{"a radius above 0 mm", i.radius},
                                                     {"a lever above 0 mm", i.lever},
                                                     {"an interval above 0 s", i.interval_s},
                                                     {"a speed above 0 mm/s", i.speed}};
  for (const auto& [what, seen] : positive) expect(seen > 0.0 && seen < 1e12, what, seen);
  expect(i.runs >= 1 && i.runs <= 10000, "1 to 10000 runs", i.runs);
  expect(i.targets >= 2 && i.targets <= 100000, "2 to 100000 targets", i.targets);
  // Below 0.45 of the spacing targets keep their order.
  expect(i.scatter >= 0.0 && i.scatter < 0.45, "a target scatter from 0 to below 0.45", i.scatter);
  expect(i.margin > 0.0 && i.margin < 0.4, "a margin above 0 and below 0.4 of the travel",
         i.margin);
  expect(std::isfinite(i.from_rad) && i.to_rad - i.from_rad > 0.0 &&
             i.to_rad - i.from_rad <= 200.0 * pi,
         "an arc with end above start and at most 100 turns, in deg",
         (i.to_rad - i.from_rad) / units::deg);
  expect(i.duration_s / i.interval_s <= 1e5, "at most 100000 intervals",
         i.duration_s / i.interval_s);
  expect(std::isfinite(i.start_s), "a finite start time", i.start_s);
  expect(i.reflector_t.allFinite(), "a finite reflector position", i.reflector_t.norm());
  if (i.location_w)
    expect(i.location_w->allFinite(), "a finite position in the workpiece", i.location_w->norm());
  expect(std::abs(i.up_b.norm() - 1.0) <= 1e-12, "a unit upward direction, length", i.up_b.norm());
}

void check_axes(const Instrument& instrument, const Chain& nominal) {
  const KindEntry& entry = kind_entry(instrument.kind);
  for (const char axis : instrument.axes) {
    const auto joint = nominal.find(axis);
    if (!joint)
      throw_input_error(instrument, fmt::format("expected an axis of the machine, seen {}", axis));
    const Motion motion = nominal.joints()[std::size_t(*joint)].motion;
    const bool turns_work = axis == 'S' && motion == Motion::Rotary;
    const bool is_measurable = motion == Motion::Spindle || turns_work ? entry.spindles
                               : motion == Motion::Rotary              ? entry.rotary
                                                                       : entry.slides;
    if (!is_measurable)
      throw_input_error(
          instrument, fmt::format("expected axes that this instrument can measure, seen {}", axis));
  }
}

}  // namespace

std::string to_string(Kind kind) { return kind_entry(kind).name; }

std::optional<Kind> find_kind(std::string_view name) {
  for (const KindEntry& entry : entries)
    if (name == entry.name) return entry.kind;
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
  return kind_entry(instrument.kind).plan(instrument, nominal);
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
    kinematics::AxisVector moved_q = q;
    moved_q[joint] = position;
    return moved_q;
  };
}

namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Joint;

const Joint& joint_of(const AxisDirection& axis, const Chain& nominal) {
  return nominal.joints()[std::size_t(axis.joint)];
}

/// Returns the parked machine with one slide at the middle of a range.
AxisVector mid_position(const ParkedMachine& parked, const AxisDirection& slide,
                        const Range& range) {
  AxisVector q = parked.q;
  q[slide.joint] = 0.5 * (range.from + range.to);
  return q;
}

/// Returns the channel for the straightness of one slide in the direction of another.
Channel straightness_across(const Instrument& instrument, const Chain& nominal,
                            const ParkedMachine& parked, const AxisDirection& line,
                            const AxisDirection& other) {
  const double cosine = line.direction_w.dot(other.direction_w);
  Channel c =
      channel(instrument, fmt::format("{} along {}", other.letter, line.letter),
              Quantity::Displacement, (other.direction_w - cosine * line.direction_w).normalized());
  const Range range = travel(instrument, joint_of(line, nominal));
  c.point_in = reflector_w(instrument, nominal, mid_position(parked, line, range));
  return c;
}

}  // namespace

// The counter shows the axis position, so p_in is the position of the reflector at position zero.
Plan laser(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_slides(instrument, parked, 1);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const AxisDirection& slide : parked.slides) {
    Channel c = channel(instrument, fmt::format("along {}", slide.letter), Quantity::Displacement,
                        slide.direction_w);
    c.point_in =
        reflector_w(instrument, nominal, parked.q) - parked.q[slide.joint] * slide.direction_w;
    builder.set_up(set_up(instrument, fmt::format("{} positioning", slide.letter), {c}));
    builder.read_both_directions(along(parked.q, slide.joint),
                                 travel(instrument, joint_of(slide, nominal)));
    builder.move(parked.q);
  }
  return std::move(builder).finish();
}

// For the second direction the optics are rotated, so it is a separate set-up.
Plan straightness(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_slides(instrument, parked, 1);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const AxisDirection& slide : parked.slides) {
    const Range range = travel(instrument, joint_of(slide, nominal));
    const CrossDirections across = cross_directions(nominal, parked.q, slide.direction_w);
    for (int k = 0; k < 2; ++k) {
      Channel c = channel(instrument, fmt::format("{} along {}", across.letter[k], slide.letter),
                          Quantity::Displacement, across.direction_w[k]);
      c.point_in = reflector_w(instrument, nominal, mid_position(parked, slide, range));
      builder.set_up(set_up(
          instrument, fmt::format("{} straightness in {}", slide.letter, across.letter[k]), {c}));
      builder.read_both_directions(along(parked.q, slide.joint), range);
      builder.move(parked.q);
    }
  }
  return std::move(builder).finish();
}

Plan angle_optics(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  if (parked.rotary_axes.empty()) expect_slides(instrument, parked, 1);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const AxisDirection& slide : parked.slides) {
    const CrossDirections across = cross_directions(nominal, parked.q, slide.direction_w);
    std::vector<Channel> channels;
    for (int k = 0; k < 2; ++k)
      channels.push_back(channel(
          instrument,
          fmt::format("about {} along {}", char(across.letter[k] - 'X' + 'A'), slide.letter),
          Quantity::Angle, across.direction_w[k]));
    builder.set_up(set_up(instrument, fmt::format("{} pitch and yaw", slide.letter), channels));
    builder.read_both_directions(along(parked.q, slide.joint),
                                 travel(instrument, joint_of(slide, nominal)));
    builder.move(parked.q);
  }
  for (const AxisDirection& rotary : parked.rotary_axes) {
    const Channel c = channel(instrument, fmt::format("about {}", rotary.letter), Quantity::Angle,
                              rotary.direction_w);
    builder.set_up(set_up(instrument, fmt::format("{} positions", rotary.letter), {c}));
    builder.read_both_directions(along(parked.q, rotary.joint),
                                 arc(instrument, joint_of(rotary, nominal)));
    builder.move(parked.q);
  }
  return std::move(builder).finish();
}

// One artefact serves both lines, so its position and rotation are common to the two channels, and
// only the angle between the lines is that of the machine.
Plan square(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_slides(instrument, parked, 2);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const std::array<AxisDirection, 2>& pair : crossing_slides(instrument, parked)) {
    std::vector<Channel> channels;
    for (std::size_t k = 0; k < 2; ++k)
      channels.push_back(straightness_across(instrument, nominal, parked, pair[k], pair[1 - k]));
    builder.set_up(
        set_up(instrument, fmt::format("{}{} square", pair[0].letter, pair[1].letter), channels));
    for (std::size_t k = 0; k < 2; ++k) {
      builder.read_both_directions(along(parked.q, pair[k].joint),
                                   travel(instrument, joint_of(pair[k], nominal)), 1, {int(k)});
      builder.move(parked.q);
    }
  }
  return std::move(builder).finish();
}

// A level on the carriage measures its tilt against gravity. It cannot measure a rotation about the
// plumb line.
Plan level(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_slides(instrument, parked, 1);
  PlanBuilder builder(instrument, nominal, parked.q);
  int plumb = 0;
  instrument.up_b.cwiseAbs().maxCoeff(&plumb);
  for (const AxisDirection& slide : parked.slides) {
    const bool primed = joint_of(slide, nominal).side == kinematics::Side::Workpiece;
    std::vector<Channel> channels;
    for (int k = 0; k < 3; ++k) {
      if (k == plumb) continue;
      const Vector3d level_b =
          Vector3d::Unit(k) - Vector3d::Unit(k).dot(instrument.up_b) * instrument.up_b;
      channels.push_back(channel(instrument,
                                 fmt::format("about {} along {}", char('A' + k), slide.letter),
                                 Quantity::Angle, level_b.normalized()));
      channels.back().of = primed ? Body::Workpiece : Body::Tool;
      channels.back().in = Body::Bed;
    }
    builder.set_up(set_up(instrument, fmt::format("{} level", slide.letter), channels));
    builder.read_both_directions(along(parked.q, slide.joint),
                                 travel(instrument, joint_of(slide, nominal)));
    builder.move(parked.q);
  }
  return std::move(builder).finish();
}

// Both lines are read against one flat straightedge. Its rotation is common to both, so their
// difference is the roll.
Plan roll_lines(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  expect_slides(instrument, parked, 1);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const AxisDirection& slide : parked.slides) {
    const Range range = travel(instrument, joint_of(slide, nominal));
    const AxisVector q = mid_position(parked, slide, range);
    const CrossDirections across = cross_directions(nominal, parked.q, slide.direction_w);
    const Vector3d arm_w = 0.5 * instrument.lever * across.direction_w[0];
    const kinematics::Pose T_wt = nominal.tool_in_workpiece(q);
    std::vector<Channel> channels;
    for (const double side : {-1.0, 1.0}) {
      Channel c = channel(instrument,
                          fmt::format("{} along {} at {}{}", across.letter[1], slide.letter,
                                      side < 0.0 ? '-' : '+', across.letter[0]),
                          Quantity::Displacement, across.direction_w[1]);
      c.point_of += T_wt.linear().transpose() * (side * arm_w);
      c.point_in = T_wt * c.point_of;
      channels.push_back(c);
    }
    builder.set_up(set_up(instrument, fmt::format("{} roll lines", slide.letter), channels));
    builder.read_both_directions(along(parked.q, slide.joint), range);
    builder.move(parked.q);
  }
  return std::move(builder).finish();
}

namespace {

/// A diagonal from one corner of the travel to the opposite one; its last axis moves upwards.
struct Diagonal {
  std::string name;        ///< "+X -Y +Z"
  std::vector<int> joint;  ///< indices of its axes, by letter
  AxisVector from;         ///< axis positions at the start
  AxisVector to;           ///< axis positions at the end
  AxisVector overshoot;    ///< on every axis, in the direction of the diagonal
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
      d.name += fmt::format("{}{}{}", k == 0 ? "" : " ", down ? '-' : '+', axis.letter);
      d.joint.push_back(axis.joint);
      d.from[axis.joint] = down ? range.to : range.from;
      d.to[axis.joint] = down ? range.from : range.to;
      d.overshoot[axis.joint] = down ? -range.overshoot : range.overshoot;
    }
    result.push_back(d);
  }
  return result;
}

/// Returns the channel along a diagonal. It counts from the reflector's position at the start.
Channel along_diagonal(const Instrument& instrument, const Chain& nominal, const Diagonal& d,
                       Quantity quantity) {
  const Vector3d start_w = reflector_w(instrument, nominal, d.from);
  const Vector3d direction_w = (reflector_w(instrument, nominal, d.to) - start_w).normalized();
  Channel c = channel(instrument, "along " + d.name, quantity, direction_w);
  c.point_in = start_w;
  return c;
}

void check_slides(const Instrument& instrument, const ParkedMachine& parked, std::size_t count) {
  expect_slides(instrument, parked, int(count));
  if (parked.slides.size() > 3)
    throw_input_error(instrument,
                      fmt::format("expected at most 3 slides, seen {}", parked.slides.size()));
  for (std::size_t a = 0; a < parked.slides.size(); ++a)
    for (std::size_t b = a + 1; b < parked.slides.size(); ++b)
      if (!are_crossing(parked.slides[a], parked.slides[b]))
        throw_input_error(instrument,
                          fmt::format("expected perpendicular slides, seen {} along {}",
                                      parked.slides[a].letter, parked.slides[b].letter));
}

}  // namespace

Plan diagonals(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  check_slides(instrument, parked, 2);
  std::vector<Diagonal> diagonal_list;
  const auto add = [&](const std::string& kind, const std::vector<AxisDirection>& axes) {
    for (Diagonal& d : volume_diagonals(instrument, nominal, parked.q, axes)) {
      d.name = kind + " diagonal " + d.name;
      diagonal_list.push_back(d);
    }
  };
  const std::vector<AxisDirection>& s = parked.slides;
  if (s.size() == 3) add("body", s);
  for (std::size_t a = 0; a < s.size(); ++a)
    for (std::size_t b = a + 1; b < s.size(); ++b) add("face", {s[a], s[b]});

  PlanBuilder builder(instrument, nominal, parked.q);
  for (const Diagonal& d : diagonal_list) {
    builder.set_up(set_up(instrument, d.name,
                          {along_diagonal(instrument, nominal, d, Quantity::Displacement)}));
    const double overshoot = d.overshoot.cwiseAbs().sum() / (d.to - d.from).cwiseAbs().sum();
    builder.read_both_directions(
        [&](double fraction) { return AxisVector(d.from + fraction * (d.to - d.from)); },
        {0.0, 1.0, overshoot});
  }
  builder.move(parked.q);
  return std::move(builder).finish();
}

// Reading 0 of a run is at the start, reading 3 k + leg after leg X (1), Y (2) or Z (3) of step k.
// Every leg follows the diagonal's direction of its axis, so that no axis reverses within a run.
Plan step_diagonal(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  check_slides(instrument, parked, 3);
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const Diagonal& d : volume_diagonals(instrument, nominal, parked.q, parked.slides)) {
    Channel c = along_diagonal(instrument, nominal, d, Quantity::Mirror);
    c.normal_of = nominal.tool_in_workpiece(d.from).linear().transpose() * c.direction_in;
    SetUp optics = set_up(instrument, "step diagonal " + d.name, {c});
    optics.normal_sigma = instrument.rotation_sigma;
    builder.set_up(optics);
    const auto read = [&](int run, int target) {
      builder.wait(instrument.dwell_s);
      builder.read(run, target);
    };
    for (int run = 0; run < instrument.runs; ++run) {
      builder.move(d.from - d.overshoot);
      builder.move(d.from);
      read(run, 0);
      for (int step = 1; step <= instrument.targets; ++step) {
        for (int leg = 0; leg < 3; ++leg) {
          const int joint = d.joint[std::size_t(leg)];
          AxisVector q = builder.q();
          q[joint] = d.from[joint] + (d.to[joint] - d.from[joint]) * step / instrument.targets;
          builder.move(q);
          read(run, 3 * (step - 1) + leg + 1);
        }
      }
    }
  }
  builder.move(parked.q);
  return std::move(builder).finish();
}

namespace {

/// A spindle with its axis in the workpiece and the side that carries the artefact.
struct SpindleAxis {
  AxisDirection axis;
  bool carries_tool = true;
};

/// Returns the spindles that the instrument is to measure.
std::vector<SpindleAxis> spindles(const Instrument& instrument, const Chain& nominal,
                                  const AxisVector& q) {
  std::vector<SpindleAxis> result;
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
Channel sensor(const Instrument& instrument, const SpindleAxis& spindle,
               const kinematics::Pose& T_wt, const Vector3d& ball_w) {
  Channel c = channel(instrument, "", Quantity::Displacement, Vector3d::UnitX());
  const Vector3d ball_t = T_wt.inverse() * ball_w;
  c.of = spindle.carries_tool ? Body::Tool : Body::Workpiece;
  c.in = spindle.carries_tool ? Body::Workpiece : Body::Tool;
  c.point_of = spindle.carries_tool ? ball_t : ball_w;
  c.point_in = spindle.carries_tool ? ball_w : ball_t;
  return c;
}

/// Returns the set-up of two balls on the spindle axis: X1, Y1 and the axial sensor at the first
/// ball, X2 and Y2 at the second, a lever away.
SetUp artefact(const Instrument& instrument, const Chain& nominal, const AxisVector& q,
               const SpindleAxis& spindle) {
  const kinematics::Pose T_wt = nominal.tool_in_workpiece(q);
  const Vector3d& axis_w = spindle.axis.direction_w;
  const Vector3d tip_w = reflector_w(instrument, nominal, q);
  const Vector3d first_w =
      spindle.carries_tool ? tip_w : nearest_axis_point(nominal, q, spindle.axis.joint, tip_w);
  const CrossDirections across = cross_directions(nominal, q, axis_w);
  std::vector<Channel> channels;
  const auto add = [&](const std::string& name, const Vector3d& ball_w,
                       const Vector3d& sensing_direction_w) {
    Channel c = sensor(instrument, spindle, T_wt, ball_w);
    c.name = name;
    c.direction_in = spindle.carries_tool ? sensing_direction_w
                                          : T_wt.linear().transpose() * sensing_direction_w;
    channels.push_back(c);
  };
  for (int ball = 0; ball < 2; ++ball)
    for (int k = 0; k < 2; ++k)
      add(fmt::format("{}{}", across.letter[k], ball + 1),
          first_w + ball * instrument.lever * axis_w, across.direction_w[k]);
  add("along the spindle", first_w, axis_w);

  SetUp result =
      set_up(instrument, fmt::format("spindle {}", spindle.axis.letter), std::move(channels));
  // With a turning workpiece the position of the ball in the workpiece is unknown.
  (spindle.carries_tool ? result.eccentricity_sigma : result.point_of_sigma) =
      instrument.position_sigma;
  return result;
}

int readings_over_time(const Instrument& instrument) {
  // 1e-9: a duration of a whole number of intervals includes its end in spite of rounding.
  return int(std::floor(instrument.duration_s / instrument.interval_s + 1e-9)) + 1;
}

}  // namespace

Plan spindle(const Instrument& instrument, const Chain& nominal) {
  if (!(instrument.spindle_speed > 0.0))
    throw_input_error(instrument, fmt::format("expected a spindle speed above 0, seen {} rpm",
                                              instrument.spindle_speed / units::rpm));
  const ParkedMachine parked = park(instrument, nominal);
  const std::vector<SpindleAxis> axes = spindles(instrument, nominal, parked.q);
  if (axes.empty()) throw_input_error(instrument, "expected a spindle to measure, seen none");
  PlanBuilder builder(instrument, nominal, parked.q);
  for (const SpindleAxis& spindle_to_test : axes) {
    builder.set_up(artefact(instrument, nominal, parked.q, spindle_to_test));
    for (int run = 0; run < instrument.runs; ++run) {
      for (int i = 0; i < instrument.targets; ++i) {
        builder.turn_spindle(spindle_to_test.axis.joint,
                             2.0 * pi * (run + double(i) / instrument.targets));
        builder.read(run, i);
      }
    }
    builder.turn_spindle(spindle_to_test.axis.joint, 2.0 * pi * instrument.runs);
    builder.stop_spindle(spindle_to_test.axis.joint);
  }
  return std::move(builder).finish();
}

// The machine is at rest. If the spindle runs, the sensors are always read at the same angle.
Plan drift(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  AxisVector q = parked.q;
  if (instrument.location_w) {
    const auto q_at_position =
        axes_with_reflector_at(instrument, nominal, q, *instrument.location_w);
    if (!q_at_position)
      throw_input_error(instrument, "expected a position within reach of the slides");
    q = *q_at_position;
  }
  const Vector3d position_w = reflector_w(instrument, nominal, q);
  const Eigen::Matrix3d R_wb = nominal.workpiece_in_bed(q).linear().transpose();
  std::vector<Channel> channels;
  for (int k = 0; k < 3; ++k) {
    channels.push_back(
        channel(instrument, std::string(1, char('X' + k)), Quantity::Displacement, R_wb.col(k)));
    channels.back().point_in = position_w;
  }
  const CrossDirections across =
      cross_directions(nominal, q, nominal.tool_in_workpiece(q).linear().col(2));
  for (int k = 0; k < 2; ++k)
    channels.push_back(channel(instrument, std::string(1, char(across.letter[k] - 'X' + 'A')),
                               Quantity::Angle, across.direction_w[k]));
  PlanBuilder builder(instrument, nominal, parked.q);
  builder.set_up(set_up(instrument, "drift", channels));
  builder.move(q);
  if (instrument.spindle_speed > 0.0) builder.run_spindle();
  for (int i = 0; i < readings_over_time(instrument); ++i) {
    if (i > 0) builder.wait(instrument.interval_s);
    builder.read(0, i);
  }
  return std::move(builder).finish();
}

Plan temperature(const Instrument& instrument, const Chain& nominal) {
  const ParkedMachine parked = park(instrument, nominal);
  PlanBuilder builder(instrument, nominal, parked.q);
  SetUp log;
  log.name = "temperatures";
  log.is_zero_unknown = false;
  builder.set_up(log);
  for (int i = 0; i < readings_over_time(instrument); ++i) {
    if (i > 0) builder.wait(instrument.interval_s);
    builder.read(0, i);
  }
  return std::move(builder).finish();
}

}  // namespace abbe::errors::metrology
