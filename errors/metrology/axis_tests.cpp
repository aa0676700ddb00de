#include "errors/metrology/axis_tests.h"

#include <cmath>
#include <utility>

#include "errors/metrology/shares.h"
#include "kinematics/least_squares.h"

namespace abbe::errors::metrology {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// Direction in which a channel looks, in the bed, at its first look.
Eigen::Vector3d sight_b(const Series& series) {
  const Bodies nominal = nominal_at(series, 0);
  const Channel& sensor = series.sensor();
  if (sensor.in == Body::Bed) return sensor.direction_in;
  return (sensor.in == Body::Workpiece ? nominal.T_bw : nominal.T_bt).linear() *
         sensor.direction_in;
}

/// Whether a length is read along the travel, not across it: by how much the nominal machine
/// itself moves the reading.
bool reads_along(const Series& series, int joint) {
  std::size_t far = 0;
  const auto moved = [&](std::size_t i) {
    return std::abs(series.look(i).state.q[joint] - series.look(0).state.q[joint]);
  };
  for (std::size_t i = 1; i < series.looks.size(); ++i)
    if (moved(i) > moved(far)) far = i;
  const auto first = nominal_at(series, 0), last = nominal_at(series, far);
  const double seen = reading(series.optics(), series.channel, {}, last, last) -
                      reading(series.optics(), series.channel, {}, first, first);
  return std::abs(seen) > 0.5 * moved(far);
}

AxisTest::What what_is_tested(const Series& series, int joint, const AxisTest& test) {
  using What = AxisTest::What;
  if (test.rotary) return test.angle ? What::Positioning : What::ErrorMotion;
  if (test.angle) return What::Angle;
  return reads_along(series, joint) ? What::Positioning : What::Straightness;
}

// Readings count from an arbitrary zero: here from the mean at the target nearest to the axis's.
void count_from_zero(PositionRuns& runs) {
  Index nearest = 0;
  runs.target.cwiseAbs().minCoeff(&nearest);
  double zero = 0.0;
  const Index n = runs.up.cols() + runs.down.cols();
  if (runs.up.cols() > 0) zero += runs.up.row(nearest).sum();
  if (runs.down.cols() > 0) zero += runs.down.row(nearest).sum();
  runs.up.array() -= zero / double(n);
  runs.down.array() -= zero / double(n);
}

}  // namespace

std::optional<AxisTest> axis_test(const Series& series, int joint) {
  const kinematics::Joint& axis = series.readings.nominal.joints()[std::size_t(joint)];
  VectorXd along(Index(series.looks.size()));
  std::vector<bool> from_below;
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    along[Index(i)] = series.look(i).state.q[joint];
    from_below.push_back(series.look(i).state.direction[std::size_t(joint)] >= 0);
  }
  auto runs = runs_of(series, along, from_below);
  if (!runs) return std::nullopt;
  count_from_zero(*runs);
  AxisTest test;
  test.name = series.name();
  test.axis = axis.name;
  test.set_up = series.set_up;
  test.angle = series.sensor().is_angle();
  test.rotary = axis.motion != kinematics::Motion::Linear;
  if (test.rotary) {
    test.spindle = axis.motion == kinematics::Motion::Spindle || axis.name == 'S';
    test.axial = std::abs(sight_b(series).dot(axis.direction_b)) > 0.7;
  }
  test.what = what_is_tested(series, joint, test);
  test.runs = std::move(*runs);
  return test;
}

bool hides_in_centring(const AxisTest& test) {
  if (test.what != AxisTest::What::ErrorMotion || test.axial) return false;
  Eigen::MatrixX2d place(test.runs.target.size(), 2);
  place << test.runs.target.array().cos(), test.runs.target.array().sin();
  return place_shares(place, 1e-9).sum() < 3.5;
}

PositionRuns form_of(const AxisTest& test) {
  PositionRuns runs = test.runs;
  const VectorXd& t = runs.target;
  Eigen::MatrixXd set_up = Eigen::MatrixXd::Ones(t.size(), 1);
  VectorXd root = VectorXd::Ones(t.size());
  if (test.what == AxisTest::What::Straightness) {
    set_up.conservativeResize(Eigen::NoChange, 2);
    set_up.col(1) = t.array() - t.mean();
  } else if (test.what != AxisTest::What::ErrorMotion) {
    return runs;
  } else {
    root = arc_shares(t).cwiseSqrt();
    if (!test.axial && !hides_in_centring(test)) {
      set_up.conservativeResize(Eigen::NoChange, 3);
      set_up.col(1) = t.array().cos();
      set_up.col(2) = t.array().sin();
    }
  }
  const Eigen::MatrixXd weighted = root.asDiagonal() * set_up;
  const VectorXd added =
      set_up * least_squares(weighted, VectorXd(root.cwiseProduct(mean_of(runs)))).x;
  runs.up.colwise() -= added;
  runs.down.colwise() -= added;
  return runs;
}

}  // namespace abbe::errors::metrology
