#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe report`: the cases of a scene as one interactive page.
Command report_command(CommonOptions& common);

/// `abbe render`: draws a finished result again, or a difference of two.
Command render_command(CommonOptions& common);

/// `abbe animate`: a film of the machine while it cuts.
Command animate_command(CommonOptions& common);

}  // namespace abbe::sim
