#include "cutting/part/recognition.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/part/face_growth.h"
#include "cutting/part/remeshing.h"
#include "kinematics/bad_input.h"
#include "kinematics/pose.h"

namespace abbe::cutting {

namespace {

using Eigen::Index;
using Eigen::Vector3d;

/// The face of each triangle of a mesh, -1 for none, and the faces.
struct Sorted {
  std::vector<int> face;  // (triangles)
  std::vector<AnalyticPatch> faces;
  int unexamined_triangles = 0;  // triangles
};

/// Returns the patches that lie on one surface as a whole.
std::vector<FaceRegion> whole_patches(const Design& design, double tolerance) {
  const std::vector<int> number = patches(design);
  const int count = number.empty() ? 0 : 1 + *std::max_element(number.begin(), number.end());
  std::vector<std::vector<int>> vertices(std::size_t(count), std::vector<int>{});
  std::vector<std::vector<int>> triangles(std::size_t(count), std::vector<int>{});
  for (std::size_t i = 0; i < number.size(); ++i)
    vertices[std::size_t(number[i])].push_back(int(i));
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    triangles[std::size_t(number[std::size_t(design.triangles(t, 0))])].push_back(t);
  std::vector<FaceRegion> found;
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    if (triangles[k].empty()) continue;
    FacetPatch patch = facet_patch(design, std::move(vertices[k]), std::move(triangles[k]));
    if (const auto surface = surface_of(patch, tolerance))
      found.push_back({*surface, std::move(patch.triangles)});
  }
  return found;
}

Sorted sorted(const Design& design, double tolerance) {
  std::vector<FaceRegion> all = whole_patches(design, tolerance);
  std::vector<char> open(std::size_t(design.triangles.rows()), 1);
  for (const FaceRegion& one : all)
    for (const int t : one.triangles) open[std::size_t(t)] = 0;
  FaceRegions grown = grow_face_regions(design, open, tolerance);
  for (FaceRegion& one : grown.faces) all.push_back(std::move(one));
  Sorted by_face{std::vector<int>(open.size(), -1), {}, grown.unexamined_triangles};
  for (FaceRegion& one : all) {
    for (const int t : one.triangles) by_face.face[std::size_t(t)] = int(by_face.faces.size());
    by_face.faces.push_back(std::move(one.surface));
  }
  return by_face;
}

/// Returns (n) the largest angle at each vertex between adjacent facets on no face: those at it,
/// and those beside them, which are the other halves of quadrangles.
Eigen::VectorXd max_facet_turns(const Design& design) {
  const auto normal = [&](int t) {
    const auto corner = [&](int k) -> Vector3d {
      return design.vertices.row(design.triangles(t, k));
    };
    return (corner(1) - corner(0)).cross(corner(2) - corner(0)).eval();
  };
  const auto count = int(design.triangles.rows());
  const std::vector<std::array<int, 3>> across = neighbours(design.triangles);
  Eigen::VectorXd of_triangle = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd turn = Eigen::VectorXd::Zero(design.vertices.rows());
  const auto is_none = [&](int t) { return design.face[std::size_t(design.triangles(t, 0))] < 0; };
  for (int t = 0; t < count; ++t)
    for (const int next : across[std::size_t(t)])
      if (next >= 0 && is_none(t))
        of_triangle[t] =
            std::max(of_triangle[t], kinematics::angle_between(normal(t), normal(next)));
  for (int t = 0; t < count; ++t) {
    if (!is_none(t)) continue;
    double here = of_triangle[t];
    for (const int next : across[std::size_t(t)])
      if (next >= 0) here = std::max(here, of_triangle[next]);
    for (const int v : design.triangles.row(t)) turn[v] = std::max(turn[v], here);
  }
  return turn;
}

/// Assigns the normal of a face to vertices on no face where the facets run into it tangentially:
/// where they lean against it by about half of the angle between them, as chords of a curve lean
/// against its tangent.
void adopt_face_normals(Design& design, const std::vector<AnalyticPatch>& faces) {
  // between half of the angle, for a tangent, and all of it, for an edge
  constexpr double half = 0.75;
  const Eigen::VectorXd turn = max_facet_turns(design);
  std::vector<std::vector<int>> at(std::size_t(design.vertices.rows()));  // vertices at one point
  for (const auto& [first, added] : design.seams) {
    if (at[std::size_t(first)].empty()) at[std::size_t(first)].push_back(first);
    at[std::size_t(first)].push_back(added);
  }
  for (const std::vector<int>& together : at)
    for (const int v : together) {
      if (design.face[std::size_t(v)] >= 0) continue;
      const Vector3d own = design.normals.row(v);
      double least = half * turn[v];
      for (const int other : together) {
        const int face = design.face[std::size_t(other)];
        if (face < 0) continue;
        const Vector3d there = dropped(faces[std::size_t(face)], design.vertices.row(v)).normal;
        if (!(kinematics::angle_between(own, there) < least)) continue;
        least = kinematics::angle_between(own, there);
        design.normals.row(v) = there;
      }
    }
}

}  // namespace

