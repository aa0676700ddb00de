#pragma once

#include <vector>

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/test_result.h"

namespace abbe::errors::metrology {

/// What the standards make of tests of a machine: positioning (ISO 230-2), straightness, angles and
/// squareness (230-1), error motion (230-7), diagonals (230-6), circles (230-4), drift (230-3); of
/// other readings their range and rms.
/// @throws std::invalid_argument for runs that the standard cannot evaluate
std::vector<TestResult> results_of(const Tests& tests);

}  // namespace abbe::errors::metrology
