#include "errors/metrology/plan_builder.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/decompositions.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr double max_travel = 1e6;           // mm; a larger range means that there is no limit
constexpr double position_tolerance = 1e-9;  // mm
constexpr int max_positions = 100'000;

bool is_spindle(const Joint& joint) { return joint.motion == Motion::Spindle || joint.name == 'S'; }

/// Returns the position of a joint that does not move. Rotary axes are set up at 0; if that is out
/// of reach, the middle is farthest from both limits.
double park_position(const Joint& joint) {
  if (is_spindle(joint)) return 0.0;
  if (joint.motion == Motion::Rotary && joint.min <= 0.0 && joint.max >= 0.0) return 0.0;
  return 0.5 * (joint.min + joint.max);
}

void check_axes_exist(const Instrument& instrument, const Chain& nominal) {
  for (const char axis : instrument.axes)
    if (!nominal.find(axis))
      throw_input_error(instrument, fmt::format("expected axes of the machine, seen {}", axis));
}

void check_limits(const Instrument& instrument, const Joint& joint) {
  if (!(joint.max - joint.min <= max_travel) || !(joint.min < joint.max))
    throw_input_error(
        instrument, fmt::format("expected finite travel limits of {}, seen {} to {} mm", joint.name,
                                joint.min, joint.max));
}

bool is_selected(const Instrument& instrument, char axis) {
  return instrument.axes.empty() ||
         std::find(instrument.axes.begin(), instrument.axes.end(), axis) != instrument.axes.end();
}

}  // namespace

ParkedMachine park(const Instrument& instrument, const Chain& nominal) {
  check_axes_exist(instrument, nominal);
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
    if (is_spindle(joint) || !is_selected(instrument, joint.name)) continue;
    const bool is_slide = joint.motion == Motion::Linear;
    const Vector3d direction_w = is_slide ? J_w.col(j).head<3>() : J_w.col(j).tail<3>();
    (is_slide ? result.slides : result.rotary_axes)
        .push_back({j, joint.name, direction_w.normalized()});
  }
  const auto by_letter = [](const AxisDirection& a, const AxisDirection& b) {
    return a.letter < b.letter;
  };
  // The order by letter makes plans independent of the order of the axes in the chain.
  std::sort(result.slides.begin(), result.slides.end(), by_letter);
  std::sort(result.rotary_axes.begin(), result.rotary_axes.end(), by_letter);
  return result;
}

Range travel(const Instrument& instrument, const Joint& slide) {
  const double clearance = instrument.margin * (slide.max - slide.min);
  return {slide.min + clearance, slide.max - clearance, 0.5 * clearance};
}

Range arc(const Instrument& instrument, const Joint& rotary) {
  double from = instrument.from_rad, to = instrument.to_rad;
  // A whole turn requests all positions, so an axis that turns less uses its full travel.
  const bool is_full_turn = to - from >= 2.0 * pi - 1e-9;
  if (is_full_turn && rotary.max - rotary.min < to - from) {
    from = rotary.min;
    to = rotary.max;
  }
  from = std::max(from, rotary.min);
  to = std::min(to, rotary.max);
  if (!(to - from > 0.0))
    throw_input_error(
        instrument,
        fmt::format("expected an arc within the travel of {}, seen {} to {} deg", rotary.name,
                    instrument.from_rad / units::deg, instrument.to_rad / units::deg));
  const double clearance = instrument.margin * (to - from);
  return {std::max(from, rotary.min + clearance), std::min(to, rotary.max - clearance),
          0.5 * clearance};
}

Eigen::VectorXd targets(const Range& range, int count) {
  return Eigen::VectorXd::LinSpaced(count, range.from, range.to);
}

