#include "errors/metrology/instrument.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "errors/metrology/plans.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using kinematics::Chain;
using kinematics::Motion;

/// What a kind is called, how it is planned, and which sorts of axis it may be asked for.
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

// Conditions are written so that NaN fails them.
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
  for (const auto& [what, seen] : not_negative) expect(seen >= 0.0 && seen < 1e12, what, seen);
  const std::pair<const char*, double> positive[] = {{"a radius above 0 mm", i.radius},
                                                     {"a lever above 0 mm", i.lever},
                                                     {"an interval above 0 s", i.interval_s},
                                                     {"a speed above 0 mm/s", i.speed}};
  for (const auto& [what, seen] : positive) expect(seen > 0.0 && seen < 1e12, what, seen);
  expect(i.runs >= 1 && i.runs <= 10000, "1 to 10000 runs", i.runs);
  expect(i.targets >= 2 && i.targets <= 100000, "2 to 100000 targets", i.targets);
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

}  // namespace abbe::errors::metrology
