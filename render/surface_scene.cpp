#include "render/surface_scene.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "kinematics/require.h"
#include "render/label.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::uint8_t status_cut = static_cast<std::uint8_t>(cutting::VertexStatus::Cut);
constexpr std::uint8_t status_uncut = static_cast<std::uint8_t>(cutting::VertexStatus::Uncut);
constexpr std::uint8_t status_gouged = static_cast<std::uint8_t>(cutting::VertexStatus::Gouged);

/// Unit normals of the vertices, those of the design or the mean of the triangles around.
cutting::Points normals(const cutting::Design& design) {
  if (design.normals.rows() == design.vertices.rows()) return design.normals;
  cutting::Points sum = cutting::Points::Zero(design.vertices.rows(), 3);
  for (const auto& t : design.triangles.rowwise()) {
    const Vector3d a = design.vertices.row(t[0]);
    const Vector3d b = design.vertices.row(t[1]);
    const Vector3d c = design.vertices.row(t[2]);
    const Vector3d twice_area = (b - a).cross(c - a);
    for (const int corner : t) sum.row(corner) += twice_area.transpose();
  }
  for (auto row : sum.rowwise()) {
    const double length = row.norm();
    row = length > 0.0 ? Eigen::RowVector3d(row / length) : Eigen::RowVector3d(0.0, 0.0, 1.0);
  }
  return sum;
}

/// Edges that belong to one triangle only.
Wire rims(const cutting::Points& points, const cutting::Triangles& triangles) {
  std::vector<std::array<int, 2>> edges;
  edges.reserve(3 * triangles.rows());
  for (const auto& t : triangles.rowwise()) {
    for (int i = 0; i < 3; ++i) {
      const int a = t[i];
      const int b = t[(i + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b)});
    }
  }
  std::sort(edges.begin(), edges.end());
  std::vector<int> ends;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t next = i + 1;
    while (next < edges.size() && edges[next] == edges[i]) ++next;
    if (next == i + 1) ends.insert(ends.end(), edges[i].begin(), edges[i].end());
    i = next;
  }
  Wire wire{points(ends, Eigen::all), {}, {0.3, 0.31, 0.33}, 2.0};
  for (int i = 0; i < static_cast<int>(ends.size()); i += 2) wire.segments.push_back({i, i + 1});
  return wire;
}

/// Which look a triangle has: 0 by deviation, 1 outside, 2 uncut, 3 gouged; the worst of its
/// corners.
std::size_t look(const Field& field, const Eigen::RowVector3i& t) {
  std::size_t worst = 0;
  for (const int corner : t) {
    const std::uint8_t status = field.status[corner];
    const std::size_t one = status == status_cut      ? 0
                            : status == status_uncut  ? 2
                            : status == status_gouged ? 3
                                                      : 1;
    worst = std::max(worst, one);
  }
  return worst;
}

}  // namespace

void check(const Field& field) {
  const Eigen::Index n = field.design.vertices.rows();
  require(field.deviation_um.size() == n, "map: one deviation a vertex is needed");
  require(field.status.size() == static_cast<std::size_t>(n), "map: one status a vertex is needed");
  require(field.design.vertices.allFinite(), "map: vertices must be finite");
  require(field.design.triangles.size() == 0 ||
              (field.design.triangles.minCoeff() >= 0 && field.design.triangles.maxCoeff() < n),
          "map: a triangle names a vertex that is not there");
  for (Eigen::Index i = 0; i < n; ++i) {
    require(field.status[i] != status_cut || std::isfinite(field.deviation_um[i]),
            "map: a cut vertex has a finite deviation");
  }
}

SurfaceScene surface_scene(const Field& field, double range_um) {
  std::array<std::vector<int>, 4> corners;
  for (const auto& t : field.design.triangles.rowwise()) {
    auto& list = corners[look(field, t)];
    list.insert(list.end(), t.begin(), t.end());
  }
  SurfaceScene scene;
  constexpr std::array<Colour, 4> colour{colours::white, colours::outside, colours::uncut,
                                         colours::gouged};
  const cutting::Points unit_normals = normals(field.design);
  for (std::size_t kind = 0; kind < corners.size(); ++kind) {
    if (corners[kind].empty()) continue;
    Solid solid;
    solid.points = field.design.vertices;
    solid.normals = unit_normals;
    solid.triangles = Eigen::Map<const cutting::Triangles>(
        corners[kind].data(), static_cast<Eigen::Index>(corners[kind].size() / 3), 3);
    solid.colour = colour[kind];
    if (kind == 0) {
      solid.range = range_um;
      solid.values = field.deviation_um.array().isFinite().select(field.deviation_um, 0.0);
    }
    scene.solids.push_back(std::move(solid));
  }
  scene.wires.push_back(rims(field.design.vertices, field.design.triangles));
  return scene;
}

