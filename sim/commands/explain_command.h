#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

Command explain_command();

}  // namespace abbe::sim
