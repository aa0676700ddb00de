#include "render/surface_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "render/figures.h"

namespace abbe::render {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::uint8_t status_cut = static_cast<std::uint8_t>(cutting::VertexStatus::Cut);
constexpr std::uint8_t status_uncut = static_cast<std::uint8_t>(cutting::VertexStatus::Uncut);
constexpr std::uint8_t status_gouged = static_cast<std::uint8_t>(cutting::VertexStatus::Gouged);

/// Returns unit normals of the vertices: those of the design, or the area-weighted means of the
/// normals of adjacent triangles.
cutting::Points unit_normals(const cutting::Design& design) {
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
    // A vertex without triangles is not drawn, so its normal does not matter.
    row = length > 0.0 ? Eigen::RowVector3d(row / length) : Eigen::RowVector3d(0.0, 0.0, 1.0);
  }
  return sum;
}

/// The rim edges of a design in a grid of cells, for finding edges that coincide.
class Rims {
 public:
  Rims(const cutting::Design& design, const cutting::Points& normals, std::vector<int> ends)
      : ends_(std::move(ends)), design_(design), normals_(normals) {
    double length = 0.0;
    for (std::size_t i = 0; i < ends_.size(); i += 2) length += (at(i) - at(i + 1)).norm();
    // With cells of twice the mean edge length, a cell has few edges and an edge is in few cells.
    cell_ = std::max(2.0 * length / std::max<double>(1.0, double(ends_.size())), 1e-6);
    for (std::size_t i = 0; i < ends_.size(); i += 2) {
      const int steps = 1 + int(std::min(1e4, 2.0 * (at(i) - at(i + 1)).norm() / cell_));
      for (int k = 0; k <= steps; ++k) {
        std::vector<std::size_t>& cell_edges =
            cells_[cell_of(at(i) + (double(k) / steps) * (at(i + 1) - at(i)))];
        if (cell_edges.empty() || cell_edges.back() != i) cell_edges.push_back(i);
      }
    }
  }

