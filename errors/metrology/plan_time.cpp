#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "errors/metrology/plans.h"
#include "kinematics/jacobian.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

/// A spindle with its line in the workpiece and the side that its artefact is on.
struct Turning {
  StandAxis axis;
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

/// A channel of the artefact's ball at a place, by sensors on the side that does not turn.
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

/// Two balls on the spindle's line, X1 and Y1 at the first, X2 and Y2 a lever along, Z at the
/// first.
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
  // On a turning workpiece the ball's place itself goes round.
  (spindle.carries_tool ? result.eccentricity_sigma : result.point_of_sigma) =
      instrument.position_sigma;
  return result;
}

int readings_over_time(const Instrument& instrument) {
  return int(std::floor(instrument.duration_s / instrument.interval_s + 1e-9)) + 1;
}

}  // namespace

Plan spindle(const Instrument& instrument, const Chain& nominal) {
  if (!(instrument.spindle_speed > 0.0))
    refuse(instrument, fmt::format("expected a spindle speed above 0, seen {} rpm",
                                   instrument.spindle_speed / units::rpm));
  const Stand stand = metrology::stand(instrument, nominal);
  const std::vector<Turning> list = spindles(instrument, nominal, stand.q);
  if (list.empty()) refuse(instrument, "expected a spindle to measure, seen none");
  Walk walk(instrument, nominal, stand.q);
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

// The machine stands, its spindle turning if it is commanded to; the sensors are read as it comes
// by the same angle.
Plan drift(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
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
  Walk walk(instrument, nominal, stand.q);
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
  const Stand stand = metrology::stand(instrument, nominal);
  Walk walk(instrument, nominal, stand.q);
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
