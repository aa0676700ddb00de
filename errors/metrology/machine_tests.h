#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/circular.h"
#include "errors/metrology/drift.h"
#include "errors/metrology/positioning.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// Readings of one channel of one set-up, in the order of the plan.
struct Series {
  const Readings& readings;
  int set_up = 0;                         ///< index in the plan
  int channel = 0;                        ///< index in that set-up
  std::vector<std::size_t> measurements;  ///< indices in the plan

  const SetUp& optics() const { return readings.plan.set_ups[std::size_t(set_up)]; }
  const Channel& sensor() const { return optics().channels[std::size_t(channel)]; }
  const Measurement& measurement(std::size_t i) const {
    return readings.plan.measurements[measurements[i]];
  }
  /// Returns the name of the set-up, followed by that of the channel if there are several.
  std::string name() const;
};

/// Returns the nominal poses of the bodies at a measurement.
Bodies nominal_bodies_at(const Series& series, std::size_t i);

/// Returns the readings minus those of a perfect set-up on the nominal machine (measurements).
Eigen::VectorXd deviations(const Series& series);

/// Returns the nominal position of the measured point in the workpiece.
Eigen::Vector3d measured_point_w(const Series& series, const kinematics::AxisVector& q);

/// Returns the indices of the axes that move.
std::vector<int> moving_joints(const Series& series);

/// Returns the deviations of a series as runs over positions along a path, in ascending order of
/// the targets, or nothing unless every run has every target once and all targets are distinct.
/// @param along       (measurements) position on the path
/// @param from_below  (measurements) true if the measurement was approached from lower positions
std::optional<PositionRuns> position_runs(const Series& series, const Eigen::VectorXd& along,
                                          const std::vector<bool>& from_below);

/// Readings of one channel while one axis moves.
struct AxisTest {
  std::string name;  ///< of set-up and channel
  char axis = 'X';
  int set_up = 0;        ///< index in the plan
  bool angle = false;    ///< true: readings are rad; false: mm
  bool rotary = false;   ///< true: targets are rad; false: mm
  bool spindle = false;  ///< the axis is a spindle
  bool axial = false;    ///< for a rotary axis: the sensor measures along the axis
  enum class TestKind {
    Positioning,
    Straightness,
    Angle,
    ErrorMotion
  } what = TestKind::Positioning;
  PositionRuns runs;  ///< reading minus nominal value
};

/// Returns the test of the only moving axis, or nothing if runs lack a target.
std::optional<AxisTest> axis_test(const Series& series, int joint);

/// Returns the runs without the contribution of the set-up: the least-squares line of the mean of a
/// straightness, the component once per turn of a radial error motion (centring of the artefact),
/// the mean of an axial error motion. Runs of other tests are unchanged. Angles have the weight of
/// their arc, so that 0 and 360 degrees together count as one position.
PositionRuns form_of(const AxisTest& test);

/// Returns true if a radial error motion was read at too few positions, three or less, to separate
/// it from the centring of the artefact.
bool is_hidden_by_centring(const AxisTest& test);

/// Lengths read while two slides move around a point.
struct CircleTest {
  std::string name;        ///< of set-up and channel, and of the run if there are several
  std::string plane;       ///< "XY": letters of the first and the second direction
  bool zero_known = true;  ///< false: the bar measures changes of its length only
  CircularRuns runs;
};

/// Returns one test per run, or none unless exactly two slides move on a circle about the socket.
/// @param moving  the axes that move
std::vector<CircleTest> circle_tests(const Series& series, const std::vector<int>& moving);

/// Displacements read while several slides move along one straight line.
struct DiagonalTest {
  std::string name;  ///< of set-up and channel
  DiagonalRuns runs;
};

/// Returns the test, or nothing if other axes than slides move, the path is not straight along the
/// beam, or runs lack a target.
/// @param moving  the axes that move, two or more
std::optional<DiagonalTest> diagonal_test(const Series& series, const std::vector<int>& moving);

/// Two straightness lines against one square.
struct SquareTest {
  std::string name;
  AxisTest first, second;
};

/// Channels of a set-up over time with all axes at rest.
struct DriftTest {
  std::string name;
  DriftLog log;             ///< reading minus the first reading
  std::vector<bool> angle;  ///< (columns) true: rad; false: mm
};

/// Deviations of all other readings from the nominal machine.
struct OtherTest {
  std::string name;
  bool angle = false;
  Eigen::VectorXd deviation;  ///< (n) with zero mean
  Eigen::VectorXd weights;    ///< (n) weights by which each position of the axes counts once
};

/// Readings of a machine, sorted into the tests that the standards evaluate.
struct Tests {
  std::vector<AxisTest> axes;
  std::vector<SquareTest> squares;
  std::vector<DiagonalTest> diagonals;
  std::vector<CircleTest> circles;
  std::vector<DriftTest> drifts;
  std::vector<OtherTest> others;
};

/// Sorts readings into tests by their geometry and the axes that moved, not by the name of the
/// instrument, in the order of the set-ups. Runs that lack a target become other tests.
Tests classify_readings(const Readings& readings);

}  // namespace abbe::errors::metrology
