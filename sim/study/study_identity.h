#pragma once

#include <string>
#include <vector>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// What answers depend on: the study's text, its scenes with every data file that they name,
/// compensators of the user's own, and this very build. 16 hexadecimal digits.
/// @param scenes  of the arms
std::string identity_of(const Study& study, const std::vector<Scene>& scenes);

}  // namespace abbe::sim::study