Recognised recognised(const Design& design, double tolerance) {
  require(std::isfinite(tolerance) && tolerance > 0.0, "recognised: tolerance must be positive");
  Sorted by_face = sorted(design, tolerance);
  Recognised found{design, std::move(by_face.faces), design.area.sum(),
                   by_face.unexamined_triangles};
  if (found.patches.empty()) return found;
  found.design = split_at_faces(design, by_face.face);
  Design& made = found.design;
  adopt_face_normals(made, found.patches);
  for (Index i = 0; i < made.vertices.rows(); ++i) {
    const int face = made.face[std::size_t(i)];
    if (face < 0) continue;
    found.patches[std::size_t(face)].area += made.area[i];
    const Contact at = dropped(found.patches[std::size_t(face)], made.vertices.row(i));
    made.vertices.row(i) = at.point;
    made.normals.row(i) = at.normal;
  }
  made.facet_error = facet_error(made.vertices, made.normals, made.triangles);
  for (Index i = 0; i < made.facet_error.size(); ++i)
    if (made.face[std::size_t(i)] >= 0) made.facet_error[i] = 0.0;
  made.area = vertex_area(made.vertices, made.triangles);
  return found;
}

SurfaceInterpolator patch_interpolator(const std::vector<AnalyticPatch>& patches,
                                       const Eigen::Isometry3d& T) {
  return [patches, T, back = T.inverse()](std::span<const Contact> corners,
                                          std::span<const double> weights) {
    const int face = corners.front().face;
    if (face < 0 || !std::all_of(corners.begin(), corners.end(),
                                 [&](const Contact& one) { return one.face == face; }))
      return smooth_facet_point(corners, weights);
    Vector3d flat = Vector3d::Zero();
    for (std::size_t i = 0; i < corners.size(); ++i) flat += weights[i] * corners[i].point;
    const Contact found = dropped(patches[std::size_t(face)], back * flat);
    return Contact{T * found.point, T.linear() * found.normal, face};
  };
}

namespace {

using kinematics::angle_between;

constexpr double tangent_angle = 2e-3;  // rad

/// A vote that passes if all but a few agree; it passes without votes.
struct Votes {
  int yes = 0, all = 0;
  void add(bool vote) {
    yes += vote;
    ++all;
  }
  bool nearly_all() const { return yes >= 0.9 * all; }
  bool most() const { return 2 * yes > all; }
};

/// Returns the angle between two normals about a line.
double turn_about(const Vector3d& line, const Vector3d& one, const Vector3d& other) {
  return std::atan2(std::abs(one.cross(other).dot(line.normalized())), one.dot(other));
}

/// Returns true if a point lies on a line to within a distance.
bool is_on(const Vector3d& p, const Vector3d& a, const Vector3d& b, double within) {
  const Vector3d along = b - a;
  return (p - a).cross(along).norm() <= within * along.norm();
}

/// Returns the points that lie off a line.
std::vector<Vector3d> off_line(const std::vector<Vector3d>& points, const Vector3d& a,
                               const Vector3d& b, double within) {
  std::vector<Vector3d> off;
  for (const Vector3d& p : points)
    if (!is_on(p, a, b, within)) off.push_back(p);
  return off;
}

/// Returns true if all but one of the points lie on two lines. Of any five such points three lie on
/// one line, so six sample points suffice to find it.
bool are_on_two_lines(const std::vector<Vector3d>& points, double within) {
  const std::size_t n = points.size();
  if (n < 6) return true;
  const auto few = [&](std::size_t i) { return points[i * (n - 1) / 5]; };
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i + 1; j < 6; ++j)
      for (std::size_t k = j + 1; k < 6; ++k) {
        if (!is_on(few(k), few(i), few(j), within)) continue;
        const std::vector<Vector3d> off = off_line(points, few(i), few(j), within);
        if (off.size() < 3) return true;
        const auto far =
            std::max_element(off.begin(), off.end(), [&](const auto& a, const auto& b) {
              return (a - off[0]).norm() < (b - off[0]).norm();
            });
        if (off_line(off, off[0], *far, within).size() < 2) return true;
      }
  return false;
}

