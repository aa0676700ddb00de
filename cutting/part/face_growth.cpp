#include "cutting/part/face_growth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/part/index_sets.h"
#include "cutting/part/remeshing.h"

namespace abbe::cutting {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The triangles at each vertex, concatenated.
struct VertexTriangles {
  std::vector<int> first, triangles;
  explicit VertexTriangles(const Design& design)
      : first(std::size_t(design.vertices.rows()) + 1, 0) {
    for (const auto& t : design.triangles.rowwise())
      for (const int v : t) ++first[std::size_t(v) + 1];
    for (std::size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1];
    triangles.resize(std::size_t(first.back()));
    std::vector<int> position = first;
    for (int t = 0; t < int(design.triangles.rows()); ++t)
      for (const int v : design.triangles.row(t))
        triangles[std::size_t(position[std::size_t(v)]++)] = t;
  }
  std::span<const int> at(int v) const {
    const auto begin = std::size_t(first[std::size_t(v)]);
    return {triangles.data() + begin, std::size_t(first[std::size_t(v) + 1]) - begin};
  }
};

/// Returns true if the triangles around a vertex are all open and enclose it.
bool is_enclosed(const FaceGrowth& growth, const VertexTriangles& around, int v) {
  for (const int t : around.at(v)) {
    if (!growth.is_open(t)) return false;
    for (int k = 0; k < 3; ++k)
      if (growth.design().triangles(t, (k + 2) % 3) != v && growth.open_across(t, k) < 0)
        return false;
  }
  return !around.at(v).empty();
}

/// Returns the triangles at a vertex and at its neighbours; empty if one of the neighbours is not
/// enclosed by open triangles.
std::vector<int> two_rings(const FaceGrowth& growth, const VertexTriangles& around, int v) {
  std::vector<int> triangles;
  for (const int t : around.at(v))
    for (const int neighbour : growth.design().triangles.row(t)) {
      if (!is_enclosed(growth, around, neighbour)) return {};
      const std::span<const int> neighbour_triangles = around.at(neighbour);
      triangles.insert(triangles.end(), neighbour_triangles.begin(), neighbour_triangles.end());
    }
  return sorted_unique(std::move(triangles));
}

/// Returns the largest angle between the normals of the first facet and the others, rad.
double max_normal_angle(const FaceGrowth& growth, std::span<const int> triangles) {
  double min_cosine = 1.0;
  for (const int t : triangles)
    min_cosine = std::min(min_cosine, growth.normal(t).dot(growth.normal(triangles.front())));
  return std::acos(std::clamp(min_cosine, -1.0, 1.0));
}

/// Search for faces from the surfaces that fit around a vertex, simple ones first.
class VertexSeedSearch {
 public:
  VertexSeedSearch(FaceGrowth& growth)
      : growth_(growth),
        around_(growth.design()),
        is_skipped_(std::size_t(growth.design().vertices.rows()), 0) {}

  void grow_all() {
    for (int v = 0; v < int(is_skipped_.size()) && !growth_.is_budget_exhausted(); ++v) {
      if (is_skipped_[std::size_t(v)] || !is_enclosed(growth_, around_, v)) continue;
      const std::span<const int> ring = around_.at(v);
      if (max_normal_angle(growth_, ring) < min_curved_angle) continue;
      if (has_common_sphere(v) && grow_forms(std::array{Form::Sphere}, {ring.begin(), ring.end()}))
        continue;
      const std::vector<int> triangles = two_rings(growth_, around_, v);
      if (triangles.empty() ||
          grow_forms(std::array{Form::Cylinder, Form::Cone, Form::Torus}, triangles))
        continue;
      // In finely meshed regions a face contains so many vertices that some can be skipped.
      if (max_normal_angle(growth_, triangles) < max_fine_angle)
        for (const int t : triangles)
          for (const int vertex : growth_.design().triangles.row(t)) skip_neighbourhood(vertex);
    }
  }

 private:
  // 0.5 deg: facets around a vertex that turn less are one flat.
  static constexpr double min_curved_angle = 0.5 * std::numbers::pi / 180.0,
                          max_fine_angle = 0.2;  // rad, turn over two rings of facets

