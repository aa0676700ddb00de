#include "errors/metrology/plan_builder.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/decompositions.h"
#include "kinematics/jacobian.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr double longest_travel = 1e6;  // mm; a larger range stands for no limit
constexpr double reached = 1e-9;        // mm
constexpr int max_places = 100'000;

bool is_spindle(const Joint& joint) { return joint.motion == Motion::Spindle || joint.name == 'S'; }

// 0 is where a rotary axis is set up; where it is out of reach the middle is farthest from both
// limits.
double park_position(const Joint& joint) {
  if (is_spindle(joint)) return 0.0;
  if (joint.motion == Motion::Rotary && joint.min <= 0.0 && joint.max >= 0.0) return 0.0;
  return 0.5 * (joint.min + joint.max);
}

void check_chosen(const Instrument& instrument, const Chain& nominal) {
  for (const char axis : instrument.axes)
    if (!nominal.find(axis))
      refuse(instrument, fmt::format("expected axes of the machine, seen {}", axis));
}

void check_limits(const Instrument& instrument, const Joint& joint) {
  if (!(joint.max - joint.min <= longest_travel) || !(joint.min < joint.max))
    refuse(instrument, fmt::format("expected limits of travel of {}, seen {} to {} mm", joint.name,
                                   joint.min, joint.max));
}

bool chosen(const Instrument& instrument, char axis) {
  return instrument.axes.empty() ||
         std::find(instrument.axes.begin(), instrument.axes.end(), axis) != instrument.axes.end();
}

}  // namespace

ParkedMachine stand(const Instrument& instrument, const Chain& nominal) {
  check_chosen(instrument, nominal);
  ParkedMachine result;
  result.q.resize(nominal.size());
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (joint.motion == Motion::Linear) check_limits(instrument, joint);
    result.q[j] = park_position(joint);
  }
  const Eigen::MatrixXd J_w = kinematics::axis_jacobian(nominal, result.q);
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (is_spindle(joint) || !chosen(instrument, joint.name)) continue;
    const bool slides = joint.motion == Motion::Linear;
    const Vector3d direction_w = slides ? J_w.col(j).head<3>() : J_w.col(j).tail<3>();
    (slides ? result.slides : result.rotary).push_back({j, joint.name, direction_w.normalized()});
  }
  const auto by_letter = [](const AxisDirection& a, const AxisDirection& b) {
    return a.name < b.name;
  };
  // The order by letter makes plans independent of the order of the axes in the chain.
  std::sort(result.slides.begin(), result.slides.end(), by_letter);
  std::sort(result.rotary.begin(), result.rotary.end(), by_letter);
  return result;
}

Range travel(const Instrument& instrument, const Joint& slide) {
  const double room = instrument.margin * (slide.max - slide.min);
  return {slide.min + room, slide.max - room, 0.5 * room};
}

Range arc(const Instrument& instrument, const Joint& rotary) {
  double from = instrument.from_rad, to = instrument.to_rad;
  // A whole turn is a request for all positions, so an axis that turns less uses its full travel.
  const bool whole = to - from >= 2.0 * pi - 1e-9;
  if (whole && rotary.max - rotary.min < to - from) {
    from = rotary.min;
    to = rotary.max;
  }
  from = std::max(from, rotary.min);
  to = std::min(to, rotary.max);
  if (!(to - from > 0.0))
    refuse(instrument,
           fmt::format("expected an arc within the travel of {}, seen {} to {} deg", rotary.name,
                       instrument.from_rad / units::deg, instrument.to_rad / units::deg));
  const double room = instrument.margin * (to - from);
  return {std::max(from, rotary.min + room), std::min(to, rotary.max - room), 0.5 * room};
}

Eigen::VectorXd targets(const Range& range, int count) {
  return Eigen::VectorXd::LinSpaced(count, range.from, range.to);
}