  /// Returns the rim edges that are no seams, two vertices each.
  std::vector<int> edges_without_seams() const {
    std::vector<int> edges;
    for (std::size_t i = 0; i < ends_.size(); i += 2)
      if (!is_seam(i)) edges.insert(edges.end(), {ends_[i], ends_[i + 1]});
    return edges;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;

  /// Returns true if another rim edge coincides with this one and has the same normal. There two
  /// faces meet smoothly that share positions but no vertices.
  bool is_seam(std::size_t i) const {
    constexpr double max_distance = 1e-3, min_cosine = 0.99;  // mm
    const Vector3d middle = 0.5 * (at(i) + at(i + 1));
    const Cell home = cell_of(middle);
    for (std::int64_t k = 0; k < 27; ++k) {
      const auto cell =
          cells_.find({home[0] + k % 3 - 1, home[1] + k / 3 % 3 - 1, home[2] + k / 9 - 1});
      if (cell == cells_.end()) continue;
      for (const std::size_t other : cell->second)
        if (other != i && normal(i).dot(normal(other)) > min_cosine &&
            cutting::distance(middle, {at(other), at(other + 1)}) < max_distance)
          return true;
    }
    return false;
  }
  Vector3d at(std::size_t i) const { return design_.vertices.row(ends_[i]); }
  Vector3d normal(std::size_t i) const {
    return (normals_.row(ends_[i]) + normals_.row(ends_[i + 1])).transpose().normalized();
  }
  Cell cell_of(const Vector3d& p) const {
    constexpr double max_index = 1e15;  // well within 64 bits
    Cell cell{};
    for (int k = 0; k < 3; ++k)
      cell[std::size_t(k)] =
          std::int64_t(std::clamp(std::floor(p[k] / cell_), -max_index, max_index));
    return cell;
  }

  std::vector<int> ends_;
  const cutting::Design& design_;
  const cutting::Points& normals_;
  double cell_ = 1.0;
  std::map<Cell, std::vector<std::size_t>> cells_;
};

/// The edges of a design that are drawn as lines.
struct MapOutline {
  std::vector<int> rims;   ///< two vertices each
  std::vector<int> folds;  ///< sharp edges and silhouettes, two vertices each
};

MapOutline map_outline(const cutting::Design& design, const Vector3d& toward_eye) {
  constexpr double sharp_cosine = 0.866;  // 30 degrees
  // Ratio of height to length of a triangle; the normal of a thinner one is inaccurate.
  constexpr double min_aspect = 0.05;
  const cutting::Points vertex_normals = unit_normals(design);
  cutting::Points triangle_normals(design.triangles.rows(), 3);
  const auto normal = [&](Eigen::Index triangle) -> Vector3d {
    const auto t = design.triangles.row(triangle);
    const Vector3d a = design.vertices.row(t[0]);
    const Vector3d b = design.vertices.row(t[1]);
    const Vector3d c = design.vertices.row(t[2]);
    const Vector3d twice_area = (b - a).cross(c - a);
    const double max_squared_side =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    if (twice_area.norm() > min_aspect * max_squared_side) return twice_area.normalized();
    return (vertex_normals.row(t[0]) + vertex_normals.row(t[1]) + vertex_normals.row(t[2]))
        .normalized();
  };
  tbb::parallel_for(Eigen::Index(0), triangle_normals.rows(),
                    [&](Eigen::Index t) { triangle_normals.row(t) = normal(t).transpose(); });
  const std::vector<cutting::TriangleSide> sides = cutting::triangle_sides(design.triangles);
  MapOutline outline;
  for (std::size_t i = 0, next = 0; i < sides.size(); i = next) {
    for (next = i + 1; next < sides.size() && sides[next].same_edge(sides[i]);) ++next;
    const auto [low, high, triangle, corner] = sides[i];
    // An edge with one triangle is a rim; an edge with more than two is not manifold and is not
    // drawn.
    if (next == i + 1) outline.rims.insert(outline.rims.end(), {low, high});
    if (next != i + 2) continue;
    const Vector3d a = triangle_normals.row(triangle);
    const Vector3d b = triangle_normals.row(sides[i + 1].triangle);
    // At the silhouette one triangle faces the eye and the other does not.
    if (a.dot(b) < sharp_cosine || a.dot(toward_eye) * b.dot(toward_eye) < 0.0)
      outline.folds.insert(outline.folds.end(), {low, high});
  }
  outline.rims = Rims(design, vertex_normals, std::move(outline.rims)).edges_without_seams();
  return outline;
}

Wire make_wire(const cutting::Points& points, const std::vector<int>& ends, const Colour& colour,
               double width_px) {
  Wire w{points(ends, Eigen::all), {}, colour, width_px};
  for (int i = 0; i < static_cast<int>(ends.size()); i += 2) w.segments.push_back({i, i + 1});
  return w;
}

/// Returns the appearance of a triangle, the highest of its corners: 0 coloured by deviation,
/// 1 outside the judged region, 2 uncut, 3 gouged.
std::size_t triangle_appearance(const Field& field, const Eigen::RowVector3i& t) {
  std::size_t highest = 0;
  for (const int corner : t) {
    const std::uint8_t status = field.status[corner];
    const std::size_t appearance = status == status_cut      ? 0
                                   : status == status_uncut  ? 2
                                   : status == status_gouged ? 3
                                                             : 1;
    highest = std::max(highest, appearance);
  }
  return highest;
}

}  // namespace

void check_field(const Field& field) {
  const Eigen::Index n = field.design.vertices.rows();
  require(field.deviation_um.size() == n, "map: expected one deviation per vertex");
  require(field.status.size() == static_cast<std::size_t>(n),
          "map: expected one status per vertex");
  require(field.design.vertices.allFinite(), "map: vertices must be finite");
  require(field.design.triangles.size() == 0 ||
              (field.design.triangles.minCoeff() >= 0 && field.design.triangles.maxCoeff() < n),
          "map: a triangle refers to a vertex that does not exist");
  for (Eigen::Index i = 0; i < n; ++i) {
    require(field.status[i] != status_cut || std::isfinite(field.deviation_um[i]),
            "map: a cut vertex must have a finite deviation");
  }
}

SurfaceScene surface_scene(const Field& field, const Eigen::VectorXd& values,
                           const ColourScale& scale, const Eigen::Vector3d& toward_eye) {
  std::array<std::vector<int>, 4> corners;
  for (const auto& t : field.design.triangles.rowwise()) {
    auto& list = corners[triangle_appearance(field, t)];
    list.insert(list.end(), t.begin(), t.end());
  }
  SurfaceScene scene;
  constexpr std::array<Colour, 4> colour{colours::white, colours::outside, colours::uncut,
                                         colours::gouged};
  const cutting::Points normals = unit_normals(field.design);
  for (std::size_t kind = 0; kind < corners.size(); ++kind) {
    if (corners[kind].empty()) continue;
    Solid solid;
    solid.points = field.design.vertices;
    solid.normals = normals;
    solid.triangles = Eigen::Map<const cutting::Triangles>(
        corners[kind].data(), static_cast<Eigen::Index>(corners[kind].size() / 3), 3);
    solid.colour = colour[kind];
    if (kind == 0) {
      solid.scale = scale;
      // Shading would change the colours that show the deviation.
      solid.shade = 0.0;
      // Values that are not finite are replaced; these triangles do not use them.
      solid.values = values.array().isFinite().select(values, scale.low);
    }
    scene.solids.push_back(std::move(solid));
  }
  const MapOutline lines = map_outline(field.design, toward_eye);
  scene.wires.push_back(make_wire(field.design.vertices, lines.folds, {0.55, 0.56, 0.58}, 1.2));
  scene.wires.push_back(make_wire(field.design.vertices, lines.rims, {0.3, 0.31, 0.33}, 2.0));
  return scene;
}