  /// Returns true if a face grows from the triangles. A region that has grown without being a face
  /// would grow again from its other vertices, so these are skipped from then on.
  bool grow_forms(std::span<const Form> forms, std::vector<int> triangles) {
    constexpr std::size_t min_growth = 4;
    const std::size_t seed_size = triangles.size();
    const FaceGrowth::GrowthAttempt attempt =
        growth_.grow(forms, growth_.region(std::move(triangles)));
    if (attempt.visited_triangles.size() > min_growth * seed_size)
      for (const int t : attempt.visited_triangles)
        for (const int v : growth_.design().triangles.row(t)) is_skipped_[std::size_t(v)] = 1;
    return attempt.is_accepted;
  }

  void skip_neighbourhood(int v) {
    for (const int t : around_.at(v))
      for (const int neighbour : growth_.design().triangles.row(t))
        is_skipped_[std::size_t(neighbour)] = 1;
  }

  /// Returns true if a vertex and its neighbours lie on a common sphere within 3 tolerances. On a
  /// free form hardly any do, so this test saves most of the fits.
  bool has_common_sphere(int v) const {
    constexpr double max_deviation = 3.0;  // tolerances
    const Points& points = growth_.design().vertices;
    std::vector<Vector3d> offsets;
    Matrix3d normal_matrix = Matrix3d::Zero();
    Vector3d right_side = Vector3d::Zero();
    for (const int t : around_.at(v))
      for (const int neighbour : growth_.design().triangles.row(t)) {
        if (neighbour == v) continue;
        offsets.push_back(points.row(neighbour) - points.row(v));
        normal_matrix += offsets.back() * offsets.back().transpose();
        right_side += 0.5 * offsets.back().squaredNorm() * offsets.back();
      }
    const Vector3d centre = normal_matrix.ldlt().solve(right_side);
    const double radius = centre.norm();
    return std::all_of(offsets.begin(), offsets.end(), [&](const Vector3d& p) {
      return std::abs((p - centre).norm() - radius) < max_deviation * growth_.tolerance();
    });
  }

  FaceGrowth& growth_;
  VertexTriangles around_;
  std::vector<char> is_skipped_;
};

/// A line along a strip, given by two points.
struct StripLine {
  Vector3d from, to;
  Vector3d direction() const { return (to - from).normalized(); }
  double length() const { return (to - from).norm(); }
};

/// Two adjacent strips: the line at which they meet, and the opposite side of each.
struct StripPair {
  StripLine first, middle, last;
};

/// Returns the line between two points of a set that are far apart: the point farthest from the
/// first one, and the point farthest from that. Empty for fewer than two points.
std::optional<StripLine> longest_line(const std::vector<Vector3d>& points) {
  if (points.size() < 2) return std::nullopt;
  const auto farthest_from = [&](const Vector3d& p) {
    return *std::max_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
      return (a - p).squaredNorm() < (b - p).squaredNorm();
    });
  };
  const Vector3d end_point = farthest_from(points.front());
  return StripLine{farthest_from(end_point), end_point};
}

/// Returns the sides of a flat along a line and opposite to it.
std::optional<std::pair<StripLine, StripLine>> sides_of_strip(const FaceGrowth& growth, int flat,
                                                              const StripLine& fold) {
  constexpr double near_fraction = 0.1;  // of the height; nearer points belong to the line's side
  std::vector<Vector3d> points;
  std::vector<double> heights;
  for (const int t : growth.flats()[std::size_t(flat)])
    for (const int v : growth.design().triangles.row(t)) {
      points.push_back(growth.design().vertices.row(v));
      heights.push_back((points.back() - fold.from).cross(fold.direction()).norm());
    }
  const double max_height = *std::max_element(heights.begin(), heights.end());
  std::vector<Vector3d> near_points, far_points;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (heights[i] <= near_fraction * max_height) near_points.push_back(points[i]);
    if (heights[i] > near_fraction * max_height) far_points.push_back(points[i]);
  }
  const auto near_side = longest_line(near_points), far_side = longest_line(far_points);
  if (!near_side || !far_side || !(far_side->length() > 0.0)) return std::nullopt;
  return std::pair(*near_side, *far_side);
}

