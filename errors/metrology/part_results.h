#pragma once

#include <vector>

#include "errors/metrology/part.h"
#include "errors/metrology/test_result.h"

namespace abbe::errors::metrology {

/// What the standards make of a part that was read: flatness (ISO 12781-1) where its normals agree,
/// circularity, centre and radius of each ring of points around one axis (ISO 12181-1), heights
/// (ISO 25178-2). A point that was read again counts once. Least-squares rings weight their points
/// by arc.
/// @throws std::invalid_argument for fewer than 3 points
std::vector<TestResult> results_of(const PartReadings& part);

}  // namespace abbe::errors::metrology
