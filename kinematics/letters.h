#pragma once

#include <string>
#include <vector>

#include "kinematics/chain.h"

namespace abbe::kinematics {

/// "CXYZAs", a letter a joint in the order of the structural code.
inline std::string letters(const std::vector<Joint>& joints) {
  std::string all;
  for (const Joint& joint : joints) all += joint.name;
  return all;
}

}  // namespace abbe::kinematics
