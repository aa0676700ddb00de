#include "cutting/stock/part_deviation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/part/design_points.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

// 1 - cosine of 0.26 deg; coincident edges differ by less.
constexpr double direction_tolerance = 1e-5;

/// A triangle at a common point of several triangles: its angle there, and the directions of the
/// two sides that bound it.
struct Wedge {
  double angle = 2 * pi;
  std::array<Vector3d, 2> sides;
  bool ends = false;
};

Wedge wedge_at(const std::array<Vector3d, 3>& p, const Vector3d& point, double joint) {
  Wedge wedge;
  for (std::size_t k = 0; k < 3; ++k) {
    if ((p[k] - point).norm() > joint) continue;
    const Vector3d to_next = (p[(k + 1) % 3] - p[k]).normalized(),
                   to_previous = (p[(k + 2) % 3] - p[k]).normalized();
    return {std::atan2(to_next.cross(to_previous).norm(), to_next.dot(to_previous)),
            {to_next, to_previous},
            true};
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d side = (p[(k + 1) % 3] - p[k]).normalized();
    if ((point - p[k]).cross(side).norm() > joint) continue;
    return {pi, {side, -side}, true};
  }
  return wedge;
}

/// Returns true if a side of a triangle coincides with no side of another.
bool has_unshared_side(const std::vector<Wedge>& wedges) {
  for (std::size_t i = 0; i < wedges.size(); ++i)
    for (const Vector3d& side : wedges[i].sides) {
      bool is_shared = false;
      for (std::size_t j = 0; j < wedges.size() && !is_shared; ++j)
        for (const Vector3d& other_side : wedges[j].sides)
          is_shared = is_shared || (i != j && side.dot(other_side) > 1.0 - direction_tolerance);
      if (!is_shared) return true;
    }
  return false;
}

}  // namespace

DesignDistance::DesignDistance(Design design, const DeviationOptions& options)
    : design_(std::move(design)),
      tree_(design_.vertices, design_.triangles),
      facet_normals_(design_.triangles.rows(), 3),
      options_(options) {
  for (Index t = 0; t < design_.triangles.rows(); ++t) {
    const Eigen::RowVector3i c = design_.triangles.row(t);
    const Eigen::RowVector3d a = design_.vertices.row(c[0]), b = design_.vertices.row(c[1]),
                             d = design_.vertices.row(c[2]);
    facet_normals_.row(t) = (b - a).cross(d - a).normalized();
  }
  is_closed_ = design_.triangles.rows() > 0 && !has_border();
}

/// Sides without a neighbour of the same vertices are tested by position, because vertices may be
/// separate along edges and seams.
bool DesignDistance::has_border() const {
  std::vector<std::array<int, 2>> sides;
  for (const auto& triangle : design_.triangles.rowwise())
    for (int k = 0; k < 3; ++k) sides.push_back({triangle[k], triangle[(k + 1) % 3]});
  const auto sorted_ends = [](const std::array<int, 2>& side) {
    return std::array<int, 2>{std::min(side[0], side[1]), std::max(side[0], side[1])};
  };
  std::ranges::sort(sides, {}, sorted_ends);
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t group_end = i + 1;
    while (group_end < sides.size() && sorted_ends(sides[group_end]) == sorted_ends(sides[i]))
      ++group_end;
    if (group_end == i + 1) {
      const Vector3d a = design_.vertices.row(sides[i][0]), b = design_.vertices.row(sides[i][1]);
      if ((b - a).norm() > options_.joint && pseudo_normal(0.5 * (a + b)).is_border) return true;
    }
    i = group_end;
  }
  return false;
}

DesignDistance::PseudoNormal DesignDistance::pseudo_normal(const Vector3d& point) const {
  PseudoNormal result{Vector3d::Zero()};
  std::vector<Wedge> wedges;
  bool is_inside_triangle = false;
  for (const TriangleTree::NearestPoint& nearest : tree_.within(point, options_.joint)) {
    const Vector3d normal = facet_normals_.row(nearest.triangle);
    if (!(normal.squaredNorm() > 0.5)) continue;  // a triangle without area has no normal
    const Eigen::RowVector3i c = design_.triangles.row(nearest.triangle);
    const Wedge wedge = wedge_at(
        {design_.vertices.row(c[0]), design_.vertices.row(c[1]), design_.vertices.row(c[2])}, point,
        options_.joint);
    // Only weights by angle give the correct side everywhere (Baerentzen and Aanaes 2005).
    result.normal += wedge.angle * normal;
    if (wedge.ends)
      wedges.push_back(wedge);
    else
      is_inside_triangle = true;
  }
  result.normal.normalize();
  result.is_border = !is_inside_triangle && has_unshared_side(wedges);
  return result;
}

