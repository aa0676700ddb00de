#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/coefficients.h"
#include "errors/geometric.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::identification {

/// What readings leave unknown: the numbers of a model, then the unknowns of every set-up.
struct Unknowns {
  struct SetUp {
    int readings = 0;  ///< index of the readings
    int set_up = 0;    ///< index in their plan
    int first = 0;     ///< place of its first unknown
    int count = 0;
  };
  std::vector<Coefficient> coefficients;  ///< (p) the first p
  std::vector<std::string> names;         ///< (n) of all
  std::vector<SetUp> set_ups;             ///< readings by readings
  int size() const { return int(names.size()); }
};

Unknowns model_unknowns(const GeometricErrors& model,
                        std::span<const metrology::Readings> readings);

/// The place of a set-up among them.
const Unknowns::SetUp& place_of(const Unknowns& unknowns, int readings, int set_up);

/// The values of the model, set-ups perfect. (n)
Eigen::VectorXd start(const GeometricErrors& model, const Unknowns& unknowns);

/// The set-ups with these values of the unknowns, readings by readings.
std::vector<metrology::Misalignment> set_ups(std::span<const metrology::Readings> readings,
                                             const Unknowns& unknowns,
                                             const Eigen::VectorXd& values);

/// What a reading of a channel counts with: its noise and rounding, or 1 nm or 1 nrad if it has
/// none. mm or rad
double sigma_of(const metrology::Channel& channel);

/// One measurement of one of several readings; rows of all tables below are these, in their order.
struct Row {
  int readings = 0;
  int measurement = 0;
};

/// The readings to first order at zero deviations and perfect set-ups: the chain's Jacobian between
/// the gradient of every channel and the basis of every curve.
struct Design {
  Unknowns unknowns;
  std::vector<Row> rows;        ///< (m) measurements of channels; a temperature is none
  Eigen::VectorXd sigma;        ///< (m) of every reading, mm or rad
  Eigen::MatrixXd A;            ///< (m x n) change of a reading per unit of an unknown, in sigmas
  Eigen::MatrixXd prior;        ///< (k x n) what is known beforehand, in standard deviations: of
                                ///< set-ups by their sigmas, of numbers by the model's covariance
  std::vector<char> is_sought;  ///< (n) 0: of zero variance beforehand, or no reading sees it
  std::vector<char> is_unobservable;  ///< (n) 1: no reading sees it and nothing is known beforehand
};
/// @throws std::invalid_argument as `estimate` says; std::out_of_range where a table is left
Design design(const GeometricErrors& model, std::span<const metrology::Readings> readings);

/// The same at these values of the unknowns, by differences of the exact readings: a misalignment
/// that multiplies a deviation (a level turned by 5 mrad, a scale) does nothing at zero deviations.
/// What is not sought stays as it was. To 1e-6 of an arm of 600 mm.
Design design_at(Design design, const GeometricErrors& model,
                 std::span<const metrology::Readings> readings, const Eigen::VectorXd& unknowns);

/// What every measurement would read with these values of the unknowns, by the exact chain. (m) mm
/// or rad
Eigen::VectorXd predicted(const GeometricErrors& model,
                          std::span<const metrology::Readings> readings, const Design& design,
                          const Eigen::VectorXd& unknowns);

/// What was read. (m)
Eigen::VectorXd observed(std::span<const metrology::Readings> readings, const Design& design);

}  // namespace abbe::errors::identification
