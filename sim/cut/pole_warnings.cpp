#include "sim/cut/pole_warnings.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/cut/part.h"

namespace abbe::sim {

std::string pole_text(const program::NearPole& pole, const kinematics::Chain& chain, double within,
                      const std::vector<std::string>& more_files) {
  if (pole.turned < pole_turn_said) return {};
  const auto letter = [&](int joint) { return chain.joints()[std::size_t(joint)].name; };
  return fmt::format(
      "the tool passes a pole of the machine, where it lies along {} and {} turns nothing, "
      "by {:.3g} deg ({}; the pole is at {} {:.4g}): nearer than {:.4g} deg {} turns by "
      "{:.4g} deg in all, at up to {:.4g} deg/min as programmed",
      letter(pole.axis), letter(pole.axis), pole.angle / units::deg,
      program::line_text(more_files, pole.line, pole.file), letter(pole.other),
      pole.at / units::deg + 0.0, within / units::deg, letter(pole.axis), pole.turned / units::deg,
      pole.fastest / units::deg * 60.0);
}

std::vector<std::string> pole_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path) {
  const auto* given = std::get_if<ProgramFile>(&scene.program.source);
  const bool tip = std::ranges::any_of(path.blocks, [](const program::Block& block) {
    return block.coordinates == program::Coordinates::Tip;
  });
  if (given == nullptr || !(given->pole_warning > 0.0) || !tip) return {};
  const program::NcOptions control = nc_options(scene, machine);
  program::PathMeter meter(machine.control,
                           {.rapid_speed = scene.machine.rapid_speed,
                            .rapid_turn = scene.machine.rapid_turn,
                            .pole = given->pole_warning},
                           &control.control_of_h);
  meter.add(path);
  const auto pole = meter.figures().pole;
  if (!pole) return {};
  std::string text = pole_text(*pole, machine.control, given->pole_warning, path.more_files);
  if (text.empty()) return {};
  return {std::move(text)};
}

}  // namespace abbe::sim