Tally tally(const Field& field, double range_um) {
  Tally result;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (field.status[i] == status_uncut) ++result.uncut;
    if (field.status[i] == status_gouged)
      ++result.gouged;
    else if (field.status[i] > status_uncut)
      ++result.outside;
    if (field.status[i] != status_cut) continue;
    const double d = field.deviation_um[i];
    result.lowest_um = result.cut == 0 ? d : std::min(result.lowest_um, d);
    result.highest_um = result.cut == 0 ? d : std::max(result.highest_um, d);
    ++result.cut;
    if (std::abs(d) > range_um) ++result.beyond;
  }
  return result;
}

void colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar,
                const TextStyle& style) {
  const double bottom = std::round(box.y);
  const double rows = std::round(box.height);
  const std::vector<Colour> scale = diverging(static_cast<int>(rows));
  for (std::size_t i = 0; i < scale.size(); ++i) {
    canvas.fill({box.x, bottom + static_cast<double>(i), box.width, 1.0}, scale[i]);
  }
  const double top = bottom + rows;
  const double middle = box.x + 0.5 * box.width;
  const double arrow = 0.8 * box.width;
  if (bar.high_end) {
    canvas.fill({{box.x, top}, {box.x + box.width, top}, {middle, top + arrow}},
                colours::beyond_high);
  }
  if (bar.low_end) {
    canvas.fill({{box.x, bottom}, {middle, bottom - arrow}, {box.x + box.width, bottom}},
                colours::beyond_low);
  }
  const LengthUnit unit = unit_for(bar.range_um);
  const double range = bar.range_um * unit.per_um;
  TextStyle label = style;
  label.across = 0.0;
  label.upward = 0.5;
  const Ticks ticks = round_ticks(-range, range, 11);
  const double right = box.x + box.width;
  for (const double value : ticks.values) {
    const double y = bottom + 0.5 * rows * (1.0 + value / range);
    canvas.line({{right, y}, {right + 0.35 * style.size_px, y}}, style.colour, 2.0);
    canvas.text({right + 0.65 * style.size_px, y}, signed_fixed(value, ticks.decimals), label);
  }
  TextStyle head = style;
  head.bold = true;
  canvas.text({box.x, top + arrow + 0.5 * style.size_px}, unit.name, head);
}

void lying_colour_bar(Canvas& canvas, const Rectangle& box, const LyingBar& bar,
                      const TextStyle& style) {
  const int digits = std::max(0, figure_decimals(bar.range) - 1);  // ranges have two digits
  const std::string low = bar.one_sided ? "0" : fixed(-bar.range, digits);
  std::string high = bar.one_sided ? fixed(bar.range, digits) : signed_fixed(bar.range, digits);
  if (!bar.unit.empty()) high += " " + bar.unit;
  TextStyle label = style;
  label.across = 0.0;
  label.upward = 0.5;
  const double gap = 0.9 * style.size_px, y = box.y + 0.5 * box.height;
  const double first = std::round(box.x + text_size(low, label).x() + gap);
  const double room = box.x + box.width - text_size(high, label).x() - gap - first;
  const int steps = std::max(1, int(room));
  canvas.text({box.x, y}, low, label);
  canvas.text({first + steps + gap, y}, high, label);
  const std::vector<Colour> scale = diverging(bar.one_sided ? 2 * steps : steps);
  const double half = 0.36 * style.size_px, arrow = 0.6 * style.size_px, last = first + steps;
  for (int i = 0; i < steps; ++i)
    canvas.fill({first + i, y - half, 1.0, 2.0 * half},
                scale[std::size_t(bar.one_sided ? steps + i : i)]);
  if (bar.high_end)
    canvas.fill({{last, y - half}, {last + arrow, y}, {last, y + half}}, colours::beyond_high);
  if (bar.low_end)
    canvas.fill({{first, y - half}, {first, y + half}, {first - arrow, y}}, colours::beyond_low);
}

}  // namespace abbe::render