/// Returns the line with its direction reversed if it is opposite to that of another line.
StripLine aligned_with(StripLine line, const StripLine& other) {
  if (line.direction().dot(other.direction()) < 0.0) std::swap(line.from, line.to);
  return line;
}

/// Returns the cylinder through three parallel lines.
std::optional<AnalyticPatch> cylinder_through(const StripPair& fold) {
  const Vector3d axis = (fold.first.to - fold.first.from + fold.middle.to - fold.middle.from +
                         fold.last.to - fold.last.from)
                            .normalized();
  const auto across_axis = [&](const Vector3d& p) -> Vector3d { return p - axis * axis.dot(p); };
  const Vector3d a = across_axis(fold.first.from - fold.middle.from),
                 b = across_axis(fold.last.from - fold.middle.from), plane_normal = a.cross(b);
  if (!(plane_normal.squaredNorm() > 0.0)) return std::nullopt;
  const Vector3d centre = (a.squaredNorm() * b - b.squaredNorm() * a).cross(plane_normal) /
                          (2.0 * plane_normal.squaredNorm());
  AnalyticPatch surface;
  surface.form = Form::Cylinder;
  surface.frame = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
  surface.origin = fold.middle.from + centre;
  surface.shape = Eigen::VectorXd::Constant(1, centre.norm());
  return surface;
}

/// Returns the cone through three lines that meet at its apex.
std::optional<AnalyticPatch> cone_through(const StripPair& fold) {
  const std::array<StripLine, 3> lines = {fold.first, fold.middle, fold.last};
  Matrix3d projections = Matrix3d::Zero();
  Vector3d right_side = Vector3d::Zero(), middle = Vector3d::Zero();
  for (const StripLine& line : lines) {
    const Vector3d u = line.direction(), from = line.from - fold.middle.from;
    const Matrix3d projection = Matrix3d::Identity() - u * u.transpose();
    projections += projection;
    right_side += projection * from;
    middle += (from + 0.5 * (line.to - line.from)) / 3.0;
  }
  const Vector3d apex = projections.ldlt().solve(right_side);
  Vector3d axis = (lines[0].direction() - lines[1].direction())
                      .cross(lines[2].direction() - lines[1].direction())
                      .normalized();
  if (axis.dot(middle - apex) < 0.0) axis = -axis;
  // 1e-3: lines almost in a plane across the axis form no cone.
  const double height = axis.dot(middle - apex), slope = std::abs(axis.dot(lines[1].direction()));
  if (!apex.allFinite() || !axis.allFinite() || !(height > 0.0) || !(slope > 1e-3))
    return std::nullopt;
  const double growth = std::sqrt(std::max(0.0, 1.0 - slope * slope)) / slope;
  AnalyticPatch surface;
  surface.form = Form::Cone;
  surface.frame = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
  surface.origin = fold.middle.from + apex + height * axis;
  surface.shape = Eigen::Vector2d(height * growth, growth);
  return surface;
}

/// Returns the cylinder or cone through two strips that meet along a side of a triangle.
std::optional<AnalyticPatch> surface_through_strips(const FaceGrowth& growth, int t, int side) {
  const Design& design = growth.design();
  const int other = growth.open_across(t, side);
  const StripLine edge{design.vertices.row(design.triangles(t, side)),
                       design.vertices.row(design.triangles(t, (side + 1) % 3))};
  const auto sides = sides_of_strip(growth, growth.flat_of(t), edge);
  const auto other_sides = sides_of_strip(growth, growth.flat_of(other), edge);
  if (!sides || !other_sides || !(sides->first.length() > 0.0)) return std::nullopt;
  const StripPair fold{aligned_with(sides->second, edge), aligned_with(sides->first, edge),
                       aligned_with(other_sides->second, edge)};
  const double min_length =
      std::min({fold.first.length(), fold.middle.length(), fold.last.length()});
  // Rounding of the vertices tilts the lines by the tolerance divided by their length.
  const double max_cylinder_sine = 1e-3 + 4.0 * growth.tolerance() / min_length;
  const Vector3d u = fold.middle.direction();
  const bool is_cylinder = fold.first.direction().cross(u).norm() < max_cylinder_sine &&
                           fold.last.direction().cross(u).norm() < max_cylinder_sine;
  std::optional<AnalyticPatch> surface = is_cylinder ? cylinder_through(fold) : cone_through(fold);
  if (!surface) return surface;
  const Vector3d n = outward(*surface, 0.5 * (edge.from + edge.to));
  surface->sign = n.dot(growth.normal(t) + growth.normal(other)) > 0.0 ? 1.0 : -1.0;
  return surface;
}

