#include "cutting/part/primitive.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <type_traits>

#include <fmt/format.h>

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

using Eigen::Vector3d;
using ProfilePiece = RevolvedProfile::ProfileSegment;
using std::numbers::pi;

constexpr double join_tolerance = 1e-9;    // mm; segments with a smaller gap are connected
constexpr double smooth_tolerance = 1e-9;  // rad; normals at a join that differ by less are equal

// Checks of dimensions.

void require_value(bool holds, const std::string& message, double seen) {
  if (!holds) throw std::invalid_argument(fmt::format("{}, seen {}", message, seen));
}

void require_positive(double value, const std::string& name) {
  require_value(std::isfinite(value) && value > 0.0, name + " must be positive and finite", value);
}

double top_radius(const Cone& cone) {
  const double top = cone.base_radius - cone.height * std::tan(cone.half_apex_angle);
  // 1e-12: the radius at the apex of a complete cone must be 0 and not a rounding error.
  return std::abs(top) < 1e-12 * cone.base_radius ? 0.0 : top;
}

void validate(const RectanglePlane& p) {
  require_positive(p.length_x, "length_x of the rectangle");
  require_positive(p.length_y, "length_y of the rectangle");
}
void validate(const Disc& p) {
  require_positive(p.radius, "radius of the disc");
  require_value(p.inner_radius >= 0.0 && p.inner_radius < p.radius,
                "inner_radius of the disc must be from 0 to below its radius", p.inner_radius);
}
void validate(const Cylinder& p) {
  require_positive(p.radius, "radius of the cylinder");
  require_positive(p.height, "height of the cylinder");
}
void validate(const Cone& p) {
  require_positive(p.base_radius, "base_radius of the cone");
  require_positive(p.height, "height of the cone");
  require_value(p.half_apex_angle > 0.0 && p.half_apex_angle < pi / 2,
                "half_apex_angle of the cone must be between 0 and pi/2", p.half_apex_angle);
  require_value(top_radius(p) >= 0.0, "height of the cone must end at or below its apex", p.height);
}
void validate(const SphereCap& p) {
  require_positive(p.radius, "radius of the sphere");
  require_value(p.rim_radius > 0.0 && p.rim_radius <= p.radius,
                "rim_radius of the sphere must be above 0 and at most its radius", p.rim_radius);
}
void validate(const Torus& p) {
  require_positive(p.radius, "radius of the torus");
  require_positive(p.tube_radius, "tube_radius of the torus");
  require_value(p.tube_radius <= p.radius, "tube_radius of the torus must be at most its radius",
                p.tube_radius);
}
void validate(const RevolvedProfile& p) {
  if (p.profile_segments.empty())
    throw std::invalid_argument("profile must have at least one piece");
  for (std::size_t i = 0; i < p.profile_segments.size(); ++i) {
    const ProfilePiece& piece = p.profile_segments[i];
    const std::string name = fmt::format("piece {} of the profile", i);
    if (!piece.from.allFinite() || !piece.to.allFinite() || !std::isfinite(piece.arc_radius))
      throw std::invalid_argument(name + " must contain only finite numbers");
    const double chord = (piece.to - piece.from).norm();
    require_value(piece.from.x() >= 0.0, name + " must not start below r = 0", piece.from.x());
    require_value(piece.to.x() > 0.0, name + " must end above r = 0", piece.to.x());
    require_value(piece.to.x() >= piece.from.x(),
                  name + " must not turn back towards the axis: r at its end", piece.to.x());
    require_value(chord > join_tolerance, name + " must be longer than 0: length", chord);
    // 1e-12: the diameter of a semicircle may differ from its chord by rounding.
    require_value(
        piece.arc_radius == 0.0 || 2.0 * std::abs(piece.arc_radius) >= chord * (1.0 - 1e-12),
        name + fmt::format(" must have an arc radius of at least half its chord {}", chord),
        piece.arc_radius);
    const ProfileCurve s = profile_curve(piece);
    // 1e-9: the slope of an arc that ends vertically is affected by rounding.
    const double min_upward = std::min(s.tangent.x(), profile_point_at(s, s.length).normal.y());
    require_value(min_upward >= -1e-9,
                  name + " must not bulge beyond its ends: cosine of its steepest slope",
                  min_upward);
    if (i > 0)
      require_value((piece.from - p.profile_segments[i - 1].to).norm() <= join_tolerance,
                    name + " must start where the previous piece ends: gap in mm",
                    (piece.from - p.profile_segments[i - 1].to).norm());
  }
}