Across across(const Chain& nominal, const AxisVector& q, const Vector3d& direction_w) {
  const Eigen::Matrix3d R_wb = nominal.workpiece_in_bed(q).linear().transpose();
  int along = 0;
  (R_wb.transpose() * direction_w).cwiseAbs().maxCoeff(&along);
  Across result;
  // The two bed axes other than the one nearest to the direction, made orthogonal to it.
  for (int k = 0, n = 0; k < 3; ++k) {
    if (k == along) continue;
    Vector3d e = R_wb.col(k) - R_wb.col(k).dot(direction_w) * direction_w;
    if (n == 1) e -= e.dot(result.direction_w[0]) * result.direction_w[0];
    result.direction_w[n] = e.normalized();
    result.letter[n++] = char('X' + k);
  }
  return result;
}

Vector3d reflector_w(const Instrument& instrument, const Chain& nominal, const AxisVector& q) {
  return nominal.tool_in_workpiece(q) * instrument.reflector_t;
}

// The axis is the set of points that its rotation does not move; the midpoint of a point and its
// image after half a turn is the nearest of them.
Vector3d on_axis(const Chain& nominal, const AxisVector& q, int joint, const Vector3d& place_w) {
  AxisVector turned = q;
  turned[joint] += pi;
  const Vector3d opposite_w =
      nominal.tool_in_workpiece(turned) * (nominal.tool_in_workpiece(q).inverse() * place_w);
  return 0.5 * (place_w + opposite_w);
}

std::optional<AxisVector> slides_for_reflector(const Instrument& instrument, const Chain& nominal,
                                               const AxisVector& q, const Vector3d& place_w,
                                               std::vector<int> slides) {
  const Eigen::MatrixXd J_w = kinematics::axis_jacobian(nominal, q);
  const bool every = slides.empty();
  for (int j = 0; every && j < nominal.size(); ++j)
    if (nominal.joints()[std::size_t(j)].motion == Motion::Linear) slides.push_back(j);
  Eigen::MatrixXd directions_w(3, Eigen::Index(slides.size()));
  for (std::size_t k = 0; k < slides.size(); ++k)
    directions_w.col(Eigen::Index(k)) = J_w.col(slides[k]).head<3>();

  AxisVector there = q;
  for (int pass = 0; pass < 2; ++pass) {  // the second pass removes the rounding of the first
    const Eigen::VectorXd left_w = place_w - reflector_w(instrument, nominal, there);
    const Eigen::VectorXd way = least_squares(directions_w, left_w).x;
    for (std::size_t k = 0; k < slides.size(); ++k) there[slides[k]] += way[Eigen::Index(k)];
  }
  // The slides may not span the space, so it is checked that the position was reached.
  if (!((place_w - reflector_w(instrument, nominal, there)).norm() <= reached)) return std::nullopt;
  return there;
}

std::vector<AxisVector> grid(const Instrument& instrument, const AxisVector& q,
                             const std::vector<GridLine>& lines) {
  std::vector<AxisVector> places = {q};
  for (const GridLine& line : lines) {
    if (double(places.size()) * double(line.at.size()) > max_places)
      refuse(instrument, fmt::format("expected a grid of at most {} places", max_places));
    std::vector<AxisVector> finer;
    for (std::size_t i = 0; i < places.size(); ++i) {
      for (Eigen::Index k = 0; k < line.at.size(); ++k) {
        finer.push_back(places[i]);  // every other line is traversed backwards, so that each step
                                     // moves one axis by one spacing
        finer.back()[line.joint] = line.at[i % 2 == 0 ? k : line.at.size() - 1 - k];
      }
    }
    places = std::move(finer);
  }
  return places;
}

bool within_travel(const Chain& nominal, const AxisVector& q) {
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (!(q[j] >= joint.min && q[j] <= joint.max)) return false;
  }
  return true;
}

bool cross(const AxisDirection& one, const AxisDirection& other) {
  constexpr double least = 0.1;  // sine of the angle between them
  return one.direction_w.cross(other.direction_w).norm() > least;
}