CrossDirections cross_directions(const Chain& nominal, const AxisVector& q,
                                 const Vector3d& direction_w) {
  const Eigen::Matrix3d R_wb = nominal.workpiece_in_bed(q).linear().transpose();
  int along = 0;
  (R_wb.transpose() * direction_w).cwiseAbs().maxCoeff(&along);
  CrossDirections result;
  // The two bed axes that are not nearest to the direction, made orthogonal to it.
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

// The midpoint of a point and its image after half a turn is the point of the axis nearest to it.
Vector3d nearest_axis_point(const Chain& nominal, const AxisVector& q, int joint,
                            const Vector3d& position_w) {
  AxisVector opposite = q;
  opposite[joint] += pi;
  const Vector3d opposite_w =
      nominal.tool_in_workpiece(opposite) * (nominal.tool_in_workpiece(q).inverse() * position_w);
  return 0.5 * (position_w + opposite_w);
}

std::optional<AxisVector> axes_with_reflector_at(const Instrument& instrument, const Chain& nominal,
                                                 const AxisVector& q, const Vector3d& position_w,
                                                 std::vector<int> slides) {
  const Eigen::MatrixXd J_w = kinematics::axis_jacobian(nominal, q);
  const bool moves_all_slides = slides.empty();
  for (int j = 0; moves_all_slides && j < nominal.size(); ++j)
    if (nominal.joints()[std::size_t(j)].motion == Motion::Linear) slides.push_back(j);
  Eigen::MatrixXd directions_w(3, Eigen::Index(slides.size()));
  for (std::size_t k = 0; k < slides.size(); ++k)
    directions_w.col(Eigen::Index(k)) = J_w.col(slides[k]).head<3>();

  AxisVector reached = q;
  for (int iteration = 0; iteration < 2;
       ++iteration) {  // the second one removes the rounding of the first
    const Eigen::VectorXd remaining_w = position_w - reflector_w(instrument, nominal, reached);
    const Eigen::VectorXd displacement = least_squares(directions_w, remaining_w).x;
    for (std::size_t k = 0; k < slides.size(); ++k)
      reached[slides[k]] += displacement[Eigen::Index(k)];
  }
  // The slides may not span the space, so the result is checked.
  if (!((position_w - reflector_w(instrument, nominal, reached)).norm() <= position_tolerance))
    return std::nullopt;
  return reached;
}

std::vector<AxisVector> grid(const Instrument& instrument, const AxisVector& q,
                             const std::vector<GridAxis>& axes) {
  std::vector<AxisVector> positions = {q};
  for (const GridAxis& axis : axes) {
    if (double(positions.size()) * double(axis.values.size()) > max_positions)
      throw_input_error(instrument,
                        fmt::format("expected a grid of at most {} points", max_positions));
    std::vector<AxisVector> refined;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      for (Eigen::Index k = 0; k < axis.values.size(); ++k) {
        // Every other line is traversed backwards, so that each step moves one axis by one spacing.
        refined.push_back(positions[i]);
        refined.back()[axis.joint] = axis.values[i % 2 == 0 ? k : axis.values.size() - 1 - k];
      }
    }
    positions = std::move(refined);
  }
  return positions;
}

bool is_within_travel(const Chain& nominal, const AxisVector& q) {
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (!(q[j] >= joint.min && q[j] <= joint.max)) return false;
  }
  return true;
}

bool are_crossing(const AxisDirection& a, const AxisDirection& b) {
  constexpr double min_sine = 0.1;  // of the angle between the directions
  return a.direction_w.cross(b.direction_w).norm() > min_sine;
}

std::vector<std::array<AxisDirection, 2>> crossing_slides(const Instrument& instrument,
                                                          const ParkedMachine& parked) {
  std::vector<std::array<AxisDirection, 2>> pairs;
  std::string letters;
  for (std::size_t a = 0; a < parked.slides.size(); ++a) {
    letters += fmt::format(" {}", parked.slides[a].letter);
    for (std::size_t b = a + 1; b < parked.slides.size(); ++b)
      if (are_crossing(parked.slides[a], parked.slides[b]))
        pairs.push_back({parked.slides[a], parked.slides[b]});
  }
  if (pairs.empty())
    throw_input_error(instrument,
                      fmt::format("expected two perpendicular slides, seen{}", letters));
  return pairs;
}

void expect_slides(const Instrument& instrument, const ParkedMachine& parked, int count) {
  if (int(parked.slides.size()) < count)
    throw_input_error(instrument, fmt::format("expected at least {} slide{} to measure, seen {}",
                                              count, count == 1 ? "" : "s", parked.slides.size()));
}

void expect_rotary_axis(const Instrument& instrument, const ParkedMachine& parked) {
  if (parked.rotary_axes.empty())
    throw_input_error(instrument, "expected a rotary axis to measure, seen none");
}

void throw_input_error(const Instrument& instrument, const std::string& message) {
  throw std::invalid_argument(
      (instrument.name.empty() ? to_string(instrument.kind) : instrument.name) + ": " + message);
}

namespace {

/// Returns targets with deviations from equal spacing of up to a fraction of it, different for each
/// target and 0 for the first and the last. Multiples of the golden section fill an interval most
/// evenly.
Eigen::VectorXd scatter_targets(Eigen::VectorXd targets, double fraction) {
  constexpr double golden_section = 0.6180339887498949;
  for (Eigen::Index i = 1; i + 1 < targets.size(); ++i) {
    const double multiple = golden_section * double(i);
    const double spacing = (targets[targets.size() - 1] - targets[0]) / double(targets.size() - 1);
    targets[i] += fraction * spacing * (2.0 * (multiple - std::floor(multiple)) - 1.0);
  }
  return targets;
}

constexpr std::size_t max_measurements = 500'000;  // about 80 MB
// mm or rad; a shorter motion is rounding of the path: the axis is at rest and does not reverse.
constexpr double min_motion = 1e-9;
constexpr double limit_tolerance = 1e-9;  // mm or rad, rounding of a position on a limit

}  // namespace