void validate_any(const Primitive& primitive) {
  std::visit([](const auto& p) { validate(p); }, primitive);
}

// Irregular spacing.

double fractional_part(double x) { return x - std::floor(x); }

/// Returns the position in [0, 1] of knot i of n intervals: a slowly varying spacing with a
/// golden-ratio jitter of up to a quarter interval in either direction, so that no two spacings are
/// equal and no step of a program fits all of them.
double irregular_knot(int i, int n) {
  if (i <= 0) return 0.0;
  if (i >= n) return 1.0;
  const double jitter = 0.5 * (fractional_part(i * 0.6180339887498949) - 0.5);
  const double x = (i + jitter) / n;
  return x + 0.1 * x * (1.0 - x);
}

// Surfaces of revolution.

/// A ring of vertices of a surface of revolution.
struct Ring {
  ProfilePoint profile_point;
  int count = 0;  ///< vertices
  int phase = 0;  ///< index of its azimuth offset; the two rings of a kink have the same
  bool is_first_of_segment = false;  ///< true if there are no triangles to the ring before
};

int ring_count(double r, double spacing) {
  if (r == 0.0) return 1;
  return std::max(6, static_cast<int>(std::lround(2.0 * pi * r / spacing)));
}

/// Returns the rings of vertices of a profile at about the given spacing.
std::vector<Ring> rings(const std::vector<ProfileCurve>& curves, double spacing) {
  std::vector<Ring> result;
  int phase = 0;
  for (std::size_t p = 0; p < curves.size(); ++p) {
    const ProfileCurve& s = curves[p];
    // An interval of an arc is at most an eighth of a turn. 0.2501: an arc of exactly an eighth of
    // a turn is one interval.
    const int min_intervals =
        1 + static_cast<int>(std::abs(s.curvature) * s.length / (0.2501 * pi));
    const int intervals =
        std::max(min_intervals, static_cast<int>(std::lround(s.length / spacing)));
    bool is_kink = true;
    if (p > 0) {
      const Vector2d previous_normal = result.back().profile_point.normal;
      is_kink = (profile_point_at(s, 0.0).normal - previous_normal).norm() > smooth_tolerance;
    }
    for (int i = is_kink ? 0 : 1; i <= intervals; ++i) {
      ProfilePoint current =
          profile_point_at(s, i == intervals ? s.length : s.length * irregular_knot(i, intervals));
      // An apex has no normal: the mesh starts slightly below it and is closed by a small flat.
      if (i == 0 && current.point.x() == 0.0) {
        if (std::abs(current.normal.x()) > smooth_tolerance)
          current = profile_point_at(s, 0.35 * s.length * irregular_knot(1, intervals));
        else
          current.normal = Vector2d(0.0, 1.0);
      }
      if (!(p > 0 && i == 0)) ++phase;
      result.push_back({current, ring_count(current.point.x(), spacing), phase, i == 0});
    }
  }
  return result;
}

long vertex_total(const std::vector<Ring>& rings) {
  long sum = 0;
  for (const Ring& ring : rings) sum += ring.count;
  return sum;
}

