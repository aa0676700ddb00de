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
struct TrianglesAt {
  std::vector<int> first, triangles;
  explicit TrianglesAt(const Design& design) : first(std::size_t(design.vertices.rows()) + 1, 0) {
    for (const auto& t : design.triangles.rowwise())
      for (const int v : t) ++first[std::size_t(v) + 1];
    for (std::size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1];
    triangles.resize(std::size_t(first.back()));
    std::vector<int> next = first;
    for (int t = 0; t < int(design.triangles.rows()); ++t)
      for (const int v : design.triangles.row(t))
        triangles[std::size_t(next[std::size_t(v)]++)] = t;
  }
  std::span<const int> at(int v) const {
    const auto begin = std::size_t(first[std::size_t(v)]);
    return {triangles.data() + begin, std::size_t(first[std::size_t(v) + 1]) - begin};
  }
};

/// Returns true if the triangles around a vertex are all open and enclose it.
bool is_within(const FaceGrowth& growth, const TrianglesAt& around, int v) {
  for (const int t : around.at(v)) {
    if (!growth.is_open(t)) return false;
    for (int k = 0; k < 3; ++k)
      if (growth.design().triangles(t, (k + 2) % 3) != v && growth.open_across(t, k) < 0)
        return false;
  }
  return !around.at(v).empty();
}

/// Returns the triangles at a vertex and at its neighbours; nothing if one of these is not enclosed
/// by open triangles.
std::vector<int> two_rings(const FaceGrowth& growth, const TrianglesAt& around, int v) {
  std::vector<int> triangles;
  for (const int t : around.at(v))
    for (const int next : growth.design().triangles.row(t)) {
      if (!is_within(growth, around, next)) return {};
      const std::span<const int> more = around.at(next);
      triangles.insert(triangles.end(), more.begin(), more.end());
    }
  return sorted_unique(std::move(triangles));
}

/// Returns the largest angle between the first facet and the others, rad.
double bend_of(const FaceGrowth& growth, std::span<const int> triangles) {
  double least = 1.0;
  for (const int t : triangles)
    least = std::min(least, growth.normal(t).dot(growth.normal(triangles.front())));
  return std::acos(std::clamp(least, -1.0, 1.0));
}

/// Grows the surfaces that fit around a vertex, simple ones first.
class VertexSeeds {
 public:
  VertexSeeds(FaceGrowth& growth)
      : growth_(growth),
        around_(growth.design()),
        tried_(std::size_t(growth.design().vertices.rows()), 0) {}

  void try_all() {
    for (int v = 0; v < int(tried_.size()) && !growth_.is_budget_exhausted(); ++v) {
      if (tried_[std::size_t(v)] || !is_within(growth_, around_, v)) continue;
      const std::span<const int> ring = around_.at(v);
      if (bend_of(growth_, ring) < flat) continue;
      if (is_round(v) && try_forms(std::array{Form::Sphere}, {ring.begin(), ring.end()})) continue;
      const std::vector<int> triangles = two_rings(growth_, around_, v);
      if (triangles.empty() ||
          try_forms(std::array{Form::Cylinder, Form::Cone, Form::Torus}, triangles))
        continue;
      // In finely meshed regions a face contains so many vertices that not all of them need be
      // tried.
      if (bend_of(growth_, triangles) < fine)
        for (const int t : triangles)
          for (const int near : growth_.design().triangles.row(t)) give_up_around(near);
    }
  }

 private:
  // 0.5 deg: below it the facets around a vertex are one flat
  static constexpr double flat = 0.5 * std::numbers::pi / 180.0,
                          fine = 0.2;  // rad, turn over two rings of facets

  /// A region that has grown without being a face would grow again from its other vertices, so
  /// these are skipped.
  bool try_forms(std::span<const Form> forms, std::vector<int> triangles) {
    constexpr std::size_t much = 4;
    const std::size_t began = triangles.size();
    const FaceGrowth::Tried tried = growth_.grow(forms, growth_.region(std::move(triangles)));
    if (tried.reached.size() > much * began)
      for (const int t : tried.reached)
        for (const int v : growth_.design().triangles.row(t)) tried_[std::size_t(v)] = 1;
    return tried.is_accepted;
  }

