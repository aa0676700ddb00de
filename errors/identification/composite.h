#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/regression.h"

/// Yang's composite element, delta(p, T) = delta_G(p) + delta_T(T) p: the cold curve of an axis and
/// a slope that grows with temperature, separated by runs along the axis at several
/// temperatures.
namespace abbe::errors::identification {

/// One run along the axis.
struct CompositeRun {
  Eigen::VectorXd p;      ///< (n) mm or rad, positions
  Eigen::VectorXd delta;  ///< (n) mm or rad, deviations
  Eigen::VectorXd dT_K;   ///< (m) temperature changes since the cold state
  bool cold = false;      ///< the run, or one of those, at which dT is zero
};
struct CompositeOptions {
  int degree = 4;  ///< of the cold polynomial
  /// Let the slope have a constant besides the temperatures. It is 0 by the definition of dT unless
  /// the cold runs were not cold; the cold curve keeps its own slope either way.
  bool slope_constant = false;
  /// Let every later run lie higher or lower than the cold curve as a whole: a drift of the zero,
  /// which `offset` reports and the composite law leaves out.
  bool free_offset = true;
};
enum class CompositeStatus {
  Ok,
  NoColdRun,    ///< none says that its dT is zero
  ColdRunWarm,  ///< a run that is said to be cold has a dT other than 0
  NoLaterRun,
  CurveNotDetermined,  ///< too few positions for the degree: see `curve`
  SlopeNotDetermined,  ///< the temperatures do not part: see `slope_fit`
};
struct CompositeFit {
  CompositeStatus status = CompositeStatus::Ok;
  int run = -1;               ///< the one to blame, where there is one
  Eigen::VectorXd geometric;  ///< (degree + 1) delta_G = sum_k geometric[k] p^k
  Eigen::VectorXd thermal;    ///< (m) delta_T = thermal_constant + thermal . dT_K, per K
  double thermal_constant = 0.0;
  Regression curve;  ///< of the cold runs, in powers of p / `curve_scale`
  double curve_scale = 1.0;
  Regression slope_fit;         ///< of the slopes on the temperatures
  std::vector<int> later;       ///< indices of the runs that are not cold
  Eigen::VectorXd slope;        ///< (later) of each such run minus the cold curve
  Eigen::VectorXd slope_error;  ///< (later) standard error
  Eigen::VectorXd offset;       ///< (later) 0 unless free_offset
  double rms = 0.0;             ///< of all readings about the law, offsets included
};
/// The cold polynomial comes from the cold runs, then a straight line through each later run minus
/// that polynomial, then its slope is regressed on the temperatures. The slope of the cold curve
/// stays in the cold curve: where slopes of whole runs are regressed with a constant, as published,
/// that constant is the cold slope and must not be added to it again.
/// @throws std::invalid_argument for no runs, shapes that disagree, numbers that are not finite, a
///         degree outside 1 .. 12
/// Source: yang2012.
[[nodiscard]] CompositeFit separate(const std::vector<CompositeRun>& runs,
                                    const CompositeOptions& options = {});

/// delta_G(p) + delta_T(dT) p
double value(const CompositeFit& fit, double p, const Eigen::VectorXd& dT_K);

/// Least-squares slope of a whole run, its geometric part included: what the paper regresses.
double whole_slope(const CompositeRun& run);

}  // namespace abbe::errors::identification