/// Returns the exact area of a surface of revolution, mm^2.
double true_area(const std::vector<ProfileCurve>& curves) {
  double area = 0.0;
  for (const ProfileCurve& s : curves) {
    const double curvature = s.curvature;
    const Vector2d start_normal = left_normal(s.tangent);
    const Vector2d end_normal = profile_point_at(s, s.length).normal;
    // Theorem of Pappus; the mean radius over an arc is the radius of its centre plus the mean of
    // the normal.
    const double mean_r = curvature == 0.0 ? 0.5 * (s.from.x() + s.to.x())
                                           : s.from.x() - start_normal.x() / curvature +
                                                 (start_normal.y() - end_normal.y()) /
                                                     (curvature * curvature * s.length);
    area += 2.0 * pi * mean_r * s.length;
  }
  return area;
}

/// Returns the rings whose total number of vertices is nearest to the requested one. The number is
/// proportional to spacing^-2, hence the exponent 0.5; it is not continuous, so the later steps are
/// damped.
std::vector<Ring> rings_for_count(const std::vector<ProfileCurve>& curves, int vertex_count) {
  double spacing = std::sqrt(true_area(curves) / vertex_count);
  std::vector<Ring> best = rings(curves, spacing);
  for (int i = 0; i < 30; ++i) {
    const double ratio = double(vertex_total(best)) / vertex_count;
    if (std::abs(ratio - 1.0) < 0.02) break;
    spacing *= std::pow(ratio, i < 10 ? 0.5 : 0.2);
    std::vector<Ring> candidate = rings(curves, spacing);
    if (std::abs(std::log(double(vertex_total(candidate)) / vertex_count)) <
            std::abs(std::log(ratio)) ||
        i < 10)
      best = std::move(candidate);
  }
  return best;
}

double vertex_azimuth(const Ring& ring, int k) {
  return 2.0 * pi * (k + fractional_part(ring.phase * 0.6180339887498949)) / ring.count;
}

/// Adds the triangles between two rings, always advancing on the ring whose next edge has the
/// smaller azimuth.
void connect_rings(const Ring& inner, int first_inner, const Ring& outer, int first_outer,
                   std::vector<Eigen::Vector3i>& triangles) {
  const int inner_count = inner.count, outer_count = outer.count;
  const auto inside = [&](int i) {
    return first_inner + ((i % inner_count) + inner_count) % inner_count;
  };
  const auto outside = [&](int j) {
    return first_outer + ((j % outer_count) + outer_count) % outer_count;
  };
  if (inner_count == 1) {
    for (int j = 0; j < outer_count; ++j)
      triangles.push_back({first_inner, outside(j), outside(j + 1)});
    return;
  }
  // The inner ring starts at the vertex nearest in azimuth to the first one of the outer ring.
  const int start =
      static_cast<int>(std::lround(vertex_azimuth(outer, 0) / (2.0 * pi) * inner_count -
                                   fractional_part(inner.phase * 0.6180339887498949)));
  int i = 0, j = 0;
  while (i < inner_count || j < outer_count) {
    const double next_i = vertex_azimuth(inner, start + i) + vertex_azimuth(inner, start + i + 1);
    const double next_j = vertex_azimuth(outer, j) + vertex_azimuth(outer, j + 1);
    if (j < outer_count && (i >= inner_count || next_j <= next_i)) {
      triangles.push_back({inside(start + i), outside(j), outside(j + 1)});
      ++j;
    } else {
      triangles.push_back({inside(start + i), outside(j), inside(start + i + 1)});
      ++i;
    }
  }
}

Design to_design(Points vertices, Points normals, const std::vector<Eigen::Vector3i>& triangles) {
  Design design;
  design.vertices = std::move(vertices);
  design.normals = std::move(normals);
  design.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    design.triangles.row(static_cast<Eigen::Index>(t)) = triangles[t];
  design.area = vertex_area(design.vertices, design.triangles);
  design.facet_error = Eigen::VectorXd::Zero(design.vertices.rows());
  design.judged.assign(static_cast<std::size_t>(design.vertices.rows()), 1);
  return design;
}