  void give_up_around(int v) {
    for (const int t : around_.at(v))
      for (const int next : growth_.design().triangles.row(t)) tried_[std::size_t(next)] = 1;
  }

  /// Returns true if a vertex and its neighbours lie on a common sphere to within 3 tolerances. On
  /// a free form hardly any do, so this saves most of the fits.
  bool is_round(int v) const {
    constexpr double near = 3.0;  // tolerances
    const Points& all = growth_.design().vertices;
    std::vector<Vector3d> from;
    Matrix3d squares = Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    for (const int t : around_.at(v))
      for (const int next : growth_.design().triangles.row(t)) {
        if (next == v) continue;
        from.push_back(all.row(next) - all.row(v));
        squares += from.back() * from.back().transpose();
        right += 0.5 * from.back().squaredNorm() * from.back();
      }
    const Vector3d centre = squares.ldlt().solve(right);
    const double radius = centre.norm();
    return std::all_of(from.begin(), from.end(), [&](const Vector3d& p) {
      return std::abs((p - centre).norm() - radius) < near * growth_.tolerance();
    });
  }

  FaceGrowth& growth_;
  TrianglesAt around_;
  std::vector<char> tried_;
};

/// A line along a strip, given by two points.
struct StripLine {
  Vector3d from, to;
  Vector3d direction() const { return (to - from).normalized(); }
  double length() const { return (to - from).norm(); }
};

/// Two adjacent strips: the line at which they meet, and the opposite side of each.
struct Fold {
  StripLine first, middle, last;
};

/// Returns the two points of a set that are farthest apart along a line; nothing for fewer than
/// two.
std::optional<StripLine> line_of(const std::vector<Vector3d>& points) {
  if (points.size() < 2) return std::nullopt;
  const auto farthest_from = [&](const Vector3d& p) {
    return *std::max_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
      return (a - p).squaredNorm() < (b - p).squaredNorm();
    });
  };
  const Vector3d end = farthest_from(points.front());
  return StripLine{farthest_from(end), end};
}

/// Returns the sides of a flat along a line and opposite to it.
std::optional<std::pair<StripLine, StripLine>> sides_of_strip(const FaceGrowth& growth, int flat,
                                                              const StripLine& fold) {
  constexpr double most = 0.1;  // of the height: points within this of the line belong to its side
  std::vector<Vector3d> points;
  std::vector<double> height;
  for (const int t : growth.flats()[std::size_t(flat)])
    for (const int v : growth.design().triangles.row(t)) {
      points.push_back(growth.design().vertices.row(v));
      height.push_back((points.back() - fold.from).cross(fold.direction()).norm());
    }
  const double highest = *std::max_element(height.begin(), height.end());
  std::vector<Vector3d> here, there;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (height[i] <= most * highest) here.push_back(points[i]);
    if (height[i] > most * highest) there.push_back(points[i]);
  }
  const auto first = line_of(here), last = line_of(there);
  if (!first || !last || !(last->length() > 0.0)) return std::nullopt;
  return std::pair(*first, *last);
}

/// Returns the line in the direction of another line.
StripLine along(StripLine line, const StripLine& other) {
  if (line.direction().dot(other.direction()) < 0.0) std::swap(line.from, line.to);
  return line;
}

/// Returns the cylinder through three parallel lines.
std::optional<AnalyticPatch> cylinder_through(const Fold& fold) {
  const Vector3d axis = (fold.first.to - fold.first.from + fold.middle.to - fold.middle.from +
                         fold.last.to - fold.last.from)
                            .normalized();
  const auto flat = [&](const Vector3d& p) -> Vector3d { return p - axis * axis.dot(p); };
  const Vector3d a = flat(fold.first.from - fold.middle.from),
                 b = flat(fold.last.from - fold.middle.from), across = a.cross(b);
  if (!(across.squaredNorm() > 0.0)) return std::nullopt;
  const Vector3d centre =
      (a.squaredNorm() * b - b.squaredNorm() * a).cross(across) / (2.0 * across.squaredNorm());
  AnalyticPatch surface;
  surface.form = Form::Cylinder;
  surface.frame = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
  surface.origin = fold.middle.from + centre;
  surface.shape = Eigen::VectorXd::Constant(1, centre.norm());
  return surface;
}

