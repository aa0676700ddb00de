#include "cutting/read_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/mesh_audit.h"
#include "cutting/mesh_words.h"
#include "cutting/read_obj.h"
#include "cutting/read_off.h"
#include "cutting/read_ply.h"
#include "cutting/read_stl.h"
#include "kinematics/text.h"

namespace abbe::cutting {
namespace {

void check_options(const ReadMeshOptions& options) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (!positive(options.unit_mm))
    throw std::invalid_argument("read_mesh: unit_mm must be positive");
  if (!positive(options.travel_ratio) || options.travel_ratio < 1.0)
    throw std::invalid_argument("read_mesh: travel_ratio must be at least 1");
  if (options.travel && !(options.travel->allFinite() && options.travel->maxCoeff() > 0.0))
    throw std::invalid_argument("read_mesh: travel must be positive and finite");
}

Soup read_soup(const MeshSource& source, const std::string& kind, const WantedMarks& wanted) {
  if (kind == "stl") return read_stl(source, wanted);
  if (kind == "obj") return read_obj(source, wanted);
  if (kind == "ply") return read_ply(source, wanted);
  if (kind == "off") return read_off(source, wanted);
  source.refuse("a mesh file ending in .stl, .obj, .ply or .off", in_quotes("." + kind));
}

/// The triangles as a surface. Equal points are one vertex, but not in a body that is closed as it
/// is indexed: bodies that touch share points and are closed without each other.
struct Indexed {
  Soup soup;
  std::vector<HalfEdge> edges;
};

Indexed indexed(const Soup& as_written, const std::string& kind) {
  if (kind != "stl") {
    Soup soup = without_unused(as_written);
    std::vector<HalfEdge> edges = half_edges(soup);
    if (is_closed(edges)) return {std::move(soup), std::move(edges)};
  }
  Soup soup = without_unused(merged(as_written));
  std::vector<HalfEdge> edges = half_edges(soup);
  return {std::move(soup), std::move(edges)};
}

Design design_of(const MeshSource& source, const Soup& soup, double unit_mm) {
  Design design;
  design.vertices.resize(static_cast<Eigen::Index>(soup.points.size()), 3);
  design.triangles.resize(static_cast<Eigen::Index>(soup.faces.size()), 3);
  for (std::size_t i = 0; i < soup.points.size(); ++i)
    design.vertices.row(static_cast<Eigen::Index>(i)) = unit_mm * soup.points[i].transpose();
  for (std::size_t f = 0; f < soup.faces.size(); ++f)
    for (int k = 0; k < 3; ++k)
      design.triangles(static_cast<Eigen::Index>(f), k) =
          soup.faces[f][static_cast<std::size_t>(k)];
  design.normals = vertex_normals(design.vertices, design.triangles);
  design.area = vertex_area(design.vertices, design.triangles);
  design.facet_error = facet_error(design.vertices, design.normals, design.triangles);
  design.judged.assign(soup.points.size(), 1);
  for (Eigen::Index i = 0; i < design.normals.rows(); ++i)
    if (!(design.normals.row(i).norm() > 0.5))
      source.refuse("a normal at every vertex",
                    "triangles that cancel at " + place_text(design.vertices.row(i).transpose()));
  return design;
}

void check_size(const MeshSource& source, const Eigen::AlignedBox3d& box,
                const ReadMeshOptions& options) {
  if (!options.travel) return;
  const double part = box.sizes().maxCoeff();
  const double travel = options.travel->maxCoeff();
  if (part <= options.travel_ratio * travel) return;
  static const std::array<std::pair<double, const char*>, 5> units = {
      {{1.0, "mm"}, {25.4, "inches"}, {10.0, "cm"}, {1e-3, "um"}, {1000.0, "m"}}};
  std::string guess = "no usual unit explains it";
  for (const auto& [unit_mm, name] : units)
    if (const double other = part / options.unit_mm * unit_mm; other <= travel) {
      guess = fmt::format("read in {} it would be {:.4g} mm long", name, other);
      break;
    }
  source.refuse(
      fmt::format(
          "a part of at most {:.4g} mm, {:.4g} times the travel of {:.4g} mm (set its unit)",
          travel * options.travel_ratio, options.travel_ratio, travel),
      fmt::format("{:.4g} x {:.4g} x {:.4g} mm: {}", box.sizes().x(), box.sizes().y(),
                  box.sizes().z(), guess));
}

}  // namespace

Design read_mesh(const std::filesystem::path& file, const ReadMeshOptions& options) {
  return read_marked_mesh(file, options, {}).design;
}

MarkedMesh read_marked_mesh(const std::filesystem::path& file, const ReadMeshOptions& options,
                            const WantedMarks& wanted) {
  check_options(options);
  const std::string ending = lower(file.extension().string());
  const std::string kind = ending.empty() ? ending : ending.substr(1);
  // corners are counted in int
  const MeshSource source = mesh_source(file, options.max_bytes,
                                        std::min<std::int64_t>(options.max_triangles, 700'000'000));
  Soup as_written = read_soup(source, kind, wanted);
  FaceMarks marks = std::exchange(as_written.marks, {});
  const auto [soup, edges] = indexed(as_written, kind);
  audit(source, soup, edges, options.open);
  Design design = design_of(source, soup, options.unit_mm);
  Eigen::AlignedBox3d box;
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i)
    box.extend(design.vertices.row(i).transpose());
  check_size(source, box, options);
  return {std::move(design), std::move(marks)};
}

}  // namespace abbe::cutting
