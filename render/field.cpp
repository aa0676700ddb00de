#include "render/field.h"

#include <cstdlib>
#include <span>
#include <string>

#include "kinematics/require.h"
#include "kinematics/units.h"
#include "render/point_data.h"

namespace abbe::render {
namespace {

void check_sizes(const Field& field) {
  const Eigen::Index n = field.design.vertices.rows();
  const auto count = static_cast<std::size_t>(n);
  require(field.deviation_um.size() == n, "residual: one deviation a vertex is needed");
  require(field.cut_time_s.size() == n, "residual: one cut time a vertex is needed");
  require(field.status.size() == count, "residual: one status a vertex is needed");
  require(field.cut_line.size() == count, "residual: one program line a vertex is needed");
}

}  // namespace

Field field(const cutting::Design& design, const cutting::Surface& surface) {
  Field result{design, surface.residual / units::um, {}, surface.cut_time_s, surface.cut_line};
  result.status.reserve(surface.status.size());
  for (const cutting::VertexStatus s : surface.status) {
    result.status.push_back(static_cast<std::uint8_t>(s));
  }
  check_sizes(result);
  return result;
}

void write_residual(const std::filesystem::path& path, const Field& field) {
  check_sizes(field);
  const Eigen::VectorXd& deviation = field.deviation_um;
  const Eigen::VectorXd& time = field.cut_time_s;
  write_point_data(path, field.design.vertices, field.design.triangles,
                   {{"deviation_um", std::span(deviation.data(), std::size_t(deviation.size()))},
                    {"status", std::span(field.status)},
                    {"cut_time_s", std::span(time.data(), std::size_t(time.size()))},
                    {"cut_line", std::span(field.cut_line)}});
}

void write_stock(const std::filesystem::path& path, const cutting::StockMesh& stock) {
  std::vector<std::uint8_t> status;
  std::vector<int> line;
  for (const std::int32_t cut : stock.line) {
    status.push_back(cut > 0 ? 0 : (cut == 0 ? 1 : 2));
    line.push_back(std::abs(cut));
  }
  write_point_data(path, stock.vertices_w, stock.triangles,
                   {{"status", std::span<const std::uint8_t>(status)},
                    {"cut_line", std::span<const int>(line)}});
}

void write_residual(const std::filesystem::path& path, const cutting::Design& design,
                    const cutting::Surface& surface) {
  write_residual(path, field(design, surface));
}

}  // namespace abbe::render
