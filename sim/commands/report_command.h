#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe report`: the cases of a scene as one interactive page.
Command report_command(Common& common);

}  // namespace abbe::sim
