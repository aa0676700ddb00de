#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/coefficients.h"
#include "errors/geometric.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::identification {

/// Unknowns of an identification: the coefficients of a model, then the unknowns of every set-up.
struct Unknowns {
  /// Block of the unknowns of one set-up.
  struct SetUp {
    int readings = 0;  ///< index of the readings
    int set_up = 0;    ///< index of the set-up in their plan
    int first = 0;     ///< index of the first unknown of the block
    int count = 0;     ///< number of unknowns of the block
  };
  std::vector<Coefficient> coefficients;  ///< (p) of the first p unknowns
  std::vector<std::string> names;         ///< (n) of all unknowns
  std::vector<SetUp> set_ups;             ///< in the order of the readings
  int size() const { return int(names.size()); }
};

/// Returns the start of the estimation: the coefficients of the model and perfect set-ups (n).
Eigen::VectorXd start(const GeometricErrors& model, const Unknowns& unknowns);

/// Returns the misalignments of all set-ups at given values of the unknowns, in the order of the
/// readings.
std::vector<metrology::Misalignment> set_ups(std::span<const metrology::Readings> readings,
                                             const Unknowns& unknowns,
                                             const Eigen::VectorXd& values);

/// Returns the standard deviation that weights a reading of a channel, mm or rad: noise and
/// rounding together, or 1 nm or 1 nrad for a channel without both.
double weighting_sigma(const metrology::Channel& channel);

/// Row of the design: one measurement of one of several sets of readings. The rows of all tables
/// below are in this order.
struct Row {
  int readings = 0;     ///< index of the readings
  int measurement = 0;  ///< index of the measurement in their plan
};

/// First-order model of the readings at zero deviations and perfect set-ups: gradient of every
/// channel times the Jacobian of the chain times the basis of every curve.
struct Design {
  Unknowns unknowns;
  std::vector<Row> rows;  ///< (m) measurements of channels; temperatures excluded
  Eigen::VectorXd sigma;  ///< (m) standard deviation of every reading, mm or rad
  Eigen::MatrixXd A;      ///< (m x n) change of a reading per unit of an unknown, in standard
                          ///< deviations
  Eigen::MatrixXd prior;  ///< (k x n) prior knowledge in standard deviations: of set-ups by
                          ///< their sigmas, of coefficients by the model's covariance
  std::vector<char>
      is_sought;  ///< (n) 0: held, as its prior variance is zero or no reading depends on it
  std::vector<char> is_unobservable;  ///< (n) 1: no reading depends on it and there is no prior
};
/// Returns the design of all readings.
/// @throws std::invalid_argument as `estimate`; std::out_of_range outside a table
Design design(const GeometricErrors& model, std::span<const metrology::Readings> readings);

/// Returns the design at given values of the unknowns, by differences of the exact readings: a
/// misalignment that multiplies a deviation (a level turned by 5 mrad, a scale) has no effect at
/// zero deviations. Columns that are not sought are unchanged. Accurate to 1e-6 of an arm of 600
/// mm.
Design design_at(Design design, const GeometricErrors& model,
                 std::span<const metrology::Readings> readings, const Eigen::VectorXd& unknowns);

/// Returns the readings at given values of the unknowns, by the exact chain (m), mm or rad.
Eigen::VectorXd predicted_readings(const GeometricErrors& model,
                                   std::span<const metrology::Readings> readings,
                                   const Design& design, const Eigen::VectorXd& unknowns);

/// Returns the actual readings (m).
Eigen::VectorXd observed_readings(std::span<const metrology::Readings> readings,
                                  const Design& design);

}  // namespace abbe::errors::identification
