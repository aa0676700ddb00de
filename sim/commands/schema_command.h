#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

Command schema_command();

}  // namespace abbe::sim
