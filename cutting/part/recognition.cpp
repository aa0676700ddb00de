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

/// The recognised faces of a mesh and their triangles.
struct TriangleFaces {
  std::vector<int> face;  // (triangles) index of the face; -1: none
  std::vector<AnalyticPatch> faces;
  int unexamined_triangles = 0;
};

/// Returns the patches that lie as a whole on one surface.
std::vector<FaceRegion> whole_patches(const Design& design, double tolerance) {
  const std::vector<int> patch_of_vertex = patches(design);
  const int count = patch_of_vertex.empty()
                        ? 0
                        : 1 + *std::max_element(patch_of_vertex.begin(), patch_of_vertex.end());
  std::vector<std::vector<int>> vertices(std::size_t(count), std::vector<int>{});
  std::vector<std::vector<int>> triangles(std::size_t(count), std::vector<int>{});
  for (std::size_t i = 0; i < patch_of_vertex.size(); ++i)
    vertices[std::size_t(patch_of_vertex[i])].push_back(int(i));
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    triangles[std::size_t(patch_of_vertex[std::size_t(design.triangles(t, 0))])].push_back(t);
  std::vector<FaceRegion> result;
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    if (triangles[k].empty()) continue;
    FacetPatch patch = facet_patch(design, std::move(vertices[k]), std::move(triangles[k]));
    if (const auto surface = recognise_surface(patch, tolerance))
      result.push_back({*surface, std::move(patch.triangles)});
  }
  return result;
}

/// Returns the faces of a mesh: patches that lie on one surface, then faces within the others.
TriangleFaces assign_faces(const Design& design, double tolerance) {
  std::vector<FaceRegion> regions = whole_patches(design, tolerance);
  std::vector<char> open(std::size_t(design.triangles.rows()), 1);
  for (const FaceRegion& region : regions)
    for (const int t : region.triangles) open[std::size_t(t)] = 0;
  FaceRegions growth = grow_face_regions(design, open, tolerance);
  for (FaceRegion& region : growth.faces) regions.push_back(std::move(region));
  TriangleFaces result{std::vector<int>(open.size(), -1), {}, growth.unexamined_triangles};
  for (FaceRegion& region : regions) {
    for (const int t : region.triangles) result.face[std::size_t(t)] = int(result.faces.size());
    result.faces.push_back(std::move(region.surface));
  }
  return result;
}

/// Returns (n) the largest angle at each vertex between adjacent facets on no face: the facets at
/// the vertex and their neighbours, which are the other halves of quadrangles.
Eigen::VectorXd max_facet_angles(const Design& design) {
  const auto normal = [&](int t) {
    return triangle_cross_product(design.vertices, design.triangles, t);
  };
  const auto count = int(design.triangles.rows());
  const std::vector<std::array<int, 3>> across = neighbours(design.triangles);
  Eigen::VectorXd triangle_angle = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd vertex_angle = Eigen::VectorXd::Zero(design.vertices.rows());
  const auto is_on_no_face = [&](int t) {
    return design.face[std::size_t(design.triangles(t, 0))] < 0;
  };
  for (int t = 0; t < count; ++t)
    for (const int neighbour : across[std::size_t(t)])
      if (neighbour >= 0 && is_on_no_face(t))
        triangle_angle[t] =
            std::max(triangle_angle[t], kinematics::angle_between(normal(t), normal(neighbour)));
  for (int t = 0; t < count; ++t) {
    if (!is_on_no_face(t)) continue;
    double max_angle = triangle_angle[t];
    for (const int neighbour : across[std::size_t(t)])
      if (neighbour >= 0) max_angle = std::max(max_angle, triangle_angle[neighbour]);
    for (const int v : design.triangles.row(t))
      vertex_angle[v] = std::max(vertex_angle[v], max_angle);
  }
  return vertex_angle;
}

