#pragma once

#include "sim/scene/fields.h"
#include "sim/scene/scene.h"

/// The keys at the top level of a scene.
namespace abbe::sim {

/// Returns the fields `title` and `seed`.
const Fields<Scene>& title_scene_fields();

/// Returns the fields of the machine and its cut, from `machine` to `control`. They are read before
/// `judging_scene_fields`, whose sections need the machine.
const Fields<Scene>& cutting_scene_fields();

/// Returns the fields of judgement and compensation, from `setup` to `variant`.
const Fields<Scene>& judging_scene_fields();

/// Returns all keys of a scene.
std::vector<Key> scene_keys();

/// Returns the scene as a table with all of its keys, defaults included. `read_scene` of its text
/// gives the same scene, except for the last digit of numbers whose unit is not mm, rad or s.
Node written(const Scene& scene);

}  // namespace abbe::sim
