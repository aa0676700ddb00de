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

// 1 - cosine; the angle between edges that coincide is below it, 0.26 deg
constexpr double same_direction = 1e-5;

/// A triangle at a point where several meet: its angle there, and the directions in which it ends.
struct Wedge {
  double angle = 2 * pi;
  std::array<Vector3d, 2> sides;
  bool ends = false;
};

Wedge wedge_at(const std::array<Vector3d, 3>& p, const Vector3d& point, double joint) {
  Wedge wedge;
  for (std::size_t k = 0; k < 3; ++k) {
    if ((p[k] - point).norm() > joint) continue;
    const Vector3d to = (p[(k + 1) % 3] - p[k]).normalized(),
                   from = (p[(k + 2) % 3] - p[k]).normalized();
    return {std::atan2(to.cross(from).norm(), to.dot(from)), {to, from}, true};
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d along = (p[(k + 1) % 3] - p[k]).normalized();
    if ((point - p[k]).cross(along).norm() > joint) continue;
    return {pi, {along, -along}, true};
  }
  return wedge;
}

/// Returns true if a triangle ends along a line where no other triangle ends.
bool has_lone_side(const std::vector<Wedge>& corners) {
  for (std::size_t i = 0; i < corners.size(); ++i)
    for (const Vector3d& side : corners[i].sides) {
      bool is_shared = false;
      for (std::size_t j = 0; j < corners.size() && !is_shared; ++j)
        for (const Vector3d& other : corners[j].sides)
          is_shared = is_shared || (i != j && side.dot(other) > 1.0 - same_direction);
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

/// Sides that no triangle with the same vertices shares are tested in space, because vertices may
/// be separate along edges and seams.
bool DesignDistance::has_border() const {
  std::vector<std::array<int, 2>> sides;
  for (const auto& t : design_.triangles.rowwise())
    for (int k = 0; k < 3; ++k) sides.push_back({t[k], t[(k + 1) % 3]});
  const auto sorted = [](const std::array<int, 2>& side) {
    return std::array<int, 2>{std::min(side[0], side[1]), std::max(side[0], side[1])};
  };
  std::ranges::sort(sides, {}, sorted);
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t next = i + 1;
    while (next < sides.size() && sorted(sides[next]) == sorted(sides[i])) ++next;
    if (next == i + 1) {
      const Vector3d a = design_.vertices.row(sides[i][0]), b = design_.vertices.row(sides[i][1]);
      if ((b - a).norm() > options_.joint && meeting(0.5 * (a + b)).is_border) return true;
    }
    i = next;
  }
  return false;
}

DesignDistance::Meeting DesignDistance::meeting(const Vector3d& point) const {
  Meeting all{Vector3d::Zero()};
  std::vector<Wedge> corners;
  bool is_inside_one = false;
  for (const TriangleTree::Nearest& one : tree_.within(point, options_.joint)) {
    const Vector3d normal = facet_normals_.row(one.triangle);
    if (!(normal.squaredNorm() > 0.5)) continue;  // without an area it has no direction
    const Eigen::RowVector3i c = design_.triangles.row(one.triangle);
    const Wedge corner = wedge_at(
        {design_.vertices.row(c[0]), design_.vertices.row(c[1]), design_.vertices.row(c[2])}, point,
        options_.joint);
    // Weights by angle give the correct side everywhere (Baerentzen and Aanaes 2005).
    all.normal += corner.angle * normal;
    if (corner.ends)
      corners.push_back(corner);
    else
      is_inside_one = true;
  }
  all.normal.normalize();
  all.is_border = !is_inside_one && has_lone_side(corners);
  return all;
}

/// Returns the height of the smooth surface above the facet, mm.
double DesignDistance::sag(const TriangleTree::Nearest& nearest) const {
  const Eigen::RowVector3i c = design_.triangles.row(nearest.triangle);
  std::array<Contact, 3> corners;
  for (int k = 0; k < 3; ++k)
    corners[std::size_t(k)] = {design_.vertices.row(c[k]), design_.normals.row(c[k])};
  const std::array<double, 3> weights{nearest.weights[0], nearest.weights[1], nearest.weights[2]};
  const Contact smooth = smooth_facet_point(corners, weights);
  return (smooth.point - nearest.point).dot(facet_normals_.row(nearest.triangle).transpose());
}

DesignDistance::At DesignDistance::at(const Vector3d& place, int guess, double most) const {
  // weight of a corner below which the nearest point is on a side
  constexpr double touching = 1e-9;
  At found;
  const TriangleTree::Nearest nearest = tree_.nearest(place, guess, most);
  found.triangle = nearest.triangle;
  if (nearest.triangle < 0) {
    found.value = std::numeric_limits<double>::quiet_NaN();
    return found;
  }
  const Vector3d way = place - nearest.point;
  const double distance = std::sqrt(nearest.squared);
  Meeting here{facet_normals_.row(nearest.triangle)};
  if (nearest.weights.minCoeff() < touching) here = meeting(nearest.point);
  const double above = way.dot(here.normal);
  found.normal = here.normal;
  const double tangential = (way - above * here.normal).norm();
  // beyond the border: below it, or aside by more than the joints and an inclination of 1e-3
  found.is_beyond = here.is_border && distance > 2 * options_.joint &&
                    (above < 0.0 || tangential > 2 * options_.joint + 1e-3 * distance);
  const double flat = above >= 0.0 ? distance : -distance;
  found.value = options_.smooth && design_.normals.rows() == design_.vertices.rows()
                    ? flat - sag(nearest)
                    : flat;
  // Along the connection itself if its direction is defined.
  found.from = distance > options_.joint ? Vector3d(way * (found.value / flat))
                                         : Vector3d(found.value * here.normal);
  return found;
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

/// Returns the points that are farther than the band, grouped in cubes of half its size. No design
/// lies between two points of a cube: a ball of the band about one of them contains the other.
Cubes far_cubes(const StockSkin& skin, const std::vector<DesignDistance::At>& all, double band) {
  Cubes cubes;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].triangle >= 0) continue;
    GridCube cube{};
    for (std::size_t k = 0; k < 3; ++k)
      cube[k] = std::int64_t(std::floor(skin.places_w(Index(i), Index(k)) / (0.5 * band)));
    cubes[cube].push_back(i);
  }
  return cubes;
}

