#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/calibration.h"

namespace abbe::sim {

/// A coefficient of a geometric belief, um or urad.
struct ParameterEstimate {
  std::string name;     ///< "EXX[2]"
  std::string element;  ///< "EXX"
  std::string unit;
  double value = 0.0;
  std::optional<double> standard_uncertainty;  ///< empty for a coefficient that was not identified
};

/// A thermal term over a day, in um or urad; a slope is in um/m or urad/m.
struct TermEstimate {
  std::string name;  ///< "EXX slope"
  std::string unit;
  Eigen::VectorXd at_epochs;  ///< (epochs)
  double range = 0.0;
  double standard_uncertainty = 0.0;  ///< at one epoch, mean over all
  double constant = 0.0;
  Eigen::VectorXd per_K;           ///< (sensors)
  Eigen::VectorXd standard_error;  ///< (sensors)
  double residual_sd = 0.0;
};

/// Dependence of a coefficient of a step diagonal on the sensors, in um/K, um/m/K or urad/K.
struct TrendEstimate {
  std::string name;
  std::string unit;
  Eigen::VectorXd per_K;                 ///< (sensors)
  Eigen::VectorXd standard_uncertainty;  ///< (sensors) empty if there are no more starts than
                                         ///< unknowns
};

/// Returns the structural code of the machine: "w b X Y Z C A s t".
std::string machine_code(const IdentificationResult& identified);

/// Returns a short description of the method.
std::string method_text(const IdentificationResult& identified);

/// Returns the number of readings of all files.
std::size_t reading_count(const IdentificationResult& identified);

/// Returns the time that the readings take on a real machine.
double machine_hours(const IdentificationResult& identified);

/// Returns all coefficients of a belief.
std::vector<ParameterEstimate> parameter_estimates(const errors::GeometricErrors& belief);

/// Returns a thermal term in the units of the report.
TermEstimate term_estimate(const RegressedTerm& term);

/// Returns the trends of a step diagonal in the units of the report; empty without temperatures.
std::vector<TrendEstimate> trend_estimates(const StepDiagonalFit& fit);

/// Returns the report of an identification as text for the terminal. Control characters in file
/// names and messages are escaped, so that each of them stays on one line.
std::string identification_text(const IdentificationResult& identified);

/// Returns the JSON report that is written beside a belief file. Scripts may rely on its keys.
nlohmann::ordered_json to_json(const IdentificationResult& identified);

/// Returns the text of the belief file: an errors file (sim/readings/belief_file.h) or, for
/// readings of a whole day, a thermal belief. It begins with comments that name its sources.
std::string belief_file_text(const IdentificationResult& identified);

/// Returns the text of the file that holds the thermal half of a composite belief.
std::string thermal_half_file_text(const IdentificationResult& composite);

}  // namespace abbe::sim
