#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/scene.h"

/// Warnings of numbers that no machine, tool or room has, as results from a wrong unit.
namespace abbe::sim {

/// Returns the unit or quantity that a number suggests, such as "kelvin"; empty if the number is
/// plausible for the key or if nothing is known about it. Zero is always plausible.
/// @param key    dotted, without the indices of lists: "thermal.source.power_W"
/// @param value  in the unit of the key
std::string probable_mistake(std::string_view key, double value);

/// Returns one warning for each key of a tree with implausible numbers: "limits.pv_um is 2e+06:
/// looks like nm, 0.05 to 5000 um expected", with the position of the first if the tree has
/// positions.
std::vector<std::string> value_warnings(const Node& tree);

/// Returns one warning for each key of a scene with implausible numbers, with the position of the
/// first: "scene.toml:12:10: thermal.room_C is 293: looks like kelvin, -40 to 60 deg C expected";
/// and one for each pair of values that do not match, such as an actual tool or a belief of the
/// control far from its nominal value. Variants are excluded, as each is a scene of its own.
std::vector<std::string> value_warnings(const Scene& scene);

}  // namespace abbe::sim
