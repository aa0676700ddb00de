#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cutting/engagement.h"
#include "cutting/stock.h"
#include "errors/compliance.h"

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

}  // namespace abbe::sim
