#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/scene.h"

/// Warnings about numbers that are implausible for any machine, tool or room, often because of a
/// wrong unit.
namespace abbe::sim {

/// Returns the probable mistake behind an implausible number, such as "kelvin". Empty if the number
/// is plausible or if no range is known for the key. Zero is always plausible.
/// @param key    dotted, without the indices of lists: "thermal.source.power_W"
/// @param value  in the unit of the key
std::string probable_mistake(std::string_view key, double value);

/// Returns one warning for each key of a tree with implausible numbers: "limits.pv_um is 2e+06:
/// looks like nm; expected 0.05 to 5000 um". It states the position of the first number if the tree
/// has positions.
std::vector<std::string> value_warnings(const Node& tree);

/// Returns the warnings for the tree of a scene, such as "scene.toml:12:10: thermal.room_C is 293:
/// looks like kelvin; expected -40 to 60 deg C", and one warning for each pair of values that do
/// not match, such as an actual tool or a belief of the control that is far from the nominal value.
/// Variants are not examined, because each is checked as a scene of its own.
std::vector<std::string> value_warnings(const Scene& scene);

}  // namespace abbe::sim