/// Returns the cone through three lines that meet at its apex.
std::optional<AnalyticPatch> cone_through(const Fold& fold) {
  const std::array<StripLine, 3> lines = {fold.first, fold.middle, fold.last};
  Matrix3d across = Matrix3d::Zero();
  Vector3d moved = Vector3d::Zero(), middle = Vector3d::Zero();
  for (const StripLine& line : lines) {
    const Vector3d u = line.direction(), from = line.from - fold.middle.from;
    const Matrix3d off = Matrix3d::Identity() - u * u.transpose();
    across += off;
    moved += off * from;
    middle += (from + 0.5 * (line.to - line.from)) / 3.0;
  }
  const Vector3d apex = across.ldlt().solve(moved);
  Vector3d axis = (lines[0].direction() - lines[1].direction())
                      .cross(lines[2].direction() - lines[1].direction())
                      .normalized();
  if (axis.dot(middle - apex) < 0.0) axis = -axis;
  // 1e-3: the lines are almost in a plane across the axis, which is no cone
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
std::optional<AnalyticPatch> through_strips(const FaceGrowth& growth, int t, int side) {
  const Design& design = growth.design();
  const int other = growth.open_across(t, side);
  const StripLine edge{design.vertices.row(design.triangles(t, side)),
                       design.vertices.row(design.triangles(t, (side + 1) % 3))};
  const auto one = sides_of_strip(growth, growth.flat_of(t), edge);
  const auto next = sides_of_strip(growth, growth.flat_of(other), edge);
  if (!one || !next || !(one->first.length() > 0.0)) return std::nullopt;
  const Fold fold{along(one->second, edge), along(one->first, edge), along(next->second, edge)};
  const double least = std::min({fold.first.length(), fold.middle.length(), fold.last.length()});
  // rounding of the vertices tilts the lines by their tolerance over the length
  const double parallel = 1e-3 + 4.0 * growth.tolerance() / least;
  const Vector3d u = fold.middle.direction();
  const bool is_cylinder = fold.first.direction().cross(u).norm() < parallel &&
                           fold.last.direction().cross(u).norm() < parallel;
  std::optional<AnalyticPatch> surface = is_cylinder ? cylinder_through(fold) : cone_through(fold);
  if (!surface) return surface;
  const Vector3d n = outward(*surface, 0.5 * (edge.from + edge.to));
  surface->sign = n.dot(growth.normal(t) + growth.normal(other)) > 0.0 ? 1.0 : -1.0;
  return surface;
}

/// Grows cylinders and cones from adjacent strips. @return true if any face was found
bool grow_from_strips(FaceGrowth& growth) {
  bool any = false;
  constexpr std::size_t largest = 512;  // triangles of two strips; larger flats are no strips
  std::set<std::pair<int, int>> met;
  std::vector<char> tried(growth.flats().size(), 0);
  for (int t = 0; t < int(growth.design().triangles.rows()) && !growth.is_budget_exhausted(); ++t)
    for (int side = 0; side < 3 && growth.is_open(t); ++side) {
      const int other = growth.open_across(t, side);
      if (other < 0) continue;
      const int a = growth.flat_of(t), b = growth.flat_of(other);
      const std::size_t in_a = growth.flats()[std::size_t(a)].size(),
                        in_b = growth.flats()[std::size_t(b)].size();
      if (a >= b || in_a < 2 || in_b < 2 || in_a + in_b > largest ||
          (tried[std::size_t(a)] && tried[std::size_t(b)]) || !met.emplace(a, b).second)
        continue;
      const std::optional<AnalyticPatch> surface = through_strips(growth, t, side);
      if (!surface) continue;
      std::vector<int> seed = growth.flats()[std::size_t(a)];
      seed.insert(seed.end(), growth.flats()[std::size_t(b)].begin(),
                  growth.flats()[std::size_t(b)].end());
      if (!std::all_of(seed.begin(), seed.end(), [&](int one) { return growth.is_open(one); }))
        continue;
      const std::size_t began = seed.size();
      FaceGrowth::RegionGrowth grown = growth.grown(*surface, growth.region(std::move(seed)));
      if (grown.is_face) {
        growth.take(std::move(grown.face));
        any = true;
      } else if (grown.reached.size() > began) {
        for (const int one : grown.reached) tried[std::size_t(growth.flat_of(one))] = 1;
      }
    }
  return any;
}

}  // namespace

