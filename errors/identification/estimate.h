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

/// From readings to what is believed of a machine. Nothing here knows what was injected.
namespace abbe::errors::identification {

/// A number that the readings cannot separate from others: it was left at its starting value. A
/// unit of it reads the same as these amounts of the others together, so they took on so much of
/// each unit by which its start is wrong.
struct Confounded {
  std::string name;
  /// Numbers and unknowns of set-ups; what reads less than 1e-6 of the number itself is not named.
  /// Empty: no reading depends on it at all.
  std::vector<std::pair<std::string, double>> with;
  /// To which the readings determine it, mm or rad, where that is worse than what machines differ
  /// by (`EstimateOptions::weak_limit`); none: the readings do not separate it at all.
  std::optional<double> standard_deviation;
};

/// How well one of several readings fits.
struct FitQuality {
  double chi_square = 0.0;          ///< of the readings used
  double degrees_of_freedom = 0.0;  ///< of them, less their part in the numbers found
};

/// A mistake in writing readings down that the nominal machine cannot show: it concerns channels
/// that read the same at every measurement of the nominal machine.
enum class Mistake { Negated, Reversed, TimesThousand, OverThousand };

/// How all readings would fit if one of them had been written down with a mistake.
struct Alternative {
  int readings = 0;
  Mistake mistake = Mistake::Negated;
  double chi_square = 0.0;      ///< of all readings, to first order
  double own_chi_square = 0.0;  ///< of that one alone
};

/// Numbers found, with their covariance.
struct Estimate {
  GeometricErrors belief;          ///< the model with the values found and their covariance; what
                                   ///< could not be found is at its start and has none
  std::vector<std::string> names;  ///< (p) of all coefficients of the model
  Eigen::VectorXd value;           ///< (p) mm or rad
  std::vector<Confounded> confounded;
  std::vector<metrology::Misalignment> set_ups;  ///< found for every set-up, readings by readings
  Eigen::VectorXd fit_residual;  ///< (measurements, temperatures left out) reading minus model, in
                                 ///< standard deviations
  std::vector<int> outliers;     ///< indices of those left out
  int degrees_of_freedom = 0;    ///< readings used and what was known beforehand, less numbers
  double reduced_chi_square = 0.0;  ///< 1 where the stated noise is true
  double condition = 0.0;           ///< of the scaled design matrix over what was found, to some
                                    ///< percent
  int iterations = 0;
  bool converged = false;
  double chi_square = 0.0;                ///< of the readings used and what was known beforehand
  std::vector<FitQuality> quality_range;  ///< (readings) where mistakes are compared
  std::vector<Alternative> alternatives;  ///< of all readings with channels of that kind, the same
};

/// Returns the reduced chi-square that chance exceeds once in a thousand fits of true readings, and
/// the one that it falls short of as often (Wilson and Hilferty's approximation). 0 .. infinity
/// without degrees of freedom
std::pair<double, double> chi_square_band(double degrees_of_freedom);

struct EstimateOptions {
  double rank_tolerance = 1e-9;  ///< least pivot that counts, of the largest, columns of unit norm
  double outlier_limit = 0.0;    ///< studentised residual beyond which a reading is left out; 0:
                                 ///< none is
  double weak_limit = 0.0;  ///< a number that is known to so many times the `typical_deviation` of
                            ///< its element or worse, and differs from its start by less than four
                            ///< of its own standard deviations, stays there; 0: none does
  int max_iterations = 20;
  double tolerance = 1e-12;           ///< mm and rad: steps below it end the iteration
  bool noise_from_residuals = false;  ///< scale the covariance by the reduced chi-square
  bool compare_mistakes = false;      ///< find `quality_range` and `alternatives`
};

/// Weighted least squares for any readings on any machine, by Gauss-Newton on the exact chain: the
/// residuals are those of the chain with the elements. The design matrix is that of the chain's
/// Jacobian at zero deviations, made once, which settles the rank and a first solution; made again
/// there, it gives the last steps and the covariance. Misalignments of the set-ups are unknowns
/// with what is stated of them beforehand. Readings without stated noise or rounding weigh, and
/// count in the covariance, as if it were 1 nm or 1 nrad.
///
/// Rank: where columns are dependent the numbers left at their starting value are chosen so that
/// constants of error motions go first, then slopes of straightness, then others from the end of
/// the model, location errors last and unknowns of set-ups only where nothing else is left; all are
/// named with what hides them. What a prior determines is found, as well as the prior knows it: a
/// tilt of the nose that only the stated tilt of a set-up tells is known to that. `weak_limit`
/// leaves such numbers out. The covariance is first order at the solution. Products of two
/// misalignments that no reading determines are not in it: a square laid to 500 urad in both tilts
/// adds 0.25 urad to a squareness.
/// @param model     elements whose numbers are wanted; their values are the start. Its covariance
///                  is what is known of them beforehand: numbers of zero variance stay as they are,
///                  so a belief may be the model of the next readings
/// @param readings  at least one set; all of the same machine
/// Bound: noise-free readings return coefficients of their own basis to 1e-9 of the largest of
/// their kind where the rank is full.
/// @throws std::invalid_argument if there is nothing to find, readings times unknowns exceed 2e8
///         (1.6 GB), the machines differ, an element does
///         not fit the machine or is random, a number is not finite, an option is out of range;
///         std::out_of_range where a table is left
Estimate estimate(const GeometricErrors& model, std::span<const metrology::Readings> readings,
                  const EstimateOptions& options = {});

/// One identified element over its axis, with its uncertainty and the readings that bear on it.
struct CurveReadings {
  ElementName element;
  Eigen::VectorXd q;          ///< (k) mm or rad, over where the axis was read
  Eigen::VectorXd value;      ///< (k) mm or rad, the mean of both ways of approach
  Eigen::VectorXd sigma;      ///< (k) standard uncertainty of it
  Eigen::VectorXd reading_q;  ///< (r) positions of the readings that bear on this element
  Eigen::VectorXd reading;    ///< (r) its value there as each reading alone would have it, all else
                              ///< as identified; readings left out as outliers are left out here
};

/// Every element of a belief that has a curve, in its order; a location error or a constant has
/// none. A reading bears on an element whose numbers, each 1 um or 10 urad, would change it at
/// least a quarter as much as those of the element that changes it most.
/// @param readings  those of the estimate
std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const metrology::Readings> readings);

}  // namespace abbe::errors::identification