/// Grows cylinders and cones from adjacent strips.
/// @return true if any face was found
bool grow_from_strips(FaceGrowth& growth) {
  bool has_found_face = false;
  constexpr std::size_t max_seed_triangles = 512;  // of two strips; larger flats are no strips
  std::set<std::pair<int, int>> pairs_visited;
  std::vector<char> is_flat_skipped(growth.flats().size(), 0);
  for (int t = 0; t < int(growth.design().triangles.rows()) && !growth.is_budget_exhausted(); ++t)
    for (int side = 0; side < 3 && growth.is_open(t); ++side) {
      const int other = growth.open_across(t, side);
      if (other < 0) continue;
      const int a = growth.flat_of(t), b = growth.flat_of(other);
      const std::size_t size_a = growth.flats()[std::size_t(a)].size(),
                        size_b = growth.flats()[std::size_t(b)].size();
      if (a >= b || size_a < 2 || size_b < 2 || size_a + size_b > max_seed_triangles ||
          (is_flat_skipped[std::size_t(a)] && is_flat_skipped[std::size_t(b)]) ||
          !pairs_visited.emplace(a, b).second)
        continue;
      const std::optional<AnalyticPatch> surface = surface_through_strips(growth, t, side);
      if (!surface) continue;
      std::vector<int> seed = growth.flats()[std::size_t(a)];
      seed.insert(seed.end(), growth.flats()[std::size_t(b)].begin(),
                  growth.flats()[std::size_t(b)].end());
      if (!std::all_of(seed.begin(), seed.end(),
                       [&](int triangle) { return growth.is_open(triangle); }))
        continue;
      const std::size_t seed_size = seed.size();
      FaceGrowth::RegionGrowth growth_result =
          growth.grow_region(*surface, growth.region(std::move(seed)));
      if (growth_result.is_face) {
        growth.add_face(std::move(growth_result.face));
        has_found_face = true;
      } else if (growth_result.visited_triangles.size() > seed_size) {
        for (const int triangle : growth_result.visited_triangles)
          is_flat_skipped[std::size_t(growth.flat_of(triangle))] = 1;
      }
    }
  return has_found_face;
}

}  // namespace

FaceRegions grow_face_regions(const Design& design, const std::vector<char>& open,
                              double tolerance) {
  constexpr int max_passes = 3;
  // Planes that are evident by themselves come first, because they bound the curved faces between
  // them. Planes that are only tangent to curved faces come last, because these must be known.
  FaceGrowth growth(design, open, tolerance);
  const int flats = int(growth.flats().size());
  for (int flat = 0; flat < flats; ++flat)
    if (auto plane = growth.evident_plane(flat)) growth.add_face(std::move(*plane));
  VertexSeedSearch(growth).grow_all();
  // A region that was rejected before the faces around it were known may be a face now.
  for (int pass = 0; pass < max_passes && grow_from_strips(growth); ++pass) {
  }
  for (int flat = 0; flat < flats; ++flat)
    if (auto plane = growth.tangent_plane(flat)) growth.add_face(std::move(*plane));
  const int unexamined_triangles = growth.is_budget_exhausted() ? growth.open_triangles() : 0;
  return {std::move(growth).faces(), unexamined_triangles};
}

