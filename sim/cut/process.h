#pragma once

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

namespace abbe::sim {

/// One look at the cut: how the tool is loaded when the axes are there.
struct ProcessStep {
  double time_s = 0.0;
  int line = 0;
  errors::Load load;
  double torque = 0.0;       ///< N mm, on the spindle against its turning
  double power_W = 0.0;      ///< of the cut
  double removed = 0.0;      ///< mm^3 since the step before
  double engaged = 0.0;      ///< mm of cutting edge in material, the mean over a revolution
  double chip = 0.0;         ///< mm, largest uncut chip thickness
  double beyond_edge = 0.0;  ///< mm, by which the cut goes beyond the edges of an insert
  int iterations = 0;        ///< of force and deflection; 0 where nothing was loaded
  double contraction = 0.0;  ///< largest ratio of two corrections running: below 1, the loop closes
                             ///< by repetition; 0 where two were not needed
  double disagreement = 0.0;  ///< mm, last change of the deflection
  bool converged = true;      ///< it is within the scene's tolerance; or the deflection is known to
                              ///< it, between two places where the force jumps
};

/// The cut followed along a program.
struct Process {
  std::vector<ProcessStep> steps;  ///< in time
  std::vector<int> crash_lines;    ///< program lines on which a rapid or the shank met material
  std::optional<cutting::Stock> stock;         ///< what is left after milling
  std::optional<cutting::TurnedStock> turned;  ///< what is left after turning
  std::vector<std::string> warnings = {};      ///< of the blank
};

/// Sums and largest values over the steps of a process.
struct ProcessTotals {
  double removed = 0.0;     ///< mm^3
  double force_max = 0.0;   ///< N
  double force_sum = 0.0;   ///< N, over the loaded steps
  std::size_t loaded = 0;   ///< steps with a force
  double torque_max = 0.0;  ///< N mm
  double power_max_W = 0.0;
  int iterations_max = 0;
  double contraction_max = 0.0;
  std::size_t open = 0;           ///< steps that did not converge
  double disagreement_max = 0.0;  ///< mm, over those
};
ProcessTotals totals(const Process& process);

/// Load at an instant: linear between two steps, zero before the first and after the last.
errors::Load load_at(const Process& process, double time_s);

/// A cut whose depth does not settle from one revolution of the work to the next.
struct RevolutionSwing {
  int revolutions = 0;  ///< in turn, where it is widest
  int line = 0;         ///< of the first of them
  double low = 0.0;     ///< N, least and
  double high = 0.0;    ///< largest force among them
  double gain = 0.0;    ///< a change of the force returns so many times as large, at the most
  int leaps = 0;  ///< how often the tool leaps out of the work and back, where it does not swing;
                  ///< the gain is then that within a revolution
};

/// Looks for it in the forces of a turned part; none if every change dies out.
/// With c, mm/N, how far the force moves the tool into the work, and a, N/mm, by how much the force
/// grows as it goes deeper, the loop within a revolution has the gain c a. But what one revolution
/// takes too deep is missing to the next: with b <= a, the part of a that is counted from what the
/// revolution before left, a change of depth returns as -c b / (1 - c a) times itself. That grows
/// where c (a + b) > 1, so a machine that the cut draws in (c > 0) swings from half of the gain on
/// at which it would run away; one that gives way (c < 0) never does. The gain is read off ten
/// changes of alternating sign, each above 1 % of the force: the second five against the first,
/// with c a >= 1/2 among them, as b <= a. Far beyond, the tool digs in, cuts itself free for some
/// revolutions and digs in again: three such leaps within forty revolutions of one line, a
/// contraction of the loop of 1 and more among them.
std::optional<RevolutionSwing> revolution_swing(const Process& process);

/// Puts some behind others.
void add_warnings(std::vector<std::string> more, std::vector<std::string>& warnings);

/// What a scene describes and nothing in it uses, in words.
std::vector<std::string> idle_warnings(const Scene& scene);

/// What went wrong with the cut itself, in words.
std::vector<std::string> process_warnings(const Scene& scene, const Process& process);

/// What a machine with heat does from the beginning of its history to the end of its program: the
/// phases of the history as they are described, then the program in stretches of the scene's
/// interval with the mean speeds and the mean cutting power of each, at last the machine at rest.
/// Two knots a stretch, since speeds jump. Empty for a scene without heat.
/// @param process  of the nominal machine, for the cutting power; empty where nothing is cut
std::vector<errors::Activity> activity(const Scene& scene, const Machine& machine,
                                       const program::Samples& samples, const Process& process);

/// Returns what no machine does: a node that leaves -40 to 150 deg C, a spindle that runs more than
/// five times as fast as the speed at which its heat is stated or, in its history, less than a
/// thirtieth of it, a datum found before the history or after the program. One sentence each; empty
/// without heat.
std::vector<std::string> heat_warnings(const DatumDescription& datum, const Truth& truth);

}  // namespace abbe::sim
