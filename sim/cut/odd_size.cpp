#include "sim/cut/odd_size.h"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/part.h"

namespace abbe::sim {

std::string unit_word(double unit_mm) {
  static const std::array<std::pair<double, const char*>, 5> words = {
      {{1.0, "mm"}, {units::inch, "inch"}, {10.0, "cm"}, {1000.0, "m"}, {units::um, "um"}}};
  for (const auto& [mm, word] : words)
    if (std::abs(unit_mm / mm - 1.0) < 1e-9) return word;
  return {};
}

std::string odd_size(const Scene& scene, const cutting::Design& design_w) {
  constexpr double small = 1.0;  // mm
  const auto* mesh = std::get_if<MeshFile>(&scene.part.shape);
  if (!mesh || mesh->any_size) return {};
  const cutting::Points p_m = cutting::transformed(design_w, scene.part.T_wm.inverse()).vertices;
  const Eigen::Vector3d size = (p_m.colwise().maxCoeff() - p_m.colwise().minCoeff()).transpose();
  const auto travel = travel_box(scene.machine);
  const bool large = travel && size.maxCoeff() > travel->maxCoeff();
  if (!large && !(size.maxCoeff() < small)) return {};
  const std::string word = unit_word(mesh->unit);
  return fmt::format(
      "the mesh, read in {}, is {:.4g} x {:.4g} x {:.4g} mm, {}: part.unit says another unit, "
      "part.any_size = true that this size is meant",
      word.empty() ? fmt::format("units of {:.4g} mm", mesh->unit) : word, size.x(), size.y(),
      size.z(),
      large ? fmt::format("more than the travel of {:.4g} mm", travel->maxCoeff())
            : "less than 1 mm");
}

}  // namespace abbe::sim