Wire isolines(const Field& field, const Eigen::VectorXd& values,
              const std::vector<double>& levels) {
  // Values are linear in each triangle, so a level crosses none or two of its sides, and points
  // come in pairs.
  std::vector<Vector3d> points;
  for (const auto& t : field.design.triangles.rowwise()) {
    if (triangle_appearance(field, t) != 0) continue;
    for (const double level : levels) {
      for (int i = 0; i < 3; ++i) {
        const int a = t[i], b = t[(i + 1) % 3];
        if ((values[a] < level) == (values[b] < level)) continue;
        const double fraction = (level - values[a]) / (values[b] - values[a]);
        points.emplace_back((1.0 - fraction) * field.design.vertices.row(a) +
                            fraction * field.design.vertices.row(b));
      }
    }
  }
  Wire w{cutting::Points(static_cast<Eigen::Index>(points.size()), 3), {}, {0.25, 0.26, 0.28}, 1.2};
  for (std::size_t i = 0; i < points.size(); ++i)
    w.points.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  for (int i = 0; i + 1 < static_cast<int>(points.size()); i += 2) w.segments.push_back({i, i + 1});
  return w;
}

VertexCounts count_vertices(const Field& field, double range_um) {
  return count_vertices(field, Span{-range_um, range_um});
}

VertexCounts count_vertices(const Field& field, const Span& ends_um) {
  VertexCounts result;
  for (Eigen::Index i = 0; i < field.deviation_um.size(); ++i) {
    if (field.status[i] == status_uncut) ++result.uncut;
    if (field.status[i] == status_gouged)
      ++result.gouged;
    else if (field.status[i] > status_uncut)
      ++result.outside;
    if (field.status[i] != status_cut) continue;
    const double deviation = field.deviation_um[i];
    result.lowest_um = result.cut == 0 ? deviation : std::min(result.lowest_um, deviation);
    result.highest_um = result.cut == 0 ? deviation : std::max(result.highest_um, deviation);
    ++result.cut;
    if (deviation < ends_um.lower || deviation > ends_um.upper) ++result.beyond_scale;
  }
  return result;
}

