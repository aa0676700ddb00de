#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe pose`: one of `--at`, `--at-file` and `--grid`. Warnings go to standard error, and into
/// JSON where that is what is written.
Command pose_command(Common& common);

}  // namespace abbe::sim