std::vector<std::array<AxisDirection, 2>> crossing_slides(const Instrument& instrument,
                                                          const ParkedMachine& stand) {
  std::vector<std::array<AxisDirection, 2>> pairs;
  std::string names;
  for (std::size_t a = 0; a < stand.slides.size(); ++a) {
    names += fmt::format(" {}", stand.slides[a].name);
    for (std::size_t b = a + 1; b < stand.slides.size(); ++b)
      if (cross(stand.slides[a], stand.slides[b]))
        pairs.push_back({stand.slides[a], stand.slides[b]});
  }
  if (pairs.empty())
    refuse(instrument, fmt::format("expected two slides across each other, seen{}", names));
  return pairs;
}

void expect_slides(const Instrument& instrument, const ParkedMachine& stand, int count) {
  if (int(stand.slides.size()) < count)
    refuse(instrument, fmt::format("expected at least {} slide{} to measure, seen {}", count,
                                   count == 1 ? "" : "s", stand.slides.size()));
}

void expect_rotary(const Instrument& instrument, const ParkedMachine& stand) {
  if (stand.rotary.empty()) refuse(instrument, "expected a rotary axis to measure, seen none");
}

void refuse(const Instrument& instrument, const std::string& sentence) {
  throw std::invalid_argument(
      (instrument.name.empty() ? to_string(instrument.kind) : instrument.name) + ": " + sentence);
}

namespace {

/// Returns targets moved off equal spacing by up to this fraction of it, each differently, the
/// first and the last not at all. Multiples of the golden section fill an interval most evenly.
Eigen::VectorXd scatter_targets(Eigen::VectorXd targets, double part) {
  constexpr double golden = 0.6180339887498949;
  for (Eigen::Index i = 1; i + 1 < targets.size(); ++i) {
    const double whole = golden * double(i);
    const double spacing = (targets[targets.size() - 1] - targets[0]) / double(targets.size() - 1);
    targets[i] += part * spacing * (2.0 * (whole - std::floor(whole)) - 1.0);
  }
  return targets;
}

constexpr std::size_t max_measurements = 500'000;  // about 80 MB
// A shorter motion is rounding of the path: the axis is at rest and has not reversed.
constexpr double still = 1e-9;  // mm or rad
constexpr double slack = 1e-9;  // mm or rad, rounding of a position on a limit

}  // namespace

kinematics::AxisState moved(kinematics::AxisState state, const AxisVector& q) {
  for (int j = 0; j < int(q.size()); ++j) {
    const double way = q[j] - state.q[j];
    if (std::abs(way) <= still) continue;
    const std::int8_t up_or_down = way > 0.0 ? 1 : -1;
    std::int8_t& last = state.direction[std::size_t(j)];
    // A new stroke begins with each reversal, and the first motion is no reversal.
    if (last != 0 && last != up_or_down) ++state.stroke[std::size_t(j)];
    last = up_or_down;
  }
  state.q = q;
  return state;
}

PlanBuilder::PlanBuilder(const Instrument& instrument, const Chain& nominal,
                         const AxisVector& start)
    : instrument_(instrument), nominal_(nominal) {
  state_.q = start;
  plan_.instrument = instrument.name.empty() ? to_string(instrument.kind) : instrument.name;
  plan_.kind = to_string(instrument.kind);
}

void PlanBuilder::set_up(SetUp set_up) {
  set_up.set_up_s = instrument_.set_up_s;
  time_s_ += set_up.set_up_s;
  plan_.set_ups.push_back(std::move(set_up));
}

void PlanBuilder::move(const AxisVector& q) {
  double slides = 0.0, turns = 0.0;
  for (int j = 0; j < nominal_.size(); ++j) {
    const Joint& joint = nominal_.joints()[std::size_t(j)];
    const bool linear = joint.motion == Motion::Linear;
    const double unit = linear ? 1.0 : units::deg;
    if (!(q[j] >= joint.min - slack && q[j] <= joint.max + slack))
      refuse(instrument_, fmt::format("expected targets within the travel of {}, {:.6g} to {:.6g} "
                                      "{}, seen {:.6g}",
                                      joint.name, joint.min / unit, joint.max / unit,
                                      linear ? "mm" : "deg", q[j] / unit));
    const double way = q[j] - state_.q[j];
    if (linear)
      // Slides move together along a straight line, whereas rotary axes turn side by side.
      slides = std::hypot(slides, way);
    else
      turns = std::max(turns, std::abs(way));
  }
  // A rotary axis turns at the rate that moves a point at the instrument's radius at its speed.
  time_s_ += std::max(slides, turns * instrument_.radius) / instrument_.speed;
  state_ = moved(std::move(state_), q);
}

