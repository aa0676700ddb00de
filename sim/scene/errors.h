#pragma once

#include <cstdint>
#include <vector>

#include "errors/geometric.h"
#include "errors/vibration.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

struct Key;

/// A section `[errors]` with its common factor.
struct ErrorsSection {
  errors::GeometricErrors geometric;
  double scale = 1.0;
};
/// Reads `errors`.
/// @param section  one table or a list of them, whose elements add up
/// @param machine  gives the units of the axes and binds each element, so that an element without
/// meaning is rejected at its position
/// @param seed     of the scene; repeatability without a seed of its own derives one from it
ErrorsSection read_errors(const Node& section, const MachineDescription& machine,
                          std::uint64_t seed, InputErrors& input_errors);
/// Returns one table, which includes the contents of files.
Node::Table written_errors(const ErrorsSection& section, const MachineDescription& machine);
std::vector<Key> errors_keys();

/// Reads and writes `[[vibration]]`.
errors::Vibration read_vibration(const Node& table, const MachineDescription& machine,
                                 InputErrors& input_errors);
Node::Table written_vibration(const errors::Vibration& vibration);
std::vector<Key> vibration_keys();

/// Returns several tables as one, each multiplied by its scale. Elements of equal name are merged
/// and ordered as on the machine, whatever the order of the tables. Numbers of different tables are
/// uncorrelated.
errors::GeometricErrors joined(std::vector<ErrorsSection> tables,
                               const MachineDescription& machine);

}  // namespace abbe::sim
