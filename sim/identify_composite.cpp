#include "sim/identify_composite.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/identification/composite.h"
#include "kinematics/units.h"
#include "sim/evaluate_tests.h"

namespace abbe::sim {
namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Eigen::VectorXd;
using errors::metrology::Readings;
using identification::CompositeRun;
using identification::CompositeStatus;
using Json = nlohmann::ordered_json;

/// Mean temperatures of some sensors while a set-up stood.
VectorXd mean_C(const Readings& readings, int set_up, const std::vector<std::string>& sensors) {
  VectorXd sum = VectorXd::Zero(Index(sensors.size()));
  int count = 0;
  for (std::size_t i = 0; i < readings.plan.looks.size(); ++i) {
    if (readings.plan.looks[i].set_up != set_up) continue;
    ++count;
    for (std::size_t k = 0; k < sensors.size(); ++k) {
      const auto found = std::find(readings.sensors.begin(), readings.sensors.end(), sensors[k]);
      if (found == readings.sensors.end())
        throw std::invalid_argument("expected a sensor that was logged, seen " + sensors[k]);
      sum[Index(k)] += readings.T_C(Index(i), found - readings.sensors.begin());
    }
  }
  return sum / count;
}

/// The runs of every axis, start by start.
std::map<char, std::vector<CompositeRun>> runs_of(const Readings& readings,
                                                  const std::vector<std::string>& sensors) {
  std::map<char, std::vector<CompositeRun>> axes;
  std::map<char, VectorXd> cold_C;
  const Tests tests = tests_of(readings);
  for (const AxisTest& test : tests.axes) {
    if (test.what != AxisTest::What::Positioning || test.rotary) continue;
    const VectorXd T_C = mean_C(readings, test.set_up, sensors);
    const bool cold = axes[test.axis].empty();
    if (cold) cold_C[test.axis] = T_C;
    axes[test.axis].push_back(
        {test.runs.target, mean_of(test.runs), T_C - cold_C[test.axis], cold});
  }
  if (axes.empty()) throw std::invalid_argument("expected the positioning of slides");
  return axes;
}

const char* sentence(CompositeStatus status) {
  switch (status) {
    case CompositeStatus::NoLaterRun:
      return "expected readings from several starts (start_h), seen one";
    case CompositeStatus::CurveNotDetermined:
      return "expected more targets than the degree of the cold curve";
    case CompositeStatus::SlopeNotDetermined:
      return "expected starts, one more than sensors, at which their temperatures part";
    default:
      return "expected a cold run";
  }
}

Json axis_json(char axis, const identification::CompositeFit& fit,
               const std::vector<std::string>& sensors) {
  Json slopes = Json::array(), per_K = Json::object();
  for (Index i = 0; i < fit.slope.size(); ++i)
    slopes.push_back({{"start", fit.later[std::size_t(i)] + 1},
                      {"slope_um_per_m", fit.slope[i] / 1e-6},
                      {"standard_error", fit.slope_error[i] / 1e-6},
                      {"offset_um", fit.offset[i] / units::um}});
  for (std::size_t k = 0; k < sensors.size(); ++k) per_K[sensors[k]] = fit.thermal[Index(k)] / 1e-6;
  return {{"axis", std::string(1, axis)},
          {"zero_of_dT", "start 1"},
          {"slopes", slopes},
          {"slope_um_per_m_K", per_K},
          {"rms_um", fit.rms / units::um}};
}

}  // namespace

Composite identify_composite(const Readings& readings, const std::vector<std::string>& sensors,
                             int degree) {
  if (sensors.empty()) throw std::invalid_argument("expected sensors to regress the slopes on");
  Composite result;
  result.axes = Json::array();
  for (const auto& [axis, runs] : runs_of(readings, sensors)) {
    identification::CompositeOptions options;
    options.degree = degree;
    const identification::CompositeFit fit = identification::separate(runs, options);
    if (fit.status != CompositeStatus::Ok)
      throw std::invalid_argument(fmt::format("{}: {}", axis, sentence(fit.status)));
    VectorXd c = fit.geometric;
    for (Index k = 0; k < c.size(); ++k) c[k] *= std::pow(fit.curve_scale, double(k));
    result.cold.elements.push_back({errors::ElementName{axis, axis, false},
                                    {{errors::Polynomial{c, 0.0, fit.curve_scale}, "cold"}}});
    result.axes.push_back(axis_json(axis, fit, sensors));
    for (Index k = 0; k < fit.slope_fit.vif.size(); ++k)
      if (fit.slope_fit.vif[k] > 10.0)
        result.warnings.push_back(
            fmt::format("{}: {} says nearly what the other sensors say (VIF {:.0f})", axis,
                        sensors[std::size_t(k)], fit.slope_fit.vif[k]));
  }
  return result;
}

}  // namespace abbe::sim