/// Returns true if the vertices lie nearer to a surface than they would by chance, with a
/// probability of 1e-9, if they were distributed anywhere within their deviation from a plane: each
/// free vertex contributes the ratio of the two deviations as a factor. Rejects what noise makes of
/// a few vertices.
bool is_significant(const AnalyticPatch& local, const FacetPatch& patch, double tolerance,
                    int tangents) {
  // 0.3: with any number of vertices a surface must fit clearly better than a plane
  constexpr double decades = 9.0, most = 0.3;
  const double free = double(patch.points.rows() - numbers_of(local.form) + 2 * tangents);
  const double bent = farthest(patch, first_guess(Form::Plane, patch));
  const double off = std::min(farthest(patch, local), tolerance);
  return free > 0.0 && off <= bent * std::min(most, std::pow(10.0, -decades / free));
}

/// Returns by what factor the vertices next to a region depart from the best-fitting surface of a
/// free form more than its own vertices do, if n lines of vertices are fitted: a polynomial of
/// degree 4 that is at most 1 at all of them reaches this value at the next.
double extrapolation_bound(const AnalyticPatch& local, const FacetPatch& patch) {
  const bool by_lines = local.form == Form::Cylinder || local.form == Form::Cone;
  const auto are_at_least = [&](int n) {
    return by_lines ? has_lines(local, patch, n) : patch.points.rows() >= n * n;
  };
  for (const auto& [lines, times] : {std::pair(13, 5.0), {9, 8.0}, {7, 12.0}})
    if (are_at_least(lines)) return times;
  return 24.0;
}

}  // namespace

/// Returns true if facets of the region that was stamped last turn enough for their surface to
/// matter.
bool FaceGrowth::bends(const Region& region) const {
  // 0.5 deg, the least turn that distinguishes a curved face from a flat
  constexpr double least = 0.5 * std::numbers::pi / 180.0;
  for (const int t : region.triangles)
    for (const int next : across_[std::size_t(t)])
      if (next > t && stamp_[std::size_t(next)] == stamped_ &&
          std::min(height_[t], height_[next]) > sliver * tolerance_ &&
          angle_between(normals_.row(t), normals_.row(next)) > least)
        return true;
  return false;
}

/// Returns true if a region that grows no further is a face.
bool FaceGrowth::is_face(const AnalyticPatch& surface, const Region& region) {
  if (!(surface.off <= tolerance_)) return false;
  for (const int t : region.triangles)
    if (!lies_on(surface, t, tolerance_)) return false;
  const std::vector<Border> around = borders(region);
  if (!bends(region)) return false;
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  const AnalyticPatch local = to_patch_coordinates(patch, surface);
  const int tangents = tangent_lines(surface, around);
  const Index enough = tangents > 0 ? 6 : 2 * numbers_of(surface.form);
  return patch.points.rows() >= enough && is_significant(local, patch, tolerance_, tangents) &&
         is_determined(local, patch, tangents) &&
         (surface.form != Form::Torus || has_lines(local, patch, 5)) &&
         ends_clearly(surface, patch, around) && !is_sector(surface, region, around);
}