FaceRegions grow_face_regions(const Design& design, const std::vector<char>& open,
                              double tolerance) {
  constexpr int passes = 3;
  // Planes that are evident by themselves come first: they bound the curved faces between them.
  // Planes that are only tangent to curved faces come last, since these must be known.
  FaceGrowth growth(design, open, tolerance);
  const int flats = int(growth.flats().size());
  for (int flat = 0; flat < flats; ++flat)
    if (auto plane = growth.evident_plane(flat)) growth.take(std::move(*plane));
  VertexSeeds(growth).try_all();
  // A region that ended at a face not yet known may be a face now.
  for (int pass = 0; pass < passes && grow_from_strips(growth); ++pass) {
  }
  for (int flat = 0; flat < flats; ++flat)
    if (auto plane = growth.tangent_plane(flat)) growth.take(std::move(*plane));
  const int unexamined_triangles = growth.is_budget_exhausted() ? growth.open_triangles() : 0;
  return {std::move(growth).faces(), unexamined_triangles};
}

namespace {

using Eigen::Index;

constexpr double min_lean = 0.866;  // cos 30 degrees, lean of a facet along its surface
constexpr double min_waste = 1e6, waste_a_triangle = 30.0, fit_work = 50.0;  // triangles
constexpr double growing_reach = 3.0;  // tolerances, while a surface is fitted to only a few facets

}  // namespace

FaceGrowth::FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance)
    : design_(design),
      tolerance_(tolerance),
      across_(neighbours(design.triangles)),
      normals_(design.triangles.rows(), 3),
      height_(design.triangles.rows()),
      face_(open.size(), closed),
      flat_(open.size(), none),
      stamp_(open.size(), 0),
      vertex_stamp_(std::size_t(design.vertices.rows()), 0),
      waste_(min_waste + waste_a_triangle * double(open.size())) {
  for (Index t = 0; t < design.triangles.rows(); ++t) {
    if (open[std::size_t(t)]) face_[std::size_t(t)] = none;
    const auto corner = [&](int k) { return vertex(design.triangles(t, k)); };
    const Vector3d cross = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    double longest = 0.0;
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (corner((k + 1) % 3) - corner(k)).norm());
    normals_.row(t) = cross.normalized();
    height_[t] = longest > 0.0 ? cross.norm() / longest : 0.0;
  }
  find_flats(open);
}

int FaceGrowth::open_across(int t, int side) const {
  const int other = across_[std::size_t(t)][std::size_t(side)];
  return other >= 0 && is_open(other) ? other : -1;
}

void FaceGrowth::stamp(const Region& region) {
  ++stamped_;
  for (const int t : region.triangles) stamp_[std::size_t(t)] = stamped_;
  for (const int v : region.vertices) vertex_stamp_[std::size_t(v)] = stamped_;
}

/// Adds those corners of a triangle that the region, which was stamped last, does not contain.
void FaceGrowth::add_corners(Region& region, int t) {
  for (const int v : design_.triangles.row(t)) {
    int& last = vertex_stamp_[std::size_t(v)];
    if (last != stamped_) region.vertices.push_back(v);
    last = stamped_;
  }
}

FaceGrowth::Region FaceGrowth::region(std::vector<int> triangles) {
  Region made{std::move(triangles), {}};
  ++stamped_;
  for (const int t : made.triangles) add_corners(made, t);
  return made;
}