kinematics::AxisState state_after_move(kinematics::AxisState state, const AxisVector& q) {
  for (int j = 0; j < int(q.size()); ++j) {
    const double displacement = q[j] - state.q[j];
    if (std::abs(displacement) <= min_motion) continue;
    const std::int8_t direction = displacement > 0.0 ? 1 : -1;
    std::int8_t& last_direction = state.direction[std::size_t(j)];
    // A new stroke begins with each reversal; the first motion is no reversal.
    if (last_direction != 0 && last_direction != direction) ++state.stroke[std::size_t(j)];
    last_direction = direction;
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
  double slide_distance = 0.0, rotation = 0.0;
  for (int j = 0; j < nominal_.size(); ++j) {
    const Joint& joint = nominal_.joints()[std::size_t(j)];
    const bool is_linear = joint.motion == Motion::Linear;
    const double unit = is_linear ? 1.0 : units::deg;
    if (!(q[j] >= joint.min - limit_tolerance && q[j] <= joint.max + limit_tolerance))
      throw_input_error(instrument_,
                        fmt::format("expected targets within the travel of {}, {:.6g} to {:.6g} "
                                    "{}, seen {:.6g}",
                                    joint.name, joint.min / unit, joint.max / unit,
                                    is_linear ? "mm" : "deg", q[j] / unit));
    const double displacement = q[j] - state_.q[j];
    if (is_linear)
      // Slides move together along a straight line, whereas rotary axes turn independently.
      slide_distance = std::hypot(slide_distance, displacement);
    else
      rotation = std::max(rotation, std::abs(displacement));
  }
  // A rotary axis turns at the rate at which a point at the instrument's radius has its speed.
  time_s_ += std::max(slide_distance, rotation * instrument_.radius) / instrument_.speed;
  state_ = state_after_move(std::move(state_), q);
}

void PlanBuilder::turn_spindle(int joint, double angle) {
  const double speed = instrument_.spindle_speed;
  time_s_ += std::abs(angle - state_.q[joint]) / speed;
  state_.q[joint] = angle;
  state_.direction[std::size_t(joint)] = 1;
  state_.spindle_speed = speed;
}

// The spindle stops at 0, the start of the next set-up.
void PlanBuilder::stop_spindle(int joint) {
  state_.q[joint] = 0.0;
  state_.spindle_speed = 0.0;
}

void PlanBuilder::run_spindle() { state_.spindle_speed = instrument_.spindle_speed; }

void PlanBuilder::read(int run, int target, const std::vector<int>& channels) {
  state_.time_s = time_s_;
  const int set_up = int(plan_.set_ups.size()) - 1;
  const auto record = [&](int channel) {
    if (plan_.measurements.size() >= max_measurements)
      throw_input_error(instrument_, fmt::format("expected at most {} readings", max_measurements));
    plan_.measurements.push_back({set_up, channel, run, target, state_});
  };
  const int channel_count = int(plan_.set_ups.back().channels.size());
  // In a set-up without channels only temperatures are logged.
  if (channel_count == 0) record(-1);
  if (channels.empty())
    for (int channel = 0; channel < channel_count; ++channel) record(channel);
  for (const int channel : channels) record(channel);
}

void PlanBuilder::move_along(const Path& path, double from, double to, int moves_per_target) {
  for (int i = 1; i <= moves_per_target; ++i)
    move(path(i == moves_per_target ? to : from + (to - from) * i / moves_per_target));
}

void PlanBuilder::read_both_directions(const Path& path, const Range& range, int moves_per_target,
                                       const std::vector<int>& channels) {
  const Eigen::VectorXd target_values =
      scatter_targets(targets(range, instrument_.targets), instrument_.scatter);
  const int count = int(target_values.size());
  // With the overshoot the first target of either direction is also approached in that direction.
  const double below = range.from - range.overshoot, above = range.to + range.overshoot;
  double position = below;
  const auto move_to = [&](double target_value) {
    move_along(path, position, target_value, moves_per_target);
    position = target_value;
  };
  const auto read_at = [&](int run, int target) {
    move_to(target_values[target]);
    wait(instrument_.dwell_s);
    read(run, target, channels);
  };
  for (int run = 0; run < instrument_.runs; ++run) {
    move_to(below);
    for (int i = 0; i < count; ++i) read_at(run, i);
    if (!instrument_.bidirectional) continue;
    move_to(above);
    for (int i = count - 1; i >= 0; --i) read_at(run, i);
  }
}

void PlanBuilder::visit(const std::vector<AxisVector>& positions,
                        const std::function<std::vector<int>(int)>& channels) {
  const auto read_at = [&](int run, int target) {
    move(positions[std::size_t(target)]);
    wait(instrument_.dwell_s);
    read(run, target, channels ? channels(target) : std::vector<int>());
  };
  const int count = int(positions.size());
  for (int run = 0; run < instrument_.runs; ++run) {
    for (int i = 0; i < count; ++i) read_at(run, i);
    if (!instrument_.bidirectional) continue;
    for (int i = count - 1; i >= 0; --i) read_at(run, i);
  }
}

Plan PlanBuilder::finish() && {
  plan_.duration_s = time_s_;
  const double first_reading_s =
      plan_.measurements.empty() ? 0.0 : plan_.measurements.front().state.time_s;
  for (Measurement& measurement : plan_.measurements)
    measurement.state.time_s += instrument_.start_s - first_reading_s;
  return std::move(plan_);
}

}  // namespace abbe::errors::metrology
