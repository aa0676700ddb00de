#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe check`: says how a scene was understood, and cuts nothing.
Command check_command(Common& common);

}  // namespace abbe::sim
