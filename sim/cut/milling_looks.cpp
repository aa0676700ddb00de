#include "sim/cut/milling_looks.h"

#include <algorithm>
#include <stdexcept>
#include <type_traits>
#include <variant>

#include <fmt/format.h>

#include "kinematics/turn_between.h"
#include "sim/cut/part.h"

namespace abbe::sim {

namespace {

/// A blank is cut where the part is.
MeshUse use_of_blank(const Scene& scene) {
  return {"the blank", "cutting", false, use_of_part(scene).travel};
}

}  // namespace

cutting::Blank blank_of(const Scene& scene, const cutting::Design& design_m) {
  return std::visit(
      [&](const auto& blank) -> cutting::Blank {
        using Shape = std::decay_t<decltype(blank)>;
        if constexpr (std::is_same_v<Shape, CuttingDescription::OffsetBlank>) {
          return cutting::offset_blank(design_m, blank.allowance, blank.floor);
        } else if constexpr (std::is_same_v<Shape, MeshFile>) {
          cutting::Design mesh = read_named_mesh(blank, use_of_blank(scene)).design;
          return cutting::MeshBlank{std::move(mesh.vertices), std::move(mesh.triangles)};
        } else if constexpr (std::is_same_v<Shape, CuttingDescription::TurnedBlank>) {
          throw std::invalid_argument("a blank that is milled, not a turned one");
        } else {
          return blank;
        }
      },
      scene.cutting->blank);
}

std::string odd_blank(const Scene& scene, const cutting::Blank& blank) {
  const auto* mesh = std::get_if<MeshFile>(&scene.cutting->blank);
  if (mesh == nullptr) return {};
  return odd_size(*mesh, use_of_blank(scene),
                  extents(std::get<cutting::MeshBlank>(blank).vertices_k));
}

cutting::Stock blank_stock(const Scene& scene, const cutting::Blank& blank) {
  const CuttingDescription& description = *scene.cutting;
  return cutting::make_stock(
      blank, scene.part.T_wm,
      {description.spacing, description.three_directions, description.max_bytes});
}

std::string uncovered_text(const Scene& scene, const cutting::Stock& blank,
                           const cutting::Design& design_m) {
  constexpr Eigen::Index most_tried = 2000;
  constexpr double tolerated = 0.05;  // of the vertices: edges that a rough blank rounds off
  const Eigen::Index n = design_m.vertices.rows();
  const Eigen::Index step = std::max<Eigen::Index>(1, n / most_tried);
  int tried = 0, outside = 0;
  for (Eigen::Index i = 0; i < n; i += step, ++tried) {
    const Eigen::Vector3d point_m = design_m.vertices.row(i).transpose();
    outside += cutting::depth(blank, scene.part.T_wm * point_m) < -blank.spacing;
  }
  if (outside <= tolerated * tried) return {};
  return fmt::format(
      "the blank does not hold {:.3g} % of the design: its sizes are in mm and in the part's own "
      "frame, and forces are of what it holds",
      100.0 * outside / tried);
}

bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample) {
  return path.blocks[std::size_t(samples.block[sample])].interpolation ==
         program::Interpolation::Rapid;
}

std::vector<std::size_t> milling_looks(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach) {
  constexpr double sharp = 0.1;  // rad
  const auto tip = [&](std::size_t i) -> Eigen::Vector3d { return T_wt[i].translation(); };
  const auto axis = [&](std::size_t i) -> Eigen::Vector3d { return T_wt[i].linear().col(2); };
  const auto rapid = [&](std::size_t i) { return is_rapid(samples, path, i); };
  std::vector<std::size_t> at{0};
  double travel = 0.0;
  const std::size_t n = samples.states.size();
  for (std::size_t i = 1; i < n; ++i) {
    travel +=
        (tip(i) - tip(i - 1)).norm() + reach * kinematics::angle_between(axis(i), axis(i - 1));
    const bool last = i + 1 == n;
    if (travel < step && !last && rapid(i) == rapid(i + 1)) {
      const Eigen::Vector3d come = tip(i) - tip(at.back()), goes = tip(i + 1) - tip(i);
      if (kinematics::angle_between(come, goes) < sharp) continue;
    }
    at.push_back(i);
    travel = 0.0;
  }
  return at;
}

}  // namespace abbe::sim
