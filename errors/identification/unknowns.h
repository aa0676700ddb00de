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

Unknowns unknowns_of(const GeometricErrors& model, std::span<const metrology::Readings> readings);

/// The place of a set-up among them.
const Unknowns::SetUp& place_of(const Unknowns& unknowns, int readings, int set_up);

/// The values of the model, set-ups perfect. (n)
Eigen::VectorXd start(const GeometricErrors& model, const Unknowns& unknowns);

/// The set-ups with these values of the unknowns, readings by readings.
std::vector<metrology::Misalignment> set_ups(std::span<const metrology::Readings> readings,
                                             const Unknowns& unknowns,
                                             const Eigen::VectorXd& values);

}  // namespace abbe::errors::identification
