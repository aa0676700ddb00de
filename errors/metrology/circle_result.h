#pragma once

#include "errors/metrology/circle_tests.h"
#include "errors/metrology/test_result.h"

namespace abbe::errors::metrology {

/// ISO 230-4, and what the shape of the circle says of its causes. A bar that reads changes of its
/// length alone gives no radius and no F; too few places leave all causes open.
/// @throws std::invalid_argument as `circular`
TestResult circle_result(const CircleTest& test);

}  // namespace abbe::errors::metrology
