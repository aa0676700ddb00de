#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/circular.h"
#include "errors/metrology/diagonals.h"
#include "errors/metrology/drift.h"
#include "errors/metrology/positioning.h"
#include "errors/metrology/readings.h"

/// Readings of `measure` sorted into what the standards evaluate.
namespace abbe::sim {

/// Readings of one channel while one axis moves.
struct AxisTest {
  std::string name;  ///< of set-up and channel
  char axis = 'X';
  int set_up = 0;        ///< in the plan
  bool angle = false;    ///< readings are rad, not mm
  bool rotary = false;   ///< targets are rad, not mm
  bool spindle = false;  ///< the axis is one
  bool axial = false;    ///< of a rotary axis: the sensor looks along it
  enum class What { Positioning, Straightness, Angle, ErrorMotion } what = What::Positioning;
  errors::metrology::PositionRuns runs;  ///< reading minus where the nominal machine would be
};

/// Two straightness lines against one square.
struct SquareTest {
  std::string name;
  AxisTest first, second;
};

struct DiagonalTest {
  std::string name;
  errors::metrology::DiagonalRuns runs;
};

struct CircleTest {
  std::string name;
  std::string plane;       ///< "XY": letters of the first and the second direction
  bool zero_known = true;  ///< else the bar only tells how its length changes
  errors::metrology::CircularRuns runs;
};

struct DriftTest {
  std::string name;
  errors::metrology::DriftLog log;  ///< reading minus the first of it
  std::vector<bool> angle;          ///< (columns)
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
Tests tests_of(const errors::metrology::Readings& readings);

/// Mean of all runs, of both ways. (targets)
Eigen::VectorXd mean_of(const errors::metrology::PositionRuns& runs);

/// The runs without what the set-up adds to them: of a straightness the least-squares line of the
/// mean, of a radial error motion what goes once round (how the artefact is centred), of an axial
/// one the mean. Those of any other test as they are. Angles count by the arc that they stand for,
/// so that 0 and 360 degrees together count as one place.
errors::metrology::PositionRuns form_of(const AxisTest& test);

/// Whether a radial error motion was read at too few places, 3, to part it from the centring.
bool hides_in_centring(const AxisTest& test);

}  // namespace abbe::sim
