#include "sim/cut/cut_warnings.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/revolution_swing.h"

namespace abbe::sim {
namespace {

std::string swing_text(const RevolutionSwing& swing) {
  const std::string how =
      swing.leaps > 0
          ? fmt::format(
                "on line {} the tool leaps out of the work and back {} times in {} "
                "revolutions, under up to {:.4g} N, with a gain of force by depth of {:.2f}",
                swing.line, swing.leaps, swing.revolutions, swing.high, swing.gain)
          : fmt::format(
                "for {} revolutions from line {} on the force swings between {:.4g} and "
                "{:.4g} N from one to the next, a change returns {:.2f} times as large",
                swing.revolutions, swing.line, swing.low, swing.high, swing.gain);
  return "the cut does not settle: " + how +
         ": under the cutting force the tool goes too far into the work, and the surface is one of "
         "chatter";
}

}  // namespace

std::vector<std::string> process_warnings(const Scene& scene, const Process& process) {
  std::vector<std::string> warnings;
  if (process.steps.empty()) return warnings;
  const ProcessTotals all = totals(process);
  // Where the force jumps, a step in thousands swings between its sides by some nm at any length of
  // step: nothing that a user could change.
  const double tolerance = scene.cutting->tolerance;
  const bool is_stray = all.disagreement_max < std::min(10.0 * tolerance, 10.0 * units::nm) &&
                        1000 * all.open < process.steps.size();
  if (all.open > 0 && !is_stray)
    warnings.push_back(
        fmt::format("force and deflection did not agree to {:.3g} nm at {} of {} steps; they "
                    "differ by {:.3g} nm at most",
                    tolerance / units::nm, all.open, process.steps.size(),
                    all.disagreement_max / units::nm));
  if (const auto swing = revolution_swing(process)) warnings.push_back(swing_text(*swing));
  if (!(all.removed > 0.0)) warnings.push_back("the tool met no material of the blank");
  if (!process.crash_lines.empty())
    warnings.push_back(fmt::format("a rapid or the shank met material on {} lines, first line {}",
                                   process.crash_lines.size(), process.crash_lines.front()));
  const auto beyond = std::ranges::max_element(process.steps, {}, &ProcessStep::beyond_edge);
  if (beyond->beyond_edge > 0.01)
    warnings.push_back(fmt::format(
        "the cut goes {:.3g} mm beyond the edges of the insert (line {}): what lies there is "
        "removed and counts in the force as if an edge along the radius cut it",
        beyond->beyond_edge, beyond->line));
  return warnings;
}

void add_warnings(std::vector<std::string> more, std::vector<std::string>& warnings) {
  std::move(more.begin(), more.end(), std::back_inserter(warnings));
}

std::vector<std::string> idle_warnings(const Scene& scene) {
  std::vector<std::string> warnings;
  const auto warn = [&](bool is, const char* what) {
    if (is) warnings.push_back(what);
  };
  const bool cuts = scene.cutting && scene.cutting->material;
  if (scene.compliance) {
    const errors::ComplianceErrors& soft = *scene.compliance;
    const bool weighs = (soft.gravity_b || soft.inertia) && !soft.masses.empty();
    warn(!cuts && !weighs && soft.clamping_w.isZero(0.0),
         "nothing loads the compliance: it wants [cutting] with a material, masses with gravity or "
         "inertia, or clamping");
    warn((soft.gravity_b || soft.inertia) && soft.masses.empty(),
         "gravity and inertia act on [[compliance.mass]], and there is none");
    warn(!soft.gravity_b && !soft.inertia && !soft.masses.empty(),
         "the masses do nothing without gravity or inertia");
  }
  warn(scene.signals.dynamometer && !cuts, "the dynamometer reads nothing without cutting forces");
  warn(scene.signals.current && !cuts && !scene.thermal && !scene.compliance,
       "signals.csv is written where there is heat, stock or compliance");
  return warnings;
}

}  // namespace abbe::sim