/// Assigns the normal of a face to vertices on no face where the facets continue the face
/// tangentially: where their angle to the face is about half of the angle between them, as for
/// chords of a curve and its tangent.
void adopt_face_normals(Design& design, const std::vector<AnalyticPatch>& faces) {
  // Between half of the angle, for a tangent, and the whole angle, for an edge.
  constexpr double max_angle_fraction = 0.75;
  const Eigen::VectorXd max_angle = max_facet_angles(design);
  std::vector<std::vector<int>> vertices_at(std::size_t(design.vertices.rows()));  // of a point
  for (const auto& [first, added] : design.seams) {
    if (vertices_at[std::size_t(first)].empty()) vertices_at[std::size_t(first)].push_back(first);
    vertices_at[std::size_t(first)].push_back(added);
  }
  for (const std::vector<int>& coincident : vertices_at)
    for (const int v : coincident) {
      if (design.face[std::size_t(v)] >= 0) continue;
      const Vector3d own_normal = design.normals.row(v);
      double min_angle = max_angle_fraction * max_angle[v];
      for (const int other : coincident) {
        const int face = design.face[std::size_t(other)];
        if (face < 0) continue;
        const Vector3d face_normal =
            project_to_surface(faces[std::size_t(face)], design.vertices.row(v)).normal;
        if (!(kinematics::angle_between(own_normal, face_normal) < min_angle)) continue;
        min_angle = kinematics::angle_between(own_normal, face_normal);
        design.normals.row(v) = face_normal;
      }
    }
}

}  // namespace

RecognisedMesh recognise_patches(const Design& design, double tolerance) {
  require(std::isfinite(tolerance) && tolerance > 0.0,
          "recognise_patches: tolerance must be positive");
  TriangleFaces triangle_faces = assign_faces(design, tolerance);
  RecognisedMesh result{design, std::move(triangle_faces.faces), design.area.sum(),
                        triangle_faces.unexamined_triangles};
  if (result.patches.empty()) return result;
  result.design = split_at_faces(design, triangle_faces.face);
  Design& mesh = result.design;
  adopt_face_normals(mesh, result.patches);
  for (Index i = 0; i < mesh.vertices.rows(); ++i) {
    const int face = mesh.face[std::size_t(i)];
    if (face < 0) continue;
    result.patches[std::size_t(face)].area += mesh.area[i];
    const Contact contact =
        project_to_surface(result.patches[std::size_t(face)], mesh.vertices.row(i));
    mesh.vertices.row(i) = contact.point;
    mesh.normals.row(i) = contact.normal;
  }
  mesh.facet_error = facet_error(mesh.vertices, mesh.normals, mesh.triangles);
  for (Index i = 0; i < mesh.facet_error.size(); ++i)
    if (mesh.face[std::size_t(i)] >= 0) mesh.facet_error[i] = 0.0;
  mesh.area = vertex_area(mesh.vertices, mesh.triangles);
  return result;
}

SurfaceInterpolator patch_interpolator(const std::vector<AnalyticPatch>& patches,
                                       const Eigen::Isometry3d& T) {
  return [patches, T, back = T.inverse()](std::span<const Contact> corners,
                                          std::span<const double> weights) {
    const int face = corners.front().face;
    if (face < 0 || !std::all_of(corners.begin(), corners.end(),
                                 [&](const Contact& corner) { return corner.face == face; }))
      return smooth_facet_point(corners, weights);
    Vector3d facet_point = Vector3d::Zero();
    for (std::size_t i = 0; i < corners.size(); ++i) facet_point += weights[i] * corners[i].point;
    const Contact contact = project_to_surface(patches[std::size_t(face)], back * facet_point);
    return Contact{T * contact.point, T.linear() * contact.normal, face};
  };
}

