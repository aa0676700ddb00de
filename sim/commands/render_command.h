#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe render`: draws a finished result again, or a difference of two.
Command render_command(Common& common);

}  // namespace abbe::sim
