#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/readings.h"
#include "kinematics/chain.h"

namespace abbe::errors::identification {

inline constexpr std::array<char, 3> slides = {'X', 'Y', 'Z'};

/// A slide of a chain by its number, 0 1 2.
/// @throws std::invalid_argument unless the chain has it and it runs along that axis of the bed
kinematics::Joint slide(const kinematics::Chain& chain, int axis);

/// One leg: a change of reading against its length, over one interval of one axis.
struct StepLeg {
  int axis = 0;
  int interval = 0;
  int diagonal = 0;        ///< set-up
  Eigen::Vector3d across;  ///< change of reading per unit of E(upper) - E(lower)
  Eigen::Index from = 0;   ///< readings it is the difference of
  Eigen::Index to = 0;
};

/// Steps of the three axes, each from its lower end upwards.
using Steps = std::array<std::vector<double>, 3>;

/// The way of four step diagonals.
struct StepPath {
  Steps steps;
  std::vector<StepLeg> legs;
};

/// @throws std::invalid_argument unless the readings are those of four diagonals, finite, each one
///         step of X, Y or Z from the one before, with the same steps on every diagonal
StepPath step_path(const metrology::Readings& readings);

/// @throws std::invalid_argument, always: "step diagonal: " and why
[[noreturn]] void refuse_diagonals(const std::string& why);

}  // namespace abbe::errors::identification