Design tessellate_surface(const RevolvedProfile& outline, int vertex_count) {
  std::vector<ProfileCurve> curves;
  for (const ProfilePiece& piece : outline.profile_segments) curves.push_back(profile_curve(piece));
  const std::vector<Ring> rings = rings_for_count(curves, vertex_count);

  Points vertices(vertex_total(rings), 3);
  Points normals(vertex_total(rings), 3);
  std::vector<Eigen::Vector3i> triangles;
  int first = 0;
  for (std::size_t k = 0; k < rings.size(); ++k) {
    const Ring& ring = rings[k];
    const ProfilePoint& s = ring.profile_point;
    for (int i = 0; i < ring.count; ++i) {
      const double c = std::cos(vertex_azimuth(ring, i)), sine = std::sin(vertex_azimuth(ring, i));
      vertices.row(first + i) << s.point.x() * c, s.point.x() * sine, s.point.y();
      normals.row(first + i) << s.normal.x() * c, s.normal.x() * sine, s.normal.y();
    }
    if (k > 0 && !ring.is_first_of_segment)
      connect_rings(rings[k - 1], first - rings[k - 1].count, ring, first, triangles);
    const bool is_apex = k == 0 && curves[0].from.x() == 0.0 && ring.count > 1;
    if (is_apex)
      for (int i = 1; i + 1 < ring.count; ++i)
        triangles.push_back({first, first + i, first + i + 1});
    first += ring.count;
  }
  return to_design(std::move(vertices), std::move(normals), triangles);
}

// The rectangle.

Design tessellate_surface(const RectanglePlane& plane, int vertex_count) {
  const double aspect = plane.length_x / plane.length_y;
  const int columns = std::max(2, static_cast<int>(std::lround(std::sqrt(vertex_count * aspect))));
  const int rows = std::max(2, static_cast<int>(std::lround(double(vertex_count) / columns)));
  Points vertices(static_cast<Eigen::Index>(columns) * rows, 3);
  Points normals(vertices.rows(), 3);
  normals.rowwise() = Eigen::RowVector3d::UnitZ();
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      // Inner vertices are displaced from the lines of the grid by the plastic-number sequence,
      // those on the sides along the side only; the corners are fixed.
      const int index = j * columns + i;
      const bool is_inner_x = i > 0 && i + 1 < columns;
      const bool is_inner_y = j > 0 && j + 1 < rows;
      const double u =
          (i + (is_inner_x ? 0.4 * (fractional_part(index * 0.7548776662466927) - 0.5) : 0.0)) /
          (columns - 1);
      const double v =
          (j + (is_inner_y ? 0.4 * (fractional_part(index * 0.5698402909980532) - 0.5) : 0.0)) /
          (rows - 1);
      vertices.row(index) << plane.length_x * (u - 0.5), plane.length_y * (v - 0.5), 0.0;
    }
  std::vector<Eigen::Vector3i> triangles;
  for (int j = 0; j + 1 < rows; ++j)
    for (int i = 0; i + 1 < columns; ++i) {
      const int a = j * columns + i, b = a + 1, c = b + columns, d = a + columns;
      const double ac = (vertices.row(a) - vertices.row(c)).squaredNorm();
      const double bd = (vertices.row(b) - vertices.row(d)).squaredNorm();
      if (ac <= bd) {
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
      } else {
        triangles.push_back({a, b, d});
        triangles.push_back({b, c, d});
      }
    }
  return to_design(std::move(vertices), std::move(normals), triangles);
}

// Enlarged surfaces.

/// Returns the point at radius r. Along a segment the r component of the normal is linear in r.
ProfilePoint at_radius(const ProfileCurve& s, double r) {
  const Vector2d start_normal = left_normal(s.tangent);
  const double dr = r - s.from.x();
  const double n_r = std::clamp(start_normal.x() + s.curvature * dr, -1.0, 1.0);
  const double n_z = std::sqrt((1.0 - n_r) * (1.0 + n_r));
  // The quotient below is the difference of two roots in a form without cancellation.
  if (dr == 0.0) return {s.from, start_normal};
  return {{r, s.from.y() - dr * (n_r + start_normal.x()) / (n_z + std::max(0.0, start_normal.y()))},
          {n_r, n_z}};
}

