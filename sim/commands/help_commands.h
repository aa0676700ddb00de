#pragma once

#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

/// Returns every key of a scene, and the keys of a study below `study`.
std::vector<Key> all_keys();

/// Returns the keys of the table at a dotted path: "machine", "study.input".
/// @throws BadUsage if there is none
std::vector<Key> keys_of(const std::string& section);

/// Returns the paths of keys that begin with a prefix, as `--set` takes them: "part.radius_mm", for
/// all tables of a list "instrument.kind", for one of them "instrument.0.kind" if the prefix has
/// its index or name. Keys of a study begin with "study." and are listed only for such a prefix.
std::vector<std::string> settable_keys(const std::string& prefix);

/// Returns the command `abbe help`; for the name of a command the parser prints its `--help`.
/// @param others  every other command
Command help_command(const std::vector<Command>& others);

/// Returns the command `abbe explain`, which describes a key.
Command explain_command();

/// Returns the command `abbe schema`, which prints the JSON Schema for editors.
Command schema_command();

}  // namespace abbe::sim
