#pragma once

#include <nlohmann/json.hpp>

#include "sim/readings/part_readings_file.h"

namespace abbe::sim {

/// What the standards make of a part that was read: flatness (ISO 12781-1) where its normals agree,
/// circularity, centre and radius of each ring of points around one axis (ISO 12181-1), heights
/// (ISO 25178-2). A point that was read again counts once. Least-squares rings weight their points
/// by arc.
/// @return [{"name", "standard", ...}], figures in um
/// @throws std::invalid_argument for fewer than 3 points
nlohmann::ordered_json part_tests(const PartReadingsFile& part);

}  // namespace abbe::sim