/// Returns the height of the smooth surface above the facet, mm.
double DesignDistance::sag(const TriangleTree::NearestPoint& nearest) const {
  const Eigen::RowVector3i c = design_.triangles.row(nearest.triangle);
  std::array<Contact, 3> corners;
  for (int k = 0; k < 3; ++k)
    corners[std::size_t(k)] = {design_.vertices.row(c[k]), design_.normals.row(c[k])};
  const std::array<double, 3> weights{nearest.weights[0], nearest.weights[1], nearest.weights[2]};
  const Contact smooth = smooth_facet_point(corners, weights);
  return (smooth.point - nearest.point).dot(facet_normals_.row(nearest.triangle).transpose());
}

DesignDistance::PointDistance DesignDistance::at(const Vector3d& query_point, int guess,
                                                 double max_distance) const {
  // With a smaller weight of a corner the nearest point is on a side.
  constexpr double max_side_weight = 1e-9;
  PointDistance result;
  const TriangleTree::NearestPoint nearest = tree_.nearest(query_point, guess, max_distance);
  result.triangle = nearest.triangle;
  if (nearest.triangle < 0) {
    result.value = std::numeric_limits<double>::quiet_NaN();
    return result;
  }
  const Vector3d displacement = query_point - nearest.point;
  const double distance = std::sqrt(nearest.squared_distance);
  PseudoNormal pseudo_normal_here{facet_normals_.row(nearest.triangle)};
  if (nearest.weights.minCoeff() < max_side_weight)
    pseudo_normal_here = pseudo_normal(nearest.point);
  const double height = displacement.dot(pseudo_normal_here.normal);
  result.normal = pseudo_normal_here.normal;
  const double tangential = (displacement - height * pseudo_normal_here.normal).norm();
  // Beyond the border: below it, or laterally off by more than the joints and an inclination of
  // 1e-3.
  result.is_beyond = pseudo_normal_here.is_border && distance > 2 * options_.joint &&
                     (height < 0.0 || tangential > 2 * options_.joint + 1e-3 * distance);
  const double facet_distance = height >= 0.0 ? distance : -distance;
  result.value = options_.smooth && design_.normals.rows() == design_.vertices.rows()
                     ? facet_distance - sag(nearest)
                     : facet_distance;
  // Along the connection of the two points if its direction is defined.
  result.from = distance > options_.joint ? Vector3d(displacement * (result.value / facet_distance))
                                          : Vector3d(result.value * pseudo_normal_here.normal);
  return result;
}

Points directed_area(const StockMesh& mesh) {
  Points area = Points::Zero(mesh.vertices_w.rows(), 3);
  for (const auto& t : mesh.triangles.rowwise()) {
    const Eigen::RowVector3d a = mesh.vertices_w.row(t[0]), b = mesh.vertices_w.row(t[1]),
                             c = mesh.vertices_w.row(t[2]);
    const Eigen::RowVector3d third = (b - a).cross(c - a) / 6.0;
    for (const int corner : t) area.row(corner) += third;
  }
  return area;
}

namespace {

using GridCube = std::array<std::int64_t, 3>;
using Cubes = std::map<GridCube, std::vector<std::size_t>>;

/// Returns the points beyond the band, grouped in cubes of half its size. No design lies between
/// two points of a cube, because the ball with the radius of the band about one contains the other.
Cubes far_cubes(const StockSkin& skin, const std::vector<DesignDistance::PointDistance>& distances,
                double band) {
  Cubes cubes;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (distances[i].triangle >= 0) continue;
    GridCube cube{};
    for (std::size_t k = 0; k < 3; ++k)
      cube[k] = std::int64_t(std::floor(skin.points_w(Index(i), Index(k)) / (0.5 * band)));
    cubes[cube].push_back(i);
  }
  return cubes;
}

