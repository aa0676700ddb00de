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

/// What one channel of one set-up read, in the order of the plan.
struct Series {
  const Readings& readings;
  int set_up = 0;                         ///< in the plan
  int channel = 0;                        ///< of that set-up
  std::vector<std::size_t> measurements;  ///< in the plan

  const SetUp& optics() const { return readings.plan.set_ups[std::size_t(set_up)]; }
  const Channel& sensor() const { return optics().channels[std::size_t(channel)]; }
  const Measurement& measurement(std::size_t i) const {
    return readings.plan.measurements[measurements[i]];
  }
  /// Of the set-up, and of the channel where there are several.
  std::string name() const;
};

/// Where the nominal machine has its bodies at a measurement.
Bodies nominal_at(const Series& series, std::size_t i);

/// Readings minus what a perfect set-up would read on the nominal machine. (measurements)
Eigen::VectorXd deviations(const Series& series);

/// Where the nominal machine has the point that is looked at, in the workpiece.
Eigen::Vector3d place_w(const Series& series, const kinematics::AxisVector& q);

/// Axes that do not stand still.
std::vector<int> moving_joints(const Series& series);

/// Deviations of a series as runs over positions along a path, the targets in their order on it.
/// @param along       (measurements) position on the path
/// @param from_below  (measurements) whether the measurement was approached from lower positions
/// @return nothing unless every run has every target once and no two targets are one
std::optional<PositionRuns> runs_of(const Series& series, const Eigen::VectorXd& along,
                                    const std::vector<bool>& from_below);

/// Readings of one channel while one axis moves.
struct AxisTest {
  std::string name;  ///< of set-up and channel
  char axis = 'X';
  int set_up = 0;        ///< in the plan
  bool angle = false;    ///< readings are rad, not mm
  bool rotary = false;   ///< targets are rad, not mm
  bool spindle = false;  ///< the axis is one
  bool axial = false;    ///< of a rotary axis: the sensor looks along it
  enum class TestKind {
    Positioning,
    Straightness,
    Angle,
    ErrorMotion
  } what = TestKind::Positioning;
  PositionRuns runs;  ///< reading minus where the nominal machine would be
};

/// The test that a series is of its one moving axis; nothing where runs lack a target.
std::optional<AxisTest> axis_test(const Series& series, int joint);

/// The runs without what the set-up adds to them: of a straightness the least-squares line of the
/// mean, of a radial error motion what goes once round (how the artefact is centred), of an axial
/// one the mean. Those of any other test as they are. Angles count by the arc that they stand for,
/// so that 0 and 360 degrees together count as one place.
PositionRuns form_of(const AxisTest& test);

/// Whether a radial error motion was read at too few places, 3, to part it from the centring.
bool is_hidden_by_centring(const AxisTest& test);

/// Lengths read while two slides go round a point.
struct CircleTest {
  std::string name;        ///< of set-up and channel, and of the run where there are several
  std::string plane;       ///< "XY": letters of the first and the second direction
  bool zero_known = true;  ///< else the bar only shows how its length changes
  CircularRuns runs;
};

/// One test a run; none if anything but two slides moves, or not on a circle about the socket.
/// @param moving  the axes that move
std::vector<CircleTest> circle_tests(const Series& series, const std::vector<int>& moving);

/// Displacements read while several slides move along one straight line.
struct DiagonalTest {
  std::string name;  ///< of set-up and channel
  DiagonalRuns runs;
};

/// Nothing if anything but slides moves, the way is not straight along the beam, or runs lack a
/// target.
/// @param moving  the axes that move, two or more
std::optional<DiagonalTest> diagonal_test(const Series& series, const std::vector<int>& moving);

// Readings of a machine sorted into what the standards evaluate.

/// Two straightness lines against one square.
struct SquareTest {
  std::string name;
  AxisTest first, second;
};

/// Channels of a set-up over time, the axes at rest.
struct DriftTest {
  std::string name;
  DriftLog log;             ///< reading minus the first of it
  std::vector<bool> angle;  ///< (columns)
};

/// Anything else: how far readings are from where the nominal machine would be.
struct OtherTest {
  std::string name;
  bool angle = false;
  Eigen::VectorXd deviation;  ///< (n) without its mean
  Eigen::VectorXd share;      ///< (n) so that each place of the axes counts once
};

struct Tests {
  std::vector<AxisTest> axes;
  std::vector<SquareTest> squares;
  std::vector<DiagonalTest> diagonals;
  std::vector<CircleTest> circles;
  std::vector<DriftTest> drifts;
  std::vector<OtherTest> others;
};

/// Sorts readings by their geometry and by which axes moved, not by the name of the instrument; the
/// order is that of the set-ups. Runs that lack a target are other tests.
Tests classify_readings(const Readings& readings);

}  // namespace abbe::errors::metrology
