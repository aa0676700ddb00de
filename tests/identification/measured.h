#pragma once

#include "errors/coefficients.h"
#include "errors/curve.h"
#include "errors/geometric.h"
#include "errors/identification/estimate.h"
#include "errors/metrology/instrument.h"
#include "errors/metrology/readings.h"
#include "tests/errors/machines.h"
#include "tests/test.h"

/// Machines within limits, truths in a model's own basis, and readings of them.
namespace abbe::errors::identification {

inline kinematics::Joint within(kinematics::Joint joint, double min, double max) {
  joint.min = min;
  joint.max = max;
  return joint;
}

/// "w C' b X Y Z A s t": a five-axis gantry of 600 x 700 x 400 mm.
inline kinematics::Chain measured_gantry() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1), head(0, 0, 200);
  const double turn = 2.0 * pi;
  return kinematics::Chain({within(joint('C', Workpiece, Rotary, ez, {0, 0, 0}), -turn, turn),
                            within(joint('X', Tool, Linear, ex, head), -300, 300),
                            within(joint('Y', Tool, Linear, ey, head), -350, 350),
                            within(joint('Z', Tool, Linear, ez, head), -50, 350),
                            within(joint('A', Tool, Rotary, ex, head), -1.9, 1.9),
                            joint('s', Tool, Spindle, ez, {0, 0, 50})},
                           at(0, 0, 0), at(0, 0, 0));
}

/// "w Y' X' b Z t", squareness of travel; every joint's point lies at the tip.
inline kinematics::Chain three_axes(
    kinematics::Squareness squareness = kinematics::Squareness::Travel) {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1), none(0, 0, 0);
  std::vector<kinematics::Joint> joints = {within(joint('Y', Workpiece, Linear, ey, none), 0, 300),
                                           within(joint('X', Workpiece, Linear, ex, none), 0, 400),
                                           within(joint('Z', Tool, Linear, ez, none), 0, 250)};
  for (kinematics::Joint& j : joints) j.squareness = squareness;
  return kinematics::Chain(joints, at(0, 0, 0), at(0, 0, 0));
}

/// "w b X Y Z t": the slides all carry the tool.
inline kinematics::Chain tool_side_axes() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1), none(0, 0, 0);
  std::vector<kinematics::Joint> joints = {within(joint('X', Tool, Linear, ex, none), 0, 400),
                                           within(joint('Y', Tool, Linear, ey, none), 0, 300),
                                           within(joint('Z', Tool, Linear, ez, none), 0, 250)};
  for (kinematics::Joint& j : joints) j.squareness = kinematics::Squareness::Travel;
  return kinematics::Chain(joints, at(0, 0, 0), at(0, 0, 0));
}

/// mm or rad, by what a number of a curve is multiplied with.
inline bool is_angle(const Coefficient& c, const GeometricErrors& model) {
  return model.elements[std::size_t(c.element)].name.is_angle();
}

inline bool is_held(const Coefficient& c, const GeometricErrors& model) {
  const auto& of = model.covariance.of;
  const auto at = std::find(of.begin(), of.end(), c);
  return at != of.end() && model.covariance.matrix(at - of.begin(), at - of.begin()) == 0.0;
}

/// Every number that is sought drawn: normal, 10 um and 30 urad of standard deviation.
inline GeometricErrors drawn_truth(const GeometricErrors& model, std::uint64_t seed,
                                   double mm = 0.010, double rad = 30e-6) {
  const std::vector<Coefficient> all = coefficients(model.elements);
  VectorXd v = VectorXd::Zero(Index(all.size()));
  for (std::size_t i = 0; i < all.size(); ++i)
    if (!is_held(all[i], model))
      v[Index(i)] = (is_angle(all[i], model) ? rad : mm) * normal_deviate(seed, i);
  GeometricErrors truth = model;
  truth.elements = with_values(model.elements, v);
  truth.covariance = {};
  return truth;
}

inline metrology::MachineUnderTest machine_of(const GeometricErrors& truth,
                                              const kinematics::Chain& chain) {
  return [model = bind(truth, chain), chain](const kinematics::AxisState& state) {
    const auto D = deviations(model, state);
    return metrology::BodyPoses{chain.workpiece_in_bed(state.q, D), chain.tool_in_bed(state.q, D)};
  };
}

inline metrology::Plan quiet(metrology::Plan plan) {
  for (metrology::SetUp& set_up : plan.set_ups) {
    for (metrology::Channel& channel : set_up.channels) channel.noise = channel.resolution = 0.0;
    set_up.rotation_sigma = set_up.point_of_sigma = set_up.point_in_sigma = 0.0;
    set_up.normal_sigma = set_up.eccentricity_sigma = 0.0;
    set_up.scale_sigma = set_up.drift_sigma = 0.0;
  }
  return plan;
}

/// Readings without noise, set up perfectly, that say of themselves what the plan says.
inline metrology::Readings noise_free(const metrology::Plan& plan, const kinematics::Chain& chain,
                                      const GeometricErrors& truth) {
  metrology::Readings readings =
      metrology::measure(quiet(plan), chain, machine_of(truth, chain), 1);
  readings.plan = plan;
  return readings;
}

/// Standard deviation of every number of a model, 0 where the estimate has none.
inline VectorXd standard_deviations(const Estimate& estimate) {
  const std::vector<Coefficient> all = coefficients(estimate.belief.elements);
  const Covariance& covariance = estimate.belief.covariance;
  VectorXd sigma = VectorXd::Zero(Index(all.size()));
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto k = Index(i);
    const auto at = std::find(all.begin(), all.end(), covariance.of[i]) - all.begin();
    sigma[at] = std::sqrt(covariance.matrix(k, k));
  }
  return sigma;
}

/// Largest difference of two sets of values over the largest value of their kind (mm, rad), over
/// the numbers whose standard deviation is below `known` of that (all, if sigma is empty).
inline double relative_difference(const VectorXd& value, const GeometricErrors& truth,
                                  const VectorXd& sigma = {}, double known = 1.0) {
  const std::vector<Coefficient> all = coefficients(truth.elements);
  const VectorXd expected = values(truth.elements);
  const auto kind = [&](std::size_t i) { return is_angle(all[i], truth) ? 1 : 0; };
  double largest[2] = {0, 0};
  for (std::size_t i = 0; i < all.size(); ++i)
    largest[kind(i)] = std::max(largest[kind(i)], std::abs(expected[Index(i)]));
  double result = 0.0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto k = Index(i);
    const double off = std::abs(value[k] - expected[k]);
    if (off == 0.0 || (sigma.size() > 0 && sigma[k] > known * largest[kind(i)])) continue;
    result = std::max(result, off / largest[kind(i)]);
  }
  return result;
}

}  // namespace abbe::errors::identification