/// Returns true if the facets around a region depart from its surface as those of another surface
/// do, separately at the borders around its axis and along it. A surface whose curvature differs by
/// c departs by c h^2 / 2 after a height h, and by about h if c h is large.
bool FaceGrowth::ends_clearly(const AnalyticPatch& surface, const FacetPatch& patch,
                              const std::vector<Border>& borders) const {
  // 0.3 and 2.5 as stated in the header; 1e-3 of the height of a facet is the step of a difference
  constexpr double share = 0.3, little = 1e-3, straight = 2.5;
  const bool is_turned = surface.form != Form::Sphere;
  const bool is_straight = surface.form == Form::Cylinder || surface.form == Form::Cone;
  const double bent = extrapolation_bound(to_patch_coordinates(patch, surface), patch);
  const std::array<double, 2> times_own = {bent, is_straight ? straight : bent};
  std::array<Votes, 2> votes;
  for (const Border& one : borders) {
    if (!is_open(one.outside) || one.height < sliver * tolerance_) continue;
    const Vector3d middle = 0.5 * (vertex(one.a) + vertex(one.b));
    const Vector3d side = (vertex(one.b) - vertex(one.a)).normalized();
    const Vector3d n = outward(surface, middle);
    const Vector3d step = little * one.height * side.cross(n).normalized();
    const double curvature = (outward(surface, middle + step) - n).norm() / step.norm();
    const double leaves = std::abs(distance_of(surface, vertex(one.beyond)));
    const Vector3d around = surface.frame.col(2).cross(middle - surface.origin).normalized();
    const bool is_around = is_turned && std::abs(side.dot(around)) > std::sqrt(0.5);
    votes[is_around].add(
        leaves > std::max({tolerance_, times_own[is_around] * surface.off,
                           0.5 * share * std::min(1.0, curvature * one.height) * one.height}));
  }
  return votes[0].nearly_all() && votes[1].nearly_all();
}

/// Returns true if the facet across a border runs into the surface without an edge, as a plane
/// does. If the surface itself continued, its next facet would lean by half of the angle by which
/// it turns over one facet.
bool FaceGrowth::is_tangent(const AnalyticPatch& surface, const Border& border) const {
  // of the turn over the inner facet: far below the half that a continuing surface would show
  constexpr double share = 0.1;
  const double unsure = tolerance_ / height_[border.outside];
  if (unsure > tangent_angle) return false;
  const auto normal_at = [&](int v) -> Vector3d {
    return surface.sign * outward(surface, vertex(v));
  };
  double turn = 0.0;
  for (const int v : design_.triangles.row(border.inside))
    turn = std::max(turn, angle_between(normal_at(border.a), normal_at(v)));
  const double most = std::min(tangent_angle + unsure, share * turn);
  for (const int end : {border.a, border.b})
    if (angle_between(normal_at(end), normals_.row(border.outside)) > most) return false;
  return true;
}

/// Returns the number of lines at which a cylinder or cone continues in tangent planes. The planes
/// must be at least as wide as two of its own facets, because on a scan a single facet may lean as
/// little by chance.
int FaceGrowth::tangent_lines(const AnalyticPatch& surface,
                              const std::vector<Border>& borders) const {
  if (surface.form != Form::Cylinder && surface.form != Form::Cone) return 0;
  // normals that differ by less than 1e-3 belong to the same line
  constexpr double apart = 1e-3, facets = 2.0;
  std::vector<Vector3d> lines;
  for (const Border& one : borders) {
    const double own = height_over(one.a, one.b, beyond(one.inside, one.a, one.b));
    if (one.height < facets * own || !is_tangent(surface, one)) continue;
    const Vector3d n = outward(surface, vertex(one.a));
    if (std::none_of(lines.begin(), lines.end(),
                     [&](const Vector3d& line) { return (line - n).norm() < apart; }))
      lines.push_back(n);
  }
  // a bend has two tangent planes at most
  return std::min(int(lines.size()), 2);
}

