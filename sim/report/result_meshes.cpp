#include "sim/report/result_meshes.h"

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/units.h"
#include "sim/files/versions.h"
#include "sim/report/little_endian.h"

namespace abbe::sim {
namespace {

std::string ply_head(const ResultMap& map) {
  // `quality` of another type than float MeshLab does not take for a quality
  std::string head =
      "ply\nformat binary_little_endian 1.0\n"
      "comment residual map of abbe; quality is the residual in um, nan where not cut\n";
  for (const auto& [name, text] : fact_texts(map.facts))
    head += fmt::format("comment {}: {}\n", name, text);
  head += fmt::format("element vertex {}\n", map.design.vertices.rows());
  for (const char* name : {"x", "y", "z"}) head += fmt::format("property double {}\n", name);
  for (const char* name : {"nx", "ny", "nz", "quality"})
    head += fmt::format("property float {}\n", name);
  return head +
         fmt::format(
             "property uchar status\nelement face {}\nproperty list uchar int vertex_indices\n"
             "end_header\n",
             map.design.triangles.rows());
}

cutting::Points machined(const ResultMap& map) {
  cutting::Points points = map.design.vertices;
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    if (map.status[std::size_t(i)] == std::uint8_t(cutting::VertexStatus::Cut))
      points.row(i) += map.residual_um[i] * units::um * map.design.normals.row(i);
  return points;
}

/// The 80 bytes before the triangles: ASCII, and no "solid" in front, which marks a text.
std::string stl_head(const std::string& what) {
  std::string head = fmt::format("abbe {}, {}", version(), what);
  for (char& c : head)
    if (c < ' ' || c > '~') c = '?';
  head.resize(80, ' ');
  return head;
}

}  // namespace

std::string to_ply(const ResultMap& map) {
  std::string bytes = ply_head(map);
  bytes.reserve(bytes.size() + 41 * std::size_t(map.design.vertices.rows()) +
                13 * std::size_t(map.design.triangles.rows()));
  for (Eigen::Index i = 0; i < map.design.vertices.rows(); ++i) {
    for (const double x : map.design.vertices.row(i)) append(bytes, x);
    for (const double x : map.design.normals.row(i)) append(bytes, float(x));
    append(bytes, float(map.residual_um[i]));
    append(bytes, map.status[std::size_t(i)]);
  }
  for (const auto& triangle : map.design.triangles.rowwise()) {
    append(bytes, std::uint8_t(3));
    for (const int corner : triangle) append(bytes, std::int32_t(corner));
  }
  return bytes;
}

std::string to_stl(const ResultMap& map) {
  return to_stl(machined(map), map.design.triangles,
                fmt::format("machined surface, mm, seed {}, {}: {}", map.facts.seed,
                            map.facts.case_name, map.facts.scene));
}

std::string to_stl(const cutting::Points& vertices, const cutting::Triangles& triangles,
                   const std::string& what) {
  std::string bytes = stl_head(what);
  bytes.reserve(84 + 50 * std::size_t(triangles.rows()));
  append(bytes, std::uint32_t(triangles.rows()));
  for (const auto& t : triangles.rowwise()) {
    const Eigen::RowVector3d a = vertices.row(t[0]), b = vertices.row(t[1]), c = vertices.row(t[2]);
    const Eigen::RowVector3d normal = (b - a).cross(c - a).normalized();
    for (const Eigen::RowVector3d& p : {normal, a, b, c})
      for (const double x : p) append(bytes, float(x));
    append(bytes, std::uint16_t(0));
  }
  return bytes;
}

}  // namespace abbe::sim