namespace {

using kinematics::angle_between;

constexpr double tangent_angle = 2e-3;  // rad

/// Count of the votes of borders.
struct Votes {
  int agreeing = 0, total = 0;
  void add(bool vote) {
    agreeing += vote;
    ++total;
  }
  bool is_nearly_unanimous() const { return agreeing >= 0.9 * total; }  // also without votes
  bool has_majority() const { return 2 * agreeing > total; }
};

/// Returns the angle between two normals about a line.
double angle_about(const Vector3d& line, const Vector3d& a, const Vector3d& b) {
  return std::atan2(std::abs(a.cross(b).dot(line.normalized())), a.dot(b));
}

/// Returns true if a point lies within a distance of the line through a and b.
bool is_on_line(const Vector3d& p, const Vector3d& a, const Vector3d& b, double max_distance) {
  const Vector3d along = b - a;
  return (p - a).cross(along).norm() <= max_distance * along.norm();
}

/// Returns the points that do not lie within a distance of the line through a and b.
std::vector<Vector3d> points_off_line(const std::vector<Vector3d>& points, const Vector3d& a,
                                      const Vector3d& b, double max_distance) {
  std::vector<Vector3d> result;
  for (const Vector3d& p : points)
    if (!is_on_line(p, a, b, max_distance)) result.push_back(p);
  return result;
}

/// Returns true if all points, with at most one exception, lie on two lines. Three of any five such
/// points lie on one line, so six sample points suffice to find it.
bool are_on_two_lines(const std::vector<Vector3d>& points, double max_distance) {
  const std::size_t n = points.size();
  if (n < 6) return true;
  const auto sample = [&](std::size_t i) { return points[i * (n - 1) / 5]; };
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i + 1; j < 6; ++j)
      for (std::size_t k = j + 1; k < 6; ++k) {
        if (!is_on_line(sample(k), sample(i), sample(j), max_distance)) continue;
        const std::vector<Vector3d> remaining =
            points_off_line(points, sample(i), sample(j), max_distance);
        if (remaining.size() < 3) return true;
        const auto farthest_point =
            std::max_element(remaining.begin(), remaining.end(), [&](const auto& a, const auto& b) {
              return (a - remaining[0]).norm() < (b - remaining[0]).norm();
            });
        if (points_off_line(remaining, remaining[0], *farthest_point, max_distance).size() < 2)
          return true;
      }
  return false;
}

/// Returns true if the vertices lie nearer to a surface than vertices that are distributed at
/// random within their deviation from a plane would with a probability of 1e-9: each free vertex
/// contributes the ratio of the two deviations as a factor. Rejects surfaces through a few noisy
/// vertices.
bool is_significant(const AnalyticPatch& local, const FacetPatch& patch, double tolerance,
                    int tangents) {
  // 0.3: with any number of vertices, a surface must fit clearly better than a plane.
  constexpr double min_decades = 9.0, max_ratio = 0.3;
  const double free_vertices =
      double(patch.points.rows() - parameter_count(local.form) + 2 * tangents);
  const double plane_deviation = max_vertex_distance(patch, initial_surface(Form::Plane, patch));
  const double deviation = std::min(max_vertex_distance(patch, local), tolerance);
  return free_vertices > 0.0 &&
         deviation <=
             plane_deviation * std::min(max_ratio, std::pow(10.0, -min_decades / free_vertices));
}

/// Returns the ratio of the departure of the vertices next to a region from the best-fitting
/// surface of a free form to that of its own vertices, if n lines of vertices are fitted: a
/// polynomial of degree 4 that is at most 1 on all of them reaches this value on the next line.
double extrapolation_bound(const AnalyticPatch& local, const FacetPatch& patch) {
  const bool has_straight_lines = local.form == Form::Cylinder || local.form == Form::Cone;
  const auto has_at_least = [&](int n) {
    return has_straight_lines ? has_lines(local, patch, n) : patch.points.rows() >= n * n;
  };
  for (const auto& [lines, factor] : {std::pair(13, 5.0), {9, 8.0}, {7, 12.0}})
    if (has_at_least(lines)) return factor;
  return 24.0;
}

}  // namespace

