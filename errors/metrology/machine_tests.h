#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/axis_tests.h"
#include "errors/metrology/circle_tests.h"
#include "errors/metrology/diagonal_tests.h"
#include "errors/metrology/drift.h"

/// Readings of a machine sorted into what the standards evaluate.
namespace abbe::errors::metrology {

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
Tests tests_of(const Readings& readings);

}  // namespace abbe::errors::metrology
