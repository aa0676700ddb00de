#include "render/field.h"

#include <cstdlib>
#include <span>
#include <string>

#include "kinematics/require.h"
#include "kinematics/units.h"

namespace abbe::render {
namespace {

void check_sizes(const Field& field) {
  const Eigen::Index n = field.design.vertices.rows();
  const auto count = static_cast<std::size_t>(n);
  require(field.deviation_um.size() == n, "residual: one deviation a vertex is needed");
  require(field.cut_time_s.size() == n, "residual: one cut time a vertex is needed");
  require(field.status.size() == count, "residual: one status a vertex is needed");
  require(field.design.area.size() == n, "residual: one area a vertex is needed");
  require(field.within_um.size() == 0 || field.within_um.size() == field.design.triangles.rows(),
          "residual: one value within a triangle is needed, or none");
  require(field.form_um.size() == 0 || field.form_um.size() == n,
          "residual: one form a vertex is needed, or none");
  require(field.tolerance_um.rows() == 0 || field.tolerance_um.rows() == n,
          "residual: limits of every vertex are needed, or of none");
  require(field.cut_line.size() == count, "residual: one program line a vertex is needed");
}

cutting::Surface surface_of(const Field& field) {
  cutting::Surface surface{field.deviation_um * units::um, field.cut_time_s, field.cut_line, {}};
  for (const std::uint8_t status : field.status) {
    const auto vertex = int(surface.status.size());
    surface.status.push_back(cutting::VertexStatus(status));
    if (surface.status.back() == cutting::VertexStatus::Gouged)
      surface.gouges.push_back({vertex, 0.0, true});  // how deep is not in the file
  }
  surface.looked_within = field.looked_within;
  surface.within = field.within_um * units::um;
  return surface;
}

}  // namespace

Field field(const cutting::Design& design, const cutting::Surface& surface) {
  Field result{design, surface.residual / units::um, {}, surface.cut_time_s, surface.cut_line};
  result.status.reserve(surface.status.size());
  for (const cutting::VertexStatus s : surface.status) {
    result.status.push_back(static_cast<std::uint8_t>(s));
  }
  result.looked_within = surface.looked_within;
  result.within_um = surface.within / units::um;
  check_sizes(result);
  return result;
}

cutting::Statistics statistics(const Field& field, const cutting::ToleranceBands& tolerance) {
  return cutting::statistics(surface_of(field), field.design, tolerance);
}

cutting::Weights weights(const Field& field) {
  return cutting::weights(surface_of(field), field.design);
}

void write_residual(const std::filesystem::path& path, const Field& field, const Facts& facts) {
  check_sizes(field);
  const auto view = [](const auto& values) {
    return std::span<const double>(values.data(), std::size_t(values.size()));
  };
  std::vector<PointArray> arrays = {{"deviation_um", view(field.deviation_um)},
                                    {"status", std::span(field.status)},
                                    {"cut_time_s", view(field.cut_time_s)},
                                    {"cut_line", std::span(field.cut_line)},
                                    {"area_mm2", view(field.design.area)}};
  // what the other arrays give exactly is there to be looked at: seven digits will do
  Eigen::VectorXf texture_um;
  if (field.form_um.size() > 0) {
    texture_um = (field.deviation_um - field.form_um).cast<float>();
    arrays.push_back({"form_um", view(field.form_um)});
    arrays.push_back(
        {"texture_um", std::span<const float>(texture_um.data(), std::size_t(texture_um.size()))});
  }
  Eigen::VectorXd lower_um, upper_um;
  if (field.tolerance_um.rows() > 0) {
    lower_um = field.tolerance_um.col(0);
    upper_um = field.tolerance_um.col(1);
    arrays.push_back({"lower_um", view(lower_um)});
    arrays.push_back({"upper_um", view(upper_um)});
  }
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> normals =
      field.design.normals.cast<float>();
  if (normals.rows() == field.design.vertices.rows())
    arrays.push_back(
        {"Normals", std::span<const float>(normals.data(), std::size_t(normals.size())), 3});
  std::vector<PointArray> of_triangles;
  if (field.within_um.size() > 0)
    of_triangles.push_back({cutting::name_of_values(field.looked_within), view(field.within_um)});
  write_point_data(path, field.design.vertices, field.design.triangles, arrays, facts,
                   of_triangles);
}

void write_stock(const std::filesystem::path& path, const StockField& stock, const Facts& facts) {
  std::vector<std::uint8_t> status;
  std::vector<int> line;
  for (const std::int32_t cut : stock.mesh.line) {
    status.push_back(cut > 0 ? 0 : (cut == 0 ? 1 : 2));
    line.push_back(std::abs(cut));
  }
  const auto view = [](const Eigen::VectorXd& values) {
    return std::span<const double>(values.data(), std::size_t(values.size()));
  };
  write_point_data(path, stock.mesh.vertices_w, stock.mesh.triangles,
                   {{"deviation_um", view(stock.deviation_um)},
                    {"largest_um", view(stock.largest_um)},
                    {"compared", std::span<const std::uint8_t>(stock.compared)},
                    {"finding", std::span<const int>(stock.finding)},
                    {"undercut", std::span<const int>(stock.undercut)},
                    {"kind", std::span<const std::uint8_t>(stock.kind)},
                    {"status", std::span<const std::uint8_t>(status)},
                    {"cut_line", std::span<const int>(line)}},
                   facts);
}

void write_residual(const std::filesystem::path& path, const cutting::Design& design,
                    const cutting::Surface& surface) {
  write_residual(path, field(design, surface));
}

}  // namespace abbe::render