/// Returns true if facets of the region that was marked last are inclined enough to distinguish
/// their surface from a plane.
bool FaceGrowth::is_curved(const Region& region) const {
  // 0.5 deg, the smallest angle that distinguishes a curved face from a flat.
  constexpr double min_angle = 0.5 * std::numbers::pi / 180.0;
  for (const int t : region.triangles)
    for (const int neighbour : across_[std::size_t(t)])
      if (neighbour > t && triangle_stamp_[std::size_t(neighbour)] == last_stamp_ &&
          std::min(height_[t], height_[neighbour]) > sliver_tolerances * tolerance_ &&
          angle_between(normals_.row(t), normals_.row(neighbour)) > min_angle)
        return true;
  return false;
}

/// Returns true if a region that has stopped growing is a face.
bool FaceGrowth::is_face(const AnalyticPatch& surface, const Region& region) {
  if (!(surface.off <= tolerance_)) return false;
  for (const int t : region.triangles)
    if (!is_on_surface(surface, t, tolerance_)) return false;
  const std::vector<Border> region_borders = borders(region);
  if (!is_curved(region)) return false;
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  const AnalyticPatch local = to_patch_coordinates(patch, surface);
  const int tangent_line_count = count_tangent_lines(surface, region_borders);
  const Index min_vertices = tangent_line_count > 0 ? 6 : 2 * parameter_count(surface.form);
  return patch.points.rows() >= min_vertices &&
         is_significant(local, patch, tolerance_, tangent_line_count) &&
         is_determined(local, patch, tangent_line_count) &&
         (surface.form != Form::Torus || has_lines(local, patch, 5)) &&
         has_distinct_border(surface, patch, region_borders) &&
         !is_sector(surface, region, region_borders);
}

/// Returns true if the facets around a region depart from its surface like those of another
/// surface, tested separately at the borders around its axis and along it. A surface whose
/// curvature differs by c departs by c h^2 / 2 at a height h, and by about h if c h is large.
bool FaceGrowth::has_distinct_border(const AnalyticPatch& surface, const FacetPatch& patch,
                                     const std::vector<Border>& borders) const {
  // 0.3 and 2.5 as stated in the header; 1e-3 of the height of a facet is the step of the
  // difference quotient.
  constexpr double curvature_fraction = 0.3, step_fraction = 1e-3, straight_factor = 2.5;
  const bool has_axis = surface.form != Form::Sphere;
  const bool is_straight = surface.form == Form::Cylinder || surface.form == Form::Cone;
  const double factor = extrapolation_bound(to_patch_coordinates(patch, surface), patch);
  const std::array<double, 2> deviation_factors = {factor, is_straight ? straight_factor : factor};
  std::array<Votes, 2> votes;
  for (const Border& border : borders) {
    if (!is_open(border.outside) || border.height < sliver_tolerances * tolerance_) continue;
    const Vector3d middle = 0.5 * (vertex(border.a) + vertex(border.b));
    const Vector3d side = (vertex(border.b) - vertex(border.a)).normalized();
    const Vector3d n = outward(surface, middle);
    const Vector3d step = step_fraction * border.height * side.cross(n).normalized();
    const double curvature = (outward(surface, middle + step) - n).norm() / step.norm();
    const double departure = std::abs(distance_of(surface, vertex(border.outer_vertex)));
    const Vector3d circumferential =
        surface.frame.col(2).cross(middle - surface.origin).normalized();
    const bool is_around = has_axis && std::abs(side.dot(circumferential)) > std::sqrt(0.5);
    votes[is_around].add(departure >
                         std::max({tolerance_, deviation_factors[is_around] * surface.off,
                                   0.5 * curvature_fraction *
                                       std::min(1.0, curvature * border.height) * border.height}));
  }
  return votes[0].is_nearly_unanimous() && votes[1].is_nearly_unanimous();
}

