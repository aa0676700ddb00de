#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/scene.h"

/// Warnings about numbers that are implausible for any machine, tool or room, as after a mistaken
/// unit.
namespace abbe::sim {

/// Returns what an implausible number seems to be instead, such as "kelvin"; empty if it is
/// plausible for its key or nothing is known about the key. Zero is always plausible.
/// @param key    dotted, without the indices of lists: "thermal.source.power_W"
/// @param value  in the unit of the key
std::string probable_mistake(std::string_view key, double value);

/// Returns one warning for each key of a tree that has implausible numbers: "limits.pv_um is 2e+06:
/// looks like nm, 0.05 to 5000 um expected". It states the position of the first of them if the
/// tree has positions.
std::vector<std::string> value_warnings(const Node& tree);

/// Returns one warning for each key of a scene that has implausible numbers, with the position of
/// the first: "scene.toml:12:10: thermal.room_C is 293: looks like kelvin, -40 to 60 deg C
/// expected". In addition one for each pair of values that do not match, such as an actual tool, or
/// what the control believes, far from the nominal value. Variants are excluded, since each is
/// checked as a scene of its own.
std::vector<std::string> value_warnings(const Scene& scene);

}  // namespace abbe::sim
