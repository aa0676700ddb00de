#include "errors/metrology/machine_results.h"

#include <algorithm>
#include <cmath>

#include "errors/metrology/circle_result.h"
#include "errors/metrology/positioning.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

TestResult positioning_result(const std::string& name, const PositionRuns& runs, bool angle) {
  const Positioning p = positioning(runs);
  TestResult result{name, "ISO 230-2:2014 positioning"};
  std::vector<Figure>& f = result.figures;
  f = {{"targets", "", runs.target.size()},
       {"runs_up", "", runs.up.cols()},
       {"runs_down", "", runs.down.cols()},
       figure("A", p.A, angle)};
  const auto one_way = [&](const std::string& way, const std::optional<OneWayPositioning>& one) {
    if (!one) return;
    f.push_back(figure("A_" + way, one->A, angle));
    f.push_back(figure("E_" + way, one->E, angle));
    f.push_back(figure("R_" + way, one->R, angle));
  };
  one_way("up", p.up);
  one_way("down", p.down);
  f.push_back(figure("E", p.E, angle));
  f.push_back(figure("M", p.M, angle));
  f.push_back(figure("R", p.R, angle));
  f.push_back(figure("B", p.B, angle));
  f.push_back(figure("B_mean", p.B_mean, angle));
  return result;
}

/// Slope of the least-squares line through the mean of all runs.
double slope_of(const PositionRuns& runs) {
  const VectorXd from_middle = runs.target.array() - runs.target.mean();
  return from_middle.dot(mean_of(runs)) / from_middle.squaredNorm();
}

/// Range of the mean of all runs about the line through its ends.
double about_ends(const PositionRuns& runs) {
  const VectorXd mean = mean_of(runs), &t = runs.target;
  const Index last = t.size() - 1;
  return range(mean - (mean[last] - mean[0]) / (t[last] - t[0]) * t);
}

TestResult error_motion_result(const AxisTest& test) {
  const char* standard = !test.spindle ? "error motion over the angle"
                         : test.axial  ? "ISO 230-7:2015 axial error motion"
                                       : "ISO 230-7:2015 radial error motion";
  std::optional<double> synchronous, asynchronous;
  if (!hides_in_centring(test)) synchronous = range(mean_of(form_of(test)));
  for (const Eigen::MatrixXd* runs : {&test.runs.up, &test.runs.down})
    if (runs->cols() > 1)
      asynchronous = std::max(asynchronous.value_or(0.0),
                              (runs->rowwise().maxCoeff() - runs->rowwise().minCoeff()).maxCoeff());
  return {test.name,
          standard,
          {{"angles", "", test.runs.target.size()},
           figure("synchronous", synchronous),
           figure("asynchronous", asynchronous)}};
}

TestResult axis_result(const AxisTest& test) {
  if (test.what == AxisTest::What::ErrorMotion) return error_motion_result(test);
  if (test.what == AxisTest::What::Positioning)
    return positioning_result(test.name, test.runs, test.angle);
  const Positioning p = positioning(test.runs);
  const bool straight = test.what == AxisTest::What::Straightness;
  TestResult result{
      test.name,
      straight ? "ISO 230-1:2012 straightness" : "ISO 230-1:2012 angular error motion",
      {{"targets", "", test.runs.target.size()}}};
  std::vector<Figure>& f = result.figures;
  if (straight) {
    f.push_back(figure("straightness_lsq", range(mean_of(form_of(test))), test.angle));
    f.push_back(figure("straightness_ends", about_ends(test.runs), test.angle));
    f.push_back({"slope", "urad", slope_of(test.runs) / units::urad});
  } else {
    f.push_back(figure("range", range(mean_of(test.runs)), test.angle));
  }
  f.push_back(figure("R", p.R ? p.R : p.up ? p.up->R : p.down->R, test.angle));
  f.push_back(figure("B", p.B, test.angle));
  return result;
}

