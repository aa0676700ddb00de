#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/calibration/identify.h"

/// What was identified in the units in which report, text and belief file state it.
namespace abbe::sim {

inline constexpr double um_per_m = 1e-6;  ///< of a slope, mm per mm

std::string machine_of(const Identified& identified);  ///< "w b X Y Z C A s t"
std::string method_of(const Identified& identified);   ///< in a few words
std::size_t readings_of(const Identified& identified);
double hours_of(const Identified& identified);  ///< on a real machine

/// A number of a geometric belief, um or urad.
struct NumberFigure {
  std::string name;     ///< "EXX[2]"
  std::string element;  ///< "EXX"
  std::string unit;
  double value = 0.0;
  std::optional<double> standard_uncertainty;  ///< none of a number that was not found
};
std::vector<NumberFigure> number_figures(const errors::GeometricErrors& belief);

/// A term over a day in um or urad, of a slope um/m or urad/m.
struct TermFigures {
  std::string name;  ///< "EXX slope"
  std::string unit;
  Eigen::VectorXd at_epochs;  ///< (epochs)
  double range = 0.0;
  double standard_uncertainty = 0.0;  ///< at an epoch, mean of all
  double constant = 0.0;
  Eigen::VectorXd per_K;           ///< (sensors)
  Eigen::VectorXd standard_error;  ///< (sensors)
  double residual_sd = 0.0;
};
TermFigures term_figures(const RegressedTerm& term);

/// How a number of a step diagonal follows the sensors, in um/K, um/m/K or urad/K.
struct TrendFigures {
  std::string name;
  std::string unit;
  Eigen::VectorXd per_K;                 ///< (sensors)
  Eigen::VectorXd standard_uncertainty;  ///< (sensors) empty where no start is to spare
};
std::vector<TrendFigures> trend_figures(const StepDiagonalFit& fit);

}  // namespace abbe::sim