/// Returns true if the facet across a border continues the surface without an edge, like a tangent
/// plane. If the surface itself continued, its next facet would be inclined by half of the angle by
/// which it turns over one facet.
bool FaceGrowth::is_tangent(const AnalyticPatch& surface, const Border& border) const {
  // A fraction of the turn over the inner facet, far below the half of a surface that continues.
  constexpr double max_turn_fraction = 0.1;
  const double normal_uncertainty = tolerance_ / height_[border.outside];
  if (normal_uncertainty > tangent_angle) return false;
  const auto normal_at = [&](int v) -> Vector3d {
    return surface.sign * outward(surface, vertex(v));
  };
  double turn = 0.0;
  for (const int v : design_.triangles.row(border.inside))
    turn = std::max(turn, angle_between(normal_at(border.a), normal_at(v)));
  const double max_angle = std::min(tangent_angle + normal_uncertainty, max_turn_fraction * turn);
  for (const int end : {border.a, border.b})
    if (angle_between(normal_at(end), normals_.row(border.outside)) > max_angle) return false;
  return true;
}

/// Returns the number of lines at which a cylinder or cone continues in tangent planes. The planes
/// must be at least as wide as two of its own facets, because on a scan a single facet may be
/// tangential by chance.
int FaceGrowth::count_tangent_lines(const AnalyticPatch& surface,
                                    const std::vector<Border>& borders) const {
  if (surface.form != Form::Cylinder && surface.form != Form::Cone) return 0;
  // Normals that differ by less than 1e-3 belong to the same line.
  constexpr double min_distance = 1e-3, min_widths = 2.0;
  std::vector<Vector3d> lines;
  for (const Border& border : borders) {
    const double facet_width =
        height_over(border.a, border.b, third_vertex(border.inside, border.a, border.b));
    if (border.height < min_widths * facet_width || !is_tangent(surface, border)) continue;
    const Vector3d n = outward(surface, vertex(border.a));
    if (std::none_of(lines.begin(), lines.end(),
                     [&](const Vector3d& line) { return (line - n).norm() < min_distance; }))
      lines.push_back(n);
  }
  // A bend has at most two tangent planes.
  return std::min(int(lines.size()), 2);
}

/// Returns the largest angle from the flat beyond a border to the next facet, across sides parallel
/// to the border: sides of its triangles or, if it is half of a quadrangle, of the other half.
FaceGrowth::Continuation FaceGrowth::continuation(const Border& border) const {
  constexpr std::size_t max_triangles = 64;    // of the flat that are visited
  constexpr double min_parallel_cosine = 0.8;  // of two sides that count as parallel
  const Vector3d side = vertex(border.b) - vertex(border.a);
  Continuation result;
  const auto visit_side = [&](int t, int k, bool is_last) {
    const int neighbour = across_[std::size_t(t)][std::size_t(k)];
    if (neighbour < 0 || triangle_stamp_[std::size_t(neighbour)] == last_stamp_) return -1;
    const int a = design_.triangles(t, k), b = design_.triangles(t, (k + 1) % 3);
    const Vector3d other = vertex(b) - vertex(a);
    const bool is_parallel =
        std::abs(side.dot(other)) > min_parallel_cosine * side.norm() * other.norm();
    const double turn = angle_about(side, normals_.row(border.outside), normals_.row(neighbour));
    if (is_parallel && height_[neighbour] > sliver_tolerances * tolerance_ && turn > result.turn)
      result = {turn, height_over(a, b, third_vertex(neighbour, a, b))};
    return is_last || is_parallel ? -1 : neighbour;
  };
  const std::vector<int>& flat = flats_[std::size_t(flat_of(border.outside))];
  for (std::size_t i = 0; i < std::min(flat.size(), max_triangles); ++i)
    for (int k = 0; k < 3; ++k)
      if (const int other_half = visit_side(flat[i], k, flat.size() > 1); other_half >= 0)
        for (int j = 0; j < 3; ++j) visit_side(other_half, j, true);
  return result;
}