/// Returns true if the border of the design passes between a cube and a neighbouring cube.
bool is_at_border(const Cubes& cubes, const GridCube& cube,
                  const std::vector<DesignDistance::PointDistance>& distances) {
  const auto is_beyond_border = [&](const std::vector<std::size_t>& points) {
    return distances[points.front()].is_beyond;
  };
  const bool is_beyond_here = is_beyond_border(cubes.at(cube));
  for (int i = 0; i < 27; ++i) {
    const auto neighbour =
        cubes.find({cube[0] + i % 3 - 1, cube[1] + i / 3 % 3 - 1, cube[2] + i / 9 - 1});
    if (neighbour != cubes.end() && is_beyond_border(neighbour->second) != is_beyond_here)
      return true;
  }
  return false;
}

/// Returns the distance of every point of the skin from the design.
std::vector<DesignDistance::PointDistance> point_distances(const StockSkin& skin,
                                                           const DesignDistance& design,
                                                           double band) {
  std::vector<DesignDistance::PointDistance> distances(skin.line.size());
  constexpr std::size_t block_size = 512;  // neighbours, since each is a guess for the next
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, distances.size(), block_size), [&](const auto& range) {
        int guess = -1;
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          distances[i] = design.at(skin.points_w.row(Index(i)).transpose(), guess, band);
          guess = distances[i].triangle;
        }
      });
  const Cubes cubes = far_cubes(skin, distances, band);
  const auto visit_cubes = [&](const auto& visit) {
    std::vector<const Cubes::value_type*> cube_list;
    for (const auto& entry : cubes) cube_list.push_back(&entry);
    tbb::parallel_for(std::size_t(0), cube_list.size(),
                      [&](std::size_t i) { visit(cube_list[i]->first, cube_list[i]->second); });
  };
  const auto exact_distance = [&](std::size_t i) {
    return design.at(skin.points_w.row(Index(i)).transpose());
  };
  visit_cubes([&](const GridCube&, const std::vector<std::size_t>& points) {
    distances[points.front()] = exact_distance(points.front());
  });
  // Neighbouring cubes read the first point of a cube, so this pass does not change it.
  visit_cubes([&](const GridCube& cube, const std::vector<std::size_t>& points) {
    const bool is_border_cube = is_at_border(cubes, cube, distances);
    for (std::size_t k = 1; k < points.size(); ++k)
      distances[points[k]] = is_border_cube ? exact_distance(points[k]) : distances[points.front()];
  });
  return distances;
}

/// Returns true if the deviation of a skin point is informative about the part.
bool is_informative(const DesignDistance::PointDistance& distance, std::int32_t line,
                    const Vector3d& outward, const DesignDistance& design, double joint) {
  constexpr double min_cosine = 0.1;  // cosine of 84 degrees
  if (distance.triangle < 0 || distance.is_beyond) return false;
  if (design.is_closed() || distance.value >= -joint) return true;
  return line != 0 && distance.normal.dot(outward) >= min_cosine;
}

}  // namespace

PartDeviation part_deviation(const StockSkin& skin, const DesignDistance& design,
                             const DeviationOptions& options) {
  const Index n = skin.mesh.vertices_w.rows();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  PartDeviation result{Eigen::VectorXd::Constant(n, nan), Eigen::VectorXd::Constant(n, nan),
                       std::vector<int>(std::size_t(n), -1),
                       std::vector<SkinStatus>(std::size_t(n), SkinStatus::Unresolved)};
  const std::vector<DesignDistance::PointDistance> distances =
      point_distances(skin, design, options.band);
  const Points outward = directed_area(skin.mesh);
  tbb::parallel_for(Index(0), n, [&](Index i) {
    const auto v = std::size_t(i);
    double sum = 0.0, max_magnitude = -1.0;
    int count = 0;
    bool is_beyond_band = false;
    for (int k = skin.first[v]; k < skin.first[v + 1]; ++k) {
      const int point = skin.point_indices[std::size_t(k)];
      const DesignDistance::PointDistance& distance = distances[std::size_t(point)];
      result.status[v] = SkinStatus::NoDesign;
      if (!is_informative(distance, skin.line[std::size_t(point)],
                          outward.row(i).transpose().normalized(), design, options.joint))
        continue;
      const double value = std::clamp(distance.value, -options.band, options.band);
      is_beyond_band = is_beyond_band || value != distance.value;
      sum += value;
      ++count;
      if (std::abs(value) <= max_magnitude) continue;
      max_magnitude = std::abs(value);
      result.max_deviation[i] = value;
      result.at[v] = point;
    }
    if (count == 0) return;
    result.status[v] = is_beyond_band ? SkinStatus::BeyondBand : SkinStatus::Compared;
    result.deviation[i] = sum / count;
  });
  return result;
}

}  // namespace abbe::cutting