namespace {

bool overlap(const Rectangle& a, const Rectangle& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

bool is_within(const Rectangle& inner, const Rectangle& outer) {
  return inner.x >= outer.x && inner.y >= outer.y &&
         inner.x + inner.width <= outer.x + outer.width &&
         inner.y + inner.height <= outer.y + outer.height;
}

Rectangle shift_into(Rectangle box, const Rectangle& area) {
  box.x = std::max(area.x, std::min(box.x, area.x + area.width - box.width));
  box.y = std::max(area.y, std::min(box.y, area.y + area.height - box.height));
  return box;
}

/// Returns the cost of a label's position: 2 for each label and 1 for each point that it overlaps.
int overlap_cost(const Rectangle& box, const std::vector<Rectangle>& labels,
                 const std::vector<Vector2d>& points, double em) {
  int cost = 0;
  for (const Rectangle& label : labels) cost += overlap(box, label) ? 2 : 0;
  for (const Vector2d& p : points)
    cost += overlap(box, {p.x() - 0.5 * em, p.y() - 0.5 * em, em, em}) ? 1 : 0;
  return cost;
}

/// Returns the rectangle of a label.
/// @param labels  rectangles of the labels placed before
Rectangle place_label(const Vector2d& point, const Vector2d& size,
                      const std::vector<Rectangle>& labels, const std::vector<Vector2d>& points,
                      const Rectangle& area, double em) {
  Rectangle best_box = shift_into({point.x() + em, point.y() + em, size.x(), size.y()}, area);
  int min_cost = overlap_cost(best_box, labels, points, em);
  // Twelve directions are tried at growing distances until a position has no overlap.
  for (const double distance : {1.6, 3.0, 5.0, 8.0}) {
    for (int k = 0; k < 12 && min_cost > 0; ++k) {
      const double angle = pi / 4.0 + k * pi / 6.0;
      const Vector2d direction(std::cos(angle), std::sin(angle));
      const Vector2d middle =
          point + distance * em * direction + 0.5 * direction.cwiseProduct(size);
      const Rectangle box{middle.x() - 0.5 * size.x(), middle.y() - 0.5 * size.y(), size.x(),
                          size.y()};
      // A label outside the map would cover other elements.
      if (!is_within(box, area)) continue;
      const int cost = overlap_cost(box, labels, points, em);
      if (cost >= min_cost) continue;
      best_box = box;
      min_cost = cost;
    }
  }
  return best_box;
}

/// Returns the point of a rectangle that is nearest to another point.
Vector2d nearest_point(const Rectangle& box, const Vector2d& p) {
  return {std::clamp(p.x(), box.x, box.x + box.width),
          std::clamp(p.y(), box.y, box.y + box.height)};
}

void draw_disc(Canvas& canvas, const Vector2d& middle, double radius, const Colour& colour) {
  std::vector<Vector2d> corners;
  for (int i = 0; i < 24; ++i)
    corners.push_back(middle + radius * Vector2d(std::cos(pi * i / 12.0), std::sin(pi * i / 12.0)));
  canvas.fill(corners, colour);
}

}  // namespace

bool is_hidden(const View& view, const cutting::Design& design, const Vector3d& point) {
  Eigen::Matrix3d to_view;
  to_view << view.right.transpose(), view.up.transpose(), view.toward_eye.transpose();
  const Vector3d p = to_view * point;
  // The surface around the point itself does not hide it.
  const double min_distance = 3.0 * view.mm_per_px;
  for (const auto& t : design.triangles.rowwise()) {
    const Vector3d a = to_view * design.vertices.row(t[0]).transpose();
    const Vector3d b = to_view * design.vertices.row(t[1]).transpose();
    const Vector3d c = to_view * design.vertices.row(t[2]).transpose();
    // A triangle behind the point cannot hide it.
    if (std::max({a.z(), b.z(), c.z()}) < p.z() + min_distance) continue;
    const auto twice_area = [&](const Vector3d& from, const Vector3d& to) {
      return (to.x() - from.x()) * (p.y() - from.y()) - (to.y() - from.y()) * (p.x() - from.x());
    };
    // Signed areas are barycentric coordinates; inside the triangle they have the same sign.
    const double u = twice_area(b, c), v = twice_area(c, a), w = twice_area(a, b);
    const double sum = u + v + w;
    if (sum == 0.0 || u / sum < 0.0 || v / sum < 0.0 || w / sum < 0.0) continue;
    if ((u * a.z() + v * b.z() + w * c.z()) / sum > p.z() + min_distance) return true;
  }
  return false;
}

std::vector<Rectangle> place_labels(const std::vector<Vector2d>& points,
                                    const std::vector<Vector2d>& sizes, const Rectangle& area,
                                    double em) {
  std::vector<Rectangle> boxes;
  for (std::size_t i = 0; i < points.size(); ++i)
    boxes.push_back(place_label(points[i], sizes[i], boxes, points, area, em));
  return boxes;
}

void draw_flags(Canvas& canvas, const std::vector<Flag>& flags, const Rectangle& area,
                const TextStyle& style) {
  const double em = style.size_px;
  std::vector<Vector2d> points, sizes;
  for (const Flag& flag : flags) {
    points.push_back(flag.at);
    sizes.push_back(text_size(flag.text, style) + Vector2d(0.8 * em, 0.5 * em));
  }
  const std::vector<Rectangle> boxes = place_labels(points, sizes, area, em);
  for (std::size_t i = 0; i < flags.size(); ++i)
    canvas.line({flags[i].at, nearest_point(boxes[i], flags[i].at)}, colours::ink, em / 11.0);
  TextStyle centred = style;
  centred.horizontal_anchor = centred.vertical_anchor = 0.5;
  for (std::size_t i = 0; i < flags.size(); ++i) {
    draw_disc(canvas, flags[i].at, 0.34 * em, colours::white);
    draw_disc(canvas, flags[i].at, 0.26 * em, colours::ink);
    if (flags[i].hidden) draw_disc(canvas, flags[i].at, 0.16 * em, colours::white);
    canvas.fill(boxes[i], colours::white, 0.9);
    canvas.frame(boxes[i], colours::faint_ink, em / 16.0);
    canvas.text({boxes[i].x + 0.5 * boxes[i].width, boxes[i].y + 0.5 * boxes[i].height},
                flags[i].text, centred);
  }
}

}  // namespace abbe::render