void PlanBuilder::spin(int joint, double angle) {
  const double speed = instrument_.spindle_speed;
  time_s_ += std::abs(angle - state_.q[joint]) / speed;
  state_.q[joint] = angle;
  state_.direction[std::size_t(joint)] = 1;
  state_.spindle_speed = speed;
}

// The spindle stops at 0, where the next set-up begins to count.
void PlanBuilder::stop_spindle(int joint) {
  state_.q[joint] = 0.0;
  state_.spindle_speed = 0.0;
}

void PlanBuilder::run_spindle() { state_.spindle_speed = instrument_.spindle_speed; }

void PlanBuilder::read(int run, int target, const std::vector<int>& channels) {
  state_.time_s = time_s_;
  const int set_up = int(plan_.set_ups.size()) - 1;
  const auto measurement = [&](int channel) {
    if (plan_.measurements.size() >= max_measurements)
      refuse(instrument_, fmt::format("expected at most {} readings", max_measurements));
    plan_.measurements.push_back({set_up, channel, run, target, state_});
  };
  const int all = int(plan_.set_ups.back().channels.size());
  // A set-up without channels reads the temperatures only.
  if (all == 0) measurement(-1);
  if (channels.empty())
    for (int channel = 0; channel < all; ++channel) measurement(channel);
  for (const int channel : channels) measurement(channel);
}

void PlanBuilder::move_along(const Path& path, double from, double to, int smoothly) {
  for (int i = 1; i <= smoothly; ++i)
    move(path(i == smoothly ? to : from + (to - from) * i / smoothly));
}

void PlanBuilder::read_both_directions(const Path& path, const Range& range, int smoothly,
                                       const std::vector<int>& channels) {
  const Eigen::VectorXd at =
      scatter_targets(targets(range, instrument_.targets), instrument_.scatter);
  const int count = int(at.size());
  // The overshoot makes the approach to the first target of either direction a true one.
  const double below = range.from - range.overshoot, above = range.to + range.overshoot;
  double here = below;
  const auto go = [&](double there) {
    move_along(path, here, there, smoothly);
    here = there;
  };
  const auto stop = [&](int run, int target) {
    go(at[target]);
    wait(instrument_.dwell_s);
    read(run, target, channels);
  };
  for (int run = 0; run < instrument_.runs; ++run) {
    go(below);
    for (int i = 0; i < count; ++i) stop(run, i);
    if (!instrument_.both_ways) continue;
    go(above);
    for (int i = count - 1; i >= 0; --i) stop(run, i);
  }
}

void PlanBuilder::visit(const std::vector<AxisVector>& places,
                        const std::function<std::vector<int>(int)>& channels) {
  const auto stop = [&](int run, int target) {
    move(places[std::size_t(target)]);
    wait(instrument_.dwell_s);
    read(run, target, channels ? channels(target) : std::vector<int>());
  };
  const int count = int(places.size());
  for (int run = 0; run < instrument_.runs; ++run) {
    for (int i = 0; i < count; ++i) stop(run, i);
    if (!instrument_.both_ways) continue;
    for (int i = count - 1; i >= 0; --i) stop(run, i);
  }
}

Plan PlanBuilder::finish() && {
  plan_.duration_s = time_s_;
  const double late = plan_.measurements.empty() ? 0.0 : plan_.measurements.front().state.time_s;
  for (Measurement& measurement : plan_.measurements)
    measurement.state.time_s += instrument_.start_s - late;
  return std::move(plan_);
}

}  // namespace abbe::errors::metrology
