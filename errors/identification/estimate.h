#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "errors/coefficients.h"
#include "errors/geometric.h"
#include "errors/metrology/readings.h"

/// Identification of a machine from readings, without access to the injected errors.
namespace abbe::errors::identification {

/// A number that the readings cannot separate from others; it was left at its starting value. A
/// unit of it has the same effect on the readings as the given amounts of the others together,
/// which therefore absorbed the error of its start in these amounts.
struct Confounded {
  std::string name;
  /// Numbers and unknowns of set-ups, and their amounts; contributions below 1e-6 of the number's
  /// own effect are omitted. Empty: no reading depends on the number at all.
  std::vector<std::pair<std::string, double>> with;
  /// Uncertainty with which the readings determine it, mm or rad, if larger than the variation
  /// between machines (`EstimateOptions::weak_limit`); empty: they do not separate it at all.
  std::optional<double> standard_deviation;
};

/// Quality of the fit for one of several sets of readings.
struct FitQuality {
  double chi_square = 0.0;          ///< of the readings used
  double degrees_of_freedom = 0.0;  ///< of the readings used, minus their contribution to the
                                    ///< numbers found
};

/// A mistake in the notation of readings that the nominal machine cannot reveal: it concerns
/// channels that read a constant value on the nominal machine.
enum class Mistake { Negated, Reversed, TimesThousand, OverThousand };

/// Hypothetical fit of all readings if one set of them had been noted with a mistake.
struct Alternative {
  int readings = 0;
  Mistake mistake = Mistake::Negated;
  double chi_square = 0.0;      ///< of all readings, to first order
  double own_chi_square = 0.0;  ///< of that set alone
};

/// The identified numbers with their covariance.
struct Estimate {
  GeometricErrors belief;          ///< the model with the values found and their covariance;
                                   ///< numbers that could not be found are at their start and have
                                   ///< no covariance
  std::vector<std::string> names;  ///< (p) of all coefficients of the model
  Eigen::VectorXd value;           ///< (p) mm or rad
  std::vector<Confounded> confounded;
  std::vector<metrology::Misalignment> set_ups;  ///< found for every set-up, in the order of the
                                                 ///< readings
  Eigen::VectorXd fit_residual;  ///< (measurements without temperatures) reading minus model, in
                                 ///< standard deviations
  std::vector<int> outliers;     ///< indices of readings left out
  int degrees_of_freedom = 0;    ///< number of readings used and of prior equations, minus number
                                 ///< of unknowns
  double reduced_chi_square = 0.0;  ///< 1 if the stated noise is correct
  double condition = 0.0;           ///< condition number of the scaled design matrix of the numbers
                                    ///< found, to a few per cent
  int iterations = 0;
  bool converged = false;
  double chi_square = 0.0;                ///< of the readings used and the prior
  std::vector<FitQuality> quality;        ///< (readings) if mistakes are compared
  std::vector<Alternative> alternatives;  ///< for all readings with channels of that kind, if
                                          ///< mistakes are compared
};

/// Returns the lower and upper bound of the reduced chi-square that correct readings exceed, by
/// chance, once in a thousand fits each (Wilson and Hilferty's approximation); 0 .. infinity
/// without degrees of freedom.
std::pair<double, double> chi_square_band(double degrees_of_freedom);

struct EstimateOptions {
  double rank_tolerance = 1e-9;  ///< smallest pivot that counts, relative to the largest; columns
                                 ///< of unit norm
  double outlier_limit = 0.0;    ///< studentised residual beyond which a reading is left out; 0:
                                 ///< never
  double weak_limit = 0.0;  ///< a number stays at its start if its uncertainty is at least this
                            ///< multiple of the `typical_deviation` of its element and it differs
                            ///< from its start by less than four of its own standard deviations; 0:
                            ///< never
  int max_iterations = 20;
  double tolerance = 1e-12;           ///< mm and rad: smaller steps end the iteration
  bool noise_from_residuals = false;  ///< scale the covariance by the reduced chi-square
  bool compare_mistakes = false;      ///< compute `quality` and `alternatives`
};

/// Estimates the numbers of a model by weighted least squares, for any readings on any machine, by
/// Gauss-Newton on the exact chain: the residuals are those of the chain with the elements. The
/// design matrix is first computed at zero deviations, which determines the rank and a first
/// solution, and once more there, for the last steps and the covariance. Misalignments of the
/// set-ups are unknowns with their stated priors. Readings without stated noise or rounding are
/// weighted, and enter the covariance, with 1 nm or 1 nrad.
/// Rank: where columns are dependent, the numbers left at their starting value are chosen such that
/// constants of error motions go first, then slopes of straightness, then others from the end of
/// the model, location errors last, and unknowns of set-ups only if nothing else is left; all are
/// named with what hides them. A number that only a prior determines is found with the uncertainty
/// of the prior: a tilt of the nose that only the stated tilt of a set-up reveals is known to that.
/// `weak_limit` leaves such numbers out.
/// The covariance is first order at the solution. It does not contain products of two misalignments
/// that no reading determines: a square aligned to 500 urad in both tilts adds 0.25 urad to a
/// squareness.
/// @param model     elements whose numbers are wanted; their values are the start. Its covariance
///                  is the prior: numbers of zero variance stay as they are, so a belief may be the
///                  model of the next readings
/// @param readings  at least one set; all of the same machine
/// Bound: noise-free readings return coefficients of their own basis to 1e-9 of the largest of
/// their kind if the rank is full.
/// @throws std::invalid_argument if there is nothing to find, readings times unknowns exceed 2e8
///         (1.6 GB), the machines differ, an element does not fit the machine or is random, a
///         number is not finite, or an option is out of range; std::out_of_range outside a table
Estimate estimate(const GeometricErrors& model, std::span<const metrology::Readings> readings,
                  const EstimateOptions& options = {});

/// One identified element over its axis, with its uncertainty and the readings that are informative
/// about it.
struct CurveReadings {
  ElementName element;
  Eigen::VectorXd q;          ///< (k) mm or rad, over the range of the readings
  Eigen::VectorXd value;      ///< (k) mm or rad, mean of both directions of approach
  Eigen::VectorXd sigma;      ///< (k) standard uncertainty of the value
  Eigen::VectorXd reading_q;  ///< (r) positions of the informative readings
  Eigen::VectorXd reading;    ///< (r) value of the element by each reading alone, all else as
                              ///< identified; outliers are excluded
};

/// Returns every element of a belief that has a curve, in order; location errors and constants have
/// none. A reading is informative about an element if its numbers, each of 1 um or 10 urad, would
/// change the reading at least a quarter as much as those of the element that changes it most.
/// @param readings  those of the estimate
std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const metrology::Readings> readings);

}  // namespace abbe::errors::identification