/// Returns the width, mm, of the region that was marked last, across the borders at which it may be
/// a sector: along the axis or, for a plane, twice its area divided by the length of its border.
double FaceGrowth::width(const AnalyticPatch& surface, const Region& region) const {
  const Vector3d axis = surface.frame.col(2);
  if (surface.form != Form::Plane) {
    double low = 0.0, high = 0.0;
    for (const int v : region.vertices) {
      const double height = axis.dot(vertex(v) - vertex(region.vertices.front()));
      low = std::min(low, height);
      high = std::max(high, height);
    }
    return (high - low) * (surface.form == Form::Cone ? std::hypot(1.0, surface.shape[1]) : 1.0);
  }
  double twice_area = 0.0, border_length = 0.0;
  for (const int t : region.triangles) {
    const auto corner = [&](int k) { return vertex(design_.triangles(t, k % 3)); };
    twice_area += triangle_cross_product(design_.vertices, design_.triangles, t).norm();
    for (int k = 0; k < 3; ++k) {
      const int neighbour = across_[std::size_t(t)][std::size_t(k)];
      if (neighbour < 0 || triangle_stamp_[std::size_t(neighbour)] != last_stamp_)
        border_length += (corner(k + 1) - corner(k)).norm();
    }
  }
  return twice_area / border_length;
}

/// Returns true if a cylinder, a cone or a plane strip is a sector of a smooth surface that is cut
/// into strips: across its edges the next facets continue to turn, by an angle proportional to the
/// mean width of two strips. Where such a surface begins without an edge, the angle is that of half
/// of its first strip; the decision is half way between the two. At the end of a face that is long
/// compared with its neighbours, or at a chamfer, there is an edge of the part.
bool FaceGrowth::is_sector(const AnalyticPatch& surface, const Region& region,
                           const std::vector<Border>& borders) const {
  // 0.9: cosine of a side along the axis; 0.3 of the diagonal: a wider plane is no strip.
  constexpr double min_axial_cosine = 0.9, min_angle_ratio = 0.1, max_strip_ratio = 0.3;
  const bool is_plane = surface.form == Form::Plane;
  if (surface.form == Form::Sphere || surface.form == Form::Torus) return false;
  const double region_width = width(surface, region);
  if (is_plane && region_width > max_strip_ratio * surface.box.diagonal().norm()) return false;
  std::array<Votes, 2> votes;  // one for each end
  for (const Border& border : borders) {
    const Vector3d side = (vertex(border.b) - vertex(border.a)).normalized();
    if (!is_plane && std::abs(side.dot(surface.frame.col(2))) > min_axial_cosine) continue;
    if (!is_open(border.outside) || height_[border.outside] < sliver_tolerances * tolerance_)
      continue;
    const Vector3d middle = 0.5 * (vertex(border.a) + vertex(border.b));
    const Vector3d n = surface.sign * outward(surface, middle);
    const double turn = angle_about(side, n, normals_.row(border.outside));
    const Continuation next_facet = continuation(border);
    if (!(next_facet.turn > 0.0)) continue;
    const bool continues = turn > tolerance_ / border.height &&
                           next_facet.turn > min_angle_ratio * turn &&
                           turn * (border.height + next_facet.width) >
                               next_facet.turn * (0.5 * region_width + border.height);
    votes[!is_plane && side.cross(n).dot(surface.frame.col(2)) > 0.0].add(continues);
  }
  return votes[0].has_majority() || votes[1].has_majority();
}

std::optional<AnalyticPatch> FaceGrowth::fit_plane(const Region& region) const {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  const std::optional<AnalyticPatch> plane =
      fit_surface(patch, initial_surface(Form::Plane, patch));
  if (!plane) return std::nullopt;
  for (const int t : region.triangles)
    if (!is_on_surface(*plane, t, tolerance_)) return std::nullopt;
  return with_extent(*plane, region);
}

