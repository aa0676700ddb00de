#include "errors/identification/curve_readings.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "errors/bound_element.h"
#include "errors/identification/design.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using metrology::Readings;

constexpr Index samples = 121;

/// Numbers of one element: where they stand among all, and their basis at a state.
struct Numbers {
  int first = 0;
  int count = 0;
};

std::vector<Numbers> numbers_of(const GeometricErrors& belief) {
  std::vector<Numbers> result(belief.elements.size());
  const std::vector<Coefficient> all = coefficients(belief.elements);
  for (std::size_t i = 0; i < all.size(); ++i) {
    Numbers& one = result[std::size_t(all[i].element)];
    if (one.count++ == 0) one.first = int(i);
  }
  return result;
}

VectorXd basis_of(const Element& element, int count, const CurveState& state) {
  VectorXd result(count);
  Index at = 0;
  for (const Curve& curve : element.curves) {
    const VectorXd one = basis(curve, state);
    result.segment(at, one.size()) = one;
    at += one.size();
  }
  return result;
}

/// Covariance of the numbers of one element; what is not known there counts as exact.
Eigen::MatrixXd covariance_of(const GeometricErrors& belief, int element, const Numbers& numbers) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(numbers.count, numbers.count);
  const std::vector<Coefficient> all = coefficients(belief.elements);
  const auto& of = belief.covariance.of;
  const auto place = [&](const Coefficient& one) {
    return int(std::find(all.begin(), all.end(), one) - all.begin()) - numbers.first;
  };
  for (std::size_t i = 0; i < of.size(); ++i)
    for (std::size_t k = 0; k < of.size(); ++k)
      if (of[i].element == element && of[k].element == element)
        result(place(of[i]), place(of[k])) = belief.covariance.matrix(Index(i), Index(k));
  return result;
}

/// Whether a row bears on an element: whether its numbers, each 1 um or 10 urad, would change the
/// reading at least a quarter as much as those of the element that changes it most.
/// (rows x elements)
std::vector<std::vector<bool>> bears_on(const Design& design, const GeometricErrors& belief,
                                        const std::vector<Numbers>& numbers) {
  std::vector<std::vector<bool>> result(design.rows.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    std::vector<double> change(numbers.size(), 0.0);
    for (std::size_t e = 0; e < numbers.size(); ++e) {
      if (belief.elements[e].name.location || numbers[e].count == 0) continue;
      const double usual = belief.elements[e].name.is_angle() ? 10 * units::urad : units::um;
      change[e] = usual * design.A.row(Index(i)).segment(numbers[e].first, numbers[e].count).norm();
    }
    const double most = *std::max_element(change.begin(), change.end());
    for (const double one : change) result[i].push_back(most > 0.0 && one >= 0.25 * most);
  }
  return result;
}

/// The same at every position: nothing to draw.
bool is_constant(const Element& element) {
  return std::all_of(element.curves.begin(), element.curves.end(), [](const Curve& curve) {
    return std::holds_alternative<Constant>(curve.shape);
  });
}

/// What is needed to draw any element of an estimate.
struct Drawing {
  const Estimate& estimate;
  std::span<const Readings> readings;
  Design design;
  GeometricModel bound;
  std::vector<Numbers> numbers;
  std::vector<std::vector<bool>> bears_on;
  std::vector<bool> outlier;  ///< (rows)

  int joint(std::size_t e) const {
    return joint_of(estimate.belief.elements[e].name.axis, readings.front().nominal, "a belief");
  }
  VectorXd basis(std::size_t e, const kinematics::AxisState& state) const {
    return basis_of(estimate.belief.elements[e], numbers[e].count,
                    curve_state(bound, state, joint(e)));
  }
  VectorXd found(std::size_t e) const {
    return estimate.value.segment(numbers[e].first, numbers[e].count);
  }
  const kinematics::AxisState& state(std::size_t row) const {
    const Row& at = design.rows[row];
    return readings[std::size_t(at.readings)].plan.looks[std::size_t(at.look)].state;
  }
};

/// The readings of one element, each as its value.
void add_readings(const Drawing& drawing, std::size_t e, CurveReadings& curve) {
  std::vector<double> at, seen;
  for (std::size_t i = 0; i < drawing.bears_on.size(); ++i) {
    if (!drawing.bears_on[i][e] || drawing.outlier[i]) continue;
    const VectorXd b = drawing.basis(e, drawing.state(i));
    Index k = 0;
    if (b.cwiseAbs().maxCoeff(&k) == 0.0) continue;
    const double per_value = drawing.design.A(Index(i), drawing.numbers[e].first + k) / b[k];
    if (per_value == 0.0) continue;
    at.push_back(drawing.state(i).q[drawing.joint(e)]);
    seen.push_back(b.dot(drawing.found(e)) + drawing.estimate.fit_residual[Index(i)] / per_value);
  }
  curve.reading_q = VectorXd::Map(at.data(), Index(at.size()));
  curve.reading = VectorXd::Map(seen.data(), Index(seen.size()));
}

/// The curve over where it was read, or over the travel.
void add_curve(const Drawing& drawing, std::size_t e, CurveReadings& curve) {
  const kinematics::Chain& nominal = drawing.readings.front().nominal;
  const kinematics::Joint& joint = nominal.joints()[std::size_t(drawing.joint(e))];
  double least = joint.min, most = joint.max;
  if (curve.reading_q.size() > 0 && curve.reading_q.maxCoeff() > curve.reading_q.minCoeff()) {
    least = curve.reading_q.minCoeff();
    most = curve.reading_q.maxCoeff();
  } else if (joint.motion != kinematics::Motion::Linear) {
    least = std::max(least, -pi);
    most = std::min(most, pi);
  }
  curve.q = VectorXd::LinSpaced(samples, least, most);
  curve.value.resize(samples);
  curve.sigma.resize(samples);
  const Eigen::MatrixXd covariance =
      covariance_of(drawing.estimate.belief, int(e), drawing.numbers[e]);
  kinematics::AxisState state;
  state.q = kinematics::AxisVector::Zero(nominal.size());
  for (Index i = 0; i < samples; ++i) {
    state.q[drawing.joint(e)] = curve.q[i];
    const VectorXd b = drawing.basis(e, state);
    curve.value[i] = b.dot(drawing.found(e));
    curve.sigma[i] = std::sqrt(std::max(0.0, b.dot(covariance * b)));
  }
}

}  // namespace

std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const Readings> readings) {
  const GeometricErrors& belief = estimate.belief;
  Drawing drawing{estimate,
                  readings,
                  design(belief, readings),
                  bind(belief, readings.front().nominal),
                  numbers_of(belief),
                  {},
                  {}};
  drawing.bears_on = bears_on(drawing.design, belief, drawing.numbers);
  drawing.outlier.resize(drawing.bears_on.size(), false);
  for (const int i : estimate.outliers) drawing.outlier[std::size_t(i)] = true;
  std::vector<CurveReadings> result;
  for (std::size_t e = 0; e < drawing.numbers.size(); ++e) {
    const Element& element = belief.elements[e];
    if (element.name.location || drawing.numbers[e].count == 0 || is_constant(element)) continue;
    CurveReadings curve;
    curve.element = element.name;
    add_readings(drawing, e, curve);
    add_curve(drawing, e, curve);
    result.push_back(std::move(curve));
  }
  return result;
}

}  // namespace abbe::errors::identification