/// Returns the largest turn from the flat beyond a border to the one after it, across sides
/// parallel to the border: those of its triangles or, if it is half of a quadrangle, of the other
/// half.
FaceGrowth::Onward FaceGrowth::onward(const Border& border) const {
  constexpr std::size_t most = 64;  // triangles of the flat that are visited
  constexpr double along = 0.8;     // cosine above which two sides are parallel
  const Vector3d side = vertex(border.b) - vertex(border.a);
  Onward found;
  const auto look = [&](int t, int k, bool is_last) {
    const int next = across_[std::size_t(t)][std::size_t(k)];
    if (next < 0 || stamp_[std::size_t(next)] == stamped_) return -1;
    const int a = design_.triangles(t, k), b = design_.triangles(t, (k + 1) % 3);
    const Vector3d other = vertex(b) - vertex(a);
    const bool runs_so = std::abs(side.dot(other)) > along * side.norm() * other.norm();
    const double turn = turn_about(side, normals_.row(border.outside), normals_.row(next));
    if (runs_so && height_[next] > sliver * tolerance_ && turn > found.turn)
      found = {turn, height_over(a, b, beyond(next, a, b))};
    return is_last || runs_so ? -1 : next;
  };
  const std::vector<int>& flat = flats_[std::size_t(flat_of(border.outside))];
  for (std::size_t i = 0; i < std::min(flat.size(), most); ++i)
    for (int k = 0; k < 3; ++k)
      if (const int half = look(flat[i], k, flat.size() > 1); half >= 0)
        for (int m = 0; m < 3; ++m) look(half, m, true);
  return found;
}