/// Returns true if a facet lies along the surface, with the same outward side. If the normals of
/// the surface hardly turn between its corners, the facet must be parallel to the tangent plane
/// there, which excludes the floor beside the torus around it. The normal of a sliver is not
/// tested.
bool FaceGrowth::lies_on(const AnalyticPatch& surface, int t, double reach) const {
  constexpr double times = 2.0;  // obtuse triangles lean by more than half the turn
  Vector3d centre = Vector3d::Zero();
  for (const int v : design_.triangles.row(t)) {
    if (!(std::abs(distance_of(surface, vertex(v))) <= reach)) return false;
    centre += vertex(v) / 3.0;
  }
  if (height_[t] < sliver * tolerance_) return true;
  const double cosine = surface.sign * outward(surface, centre).dot(normals_.row(t));
  if (!(cosine > min_lean)) return false;
  // the normal of a facet is uncertain by the deviation of its corners over its height
  double most = 2.0 * reach / height_[t];
  if (cosine > 1.0 - 0.5 * most * most) return true;
  const Vector3d first = outward(surface, vertex(design_.triangles(t, 0)));
  for (const int k : {1, 2})
    most = std::max(most,
                    2.0 * reach / height_[t] +
                        times * (outward(surface, vertex(design_.triangles(t, k))) - first).norm());
  return cosine > 1.0 - 0.5 * most * most;
}

/// Returns the region with the triangles around it that lie on the surface and are permitted, at
/// most doubled, so that the surface is refitted before an error of the fit can spread.
FaceGrowth::Region FaceGrowth::spread(const AnalyticPatch& surface, Region region, double reach,
                                      const May& may) {
  constexpr std::size_t few = 16;
  stamp(region);
  const std::size_t most = region.triangles.size() + std::max(few, region.triangles.size());
  for (std::size_t i = 0; i < region.triangles.size() && region.triangles.size() < most; ++i)
    for (const int next : across_[std::size_t(region.triangles[i])]) {
      if (next < 0 || stamp_[std::size_t(next)] == stamped_ || !may(next) ||
          !lies_on(surface, next, reach))
        continue;
      stamp_[std::size_t(next)] = stamped_;
      region.triangles.push_back(next);
      add_corners(region, next);
    }
  return region;
}

// Three iterations solve a plane to rounding; the other forms start near their solution and need at
// most eight.
AnalyticPatch FaceGrowth::refitted(const AnalyticPatch& surface, const Region& region) const {
  const int rounds = surface.form == Form::Plane ? 3 : 8;
  const FacetPatch patch = facet_patch(design_, region.vertices, {});
  return from_patch_coordinates(patch,
                                adjusted(to_patch_coordinates(patch, surface), patch, rounds));
}

void FaceGrowth::find_flats(const std::vector<char>& open) {
  constexpr std::size_t few = 8;  // triangles; up to this number the plane of the largest is
                                  // accurate enough
  std::vector<int> order;
  for (int t = 0; t < int(open.size()); ++t)
    if (open[std::size_t(t)]) order.push_back(t);
  // the largest triangles first, since their normals are the most accurate
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return height_[a] > height_[b]; });
  const May may = [&](int t) { return is_open(t) && flat_[std::size_t(t)] == none; };
  for (const int seed : order) {
    if (flat_[std::size_t(seed)] != none) continue;
    AnalyticPatch plane;
    plane.frame.col(2) = normals_.row(seed);
    plane.frame.col(0) = plane.frame.col(2).unitOrthogonal();
    plane.frame.col(1) = plane.frame.col(2).cross(plane.frame.col(0));
    plane.origin = vertex(design_.triangles(seed, 0));
    Region flat = region({seed});
    for (std::size_t before = 0; before < flat.triangles.size();) {
      before = flat.triangles.size();
      flat = spread(plane, std::move(flat), tolerance_, may);
      if (flat.triangles.size() > few) plane = refitted(plane, flat);
    }
    for (const int t : flat.triangles) flat_[std::size_t(t)] = int(flats_.size());
    flats_.push_back(std::move(flat.triangles));
  }
}

