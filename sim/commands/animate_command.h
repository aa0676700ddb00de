#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe animate`: a film of the machine while it cuts.
Command animate_command(Common& common);

}  // namespace abbe::sim