namespace {

using Eigen::Index;

constexpr double min_normal_cosine = 0.866;  // cos 30 degrees, of a facet and its surface
constexpr double min_wasted_work = 1e6, wasted_work_per_triangle = 30.0, fit_work = 50.0;
constexpr double growing_tolerances = 3.0;  // while the surface is fitted to only a few facets

}  // namespace

FaceGrowth::FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance)
    : design_(design),
      tolerance_(tolerance),
      across_(neighbours(design.triangles)),
      normals_(design.triangles.rows(), 3),
      height_(design.triangles.rows()),
      face_(open.size(), closed),
      flat_(open.size(), no_face),
      triangle_stamp_(open.size(), 0),
      vertex_stamp_(std::size_t(design.vertices.rows()), 0),
      max_wasted_work_(min_wasted_work + wasted_work_per_triangle * double(open.size())) {
  for (Index t = 0; t < design.triangles.rows(); ++t) {
    if (open[std::size_t(t)]) face_[std::size_t(t)] = no_face;
    const auto corner = [&](int k) { return vertex(design.triangles(t, k)); };
    const Vector3d cross = triangle_cross_product(design.vertices, design.triangles, t);
    double max_side_px = 0.0;
    for (int k = 0; k < 3; ++k)
      max_side_px = std::max(max_side_px, (corner((k + 1) % 3) - corner(k)).norm());
    normals_.row(t) = cross.normalized();
    height_[t] = max_side_px > 0.0 ? cross.norm() / max_side_px : 0.0;
  }
  find_flats(open);
}

int FaceGrowth::open_across(int t, int side) const {
  const int other = across_[std::size_t(t)][std::size_t(side)];
  return other >= 0 && is_open(other) ? other : -1;
}

void FaceGrowth::mark_region(const Region& region) {
  ++last_stamp_;
  for (const int t : region.triangles) triangle_stamp_[std::size_t(t)] = last_stamp_;
  for (const int v : region.vertices) vertex_stamp_[std::size_t(v)] = last_stamp_;
}

/// Adds those corners of a triangle that the region, which was marked last, does not contain.
void FaceGrowth::add_corners(Region& region, int t) {
  for (const int v : design_.triangles.row(t)) {
    int& stamp_of_vertex = vertex_stamp_[std::size_t(v)];
    if (stamp_of_vertex != last_stamp_) region.vertices.push_back(v);
    stamp_of_vertex = last_stamp_;
  }
}

FaceGrowth::Region FaceGrowth::region(std::vector<int> triangles) {
  Region result{std::move(triangles), {}};
  ++last_stamp_;
  for (const int t : result.triangles) add_corners(result, t);
  return result;
}

/// Returns true if a facet lies along the surface, with the same outward side. If the normal of the
/// surface hardly varies between the corners, the facet must be parallel to the tangent plane
/// there, which excludes the floor next to the torus around it. The normal of a sliver is not
/// tested.
bool FaceGrowth::is_on_surface(const AnalyticPatch& surface, int t, double reach) const {
  constexpr double obtuse_factor = 2.0;  // obtuse triangles lean by more than half of the turn
  Vector3d centre = Vector3d::Zero();
  for (const int v : design_.triangles.row(t)) {
    if (!(std::abs(distance_of(surface, vertex(v))) <= reach)) return false;
    centre += vertex(v) / 3.0;
  }
  if (height_[t] < sliver_tolerances * tolerance_) return true;
  const double cosine = surface.sign * outward(surface, centre).dot(normals_.row(t));
  if (!(cosine > min_normal_cosine)) return false;
  // The uncertainty of the normal of a facet is the deviation of its corners over its height.
  double max_angle = 2.0 * reach / height_[t];
  if (cosine > 1.0 - 0.5 * max_angle * max_angle) return true;
  const Vector3d first = outward(surface, vertex(design_.triangles(t, 0)));
  for (const int k : {1, 2})
    max_angle = std::max(
        max_angle,
        2.0 * reach / height_[t] +
            obtuse_factor * (outward(surface, vertex(design_.triangles(t, k))) - first).norm());
  return cosine > 1.0 - 0.5 * max_angle * max_angle;
}

