#pragma once

#include "sim/loop/seen.h"

namespace abbe::sim {

/// A correction that reaches the axes while the program runs: the ideal one as the channel of the
/// case lets it through at its own cycle, then as the position loops follow. Samples are added
/// where it bends between those of the program, so that it is met within a tenth of the chord
/// tolerance.
/// @param commanded  (samples) of the program, uncorrected
/// @param ideal      (samples) corrected
/// @throws BadInput naming the scene for a channel that cannot be
Commands through_time(const Seen& seen, CaseDescription::Channel channel,
                      const std::vector<kinematics::AxisState>& commanded,
                      const std::vector<kinematics::AxisState>& ideal);

}  // namespace abbe::sim