/// Returns the width, mm, of the region that was stamped last, across the borders at which it may
/// be a sector: along the axis or, for a plane, twice its area divided by the length of its border.
double FaceGrowth::width(const AnalyticPatch& surface, const Region& region) const {
  const Vector3d axis = surface.frame.col(2);
  if (surface.form != Form::Plane) {
    double low = 0.0, high = 0.0;
    for (const int v : region.vertices) {
      const double at = axis.dot(vertex(v) - vertex(region.vertices.front()));
      low = std::min(low, at);
      high = std::max(high, at);
    }
    return (high - low) * (surface.form == Form::Cone ? std::hypot(1.0, surface.shape[1]) : 1.0);
  }
  double twice_area = 0.0, border = 0.0;
  for (const int t : region.triangles) {
    const auto corner = [&](int k) { return vertex(design_.triangles(t, k % 3)); };
    twice_area += (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    for (int k = 0; k < 3; ++k) {
      const int next = across_[std::size_t(t)][std::size_t(k)];
      if (next < 0 || stamp_[std::size_t(next)] != stamped_)
        border += (corner(k + 1) - corner(k)).norm();
    }
  }
  return twice_area / border;
}

/// Returns true if a cylinder, a cone or the strip of a plane ends at edges across which the next
/// facets continue to turn like those of a smooth surface that is cut into strips: the angle
/// between two of them is proportional to the mean of their widths. Where such a surface begins
/// without an edge, the angle is that of half of its first strip; the decision is half way between
/// the two. At the end of a face that is long compared with its neighbours, or at a chamfer, there
/// is an edge of the part.
bool FaceGrowth::is_sector(const AnalyticPatch& surface, const Region& region,
                           const std::vector<Border>& borders) const {
  // 0.9: cosine of a side along the axis; 0.3 of the diagonal: a wider plane is no strip
  constexpr double along = 0.9, little = 0.1, slender = 0.3;
  const bool is_plane = surface.form == Form::Plane;
  if (surface.form == Form::Sphere || surface.form == Form::Torus) return false;
  const double wide = width(surface, region);
  if (is_plane && wide > slender * surface.box.diagonal().norm()) return false;
  std::array<Votes, 2> votes;  // one for each end
  for (const Border& one : borders) {
    const Vector3d side = (vertex(one.b) - vertex(one.a)).normalized();
    if (!is_plane && std::abs(side.dot(surface.frame.col(2))) > along) continue;
    if (!is_open(one.outside) || height_[one.outside] < sliver * tolerance_) continue;
    const Vector3d middle = 0.5 * (vertex(one.a) + vertex(one.b));
    const Vector3d n = surface.sign * outward(surface, middle);
    const double turn = turn_about(side, n, normals_.row(one.outside));
    const Onward after = onward(one);
    if (!(after.turn > 0.0)) continue;
    const bool goes_on = turn > tolerance_ / one.height && after.turn > little * turn &&
                         turn * (one.height + after.width) > after.turn * (0.5 * wide + one.height);
    votes[!is_plane && side.cross(n).dot(surface.frame.col(2)) > 0.0].add(goes_on);
  }
  return votes[0].most() || votes[1].most();
}

std::optional<AnalyticPatch> FaceGrowth::plane_of_flat(const Region& region) const {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  const std::optional<AnalyticPatch> plane = fitted(patch, first_guess(Form::Plane, patch));
  if (!plane) return std::nullopt;
  for (const int t : region.triangles)
    if (!lies_on(*plane, t, tolerance_)) return std::nullopt;
  return with_sizes(*plane, region);
}

/// Returns true if the facets around a plane turn away from it by more than the deviation of its
/// own vertices; those of a nearly flat part of a scan or free form do not.
bool FaceGrowth::turns_away(const AnalyticPatch& plane, const Region& region,
                            const std::vector<Border>& borders) const {
  // 0.2 deg as stated in the header
  constexpr double least = 0.2 * std::numbers::pi / 180.0;
  const FacetPatch patch = facet_patch(design_, region.vertices, {});
  const double own = extrapolation_bound(plane, patch) * plane.off;
  Votes votes;
  for (const Border& one : borders) {
    if (!is_open(one.outside)) continue;
    const double leaves = std::abs(distance_of(plane, vertex(one.beyond)));
    const double turned = one.height < sliver * tolerance_ ? 0.0 : std::sin(least) * one.height;
    votes.add(leaves > std::max({tolerance_, own, turned}));
  }
  return votes.nearly_all();
}

/// Returns true if slivers are less than half of the area of a region.
bool FaceGrowth::has_normals(const Region& region) const {
  double sure = 0.0, all = 0.0;
  for (const int t : region.triangles) {
    const auto corner = [&](int k) { return vertex(design_.triangles(t, k)); };
    const double twice = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    all += twice;
    if (height_[t] >= sliver * tolerance_) sure += twice;
  }
  return 2.0 * sure > all;
}

std::optional<FaceRegion> FaceGrowth::evident_plane(int flat) {
  constexpr std::size_t halves = 4;  // of a few quadrangles
  const std::vector<int>& triangles = flats_[std::size_t(flat)];
  if (triangles.size() <= halves || !is_open(triangles.front())) return std::nullopt;
  const Region all = region(triangles);
  std::vector<Vector3d> points;
  for (const int v : all.vertices) points.push_back(vertex(v));
  if (are_on_two_lines(points, sliver * tolerance_)) return std::nullopt;
  const std::optional<AnalyticPatch> plane = plane_of_flat(all);
  if (!plane || !has_normals(all)) return std::nullopt;
  const std::vector<Border> around = borders(all);
  if (!turns_away(*plane, all, around) || is_sector(*plane, all, around)) return std::nullopt;
  return FaceRegion{*plane, triangles};
}

std::optional<FaceRegion> FaceGrowth::tangent_plane(int flat) {
  std::vector<int> left = flats_[std::size_t(flat)];
  std::erase_if(left, [&](int t) { return !is_open(t); });
  // a flat that has lost triangles to another face is no plane of its own
  if (left.size() != flats_[std::size_t(flat)].size()) return std::nullopt;
  const Region all = region(std::move(left));
  Votes votes;
  for (const Border& one : borders(all)) {
    const int there = face_[std::size_t(one.outside)];
    if (there < 0 || faces_[std::size_t(there)].surface.form == Form::Plane) continue;
    const Border back{one.outside, one.inside, one.a, one.b, -1, 0.0};
    votes.add(is_tangent(faces_[std::size_t(there)].surface, back));
  }
  if (votes.all == 0 || !votes.nearly_all()) return std::nullopt;
  const std::optional<AnalyticPatch> plane = plane_of_flat(all);
  if (!plane) return std::nullopt;
  return FaceRegion{*plane, all.triangles};
}

}  // namespace abbe::cutting
