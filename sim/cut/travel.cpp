#include "sim/cut/travel.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim {
namespace {

/// ", whose words count in inches (G20 on line 2, after G21 on line 1)"; empty of a block in mm.
std::string inch_text(const program::Path& path, const program::Block& block) {
  const auto later = std::ranges::find_if(
      path.unit_words, [&](const program::UnitWord& word) { return word.line > block.line; });
  const auto words = later - path.unit_words.begin();
  if (!block.inch || words == 0) return {};
  const std::string before =
      words > 1 ? fmt::format(", after G21 on line {}", (later - 2)->line) : "";
  return fmt::format(", whose words count in inches (G20 on line {}{})", (later - 1)->line, before);
}

}  // namespace

void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples) {
  constexpr double slack = 1e-6;  // mm or rad: words are rounded, limits are not exact
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    for (int k = 0; k < machine.nominal.size(); ++k) {
      const kinematics::Joint& joint = machine.nominal.joints()[std::size_t(k)];
      const double q = samples.states[i].q[k];
      if (is_spindle(machine, k)) continue;
      if (q >= joint.min - slack && q <= joint.max + slack) continue;
      const bool turns = joint.motion == kinematics::Motion::Rotary;
      const double unit = turns ? units::deg : 1.0;
      throw BadInput(path.file, samples.line[i], 0,
                     fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                                 joint.max / unit, turns ? "deg" : "mm"),
                     fmt::format("{} = {:.9g} in this block{}", joint.name, q / unit,
                                 inch_text(path, path.blocks[std::size_t(samples.block[i])])));
    }
  }
}

}  // namespace abbe::sim
