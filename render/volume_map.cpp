#include "render/volume_map.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "render/canvas.h"
#include "render/colour_bar.h"
#include "render/figures.h"
#include "render/layout.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Size = std::array<int, 3>;

constexpr double mm_per_um = 1e-3;
constexpr int max_lines = 24;  // largest number of grid lines drawn along each direction
constexpr Colour outline_colour{0.30, 0.45, 0.62};

void check_picture(const VolumePicture& picture, double magnification) {
  const Size& s = picture.size;
  require(s[0] > 0 && s[1] > 0 && s[2] > 0, "volume map: every size must be positive");
  // A line of points has no surface to colour.
  require(int(s[0] > 1) + int(s[1] > 1) + int(s[2] > 1) >= 2,
          "volume map: at least two sizes must be greater than 1");
  require(Eigen::Index(s[0]) * s[1] * s[2] == picture.points.rows() &&
              picture.points.rows() == picture.displacement_um.rows(),
          "volume map: the product of the sizes must be the number of points");
  require(picture.points.allFinite() && picture.displacement_um.allFinite(),
          "volume map: all numbers must be finite");
  require(magnification > 0.0 && std::isfinite(magnification),
          "volume map: the magnification must be positive");
}

/// Returns the row of a grid point.
int point_index(const Size& size, const Size& at) {
  return at[0] + size[0] * (at[1] + size[1] * at[2]);
}

/// A face of the grid, spanned by the directions `u` and `v`.
struct Face {
  int u, v;
  Size origin;  ///< grid point at its corner
};

std::vector<Face> grid_faces(const Size& size) {
  std::vector<Face> faces;
  for (int w = 0; w < 3; ++w) {
    const int u = w == 0 ? 1 : 0, v = w == 2 ? 1 : 2;
    // A flat grid has a single face.
    if (size[std::size_t(u)] < 2 || size[std::size_t(v)] < 2) continue;
    Size origin{0, 0, 0};
    faces.push_back({u, v, origin});
    origin[std::size_t(w)] = size[std::size_t(w)] - 1;
    if (size[std::size_t(w)] > 1) faces.push_back({u, v, origin});
  }
  return faces;
}

/// Returns the row of a point of a face.
int point_index(const Size& size, const Face& face, int i, int k) {
  Size at = face.origin;
  at[std::size_t(face.u)] = i;
  at[std::size_t(face.v)] = k;
  return point_index(size, at);
}

/// Returns the triangles of all faces.
cutting::Triangles hull(const Size& size) {
  std::vector<int> corners;
  for (const Face& face : grid_faces(size))
    for (int k = 0; k + 1 < size[std::size_t(face.v)]; ++k)
      for (int i = 0; i + 1 < size[std::size_t(face.u)]; ++i) {
        // Each cell of a face is split into two triangles.
        const int a = point_index(size, face, i, k), b = point_index(size, face, i + 1, k);
        const int c = point_index(size, face, i + 1, k + 1), d = point_index(size, face, i, k + 1);
        corners.insert(corners.end(), {a, b, c, a, c, d});
      }
  return Eigen::Map<const cutting::Triangles>(corners.data(), Eigen::Index(corners.size() / 3), 3);
}

/// Returns evenly spaced indices from 0 to n - 1, at most about max_lines of them.
std::vector<int> line_indices(int n) {
  const int step = (n - 2) / max_lines + 1;
  std::vector<int> indices;
  for (int i = 0; i < n - 1; i += step) indices.push_back(i);
  indices.push_back(n - 1);
  return indices;
}

/// Returns the segments of the grid lines on the faces.
std::vector<std::array<int, 2>> hull_lines(const Size& size) {
  std::vector<std::array<int, 2>> lines;
  for (const Face& face : grid_faces(size)) {
    const int nu = size[std::size_t(face.u)], nv = size[std::size_t(face.v)];
    for (const int k : line_indices(nv))
      for (int i = 0; i + 1 < nu; ++i)
        lines.push_back({point_index(size, face, i, k), point_index(size, face, i + 1, k)});
    for (const int i : line_indices(nu))
      for (int k = 0; k + 1 < nv; ++k)
        lines.push_back({point_index(size, face, i, k), point_index(size, face, i, k + 1)});
  }
  return lines;
}

/// Returns the edges of the grid, each as the points along it.
std::vector<std::vector<int>> grid_edges(const Size& size) {
  std::vector<std::vector<int>> edges;
  for (int u = 0; u < 3; ++u) {
    if (size[std::size_t(u)] < 2) continue;
    const int v = (u + 1) % 3, w = (u + 2) % 3;
    for (int ends = 0; ends < 4; ++ends) {
      Size at{0, 0, 0};
      if ((ends & 1) != 0) at[std::size_t(v)] = size[std::size_t(v)] - 1;
      if ((ends & 2) != 0) at[std::size_t(w)] = size[std::size_t(w)] - 1;
      // With a size of 1, both ends of a direction are the same edge.
      if (((ends & 1) != 0 && size[std::size_t(v)] == 1) ||
          ((ends & 2) != 0 && size[std::size_t(w)] == 1))
        continue;
      edges.emplace_back();
      for (int i = 0; i < size[std::size_t(u)]; ++i) {
        at[std::size_t(u)] = i;
        edges.back().push_back(point_index(size, at));
      }
    }
  }
  return edges;
}

