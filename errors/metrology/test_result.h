#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/circular.h"

namespace abbe::errors::metrology {

/// One number or word of a test.
struct Figure {
  std::string name;  ///< as the standard has it: "A_up", "G_both_lsq"
  std::string unit;  ///< of the value as it stands here: "um", "urad", "um_per_m", "mm"; or empty
  /// std::monostate: the readings cannot give it.
  std::variant<std::monostate, double, Estimated, Eigen::Index, bool, std::string,
               std::vector<std::string>, Eigen::Vector3d>
      value;
};

/// A number in um or urad.
/// @param value  mm, or rad of an angle; none: the readings cannot give it
Figure figure(std::string name, const std::optional<double>& value, bool angle = false);

/// Figures of one part of a test: an interval of a drift, the causes of a circle.
struct FigureGroup {
  std::string name;
  std::vector<Figure> figures = {};
  std::vector<FigureGroup> groups = {};
};

/// What a standard makes of readings.
struct TestResult {
  std::string name;      ///< of set-up and channel, or of what is tested
  std::string standard;  ///< "ISO 230-2:2014 positioning"
  std::vector<Figure> figures = {};
  std::vector<FigureGroup> groups = {};
  std::vector<TestResult> diagonals = {};  ///< of a set of them
};

}  // namespace abbe::errors::metrology
