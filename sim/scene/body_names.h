#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"

/// The names by which a search for collisions reports bodies, and leaves pairs of them out.
namespace abbe::sim {

/// Of a machine, in its order: what has no name of its own is "body of X", or "body 2 of X" where X
/// carries several such.
std::vector<std::string> body_names(const MachineDescription& machine);

/// What has no name of its own is "fixture", or "fixture 2" of several such.
std::vector<std::string> fixture_names(const std::vector<BodyDescription>& fixtures);

/// Refuses a body of a machine with the name of another, or with one that part, stock and tool
/// have.
/// @param machine  the table that it was read from
void check_body_names(TableReader& machine, const MachineDescription& described);

/// The same of fixtures, bodies of the machine among the others. @param scene  likewise
void check_fixture_names(TableReader& scene, const Scene& described);

/// Refuses pairs to be left out of which one is not there. @param scene  likewise
void check_ignored_names(TableReader& scene, const Scene& described);

}  // namespace abbe::sim
