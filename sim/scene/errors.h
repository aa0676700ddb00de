#pragma once

#include <cstdint>
#include <vector>

#include "errors/geometric.h"
#include "errors/vibration.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

struct Key;

struct ErrorsSection {
  errors::GeometricErrors geometric;
  double scale = 1.0;
};
/// @param section  one table or a list of them; several add up
/// @param machine  for the units of its axes and to bind each element to it, so that an element
/// that
///                 means nothing is refused where it stands
/// @param seed     of the scene, from which repeatability without a seed of its own takes one
ErrorsSection read_errors(const Node& section, const MachineDescription& machine,
                          std::uint64_t seed, InputErrors& input_errors);
/// One table; what came from files stands in it.
Node::Table written_errors(const ErrorsSection& section, const MachineDescription& machine);
std::vector<Key> errors_keys();

/// `[[vibration]]`
errors::Vibration read_vibration(const Node& table, const MachineDescription& machine,
                                 InputErrors& input_errors);
Node::Table written_vibration(const errors::Vibration& vibration);
std::vector<Key> vibration_keys();

/// Tables of errors as one, each times its scale. Elements of one name become one; they stand in
/// the order of the machine, whatever that of the tables is. What one table knows is not correlated
/// with what another knows.
errors::GeometricErrors joined(std::vector<ErrorsSection> tables,
                               const MachineDescription& machine);

}  // namespace abbe::sim