/// Returns the region with the triangles around it that lie on the surface and pass the filter. It
/// is at most doubled, so that the surface is refitted before an error of the fit can spread.
FaceGrowth::Region FaceGrowth::expand(const AnalyticPatch& surface, Region region, double reach,
                                      const TriangleFilter& filter) {
  constexpr std::size_t min_growth = 16;
  mark_region(region);
  const std::size_t max_triangles =
      region.triangles.size() + std::max(min_growth, region.triangles.size());
  for (std::size_t i = 0; i < region.triangles.size() && region.triangles.size() < max_triangles;
       ++i)
    for (const int neighbour : across_[std::size_t(region.triangles[i])]) {
      if (neighbour < 0 || triangle_stamp_[std::size_t(neighbour)] == last_stamp_ ||
          !filter(neighbour) || !is_on_surface(surface, neighbour, reach))
        continue;
      triangle_stamp_[std::size_t(neighbour)] = last_stamp_;
      region.triangles.push_back(neighbour);
      add_corners(region, neighbour);
    }
  return region;
}

// Three iterations solve a plane to rounding; the other forms start near their solution and need
// eight at most.
AnalyticPatch FaceGrowth::refit_surface(const AnalyticPatch& surface, const Region& region) const {
  const int max_iterations = surface.form == Form::Plane ? 3 : 8;
  const FacetPatch patch = facet_patch(design_, region.vertices, {});
  return from_patch_coordinates(
      patch, refine_fit(to_patch_coordinates(patch, surface), patch, max_iterations));
}

void FaceGrowth::find_flats(const std::vector<char>& open) {
  constexpr std::size_t max_exact_seed = 8;  // triangles; up to this number the plane of the
                                             // largest one is accurate enough
  std::vector<int> order;
  for (int t = 0; t < int(open.size()); ++t)
    if (open[std::size_t(t)]) order.push_back(t);
  // The highest triangles come first, because their normals are the most accurate.
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return height_[a] > height_[b]; });
  const TriangleFilter filter = [&](int t) {
    return is_open(t) && flat_[std::size_t(t)] == no_face;
  };
  for (const int seed : order) {
    if (flat_[std::size_t(seed)] != no_face) continue;
    AnalyticPatch plane;
    plane.frame.col(2) = normals_.row(seed);
    plane.frame.col(0) = plane.frame.col(2).unitOrthogonal();
    plane.frame.col(1) = plane.frame.col(2).cross(plane.frame.col(0));
    plane.origin = vertex(design_.triangles(seed, 0));
    Region flat = region({seed});
    for (std::size_t previous_size = 0; previous_size < flat.triangles.size();) {
      previous_size = flat.triangles.size();
      flat = expand(plane, std::move(flat), tolerance_, filter);
      if (flat.triangles.size() > max_exact_seed) plane = refit_surface(plane, flat);
    }
    for (const int t : flat.triangles) flat_[std::size_t(t)] = int(flats_.size());
    flats_.push_back(std::move(flat.triangles));
  }
}

/// Returns the least-squares surface, in mm, from a start in the coordinates of a patch; empty if a
/// vertex is farther than the tolerance.
std::optional<AnalyticPatch> FaceGrowth::fit_surface(const FacetPatch& patch,
                                                     const AnalyticPatch& start) const {
  struct Stage {
    int rounds;
    double max_tolerances;  // tolerances; beyond it the fit is abandoned
  };
  AnalyticPatch local = start;
  for (const auto& [rounds, max_tolerances] : {Stage{3, 30.0}, {3, 3.0}, {6, 1.0}}) {
    local = refine_fit(local, patch, rounds);
    if (!(max_vertex_distance(patch, local) <= max_tolerances * tolerance_)) return std::nullopt;
  }
  AnalyticPatch surface = from_patch_coordinates(patch, local);
  const Vector3d centre = patch.middle + patch.size * patch.centres.row(0).transpose();
  surface.sign = outward(surface, centre).dot(patch.normals.row(0)) > 0.0 ? 1.0 : -1.0;
  return surface;
}