/// Returns true if the facets around a plane depart from it by more than its own vertices, which is
/// not the case for a nearly flat part of a scan or free form.
bool FaceGrowth::has_folded_border(const AnalyticPatch& plane, const Region& region,
                                   const std::vector<Border>& borders) const {
  // 0.2 deg as stated in the header.
  constexpr double min_angle = 0.2 * std::numbers::pi / 180.0;
  const FacetPatch patch = facet_patch(design_, region.vertices, {});
  const double own_deviation = extrapolation_bound(plane, patch) * plane.off;
  Votes votes;
  for (const Border& border : borders) {
    if (!is_open(border.outside)) continue;
    const double departure = std::abs(distance_of(plane, vertex(border.outer_vertex)));
    const double folded_departure =
        border.height < sliver_tolerances * tolerance_ ? 0.0 : std::sin(min_angle) * border.height;
    votes.add(departure > std::max({tolerance_, own_deviation, folded_departure}));
  }
  return votes.is_nearly_unanimous();
}

/// Returns true if slivers cover less than half of the area of a region.
bool FaceGrowth::has_reliable_normals(const Region& region) const {
  double reliable_area = 0.0, total_area = 0.0;
  for (const int t : region.triangles) {
    const double twice_area = triangle_cross_product(design_.vertices, design_.triangles, t).norm();
    total_area += twice_area;
    if (height_[t] >= sliver_tolerances * tolerance_) reliable_area += twice_area;
  }
  return 2.0 * reliable_area > total_area;
}

std::optional<FaceRegion> FaceGrowth::evident_plane(int flat) {
  constexpr std::size_t max_quadrangle_halves = 4;  // of a few quadrangles
  const std::vector<int>& triangles = flats_[std::size_t(flat)];
  if (triangles.size() <= max_quadrangle_halves || !is_open(triangles.front())) return std::nullopt;
  const Region flat_region = region(triangles);
  std::vector<Vector3d> points;
  for (const int v : flat_region.vertices) points.push_back(vertex(v));
  if (are_on_two_lines(points, sliver_tolerances * tolerance_)) return std::nullopt;
  const std::optional<AnalyticPatch> plane = fit_plane(flat_region);
  if (!plane || !has_reliable_normals(flat_region)) return std::nullopt;
  const std::vector<Border> region_borders = borders(flat_region);
  if (!has_folded_border(*plane, flat_region, region_borders) ||
      is_sector(*plane, flat_region, region_borders))
    return std::nullopt;
  return FaceRegion{*plane, triangles};
}

std::optional<FaceRegion> FaceGrowth::tangent_plane(int flat) {
  std::vector<int> triangles_left = flats_[std::size_t(flat)];
  std::erase_if(triangles_left, [&](int t) { return !is_open(t); });
  // A flat that has lost triangles to another face is not a separate plane.
  if (triangles_left.size() != flats_[std::size_t(flat)].size()) return std::nullopt;
  const Region flat_region = region(std::move(triangles_left));
  Votes votes;
  for (const Border& border : borders(flat_region)) {
    const int adjacent_face = face_[std::size_t(border.outside)];
    if (adjacent_face < 0 || faces_[std::size_t(adjacent_face)].surface.form == Form::Plane)
      continue;
    const Border reversed_border{border.outside, border.inside, border.a, border.b, -1, 0.0};
    votes.add(is_tangent(faces_[std::size_t(adjacent_face)].surface, reversed_border));
  }
  if (votes.total == 0 || !votes.is_nearly_unanimous()) return std::nullopt;
  const std::optional<AnalyticPatch> plane = fit_plane(flat_region);
  if (!plane) return std::nullopt;
  return FaceRegion{*plane, flat_region.triangles};
}

}  // namespace abbe::cutting