cutting::Points displaced_points(const VolumePicture& picture, double magnification) {
  return picture.points + (mm_per_um * magnification) * picture.displacement_um;
}

/// Returns the normal of a flat grid: +Z, -Y or +X if the grid is parallel to two axes. Empty if
/// the grid is not flat.
std::optional<Vector3d> flat_grid_normal(const VolumePicture& picture) {
  const Size& s = picture.size;
  if (s[0] > 1 && s[1] > 1 && s[2] > 1) return std::nullopt;
  const Eigen::RowVector3d middle = picture.points.colwise().mean();
  const cutting::Points centred = picture.points.rowwise() - middle;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal_axes(centred.transpose() *
                                                                      centred);
  // A grid is flat if its thickness is below 1e-6 of its size; eigenvalues are squares of lengths.
  if (principal_axes.eigenvalues()[0] > 1e-12 * principal_axes.eigenvalues()[2])
    return std::nullopt;
  Vector3d n = principal_axes.eigenvectors().col(0);
  for (double& x : n)
    if (std::abs(x) < 1e-9) x = 0.0;
  // The sign of an eigenvector is arbitrary; this direction selects +Z, -Y or +X.
  const Vector3d preferred_side(1.0, -2.0, 4.0);
  return n.dot(preferred_side) < 0.0 ? Vector3d(-n) : n;
}

/// Returns the end of a scale, at least 1 nm, so that a grid without displacements has a scale.
double scale_end(double largest_um) { return std::max(round_up_range(largest_um), 1e-3); }

Solid make_solid(const cutting::Points& points, const cutting::Triangles& triangles,
                 const Eigen::VectorXd& values, const ColourScale& scale) {
  Solid result;
  result.points = points;
  result.triangles = triangles;
  result.values = values;
  result.scale = scale;
  result.shade = 0.0;
  return result;
}

/// Areas of the elements, px.
struct VolumeLayout {
  Rectangle main, main_foot;
  std::array<Rectangle, 3> components;
  Rectangle component_foot;
};

VolumeLayout volume_layout(const Page& page, double figures_height) {
  const double u = page.unit, gap = 36.0 * u, foot = 112.0 * u;
  const double margin = 20.0 * u;
  const Rectangle inner{page.inner.x + margin, page.inner.y + margin,
                        page.inner.width - 2.0 * margin, page.inner.height - margin};
  const double left = std::round(0.64 * inner.width);
  VolumeLayout layout;
  const double height = inner.height - figures_height - foot;
  layout.main = {inner.x, inner.y + foot, left, height};
  layout.main_foot = {inner.x, inner.y, left, foot};
  const double x = inner.x + left + gap, width = inner.width - left - gap;
  for (int i = 0; i < 3; ++i)
    layout.components[std::size_t(i)] = {x, inner.y + foot + (2 - i) * height / 3.0, width,
                                         height / 3.0};
  layout.component_foot = {x, inner.y, width, foot};
  return layout;
}

View draw_main(Canvas& canvas, const VolumePicture& picture, double magnification,
               const Rectangle& area, const Vector3d& from, double range) {
  const cutting::Points displaced = displaced_points(picture, magnification);
  // The view contains the displaced and the undisplaced grid.
  cutting::Points view_points(2 * displaced.rows(), 3);
  view_points << displaced, picture.points;
  const View view = fit_view(view_points, from, Vector3d::UnitZ(), area);
  const Wire lines{displaced, hull_lines(picture.size), {0.25, 0.26, 0.28}, 1.0};
  canvas.scene(view,
               {make_solid(displaced, hull(picture.size), picture.displacement_um.rowwise().norm(),
                           colour_scale(0.0, range))},
               {lines});
  for (const std::vector<int>& edge : grid_edges(picture.size)) {
    std::vector<Vector2d> line;
    for (const int i : edge) line.push_back(project(view, picture.points.row(i).transpose()));
    canvas.line(line, outline_colour, 2.0);
  }
  return view;
}

void draw_main_foot(Canvas& canvas, const Rectangle& foot, const View& view, double range,
                    const TextStyle& body) {
  const double em = body.size_px;
  draw_horizontal_colour_bar(
      canvas, {foot.x + 5.0 * em, foot.y + 0.55 * foot.height, foot.width - 5.0 * em, 1.6 * em},
      ColourBar{colour_scale(0.0, range)}, body);
  draw_triad(canvas, view, {foot.x + 1.9 * em, foot.y + 0.5 * foot.height}, 1.5 * em, body);
  const double y = foot.y + 0.22 * foot.height;
  draw_scale_bar(canvas, view, {foot.x + 5.0 * em, y}, 0.25 * foot.width, body);
  const double x = foot.x + 0.55 * foot.width;
  canvas.line({{x, y}, {x + 2.0 * em, y}}, outline_colour, 2.0);
  TextStyle label_style = body;
  label_style.vertical_anchor = 0.5;
  canvas.text({x + 2.6 * em, y}, "nominal position", label_style);
}

