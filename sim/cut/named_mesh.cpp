#include "sim/cut/named_mesh.h"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

cutting::MarkedMesh read_named_mesh(const MeshFile& mesh, const MeshUse& use,
                                    cutting::ReadMeshOptions options,
                                    const cutting::WantedMarks& wanted) {
  options.unit_mm *= mesh.unit;
  options.open = mesh.open;
  try {
    return cutting::read_marked_mesh(mesh.file, options, wanted);
  } catch (const cutting::MeshWithRim& rim) {
    const Place& at = mesh.place;
    throw BadInput(at.file ? *at.file : mesh.file.string(), at.line, at.column,
                   fmt::format("a closed mesh for {}{}", use.what,
                               use.may_open ? fmt::format(", or {}.open = true for a surface with "
                                                          "a rim",
                                                          use.table)
                                            : ""),
                   fmt::format("{} with {}", mesh.file.string(), rim.seen));
  }
}

Eigen::Vector3d extents(const cutting::Points& vertices) {
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).transpose();
}

std::string unit_word(double unit_mm) {
  static const std::array<std::pair<double, const char*>, 5> words = {
      {{1.0, "mm"}, {units::inch, "inch"}, {10.0, "cm"}, {1000.0, "m"}, {units::um, "um"}}};
  for (const auto& [mm, word] : words)
    if (std::abs(unit_mm / mm - 1.0) < 1e-9) return word;
  return {};
}

std::string odd_size(const MeshFile& mesh, const MeshUse& use, const Eigen::Vector3d& size) {
  constexpr double small = 1.0;  // mm
  if (mesh.any_size) return {};
  const bool large = use.travel && size.maxCoeff() > *use.travel;
  if (!large && !(size.maxCoeff() < small)) return {};
  const std::string word = unit_word(mesh.unit);
  return fmt::format(
      "the mesh of {}, read in {}, is {:.4g} x {:.4g} x {:.4g} mm, {}: {} says another unit, "
      "{}.any_size = true that this size is meant",
      use.what, word.empty() ? fmt::format("units of {:.4g} mm", mesh.unit) : word, size.x(),
      size.y(), size.z(),
      large ? fmt::format("more than the travel of {:.4g} mm", *use.travel) : "less than 1 mm",
      large ? use.table + ".unit" : fmt::format("{}.unit (\"m\" for metres)", use.table),
      use.table);
}

}  // namespace abbe::sim