/// Returns the radius nearest to `r` to which a segment can be extended: an arc ends where it is
/// vertical.
double reachable_radius(const ProfileCurve& s, double r) {
  if (s.curvature == 0.0) return std::max(0.0, r);
  const double start_normal_r = left_normal(s.tangent).x();
  const double a = s.from.x() + (1.0 - start_normal_r) / s.curvature;
  const double b = s.from.x() + (-1.0 - start_normal_r) / s.curvature;
  return std::max(0.0, std::clamp(r, std::min(a, b), std::max(a, b)));
}

/// Returns the end of a curve at an arc length, extended by a margin.
Vector2d extended_end(const ProfileCurve& s, double arc, double margin) {
  const ProfilePoint end = profile_point_at(s, arc);
  const bool is_vertical = std::abs(end.normal.y()) < 1e-9;
  if (is_vertical && s.curvature != 0.0) return end.point;
  if (is_vertical) return end.point + margin * s.tangent;
  return at_radius(s, reachable_radius(s, end.point.x() + margin)).point;
}

RevolvedProfile extended(RevolvedProfile outline, double margin) {
  const ProfileCurve first = profile_curve(outline.profile_segments.front());
  const ProfileCurve last = profile_curve(outline.profile_segments.back());
  if (first.from.x() > 0.0)
    outline.profile_segments.front().from = extended_end(first, 0.0, -margin);
  outline.profile_segments.back().to = extended_end(last, last.length, margin);
  return outline;
}

}  // namespace

Design tessellate(const Primitive& primitive, const TessellationOptions& options) {
  validate_any(primitive);
  require_value(options.vertices >= 100 && options.vertices <= 50'000'000,
                "number of vertices must be from 100 to 50 million", options.vertices);
  if (const auto* plane = std::get_if<RectanglePlane>(&primitive))
    return tessellate_surface(*plane, options.vertices);
  return tessellate_surface(profile(primitive), options.vertices);
}

std::optional<Contact> highest_surface_point(const Primitive& primitive, double x, double y) {
  if (const auto* plane = std::get_if<RectanglePlane>(&primitive)) {
    validate(*plane);
    const bool is_inside =
        std::abs(x) <= 0.5 * plane->length_x && std::abs(y) <= 0.5 * plane->length_y;
    if (!is_inside) return std::nullopt;
    return Contact{Vector3d(x, y, 0.0), Vector3d::UnitZ()};
  }
  const double r = std::hypot(x, y);
  std::optional<ProfilePoint> highest;
  for (const ProfilePiece& piece : profile(primitive).profile_segments) {
    const bool is_vertical = piece.to.x() == piece.from.x();
    if (is_vertical || !(r >= piece.from.x() && r <= piece.to.x())) continue;
    const ProfilePoint candidate = at_radius(profile_curve(piece), r);
    // At a kink the first segment, which is nearer to the axis, is kept.
    if (!highest || candidate.point.y() > highest->point.y() + join_tolerance) highest = candidate;
  }
  if (!highest) return std::nullopt;
  const Vector2d n = highest->normal;
  if (r == 0.0) return Contact{Vector3d(0.0, 0.0, highest->point.y()), Vector3d::UnitZ()};
  return Contact{Vector3d(x, y, highest->point.y()), Vector3d(n.x() * x / r, n.x() * y / r, n.y())};
}

