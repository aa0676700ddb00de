#include "sim/loop/perfect.h"

#include "sim/cut/accelerations.h"
#include "sim/cut/tool_motion.h"
#include "sim/loop/correctors.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;

errors::Load foreseen_load(const program::Samples& samples, const Foreseen& run, double time_s) {
  errors::Load load = load_at(run.process, time_s);
  if (run.accelerations.empty()) return load;
  load.acceleration = run.accelerations[sample_at(samples, time_s)];
  return load;
}

/// The steps of a cut without its stock.
Process steps_of(const Process& process) { return {process.steps, {}, {}, {}}; }

}  // namespace

compensation::Belief perfect_belief(const Job& job, Foreseen run) {
  return [known = without_random(job.truth), &job, run = std::move(run)](const AxisState& state) {
    return tool_in_workpiece(known, state, foreseen_load(job.samples, run, state.time_s));
  };
}

// A perfect belief knows what its own corrections do: the program says at first how the masses
// press and the rigid machine how the cut does, then the corrected commands say it, each time by
// some hundredths of before.
Corrector perfect_corrector(const Job& job, const Seen& seen, const CaseDescription& compensator) {
  constexpr int rounds = 3;
  Foreseen run{steps_of(job.nominal_process), job.accelerations};
  Corrector corrector = belief_corrector(seen, compensator, perfect_belief(job, run));
  const bool bends = job.truth.compliance && !job.nominal_process.steps.empty();
  const bool presses = !job.accelerations.empty();
  if (!bends && !presses) return corrector;
  Commands commands = as_programmed(job);
  const std::vector<AxisState> uncorrected = commands.samples.states;
  for (int round = presses ? 0 : rounds - 1; round < rounds; ++round) {
    commands.samples.states = corrector(uncorrected, job.T_wt_nominal).states;
    if (presses) run.accelerations = accelerations(commands.samples);
    // following the cut costs most, so it is done once, with the commands nearly as they will be
    if (bends && round + 1 == rounds) run.process = steps_of(cut_process(job, commands));
    corrector = belief_corrector(seen, compensator, perfect_belief(job, run));
  }
  return corrector;
}

}  // namespace abbe::sim
