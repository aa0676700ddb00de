#pragma once

#include "sim/commands/command.h"

/// The commands `abbe report`, `abbe render` and `abbe animate`.
namespace abbe::sim {

/// Returns the command `abbe report`, which writes the cases of a scene, a study or results as one
/// interactive page.
Command report_command(CommonOptions& common);

/// Returns the command `abbe render`, which draws a finished result, or the difference of two.
Command render_command(CommonOptions& common);

/// Returns the command `abbe animate`, which films the machine while it cuts.
Command animate_command(CommonOptions& common);

}  // namespace abbe::sim
