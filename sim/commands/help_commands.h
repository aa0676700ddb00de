#pragma once

#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

/// Every key of a scene, and the keys of a study below `study`.
std::vector<Key> all_keys();

/// Keys of the table at a dotted path: "machine", "study.input".
/// @throws BadUsage if there is none
std::vector<Key> keys_of(const std::string& section);

/// Paths of keys that begin with a prefix, as `--set` takes them: "part.radius_mm", of every table
/// of a list "instrument.kind", of one where the prefix has its index or name, "instrument.0.kind".
/// Keys of a study begin with "study." and are listed for a prefix that does.
std::vector<std::string> settable_keys(const std::string& prefix);

/// `abbe help`; the command line answers for commands as `--help` does.
/// @param others  every other command
Command help_command(const std::vector<Command>& others);

Command explain_command();

Command schema_command();

}  // namespace abbe::sim
