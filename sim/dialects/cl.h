#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// Reads cutter locations: APT statements as CAM systems post them, or a CSV of x y z i j k feed.
/// Points are the tip in the workpiece (plus the work offset), vectors the tool axis from the tip
/// to the spindle; rotary axes are those of `kinematics::inverse` with the least rotary travel
/// first, and between points the tip goes straight while the rotary axes turn in proportion.
void read_cl(std::string_view text, ProgramRun& run);

/// Its words.
std::span<const WordUse> cl_words();

}  // namespace abbe::sim::dialects