/// Returns true if a neighbouring cube is on the other side of the design's border.
bool is_at_border(const Cubes& cubes, const GridCube& cube,
                  const std::vector<DesignDistance::At>& all) {
  const auto beyond = [&](const std::vector<std::size_t>& places) {
    return all[places.front()].is_beyond;
  };
  const bool here = beyond(cubes.at(cube));
  for (int i = 0; i < 27; ++i) {
    const auto beside =
        cubes.find({cube[0] + i % 3 - 1, cube[1] + i / 3 % 3 - 1, cube[2] + i / 9 - 1});
    if (beside != cubes.end() && beyond(beside->second) != here) return true;
  }
  return false;
}

/// Returns the distance of every point of the skin from the design.
std::vector<DesignDistance::At> held_against(const StockSkin& skin, const DesignDistance& design,
                                             double band) {
  std::vector<DesignDistance::At> all(skin.line.size());
  constexpr std::size_t block = 512;  // neighbours, each a guess for the next
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, all.size(), block), [&](const auto& range) {
    int guess = -1;
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      all[i] = design.at(skin.places_w.row(Index(i)).transpose(), guess, band);
      guess = all[i].triangle;
    }
  });
  const Cubes cubes = far_cubes(skin, all, band);
  const auto for_all = [&](const auto& act) {
    std::vector<const Cubes::value_type*> list;
    for (const auto& one : cubes) list.push_back(&one);
    tbb::parallel_for(std::size_t(0), list.size(),
                      [&](std::size_t i) { act(list[i]->first, list[i]->second); });
  };
  const auto exactly = [&](std::size_t i) {
    return design.at(skin.places_w.row(Index(i)).transpose());
  };
  for_all([&](const GridCube&, const std::vector<std::size_t>& places) {
    all[places.front()] = exactly(places.front());
  });
  // The first point of a cube is not changed here, because neighbouring cubes read it.
  for_all([&](const GridCube& cube, const std::vector<std::size_t>& places) {
    const bool each = is_at_border(cubes, cube, all);
    for (std::size_t k = 1; k < places.size(); ++k)
      all[places[k]] = each ? exactly(places[k]) : all[places.front()];
  });
  return all;
}

/// Returns true if a point of the skin is informative about the part.
bool tells(const DesignDistance::At& at, std::int32_t line, const Vector3d& outward,
           const DesignDistance& design, double joint) {
  constexpr double steep = 0.1;  // cosine of 84 degrees
  if (at.triangle < 0 || at.is_beyond) return false;
  if (design.is_closed() || at.value >= -joint) return true;
  return line != 0 && at.normal.dot(outward) >= steep;
}

}  // namespace

PartDeviation part_deviation(const StockSkin& skin, const DesignDistance& design,
                             const DeviationOptions& options) {
  const Index n = skin.mesh.vertices_w.rows();
  const double none = std::numeric_limits<double>::quiet_NaN();
  PartDeviation part{Eigen::VectorXd::Constant(n, none), Eigen::VectorXd::Constant(n, none),
                     std::vector<int>(std::size_t(n), -1),
                     std::vector<SkinStatus>(std::size_t(n), SkinStatus::Unresolved)};
  const std::vector<DesignDistance::At> at = held_against(skin, design, options.band);
  const Points outward = directed_area(skin.mesh);
  tbb::parallel_for(Index(0), n, [&](Index i) {
    const auto v = std::size_t(i);
    double sum = 0.0, most = -1.0;
    int count = 0;
    bool cut_off = false;
    for (int k = skin.first[v]; k < skin.first[v + 1]; ++k) {
      const int place = skin.place[std::size_t(k)];
      const DesignDistance::At& one = at[std::size_t(place)];
      part.status[v] = SkinStatus::NoDesign;
      if (!tells(one, skin.line[std::size_t(place)], outward.row(i).transpose().normalized(),
                 design, options.joint))
        continue;
      const double value = std::clamp(one.value, -options.band, options.band);
      cut_off = cut_off || value != one.value;
      sum += value;
      ++count;
      if (std::abs(value) <= most) continue;
      most = std::abs(value);
      part.largest[i] = value;
      part.at[v] = place;
    }
    if (count == 0) return;
    part.status[v] = cut_off ? SkinStatus::CutOff : SkinStatus::Compared;
    part.deviation[i] = sum / count;
  });
  return part;
}

}  // namespace abbe::cutting
