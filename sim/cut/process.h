#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cutting/stock/engagement.h"
#include "cutting/stock/stock.h"
#include "errors/compliance.h"
#include "errors/thermal_run.h"
#include "sim/machine/machine.h"
#include "sim/machine/truth.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

/// The cutting process along a program: loads, removed volume, chatter, and the heat it causes.
namespace abbe::sim {

/// A step of the simulated cut: the load on the tool at a sample.
struct ProcessStep {
  double time_s = 0.0;
  int line = 0;
  errors::Load load;
  double torque = 0.0;        ///< N mm, on the spindle, against its rotation
  double power_W = 0.0;       ///< cutting power
  double removed = 0.0;       ///< volume since the step before, mm^3
  double engaged = 0.0;       ///< length of cutting edge in material, mean over a revolution, mm
  double chip = 0.0;          ///< largest uncut chip thickness, mm
  double overhang = 0.0;      ///< length by which the cut exceeds the edges of an insert, mm
  int iterations = 0;         ///< of force and deflection; 0 without load
  double loop_gain = 0.0;     ///< largest ratio of two successive corrections, 0 if there were
                              ///< fewer; plain repetition converges if it is below 1
  double disagreement = 0.0;  ///< last change of the deflection, mm
  bool converged = true;      ///< the disagreement is within the tolerance of the scene, or the
                              ///< deflection is known to it where the force jumps
};

/// The cutting process along a program.
struct Process {
  std::vector<ProcessStep> steps;  ///< in order of time
  std::vector<int> crash_lines;    ///< program lines on which a rapid or the shank met material
  std::optional<cutting::Stock> stock;         ///< the stock left by milling
  std::optional<cutting::TurnedStock> turned;  ///< the stock left by turning
  std::vector<std::string> warnings = {};      ///< about the blank
  std::vector<std::size_t> part_starts = {};   ///< (parts) number of the first step of each part of
                                               ///< the job; may be empty for a single part
};

/// Appends the process of the next part of a job. The stock becomes that of the part.
void append_part(Process part, Process& process);
/// Returns the steps of one part of a job, without the stock.
/// @param process  of all parts
Process part_process(const Process& process, std::size_t part);
/// Moves the stock, milled or turned, out of a process into one without steps.
Process take_stock(Process& process);

/// Sums and largest values over the steps of a process.
struct ProcessTotals {
  double removed = 0.0;          ///< mm^3
  double max_force = 0.0;        ///< N
  double force_sum = 0.0;        ///< N, over the loaded steps
  std::size_t loaded_steps = 0;  ///< number of steps with a force
  double max_torque = 0.0;       ///< N mm
  double max_power_W = 0.0;
  int max_iterations = 0;
  double max_loop_gain = 0.0;
  std::size_t unconverged_steps = 0;  ///< number of steps that did not converge
  double max_disagreement = 0.0;      ///< mm, largest of those steps
};
/// Returns the totals of a process.
ProcessTotals totals(const Process& process);

/// Returns the load at an instant: linear between steps, zero before the first and after the last.
errors::Load load_at(const Process& process, double time_s);

/// A cut whose depth does not settle from one revolution of the work to the next (chatter).
struct RevolutionSwing {
  int revolutions = 0;  ///< length of the widest swing, in consecutive revolutions
  int line = 0;         ///< program line of the first of them
  double low = 0.0;     ///< N, smallest force among them
  double high = 0.0;    ///< N, largest force among them
  double gain = 0.0;    ///< largest ratio of a change of force to the change a revolution before
  int leaps = 0;        ///< number of times the tool leaps out of the work and back; 0 if the force
                        ///< alternates. With leaps the gain is that within a revolution
};

/// Returns the swing in the forces of a turned part; none if every change decays.
/// Let c, mm/N, be how far the force moves the tool into the work, and a, N/mm, the slope of the
/// force with depth; the loop within a revolution has the gain c a. What one revolution takes too
/// deep is missing in the next: with b <= a, the part of a counted from the surface left by the
/// revolution before, a change of depth returns as -c b / (1 - c a) times itself. It grows if c (a
/// + b) > 1, so a machine that the cut draws in (c > 0) swings from half of the gain at which it
/// would run away; one that yields (c < 0) never does.
/// The gain is taken from ten changes of alternating sign, each above 1 % of the force: the last
/// five against the first five, with c a >= 1/2 among them, as b <= a. Far beyond that the tool
/// digs in, cuts itself free for some revolutions and digs in again: at least three such leaps
/// within forty revolutions of one line, with a contraction of the loop of 1 or more among them.
std::optional<RevolutionSwing> revolution_swing(const Process& process);

/// Appends warnings to others.
void add_warnings(std::vector<std::string> additional, std::vector<std::string>& warnings);

/// Returns warnings about parts of a scene that have no effect.
std::vector<std::string> idle_warnings(const Scene& scene);

/// Returns warnings about the cutting process itself.
std::vector<std::string> process_warnings(const Scene& scene, const Process& process);

/// Calls `use` for the samples of each window of a program in order, or for those of the whole
/// program; of a window that begins with the last sample of the one before, `first` is 1.
using SamplesVisitor = std::function<void(
    const std::function<void(const program::Samples& samples, std::size_t first)>& use)>;

/// Returns the activity of a machine with heat from the beginning of its history to the end of its
/// program: the phases of the history; the program in intervals of the scene, with mean speeds and
/// mean cutting power; finally the machine at rest. An interval has two knots, since speeds jump.
/// Empty for a scene without heat.
/// @param visit_samples  of the program; empty if none runs
/// @param process  of the nominal machine, for the cutting power; empty if nothing is cut
std::vector<errors::Activity> activity(const Scene& scene, const Machine& machine,
                                       const SamplesVisitor& visit_samples, const Process& process);

/// Returns warnings about implausible heat, one sentence each: a node outside -40 to 150 deg C, a
/// spindle that runs more than five times as fast as the speed at which its heat is stated or, in
/// its history, at less than a thirtieth of it, a datum measured before the history or after the
/// program. Empty without heat.
std::vector<std::string> heat_warnings(const DatumDescription& datum, const Truth& truth);

}  // namespace abbe::sim
