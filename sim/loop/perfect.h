#pragma once

#include "sim/cut/cut.h"
#include "sim/loop/seen.h"

namespace abbe::sim {

/// What acts in the run that a perfect belief foresees.
struct Foreseen {
  Process process;                                    ///< its steps
  std::vector<kinematics::AxisVector> accelerations;  ///< (samples) of the axes; empty where no
                                                      ///< mass has inertia
};

/// The one door between truth and compensation: the perfect belief, without random parts. It refers
/// to the job, which must outlive it.
compensation::Belief perfect_belief(const Job& job, Foreseen run);

/// Corrects by the perfect belief, which foresees what its own corrections do.
Corrector perfect_corrector(const Job& job, const Seen& seen, const CaseDescription& compensator);

}  // namespace abbe::sim
