#pragma once

#include "sim/scene/fields.h"
#include "sim/scene/scene.h"

/// Fields at the top level of a scene, in three groups that are read one after the other.
namespace abbe::sim {

/// Returns the fields `title` and `seed`.
const Fields<Scene>& title_scene_fields();

/// Returns the fields of the machine and the cut, from `machine` to `control`. They are read before
/// `judging_scene_fields`, whose sections need the machine.
const Fields<Scene>& cutting_scene_fields();

/// Returns the fields of judgement and compensation, from `setup` to `compare`.
const Fields<Scene>& judging_scene_fields();

/// Returns all keys of a scene.
std::vector<Key> scene_keys();

/// Returns the scene as a table with all keys, defaults included. Reading its text gives the same
/// scene, except for the last digit of numbers in units other than mm, rad and s.
Node to_table(const Scene& scene);

}  // namespace abbe::sim