FaceGrowth::GrowthAttempt FaceGrowth::grow(std::span<const Form> forms, const Region& region) {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  std::optional<AnalyticPatch> axis;
  GrowthAttempt attempt;
  for (const Form form : forms) {
    const bool has_axis = form != Form::Plane && form != Form::Sphere;
    if (has_axis && !axis) axis = revolution_from_normals(patch);
    const auto surface =
        fit_surface(patch, initial_surface(form, patch, axis.value_or(AnalyticPatch{})));
    if (!surface) continue;
    RegionGrowth growth = grow_region(*surface, region);
    if (growth.is_face) {
      add_face(std::move(growth.face));
      return {true, {}};
    }
    if (growth.visited_triangles.size() > attempt.visited_triangles.size())
      attempt.visited_triangles = std::move(growth.visited_triangles);
  }
  return attempt;
}

FaceGrowth::RegionGrowth FaceGrowth::grow_region(AnalyticPatch surface, Region region) {
  const TriangleFilter filter = [&](int t) { return is_open(t); };
  double work = 0.0;
  for (std::size_t previous_size = 0; previous_size < region.triangles.size();) {
    previous_size = region.triangles.size();
    region = expand(surface, std::move(region), growing_tolerances * tolerance_, filter);
    if (region.triangles.size() > previous_size) surface = refit_surface(surface, region);
    work += fit_work + double(region.triangles.size() + region.vertices.size());
  }
  // Triangles that were added before the surface was well determined may not lie on it.
  std::vector<int> visited_triangles = region.triangles;
  std::erase_if(region.triangles, [&](int t) { return !is_on_surface(surface, t, tolerance_); });
  // A region that loses more than half of its triangles was on another surface.
  bool is_accepted = 2 * region.triangles.size() >= visited_triangles.size();
  if (is_accepted) {
    region = this->region(std::move(region.triangles));
    surface = with_extent(refit_surface(surface, region), region);
    is_accepted = is_face(surface, region);
  }
  if (!is_accepted) wasted_work_ += work;
  return {{surface, std::move(region.triangles)}, is_accepted, std::move(visited_triangles)};
}

/// Returns the surface with the bounding box of a region and the largest distance of its vertices.
AnalyticPatch FaceGrowth::with_extent(AnalyticPatch surface, const Region& region) const {
  surface.off = 0.0;
  for (const int v : region.vertices) {
    surface.box.extend(vertex(v));
    surface.off = std::max(surface.off, std::abs(distance_of(surface, vertex(v))));
  }
  return surface;
}

/// Returns the vertex of a triangle opposite to the side from a to b.
int FaceGrowth::third_vertex(int t, int a, int b) const {
  int result = no_face;
  for (const int v : design_.triangles.row(t))
    if (v != a && v != b) result = v;
  return result;
}

/// Returns the distance of a vertex from the line through two others, mm.
double FaceGrowth::height_over(int a, int b, int c) const {
  const Vector3d side = vertex(b) - vertex(a);
  return side.cross(vertex(c) - vertex(a)).norm() / side.norm();
}

std::vector<FaceGrowth::Border> FaceGrowth::borders(const Region& region) {
  mark_region(region);
  std::vector<Border> result;
  for (const int t : region.triangles)
    for (int k = 0; k < 3; ++k) {
      const int outside = across_[std::size_t(t)][std::size_t(k)];
      if (outside < 0 || triangle_stamp_[std::size_t(outside)] == last_stamp_) continue;
      Border border{t,  outside, design_.triangles(t, k), design_.triangles(t, (k + 1) % 3),
                    -1, 0.0};
      border.outer_vertex = third_vertex(outside, border.a, border.b);
      border.height = height_over(border.a, border.b, border.outer_vertex);
      result.push_back(border);
    }
  return result;
}

void FaceGrowth::add_face(FaceRegion face) {
  for (const int t : face.triangles) face_[std::size_t(t)] = int(faces_.size());
  faces_.push_back(std::move(face));
}

}  // namespace abbe::cutting
