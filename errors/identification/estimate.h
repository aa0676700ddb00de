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

/// A coefficient that the readings cannot separate from others. It stays at its starting value. A
/// unit of it has the same effect on the readings as the given amounts of the others together,
/// which therefore absorb the error of its start in these amounts.
struct ConfoundedCoefficient {
  std::string name;
  /// Other coefficients and unknowns of set-ups with their amounts; contributions below 1e-6 of the
  /// coefficient's own effect are omitted. Empty: no reading depends on the coefficient at all.
  std::vector<std::pair<std::string, double>> with;
  /// Standard uncertainty, mm or rad, if the readings determine it less closely than machines vary
  /// (`EstimateOptions::weak_limit`); empty: they do not separate it at all.
  std::optional<double> standard_deviation;
};

/// Quality of the fit for one of several sets of readings.
struct FitQuality {
  double chi_square = 0.0;          ///< of the readings used
  double degrees_of_freedom = 0.0;  ///< of the readings used, minus their contribution to the
                                    ///< coefficients found
};

/// Mistakes in recorded readings that the nominal machine cannot reveal: they concern channels that
/// read a constant value on the nominal machine.
enum class Mistake { Negated, Reversed, MultipliedByThousand, DividedByThousand };

/// Hypothetical fit of all readings, as if one set of them had been recorded with a mistake.
struct Alternative {
  int readings = 0;  ///< index of the set
  Mistake mistake = Mistake::Negated;
  double chi_square = 0.0;      ///< of all readings, to first order
  double own_chi_square = 0.0;  ///< of that set alone
};

/// The identified coefficients with their covariance.
struct Estimate {
  GeometricErrors belief;          ///< the model with the values found and their covariance;
                                   ///< coefficients that could not be found are at their start and
                                   ///< have no covariance
  std::vector<std::string> names;  ///< (p) of all coefficients of the model
  Eigen::VectorXd value;           ///< (p) mm or rad
  std::vector<ConfoundedCoefficient> confounded;
  std::vector<metrology::Misalignment> set_ups;  ///< of every set-up, in the order of the readings
  Eigen::VectorXd fit_residual;  ///< (measurements without temperatures) reading minus model, in
                                 ///< standard deviations
  std::vector<int> outliers;     ///< indices of readings left out
  int degrees_of_freedom = 0;    ///< number of readings used and of prior equations, minus number
                                 ///< of unknowns
  double reduced_chi_square = 0.0;  ///< 1 if the stated noise is correct
  double condition = 0.0;           ///< condition number of the scaled design matrix of the
                                    ///< coefficients found, to a few per cent
  int iterations = 0;
  bool converged = false;
  double chi_square = 0.0;                ///< of the readings used and the prior
  std::vector<FitQuality> quality;        ///< (readings) if mistakes are compared
  std::vector<Alternative> alternatives;  ///< for all readings with such channels, if mistakes are
                                          ///< compared
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
  double weak_limit = 0.0;  ///< a coefficient stays at its start if its uncertainty is at least
                            ///< this multiple of the `typical_deviation` of its element and it
                            ///< differs from its start by less than four of its own standard
                            ///< deviations; 0: never
  int max_iterations = 20;
  double tolerance = 1e-12;           ///< mm and rad: smaller steps end the iteration
  bool noise_from_residuals = false;  ///< scale the covariance by the reduced chi-square
  bool compare_mistakes = false;      ///< compute `quality` and `alternatives`
};

/// Estimates the coefficients of a model by weighted least squares, for any readings on any
/// machine, by Gauss-Newton on the exact chain: the residuals are those of the chain with the
/// elements. The design matrix is first computed at zero deviations, which determines the rank and
/// a first solution, and a second time at that solution, for the last steps and the covariance.
/// Misalignments of the set-ups are unknowns with their stated priors. Readings without stated
/// noise or rounding are weighted, and enter the covariance, with 1 nm or 1 nrad.
/// Rank: where columns are dependent, some coefficients stay at their starting value: first
/// constants of error motions, then slopes of straightness, then others from the end of the model,
/// then location errors, and unknowns of set-ups only if nothing else is left. All are listed with
/// the coefficients that hide them. A coefficient that only a prior determines is found with the
/// uncertainty of the prior: a tilt of the nose that only the stated tilt of a set-up reveals has
/// the uncertainty of that tilt. `weak_limit` leaves such coefficients out. The covariance is first
/// order at the solution. It does not contain products of two misalignments that no reading
/// determines: a square aligned to 500 urad in both tilts adds 0.25 urad to a squareness.
/// @param model     elements whose coefficients are identified; their values are the start. Its
///                  covariance is the prior: coefficients of zero variance stay unchanged, so a
///                  belief may be the model of the next readings
/// @param readings  at least one set; all of the same machine
/// Bound: noise-free readings return coefficients of their own basis to 1e-9 of the largest of
/// their kind if the rank is full.
/// @throws std::invalid_argument if the model has no coefficient or the readings no value, readings
///         times unknowns exceed 2e8 (1.6 GB), the machines differ, an element does not fit the
///         machine or is random, a value is not finite, or an option is out of range;
///         std::out_of_range outside a table
Estimate estimate(const GeometricErrors& model, std::span<const metrology::Readings> readings,
                  const EstimateOptions& options = {});

/// Curve of an identified element over its axis, with its uncertainty and the readings that are
/// informative about it.
struct CurveReadings {
  ElementName element;
  Eigen::VectorXd q;          ///< (k) mm or rad, over the range of the readings
  Eigen::VectorXd value;      ///< (k) mm or rad, mean of both directions of approach
  Eigen::VectorXd sigma;      ///< (k) standard uncertainty of the value
  Eigen::VectorXd reading_q;  ///< (r) positions of the informative readings
  Eigen::VectorXd reading;    ///< (r) value of the element by each reading alone, with all other
                              ///< elements as identified; outliers are excluded
};

/// Returns the curves of all elements of a belief, in order; location errors and constants have
/// none. A reading is informative about an element if its coefficients, each of 1 um or 10 urad,
/// would change the reading at least a quarter as much as those of the element that changes it
/// most.
/// @param readings  those of the estimate
std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const metrology::Readings> readings);

}  // namespace abbe::errors::identification