/// Returns the least-squares surface near one in the coordinates of a patch, in mm; nothing if a
/// vertex is farther than the tolerance.
std::optional<AnalyticPatch> FaceGrowth::fitted(const FacetPatch& patch,
                                                const AnalyticPatch& near) const {
  struct Stage {
    int rounds;
    double within;  // tolerances; beyond it the fit is abandoned
  };
  AnalyticPatch local = near;
  for (const auto& [rounds, within] : {Stage{3, 30.0}, {3, 3.0}, {6, 1.0}}) {
    local = adjusted(local, patch, rounds);
    if (!(farthest(patch, local) <= within * tolerance_)) return std::nullopt;
  }
  AnalyticPatch surface = from_patch_coordinates(patch, local);
  const Vector3d centre = patch.middle + patch.size * patch.centres.row(0).transpose();
  surface.sign = outward(surface, centre).dot(patch.normals.row(0)) > 0.0 ? 1.0 : -1.0;
  return surface;
}

FaceGrowth::Tried FaceGrowth::grow(std::span<const Form> forms, const Region& region) {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  std::optional<AnalyticPatch> axis;
  Tried tried;
  for (const Form form : forms) {
    const bool is_turned = form != Form::Plane && form != Form::Sphere;
    if (is_turned && !axis) axis = revolution_from_normals(patch);
    const auto surface = fitted(patch, first_guess(form, patch, axis.value_or(AnalyticPatch{})));
    if (!surface) continue;
    RegionGrowth found = grown(*surface, region);
    if (found.is_face) {
      take(std::move(found.face));
      return {true, {}};
    }
    if (found.reached.size() > tried.reached.size()) tried.reached = std::move(found.reached);
  }
  return tried;
}

FaceGrowth::RegionGrowth FaceGrowth::grown(AnalyticPatch surface, Region region) {
  const May may = [&](int t) { return is_open(t); };
  double work = 0.0;
  for (std::size_t before = 0; before < region.triangles.size();) {
    before = region.triangles.size();
    region = spread(surface, std::move(region), growing_reach * tolerance_, may);
    if (region.triangles.size() > before) surface = refitted(surface, region);
    work += fit_work + double(region.triangles.size() + region.vertices.size());
  }
  // Triangles that were added before the surface was well known may not lie on it.
  std::vector<int> reached = region.triangles;
  std::erase_if(region.triangles, [&](int t) { return !lies_on(surface, t, tolerance_); });
  // a region of which half is lost was on another surface
  bool found = 2 * region.triangles.size() >= reached.size();
  if (found) {
    region = this->region(std::move(region.triangles));
    surface = with_sizes(refitted(surface, region), region);
    found = is_face(surface, region);
  }
  if (!found) wasted_ += work;
  return {{surface, std::move(region.triangles)}, found, std::move(reached)};
}

/// Returns the surface with the bounding box of a region and the distance of its farthest vertex.
AnalyticPatch FaceGrowth::with_sizes(AnalyticPatch surface, const Region& region) const {
  surface.off = 0.0;
  for (const int v : region.vertices) {
    surface.box.extend(vertex(v));
    surface.off = std::max(surface.off, std::abs(distance_of(surface, vertex(v))));
  }
  return surface;
}

/// Returns the vertex of a triangle that is not on one of its sides.
int FaceGrowth::beyond(int t, int a, int b) const {
  int found = none;
  for (const int v : design_.triangles.row(t))
    if (v != a && v != b) found = v;
  return found;
}

/// Returns the distance of a vertex from the line through two others, mm.
double FaceGrowth::height_over(int a, int b, int beyond) const {
  const Vector3d side = vertex(b) - vertex(a);
  return side.cross(vertex(beyond) - vertex(a)).norm() / side.norm();
}

std::vector<FaceGrowth::Border> FaceGrowth::borders(const Region& region) {
  stamp(region);
  std::vector<Border> all;
  for (const int t : region.triangles)
    for (int k = 0; k < 3; ++k) {
      const int outside = across_[std::size_t(t)][std::size_t(k)];
      if (outside < 0 || stamp_[std::size_t(outside)] == stamped_) continue;
      Border one{t, outside, design_.triangles(t, k), design_.triangles(t, (k + 1) % 3), -1, 0.0};
      one.beyond = beyond(outside, one.a, one.b);
      one.height = height_over(one.a, one.b, one.beyond);
      all.push_back(one);
    }
  return all;
}

void FaceGrowth::take(FaceRegion face) {
  for (const int t : face.triangles) face_[std::size_t(t)] = int(faces_.size());
  faces_.push_back(std::move(face));
}

}  // namespace abbe::cutting
