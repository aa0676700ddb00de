#pragma once

#include "sim/scene/fields.h"
#include "sim/scene/scene.h"

/// The keys at the top of a scene.
namespace abbe::sim {

/// `title` and `seed`
const Fields<Scene>& title_scene_fields();

/// What is cut on which machine: machine to control. Read before `judging_fields`, as their
/// sections ask for the machine.
const Fields<Scene>& cutting_scene_fields();

/// How the cut is judged and compensated: setup to variants.
const Fields<Scene>& judging_scene_fields();

/// Every key of a scene.
std::vector<Key> scene_keys();

/// The scene as a table with every key that it has, those left to their default too; `read_scene`
/// of its text gives the same scene, apart from the last digit of numbers whose unit is not mm,
/// rad or s.
Node written(const Scene& scene);

}  // namespace abbe::sim
