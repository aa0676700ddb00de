#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/scene.h"

/// Numbers that no machine, tool or room has, as they come of another unit than that of the key.
namespace abbe::sim {

/// Returns the unit or quantity that a number looks like, such as "kelvin"; empty if the number is
/// plausible for the key or if nothing is known of it. Zero is always plausible.
/// @param key    dotted, without the indices of lists: "thermal.source.power_W"
/// @param value  in the unit of the key
std::string probable_mistake(std::string_view key, double value);

/// Returns one warning for each key of a tree with implausible numbers: "limits.pv_um is 2e+06:
/// looks like nm, 0.05 to 5000 um expected", with the place of the first where the tree has places.
std::vector<std::string> value_warnings(const Node& tree);

/// Returns one warning for each key of a scene with implausible numbers, with the place of the
/// first: "scene.toml:12:10: thermal.room_C is 293: looks like kelvin, -40 to 60 deg C expected";
/// and one for each pair that does not go together: what the control or an actual tool is far from
/// its nominal. Variants are left out, as each is a scene of its own.
std::vector<std::string> value_warnings(const Scene& scene);

}  // namespace abbe::sim
