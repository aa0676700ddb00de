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
  } test_kind = TestKind::Positioning;
  PositionRuns runs;  ///< reading minus nominal value
};

/// Returns the runs without the contribution of the set-up: the least-squares line of the mean of a
/// straightness, the component once per turn of a radial error motion (centring of the artefact),
/// the mean of an axial error motion. Runs of other tests are unchanged. Angles have the weight of
/// their arc, so that 0 and 360 degrees together count as one position.
PositionRuns form_runs(const AxisTest& test);

/// Returns true if a radial error motion was read at too few positions, three or less, to separate
/// it from the centring of the artefact.
bool is_hidden_by_centring(const AxisTest& test);

/// Lengths read while two slides move around a point.
struct CircleTest {
  std::string name;           ///< of set-up and channel, and of the run if there are several
  std::string plane;          ///< "XY": letters of the first and the second direction
  bool is_zero_known = true;  ///< false: the bar measures changes of its length only
  CircularRuns runs;
};

/// Displacements read while several slides move along one straight line.
struct DiagonalTest {
  std::string name;  ///< of set-up and channel
  DiagonalRuns runs;
};

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
struct MachineTests {
  std::vector<AxisTest> axes;
  std::vector<SquareTest> squares;
  std::vector<DiagonalTest> diagonals;
  std::vector<CircleTest> circles;
  std::vector<DriftTest> drifts;
  std::vector<OtherTest> others;
};

/// Sorts readings into tests by their geometry and the axes that moved, not by the name of the
/// instrument, in the order of the set-ups. Runs that lack a target become other tests.
MachineTests classify_readings(const Readings& readings);

}  // namespace abbe::errors::metrology
