#include "errors/identification/check_readings.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "errors/metrology/observable.h"

namespace abbe::errors::identification {

using Eigen::Index;
using kinematics::Chain;
using kinematics::Joint;
using metrology::Look;
using metrology::Readings;

namespace {

bool near(double a, double b) { return a == b || std::abs(a - b) <= 1e-9; }

bool same(const Joint& a, const Joint& b) {
  return a.name == b.name && a.side == b.side && a.motion == b.motion && near(a.min, b.min) &&
         near(a.max, b.max) && (a.direction_b - b.direction_b).norm() <= 1e-9 &&
         (a.point_b - b.point_b).norm() <= 1e-9 && a.deviation_axes == b.deviation_axes &&
         a.squareness == b.squareness;
}

bool same(const Chain& a, const Chain& b) {
  const auto far_apart = [](const kinematics::Pose& S, const kinematics::Pose& T) {
    return (S.matrix() - T.matrix()).cwiseAbs().maxCoeff() > 1e-9;
  };
  if (a.size() != b.size() || far_apart(a.T_bw_home(), b.T_bw_home()) ||
      far_apart(a.T_bt_home(), b.T_bt_home()))
    return false;
  for (int i = 0; i < a.size(); ++i)
    if (!same(a.joints()[std::size_t(i)], b.joints()[std::size_t(i)])) return false;
  return true;
}

void check_measured(const Readings& readings) {
  const metrology::Plan& plan = readings.plan;
  const auto fault = [&](Index i, const std::string& what) {
    throw std::invalid_argument(fmt::format("reading {} of {}: {}", i + 1, plan.instrument, what));
  };
  if (readings.value.size() != 0 && readings.value.size() != Index(plan.looks.size()))
    throw std::invalid_argument(fmt::format("readings of {}: expected {} values, seen {}",
                                            plan.instrument, plan.looks.size(),
                                            readings.value.size()));
  for (Index i = 0; i < readings.value.size(); ++i) {
    const Look& look = plan.looks[std::size_t(i)];
    if (look.set_up < 0 || look.set_up >= int(plan.set_ups.size()))
      fault(i, fmt::format("there is no set-up {}", look.set_up));
    const auto& channels = plan.set_ups[std::size_t(look.set_up)].channels;
    if (channels.empty()) continue;
    if (look.channel < 0 || look.channel >= int(channels.size()))
      fault(i, fmt::format("there is no channel {}", look.channel));
    if (look.state.q.size() != readings.nominal.size() || !look.state.q.allFinite() ||
        !std::isfinite(look.state.time_s))
      fault(i, "expected one finite position of every axis");
    if (!std::isfinite(readings.value[i])) fault(i, "expected a finite number");
    const double noise = metrology::standard_deviation(channels[std::size_t(look.channel)]);
    if (!std::isfinite(noise)) fault(i, "expected a finite noise");
  }
}

}  // namespace

void check_readings(const GeometricErrors& model, std::span<const Readings> readings) {
  if (readings.empty()) throw std::invalid_argument("there are no readings");
  for (const Readings& r : readings) {
    check_measured(r);
    if (!same(r.nominal, readings.front().nominal))
      throw std::invalid_argument(fmt::format("readings of {} and of {} are of different machines",
                                              readings.front().plan.instrument, r.plan.instrument));
  }
  if (!values(model.elements).allFinite())
    throw std::invalid_argument("a starting value is not finite");
  for (const Element& element : model.elements)
    for (const Curve& curve : element.curves)
      if (is_random(curve))
        throw std::invalid_argument(to_string(element.name) + ": chance cannot be identified");
}

}  // namespace abbe::errors::identification