void draw_components(Canvas& canvas, const VolumePicture& picture, const VolumeLayout& layout,
                     const Vector3d& from, const TextStyle& body) {
  const double range = scale_end(picture.displacement_um.cwiseAbs().maxCoeff());
  const LengthUnit unit = length_unit(range);
  const cutting::Triangles triangles = hull(picture.size);
  TextStyle head = body;
  head.bold = true;
  const double title = 1.5 * line_height(body);
  for (int i = 0; i < 3; ++i) {
    const Eigen::VectorXd values = picture.displacement_um.col(i);
    const Rectangle& box = layout.components[std::size_t(i)];
    const Rectangle area{box.x, box.y + 8.0, box.width, box.height - title - 8.0};
    const View view = fit_view(picture.points, from, Vector3d::UnitZ(), area);
    Wire outline{picture.points, {}, {0.25, 0.26, 0.28}, 1.0};
    for (const std::vector<int>& edge : grid_edges(picture.size))
      for (std::size_t k = 1; k < edge.size(); ++k)
        outline.segments.push_back({edge[k - 1], edge[k]});
    canvas.scene(view, {make_solid(picture.points, triangles, values, colour_scale(-range, range))},
                 {outline});
    const double low = values.minCoeff() * unit.per_um, high = values.maxCoeff() * unit.per_um;
    const int digits = significant_decimals(std::max(std::abs(low), std::abs(high)));
    const std::string name = fmt::format("in {}", "XYZ"[i]);
    const double y = box.y + box.height - 0.2 * line_height(body);
    TextStyle style = head;
    style.vertical_anchor = 1.0;
    canvas.text({box.x, y}, name, style);
    style.bold = false;
    style.horizontal_anchor = 1.0;
    canvas.text(
        {box.x + box.width, y},
        fmt::format("{} … {} {}", signed_fixed(low, digits), signed_fixed(high, digits), unit.name),
        style);
  }
  const Rectangle& foot = layout.component_foot;
  draw_horizontal_colour_bar(canvas,
                             {foot.x, foot.y + 0.55 * foot.height, foot.width, 1.6 * body.size_px},
                             ColourBar{colour_scale(-range, range)}, body);
}

}  // namespace

double fitted_magnification(const VolumePicture& picture) {
  if (picture.points.rows() == 0) return 1.0;
  const double largest = mm_per_um * picture.displacement_um.rowwise().norm().maxCoeff();
  const Eigen::RowVector3d extent =
      picture.points.colwise().maxCoeff() - picture.points.colwise().minCoeff();
  if (!(largest > 0.0) || !(extent.norm() > 0.0)) return 1.0;
  const double exact = extent.norm() / 12.0 / largest;
  // Rounded down to 1, 2 or 5 x 10^k, because larger displacements could cross the grid.
  const double rounded_up = round_up_125(exact);
  return std::max(rounded_up > exact ? round_up_125(0.39 * rounded_up) : rounded_up, 1e-9);
}

void write_volume_map(const std::filesystem::path& path, const VolumePicture& picture,
                      const VolumeOptions& options) {
  const double magnification = options.magnification.value_or(fitted_magnification(picture));
  check_picture(picture, magnification);
  const Vector3d from =
      options.from.value_or(flat_grid_normal(picture).value_or(Vector3d(-0.5, -1.0, 0.6)));
  const double range = scale_end(picture.displacement_um.rowwise().norm().maxCoeff());
  std::vector<std::string> caption{
      fmt::format("displacements magnified {} ×, coloured by magnitude on the left and by "
                  "component on the right; view {}",
                  fixed(magnification, round_decimals(magnification)),
                  view_description(fit_view({}, from, Vector3d::UnitZ(), {})))};
  caption.insert(caption.end(), picture.caption.begin(), picture.caption.end());
  const double unit = type_sizes(options.width, options.height).unit;
  const Page sheet = page(options.width, options.height, picture.title, caption, unit);
  const TextStyle figures{.size_px = 26.0 * unit};
  const double figures_height = picture.figures.empty() ? 0.0 : 1.9 * line_height(figures);
  const VolumeLayout layout = volume_layout(sheet, figures_height);

  Canvas canvas(sheet.width, sheet.height);
  const View view = draw_main(canvas, picture, magnification, layout.main, from, range);
  draw_main_foot(canvas, layout.main_foot, view, range, sheet.body);
  draw_components(canvas, picture, layout, from, sheet.body);
  if (!picture.figures.empty())
    draw_paragraph(canvas,
                   {sheet.inner.x + 20.0 * unit,
                    sheet.inner.y + sheet.inner.height - 0.15 * line_height(figures)},
                   wrap_text(picture.figures, figures, sheet.inner.width - 40.0 * unit, 1),
                   figures);
  draw_page(canvas, sheet);
  canvas.write_png(path);
}

}  // namespace abbe::render