// Straightness slopes turn the lines the same way only if the axes turn apart.
TestResult square_result(const SquareTest& test) {
  const std::vector<std::string> axes{std::string(1, test.first.axis),
                                      std::string(1, test.second.axis)};
  return {test.name,
          "ISO 230-1:2012 squareness",
          {{"axes", "", axes},
           {"squareness", "urad",
            -(slope_of(test.first.runs) + slope_of(test.second.runs)) / units::urad},
           {"sign", "", "angle between the positive directions minus 90 degrees"}}};
}

bool is_face(const DiagonalTest& test) {
  const auto& signs = test.runs.signs;
  return std::count(signs.begin(), signs.end(), 0) > 0;
}

/// Body and face diagonals apart, and where one comes again, as from another start, a new set.
std::vector<std::vector<DiagonalTest>> sets_of(const std::vector<DiagonalTest>& tests) {
  std::vector<std::vector<DiagonalTest>> sets;
  for (const DiagonalTest& test : tests) {
    const auto fits = [&](const std::vector<DiagonalTest>& set) {
      return is_face(set.front()) == is_face(test) &&
             std::none_of(set.begin(), set.end(), [&](const DiagonalTest& other) {
               return other.runs.signs == test.runs.signs;
             });
    };
    const auto set = std::find_if(sets.begin(), sets.end(), fits);
    if (set == sets.end())
      sets.push_back({test});
    else
      set->push_back(test);
  }
  return sets;
}

TestResult diagonals_result(const std::vector<DiagonalTest>& tests) {
  std::vector<DiagonalRuns> set;
  for (const DiagonalTest& test : tests) set.push_back(test.runs);
  const Diagonals d = diagonals(set);
  TestResult result{is_face(tests.front()) ? "face diagonals" : "body diagonals",
                    "ISO 230-6:2002 diagonals",
                    {figure("E_d", d.E_d), figure("B_d", d.B_d)}};
  for (const DiagonalTest& test : tests)
    result.diagonals.push_back(positioning_result(test.name, test.runs.runs, false));
  return result;
}

TestResult drift_result(const DriftTest& test) {
  TestResult result{test.name, "ISO 230-3:2020 thermal drift"};
  const VectorXd& t = test.log.time_s;
  std::vector<DriftInterval> intervals{{"whole", t[0], t[t.size() - 1]}};
  if (t[t.size() - 1] - t[0] > 3600.0)
    intervals.insert(intervals.begin(), {"first_hour", t[0], t[0] + 3600.0});
  for (const DriftRange& one : drift(test.log, intervals)) {
    const double hours = (one.interval.to_s - one.interval.from_s) / 3600.0;
    FigureGroup interval{one.interval.name, {{"hours", "", hours}}};
    for (std::size_t c = 0; c < test.log.names.size(); ++c)
      interval.groups.push_back({test.log.names[c],
                                 {figure("range", one.range[Index(c)], test.angle[c]),
                                  figure("change", one.change[Index(c)], test.angle[c])}});
    result.groups.push_back(std::move(interval));
  }
  return result;
}

TestResult other_result(const OtherTest& test) {
  return {test.name,
          "range of the readings minus the nominal machine",
          {{"readings", "", test.deviation.size()},
           figure("range", range(test.deviation), test.angle),
           figure("rms", std::sqrt(test.share.dot(test.deviation.cwiseAbs2())), test.angle)}};
}

}  // namespace

std::vector<TestResult> results_of(const Tests& tests) {
  std::vector<TestResult> results;
  for (const AxisTest& test : tests.axes) results.push_back(axis_result(test));
  for (const SquareTest& test : tests.squares) results.push_back(square_result(test));
  for (const auto& set : sets_of(tests.diagonals)) results.push_back(diagonals_result(set));
  for (const CircleTest& test : tests.circles) results.push_back(circle_result(test));
  for (const DriftTest& test : tests.drifts) results.push_back(drift_result(test));
  for (const OtherTest& test : tests.others) results.push_back(other_result(test));
  return results;
}

}  // namespace abbe::errors::metrology