Primitive enlarge(const Primitive& primitive, double margin) {
  require_value(std::isfinite(margin) && margin >= 0.0, "margin must be finite and not negative",
                margin);
  validate_any(primitive);
  return std::visit(
      [&](const auto& p) -> Primitive {
        using Kind = std::decay_t<decltype(p)>;
        if constexpr (std::is_same_v<Kind, RectanglePlane>)
          return RectanglePlane{p.length_x + 2.0 * margin, p.length_y + 2.0 * margin};
        else if constexpr (std::is_same_v<Kind, Disc>)
          return Disc{p.radius + margin, std::max(0.0, p.inner_radius - margin)};
        else if constexpr (std::is_same_v<Kind, SphereCap>)
          return SphereCap{p.radius, std::min(p.radius, p.rim_radius + margin)};
        else if constexpr (std::is_same_v<Kind, Torus>)
          return p;
        else
          return extended(profile(p), margin);
      },
      primitive);
}

RevolvedProfile profile(const Primitive& primitive) {
  validate_any(primitive);
  return std::visit(
      [](const auto& p) -> RevolvedProfile {
        using Kind = std::decay_t<decltype(p)>;
        if constexpr (std::is_same_v<Kind, RectanglePlane>) {
          throw std::invalid_argument(
              "a rectangle has no profile: it is not a surface of revolution");
        } else if constexpr (std::is_same_v<Kind, Disc>) {
          return {{{{p.inner_radius, 0.0}, {p.radius, 0.0}}}};
        } else if constexpr (std::is_same_v<Kind, Cylinder>) {
          return {{{{p.radius, p.height}, {p.radius, 0.0}}}};
        } else if constexpr (std::is_same_v<Kind, Cone>) {
          return {{{{top_radius(p), p.height}, {p.base_radius, 0.0}}}};
        } else if constexpr (std::is_same_v<Kind, SphereCap>) {
          const double r = p.rim_radius;
          const double depth = r * r / (p.radius + std::sqrt((p.radius - r) * (p.radius + r)));
          return {{{{0.0, 0.0}, {r, -depth}, p.radius}}};
        } else if constexpr (std::is_same_v<Kind, Torus>) {
          const Vector2d crest(p.radius, p.tube_radius);
          return {{{{p.radius - p.tube_radius, 0.0}, crest, p.tube_radius},
                   {crest, {p.radius + p.tube_radius, 0.0}, p.tube_radius}}};
        } else {
          return p;
        }
      },
      primitive);
}

namespace {

Vector2d rotated(const Vector2d& vector, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * vector.x() - s * vector.y(), s * vector.x() + c * vector.y()};
}

}  // namespace

ProfileCurve profile_curve(const RevolvedProfile::ProfileSegment& segment) {
  const Vector2d chord = segment.to - segment.from;
  const double chord_length = chord.norm();
  const Vector2d chord_direction = chord / chord_length;
  if (segment.arc_radius == 0.0)
    return {segment.from, segment.to, chord_direction, 0.0, chord_length};
  const double half_angle =
      std::asin(std::min(1.0, chord_length / (2.0 * std::abs(segment.arc_radius))));
  const double sign = segment.arc_radius > 0.0 ? 1.0 : -1.0;
  return {segment.from, segment.to, rotated(chord_direction, sign * half_angle),
          1.0 / segment.arc_radius, 2.0 * half_angle * std::abs(segment.arc_radius)};
}

ProfilePoint profile_point_at(const ProfileCurve& s, double arc) {
  const double angle = arc * s.curvature;
  const Vector2d normal = left_normal(rotated(s.tangent, -angle));
  if (arc <= 0.0) return {s.from, normal};
  if (arc >= s.length) return {s.to, normal};
  if (s.curvature == 0.0) return {s.from + arc * s.tangent, normal};
  const double chord = 2.0 * std::sin(0.5 * angle) / s.curvature;
  return {s.from + chord * rotated(s.tangent, -0.5 * angle), normal};
}

Vector2d left_normal(const Vector2d& tangent) { return {-tangent.y(), tangent.x()}; }

}  // namespace abbe::cutting
