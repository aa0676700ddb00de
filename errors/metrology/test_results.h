#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/circular.h"
#include "errors/metrology/machine_tests.h"
#include "errors/metrology/part.h"

namespace abbe::errors::metrology {

/// Named value of a test result.
struct Figure {
  std::string name;  ///< as in the standard: "A_up", "G_both_lsq"
  std::string unit;  ///< unit of the value: "um", "urad", "um_per_m", "mm"; may be empty
  /// std::monostate: the readings do not determine the value.
  std::variant<std::monostate, double, EstimatedValue, Eigen::Index, bool, std::string,
               std::vector<std::string>, Eigen::Vector3d>
      value;
};

/// Returns a figure in um or urad.
/// @param value  mm, or rad for an angle; empty: the readings do not determine it
Figure figure(std::string name, const std::optional<double>& value, bool angle = false);

/// Group of figures of a test, such as an interval of a drift or the causes of a circle.
struct FigureGroup {
  std::string name;
  std::vector<Figure> figures = {};
  std::vector<FigureGroup> groups = {};
};

/// Result of a test by a standard.
struct TestResult {
  std::string name;      ///< of set-up and channel, or of the tested object
  std::string standard;  ///< "ISO 230-2:2014 positioning"
  std::vector<Figure> figures = {};
  std::vector<FigureGroup> groups = {};
  std::vector<TestResult> diagonals = {};  ///< single results of a set of diagonals
};

/// Returns the results of tests of a machine: positioning (ISO 230-2), straightness, angles and
/// squareness (230-1), error motion (230-7), diagonals (230-6), circles (230-4) and drift (230-3).
/// For other readings it returns their range and RMS.
/// @throws std::invalid_argument for runs that the standard cannot evaluate
std::vector<TestResult> standard_results(const MachineTests& tests);

/// Returns the results of a measured part: flatness (ISO 12781-1) if its normals agree,
/// circularity, centre and radius of each ring of points around one axis (ISO 12181-1), heights
/// (ISO 25178-2). A point that was read twice counts once. In least-squares circles the weight of
/// a point is its arc.
/// @throws std::invalid_argument for fewer than 3 points
std::vector<TestResult> standard_results(const PartReadings& part);

}  // namespace abbe::errors::metrology
