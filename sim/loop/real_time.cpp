#include "sim/loop/real_time.h"

#include <algorithm>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "sim/compensation/channels.h"

namespace abbe::sim {
namespace {

using compensation::Course;
using Eigen::Index;
using Eigen::VectorXd;
using kinematics::AxisState;
using kinematics::AxisVector;
using Channel = CaseDescription::Channel;

constexpr double arm = 200.0;  // mm, at which an angle counts as a length

template <typename Row>
Course course_of(const std::vector<AxisState>& states, Index columns, const Row& row) {
  Course course{VectorXd(Index(states.size())), Eigen::MatrixXd(Index(states.size()), columns)};
  for (std::size_t i = 0; i < states.size(); ++i) {
    course.time_s[Index(i)] = states[i].time_s;
    course.value.row(Index(i)) = row(i).transpose();
  }
  return course;
}

/// An axis that nothing is wanted of has no box, so it stands where it stood without one.
VectorXd counts_of(const Seen& seen, const Course& wanted) {
  const auto& joints = seen.machine.control.joints();
  const CompensationDescription::Pulses& pulses = seen.compensation.pulses;
  VectorXd counts = VectorXd::Zero(Index(joints.size()));
  for (int i = 0; i < seen.machine.control.size(); ++i) {
    const bool slide = joints[std::size_t(i)].motion == kinematics::Motion::Linear;
    const double count = slide ? pulses.count : pulses.count_rad;
    if (!is_spindle(seen.machine, i) && wanted.value.col(i).cwiseAbs().maxCoeff() > 1e-6 * count)
      counts[i] = count;
  }
  return counts;
}

/// What of the wanted correction the channel lets through, before the position loop.
Course arriving(const Seen& seen, Channel channel, const Course& wanted,
                const std::vector<AxisState>& commanded) {
  const CompensationDescription& limits = seen.compensation;
  if (channel == Channel::Open) return compensation::through(wanted, limits.open);
  if (channel == Channel::Origin)
    return compensation::through(wanted, limits.origin, seen.machine.control.joints());
  compensation::Pulses pulses;
  pulses.count = counts_of(seen, wanted);
  pulses.cycle_s = limits.pulses.cycle_s;
  pulses.pulse_s = limits.pulses.pulse_s;
  pulses.phase_seed = seen.seed;
  return compensation::through(
      wanted, pulses, course_of(commanded, wanted.value.cols(), [&](std::size_t i) -> VectorXd {
        return commanded[i].q;
      }));
}

/// The samples of the program with others between them at the knots of a course.
struct Merged {
  program::Samples samples;          ///< as commanded
  std::vector<AxisVector> nominal;   ///< (samples) as the nominal machine would be commanded
  std::vector<std::ptrdiff_t> knot;  ///< (samples) the knot there, -1 between knots
};

AxisState between(const AxisState& a, const AxisState& b, double time_s) {
  AxisState state = b;
  const double u = (time_s - a.time_s) / (b.time_s - a.time_s);
  state.q = a.q + u * (b.q - a.q);
  state.time_s = time_s;
  return state;
}

Merged merged(const Seen& seen, const std::vector<AxisState>& commanded, const VectorXd& knots) {
  Merged all;
  const auto& nominal = seen.samples.states;
  const auto add = [&](const AxisState& state, const AxisVector& q, std::size_t i,
                       std::ptrdiff_t knot) {
    all.samples.states.push_back(state);
    all.samples.line.push_back(seen.samples.line[i]);
    all.samples.block.push_back(seen.samples.block[i]);
    all.nominal.push_back(q);
    all.knot.push_back(knot);
  };
  Index k = 0;
  for (std::size_t i = 0, next = 0; i < commanded.size(); i = next) {
    const double time_s = commanded[i].time_s;
    for (; k < knots.size() && knots[k] < time_s; ++k)
      if (i > 0)
        add(between(commanded[i - 1], commanded[i], knots[k]),
            between(nominal[i - 1], nominal[i], knots[k]).q, i, k);
    const Index first = k;
    while (k < knots.size() && knots[k] == time_s) ++k;
    const bool knot_here = k > first;
    // samples of one instant are a reversal: the first is before a jump there, the others after it
    add(commanded[i], nominal[i].q, i, knot_here ? first : -1);
    for (next = i + 1; next < commanded.size() && commanded[next].time_s == time_s; ++next)
      add(commanded[next], nominal[next].q, next, knot_here ? k - 1 : -1);
    if (next == i + 1 && k - first > 1) add(commanded[i], nominal[i].q, i, k - 1);
  }
  return all;
}

VectorXd value_at_sample(const Course& course, compensation::CourseWalk& walk, const Merged& all,
                         std::size_t i) {
  return all.knot[i] >= 0 ? VectorXd(course.value.row(all.knot[i]).transpose())
                          : walk.at(all.samples.states[i].time_s);
}

Commands with_samples(const Seen& seen, Merged& all) {
  Commands result;
  result.T_wt_nominal.resize(all.nominal.size());
  tbb::parallel_for(std::size_t(0), all.nominal.size(), [&](std::size_t i) {
    result.T_wt_nominal[i] = seen.machine.nominal.tool_in_workpiece(all.nominal[i]);
  });
  result.samples = std::move(all.samples);
  return result;
}

/// Displacement of the tip in its own frame that the corrections would make.
Course wanted_of_tool(const Seen& seen, const std::vector<AxisState>& commanded,
                      const std::vector<AxisState>& ideal) {
  return course_of(commanded, 3, [&](std::size_t i) -> VectorXd {
    const kinematics::Pose from = seen.machine.control.tool_in_workpiece(commanded[i].q);
    const kinematics::Pose to = seen.machine.control.tool_in_workpiece(ideal[i].q);
    return from.linear().transpose() * (to.translation() - from.translation());
  });
}

Commands through_piezo(const Seen& seen, const std::vector<AxisState>& commanded,
                       const std::vector<AxisState>& ideal) {
  const compensation::Piezo& piezo = seen.compensation.piezo;
  const Course stroke =
      compensation::thinned(compensation::through(wanted_of_tool(seen, commanded, ideal), piezo),
                            VectorXd::Constant(1, 0.1 * seen.chord_tolerance));
  Merged all = merged(seen, commanded, stroke.time_s);
  compensation::CourseWalk walk(stroke);
  VectorXd strokes(Index(all.knot.size()));
  for (std::size_t i = 0; i < all.knot.size(); ++i)
    strokes[Index(i)] = value_at_sample(stroke, walk, all, i)[0];
  Commands result = with_samples(seen, all);
  result.piezo = {piezo, std::move(strokes)};
  return result;
}

Commands through_axes(const Seen& seen, Channel channel, const std::vector<AxisState>& commanded,
                      const std::vector<AxisState>& ideal) {
  const Index n = seen.machine.control.size();
  const Course wanted = course_of(
      commanded, n, [&](std::size_t i) -> VectorXd { return ideal[i].q - commanded[i].q; });
  VectorXd tolerance = VectorXd::Constant(n, 0.1 * seen.chord_tolerance);
  for (int i = 0; i < n; ++i)
    if (seen.machine.control.joints()[std::size_t(i)].motion != kinematics::Motion::Linear)
      tolerance[i] /= arm;
  const Course course = compensation::thinned(
      compensation::followed_by(arriving(seen, channel, wanted, commanded), seen.compensation.loop),
      tolerance);
  Merged all = merged(seen, commanded, course.time_s);
  compensation::CourseWalk walk(course);
  std::vector<AxisVector> correction(all.knot.size());
  for (std::size_t i = 0; i < all.knot.size(); ++i) {
    correction[i] = value_at_sample(course, walk, all, i);
    all.samples.states[i].q += correction[i];
  }
  Commands result = with_samples(seen, all);
  result.correction = std::move(correction);
  return result;
}

}  // namespace

Commands through_time(const Seen& seen, Channel channel, const std::vector<AxisState>& commanded,
                      const std::vector<AxisState>& ideal) {
  try {
    return channel == Channel::Piezo ? through_piezo(seen, commanded, ideal)
                                     : through_axes(seen, channel, commanded, ideal);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(seen.file.string(), 0, 0, "a channel that this program can pass through",
                   fault.what());
  }
}

}  // namespace abbe::sim
