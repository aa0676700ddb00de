#pragma once

#include <optional>
#include <string>

#include "errors/metrology/positioning.h"
#include "errors/metrology/series.h"

namespace abbe::errors::metrology {

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
bool hides_in_centring(const AxisTest& test);

}  // namespace abbe::errors::metrology
