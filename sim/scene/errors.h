#pragma once

#include <cstdint>
#include <vector>

#include "errors/geometric.h"
#include "errors/vibration.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

struct Key;

/// A section `[errors]`, whose elements are multiplied by a common factor.
struct ErrorsSection {
  errors::GeometricErrors geometric;
  double scale = 1.0;
};
/// Reads `errors`.
/// @param section  one table or a list of tables, whose elements add up
/// @param machine  gives the units of the axes; an element that the machine cannot have is reported
/// @param seed     seed of the scene, from which curves without a seed of their own derive one
ErrorsSection read_errors(const Node& section, const MachineDescription& machine,
                          std::uint64_t seed, InputErrors& input_errors);
/// Returns the section as one table, which includes the contents of files.
Node::Table errors_to_table(const ErrorsSection& section, const MachineDescription& machine);
std::vector<Key> errors_keys();

/// Reads and writes `[[vibration]]`.
errors::Vibration read_vibration(const Node& table, const MachineDescription& machine,
                                 InputErrors& input_errors);
Node::Table vibration_to_table(const errors::Vibration& vibration);
std::vector<Key> vibration_keys();

/// Joins several tables, each multiplied by its scale. Elements of equal name are merged; the
/// elements are in the order of the machine, not of the tables. Numbers of different tables are
/// uncorrelated.
errors::GeometricErrors join_errors_tables(std::vector<ErrorsSection> tables,
                                           const MachineDescription& machine);

}  // namespace abbe::sim
