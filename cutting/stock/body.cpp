#include "cutting/stock/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh_file.h"
#include "cutting/stock/stock.h"
#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/surface_search.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

/// Returns the number of sides of a polygon around a circle whose corners protrude by at most
/// `sag`; at least 8, so that small bodies keep their shape.
int side_count(double radius, double sag) {
  // The upper limit protects the memory from a sag near rounding.
  constexpr double min_sides = 8.0, max_sides = 1e5;
  const double half_angle = std::acos(radius / (radius + sag));
  return int(std::clamp(std::ceil(std::numbers::pi / half_angle), min_sides, max_sides));
}

ClosedMesh make_mesh(const std::vector<Vector3d>& vertices,
                     const std::vector<std::array<int, 3>>& triangles) {
  return {Eigen::Map<const Points>(vertices.front().data(), Index(vertices.size()), 3),
          triangle_matrix(triangles)};
}

/// Returns the profile with its ends on the axis.
std::vector<Eigen::Vector2d> closed_profile(const Eigen::MatrixX2d& profile) {
  std::vector<Eigen::Vector2d> points;
  if (profile(0, 0) > 0.0) points.emplace_back(0.0, profile(0, 1));
  for (const auto& row : profile.rowwise()) points.emplace_back(row.transpose());
  if (points.back().x() > 0.0) points.emplace_back(0.0, points.back().y());
  return points;
}

}  // namespace

ClosedMesh box_mesh(const Vector3d& size) {
  require(size.allFinite() && (size.array() > 0.0).all(), "box: sizes must be positive");
  const Vector3d half = 0.5 * size;
  Eigen::MatrixX2d outline(4, 2);
  outline << -half.x(), -half.y(), half.x(), -half.y(), half.x(), half.y(), -half.x(), half.y();
  ClosedMesh mesh = extruded_mesh(outline, size.z());
  mesh.vertices.col(2).array() -= half.z();
  return mesh;
}

ClosedMesh revolved_mesh(const Eigen::MatrixX2d& profile, double sag) {
  require(profile.rows() >= 2 && profile.allFinite(),
          "revolution: expected at least two finite points");
  require((profile.col(0).array() >= 0.0).all() && profile.col(0).maxCoeff() > 0.0,
          "revolution: radii must not be negative, nor all zero");
  require(std::isfinite(sag) && sag > 0.0, "revolution: the sag must be positive");
  const std::vector<Eigen::Vector2d> points = closed_profile(profile);
  const int n = side_count(profile.col(0).maxCoeff(), sag);
  // The sides of the polygon touch the circle from outside.
  const double circumscription = 1.0 / std::cos(std::numbers::pi / n);
  std::vector<Vector3d> vertices;
  std::vector<std::array<int, 2>> rings;  // first vertex, and the step to the next: 0 on the axis
  for (const Eigen::Vector2d& point : points) {
    const bool is_on_axis = point.x() == 0.0;
    rings.push_back({int(vertices.size()), is_on_axis ? 0 : 1});
    for (int side = 0; side < (is_on_axis ? 1 : n); ++side) {
      const double angle = 2.0 * std::numbers::pi * side / n, r = circumscription * point.x();
      vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), point.y());
    }
  }
  std::vector<std::array<int, 3>> triangles;
  const auto corner = [&](std::size_t i, int side) {
    return rings[i][0] + rings[i][1] * (side % n);
  };
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    require(points[i] != points[i + 1], "revolution: neighbouring points must differ");
    require(points[i].y() <= points[i + 1].y(), "revolution: heights must not decrease");
    require(rings[i][1] + rings[i + 1][1] > 0, "revolution: the profile must leave the axis once");
    for (int side = 0; side < n; ++side) {
      const int a = corner(i, side), b = corner(i, side + 1), c = corner(i + 1, side + 1),
                d = corner(i + 1, side);
      if (a != b) triangles.push_back({a, b, c});
      if (c != d) triangles.push_back({a, c, d});
    }
  }
  return make_mesh(vertices, triangles);
}

ClosedMesh sphere_mesh(double radius, double sag) {
  require(std::isfinite(radius) && radius > 0.0, "sphere: the radius must be positive");
  require(std::isfinite(sag) && sag > 0.0, "sphere: the sag must be positive");
  // Half of the sag is for the profile, half for the facets around it.
  const int n = (side_count(radius, 0.5 * sag) + 1) / 2;
  const double r = radius / std::cos(0.5 * std::numbers::pi / n);
  Eigen::MatrixX2d profile(n + 1, 2);
  for (int i = 0; i <= n; ++i) {
    const double angle = std::numbers::pi * i / n;
    profile.row(i) << (i == 0 || i == n ? 0.0 : r * std::sin(angle)), -r * std::cos(angle);
  }
  return revolved_mesh(profile, 0.5 * sag);
}

ClosedMesh extruded_mesh(const Eigen::MatrixX2d& outline, double height) {
  require(outline.rows() >= 3 && outline.allFinite(),
          "extrusion: expected at least three finite corners");
  require(std::isfinite(height) && height > 0.0, "extrusion: the height must be positive");
  const int n = int(outline.rows());
  double twice_area = 0.0;
  std::vector<Vector3d> corners;
  for (int i = 0; i < n; ++i) {
    const Eigen::RowVector2d a = outline.row(i), b = outline.row((i + 1) % n);
    twice_area += a.x() * b.y() - a.y() * b.x();
    corners.emplace_back(a.x(), a.y(), 0.0);
  }
  const std::vector<std::array<int, 3>> top = triangulate(corners);
  require(!top.empty() && twice_area > 0.0,
          "extrusion: the outline must run counter-clockwise and not cross itself");
  std::vector<Vector3d> vertices = corners;
  for (const Vector3d& corner : corners) vertices.push_back(corner + height * Vector3d::UnitZ());
  std::vector<std::array<int, 3>> triangles;
  for (const auto& [a, b, c] : top) {
    triangles.push_back({a, c, b});
    triangles.push_back({a + n, b + n, c + n});
  }
  for (int i = 0; i < n; ++i) {
    const int next = (i + 1) % n;
    triangles.push_back({i, next, next + n});
    triangles.push_back({i, next + n, i + n});
  }
  return make_mesh(vertices, triangles);
}

namespace {

/// Returns the profile of a form cutter with every arc replaced by a polygon of its tangents, which
/// contains the arc.
Eigen::MatrixX2d circumscribed_profile(const ToolOutline& outline, double sag) {
  std::vector<Eigen::Vector2d> points{outline.segments.front().from};
  for (const OutlineSegment& segment : outline.segments) {
    const double arc_angle =
        std::acos(std::clamp(segment.normal_from.dot(segment.normal_to), -1.0, 1.0));
    const int sides = segment.radius > 0.0 ? side_count(segment.radius, sag) : 1;
    const int tangent_count =
        std::max(1, int(std::ceil(arc_angle * sides / (2.0 * std::numbers::pi))));
    const double half_angle = 0.5 * arc_angle / tangent_count;
    for (int k = 0; k < tangent_count && segment.radius > 0.0; ++k) {
      const Eigen::Vector2d direction =
          Eigen::Rotation2Dd((2 * k + 1) * half_angle) * segment.normal_from / std::cos(half_angle);
      points.push_back(segment.from + segment.radius * (direction - segment.normal_from));
    }
    points.push_back(segment.to);
  }
  Eigen::MatrixX2d profile(Index(points.size()), 2);
  Index count = 0;
  for (const Eigen::Vector2d& point : points) {
    // The profile begins and ends at the axis, and rounding must not make a height fall.
    const Eigen::RowVector2d next_row(
        std::max(0.0, point.x()),
        std::clamp(point.y(), count > 0 ? profile(count - 1, 1) : 0.0, outline.height));
    if (count == 0 || next_row != profile.row(count - 1)) profile.row(count++) = next_row;
  }
  return profile.topRows(count);
}

}  // namespace

ClosedMesh cutter_mesh(const Cutter& cutter, double sag) {
  check_cutter(cutter);
  require(std::isfinite(sag) && sag > 0.0, "cutter: the sag must be positive");
  if (cutter.outline)
    return revolved_mesh(circumscribed_profile(*cutter.outline, 0.5 * sag), 0.5 * sag);
  const double r = cutter.corner_radius, flat_radius = cutter.radius - r,
               right_angle = 0.5 * std::numbers::pi;
  // The corner becomes a polygon of its tangents, which contains it.
  const int tangent_count = r > 0.0 ? std::max(1, (side_count(r, 0.5 * sag) + 3) / 4) : 0;
  std::vector<Eigen::Vector2d> points{{flat_radius, 0.0}};
  const double tangent_radius =
      tangent_count > 0 ? r / std::cos(0.5 * right_angle / tangent_count) : 0.0;
  for (int k = 0; k < tangent_count; ++k) {
    const double angle = right_angle * (k + 0.5) / tangent_count;
    points.emplace_back(flat_radius + tangent_radius * std::sin(angle),
                        std::max(0.0, r - tangent_radius * std::cos(angle)));
  }
  points.emplace_back(cutter.radius, r);
  if (cutter.flank_length > r) points.emplace_back(cutter.radius, cutter.flank_length);
  const auto duplicates = std::ranges::unique(points);
  points.erase(duplicates.begin(), duplicates.end());
  Eigen::MatrixX2d profile(Index(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) profile.row(Index(i)) = points[i].transpose();
  return revolved_mesh(profile, tangent_count > 0 ? 0.5 * sag : sag);
}

std::vector<ClosedMesh> cutter_meshes(const Cutter& cutter, double sag) {
  check_cutter(cutter);
  if (is_hollow(cutter)) {
    std::vector<ClosedMesh> meshes;
    for (const Cutter& part : convex_parts(cutter)) meshes.push_back(cutter_mesh(part, sag));
    return meshes;
  }
  if (cutter.outline) return {cutter_mesh(cutter, sag)};
  const double r = cutter.corner_radius, flat_radius = cutter.radius - r;
  std::vector<ClosedMesh> meshes;
  if (cutter.flank_length > r) {
    Eigen::MatrixX2d flank(2, 2);
    flank << cutter.radius, r, cutter.radius, cutter.flank_length;
    meshes.push_back(revolved_mesh(flank, sag));
  }
  if (r == 0.0) return meshes;
  std::vector<Vector3d> corners{{0.0, 0.0, r}};
  std::vector<std::array<int, 3>> fan;
  const int n = flat_radius > 0.0 ? side_count(flat_radius, sag) : 0;
  for (int k = 0; k < n; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / n,
                 out = flat_radius / std::cos(std::numbers::pi / n);
    corners.emplace_back(out * std::cos(angle), out * std::sin(angle), r);
    fan.push_back({0, 1 + k, 1 + (k + 1) % n});
  }
  // A degenerate triangle with a skin is a ball.
  if (n == 0) fan.push_back({0, 0, 0});
  meshes.push_back(make_mesh(corners, fan));
  meshes.back().skin = r;
  return meshes;
}

ClosedMesh transformed_mesh(ClosedMesh mesh, const kinematics::Pose& T) {
  mesh.vertices = (mesh.vertices * T.linear().transpose()).rowwise() + T.translation().transpose();
  return mesh;
}

namespace {

constexpr std::size_t chunk_size = 64;  // number of moves that share a box

/// Returns the motion of the point at a distance (mm) above the tip along the axis.
CutterMotion shifted_motion(const CutterMotion& motion, double distance) {
  CutterMotion result = motion;
  result.tip += distance * motion.axis;
  return result;
}

AlignedBox3d expanded(const AlignedBox3d& box, double distance) {
  const Vector3d margin = Vector3d::Constant(distance);
  return {box.min() - margin, box.max() + margin};
}

/// Returns the bounding box of the segment of a shank's axis inside a region; empty if there is
/// none.
AlignedBox3d axis_segment_box(const AlignedBox3d& region, const Vector3d& low_end,
                              const Vector3d& axis, double length) {
  double begin = 0.0, end = length;
  for (int k = 0; k < 3; ++k) {
    if (axis[k] == 0.0) {
      if (low_end[k] < region.min()[k] || low_end[k] > region.max()[k]) return {};
      continue;
    }
    const double a = (region.min()[k] - low_end[k]) / axis[k];
    const double b = (region.max()[k] - low_end[k]) / axis[k];
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  AlignedBox3d box;
  if (begin <= end) box.extend(low_end + begin * axis).extend(low_end + end * axis);
  return box;
}

/// The moves during which a shank enters the box around the part, each with the bounding box of the
/// shank's segment inside. A long shank may lean over much of a part, but its segment in that box
/// is short.
class ChunkedMoves {
 public:
  ChunkedMoves(const Cutter& shank, const CutterMotion& path, const AlignedBox3d& part) {
    for (Index i = 0; i < path.tip.rows(); ++i) {
      const Index next = std::min<Index>(i + 1, path.tip.rows() - 1);
      const AlignedBox3d box = move_box(shank, path, {i, next}, part);
      if (!box.isEmpty()) moves_.push_back({box, int(i)});
    }
    for (std::size_t first = 0; first < moves_.size(); first += chunk_size) {
      AlignedBox3d chunk_box;
      for (std::size_t i = first; i < std::min(first + chunk_size, moves_.size()); ++i)
        chunk_box.extend(moves_[i].box);
      chunks_.push_back(chunk_box);
    }
  }

  bool empty() const { return moves_.empty(); }

  /// Calls visit_move(move) for the moves whose box intersects `box`, until it returns false.
  template <class Visitor>
  void visit(const AlignedBox3d& box, const Visitor& visit_move) const {
    for (std::size_t c = 0; c < chunks_.size(); ++c) {
      if (!chunks_[c].intersects(box)) continue;
      const std::size_t first = c * chunk_size, last = std::min(first + chunk_size, moves_.size());
      for (std::size_t i = first; i < last; ++i)
        if (moves_[i].box.intersects(box) && !visit_move(moves_[i].move)) return;
    }
  }

 private:
  /// Returns the box of one move. Between two samples no point of the shank is farther than
  /// `margin` from its position at one of them.
  static AlignedBox3d move_box(const Cutter& shank, const CutterMotion& path,
                               const std::array<Index, 2>& ends, const AlignedBox3d& part) {
    const double length = shank.flank_length;
    const double margin =
        shank.radius + (path.tip.row(ends[1]) - path.tip.row(ends[0])).norm() +
        2.0 * (length + shank.radius) * (path.axis.row(ends[1]) - path.axis.row(ends[0])).norm();
    AlignedBox3d box;
    for (const Index i : ends) {
      const AlignedBox3d segment_box =
          axis_segment_box(expanded(part, margin), path.tip.row(i), path.axis.row(i), length);
      if (!segment_box.isEmpty()) box.extend(expanded(segment_box, margin));
    }
    return box;
  }

  struct BoxedMove {
    AlignedBox3d box;
    int move;
  };
  std::vector<BoxedMove> moves_;
  std::vector<AlignedBox3d> chunks_;
};

/// A non-cutting section with its path through the region around the part.
struct MovingSection {
  Cutter shape;
  CutterMotion path;
  ChunkedMoves moves;

  MovingSection(const NonCuttingSection& section, const CutterMotion& motion,
                const AlignedBox3d& region)
      : shape(section.shape),
        path(shifted_motion(motion, section.base)),
        moves(shape, path, region) {}
};

/// Depth below the design, mm, and the program line; 0 without contact.
struct VertexDepth {
  double depth = 0.0;
  int line = 0;
  bool continues_deeper = false;  ///< the ray ends inside the shank
};

ShankContact summarize(const std::vector<VertexDepth>& depths, double tolerated_depth) {
  ShankContact contact;
  contact.tolerated_depth = tolerated_depth;
  for (const VertexDepth& vertex : depths) {
    if (vertex.depth <= 0.0) continue;
    contact.continues_deeper |= vertex.continues_deeper;
    if (contact.vertices++ == 0 || vertex.line < contact.first_line)
      contact.first_line = vertex.line;
    if (vertex.depth <= contact.deepest) continue;
    contact.deepest = vertex.depth;
    contact.line = vertex.line;
  }
  return contact;
}

/// Returns the depth of a shank at a vertex, at most that of the inner end of the ray.
/// @param shift  mm along the normal, from the vertex to the ray's point
VertexDepth vertex_depth(const Cutter& shank, const CutterMotion& path, const ChunkedMoves& moves,
                         const Ray& ray, double shift) {
  AlignedBox3d box;
  box.extend(ray.point - ray.band * ray.normal).extend(ray.point + ray.band * ray.normal);
  VertexDepth deepest;
  double limit = ray.band;
  moves.visit(box, [&](int move) {
    const std::optional<Entry> entry = first_entry(shank, move_after(path, move), ray, limit);
    if (!entry) return true;
    if (entry->s >= limit && deepest.depth > 0.0) return true;
    limit = entry->s;
    const Index next = std::min<Index>(move + 1, path.tip.rows() - 1);
    deepest = {std::min(-(entry->s + shift), ray.band - shift), path.line[std::size_t(next)],
               entry->s <= -ray.band};
    return entry->s > -ray.band;
  });
  return deepest;
}

/// The check of one moving section against the vertices of a design.
class ShankCheck {
 public:
  /// @param passed  mm, tolerated depth
  ShankCheck(const Design& design_w, const Cutter& shank, const CutterMotion& path,
             const ChunkedMoves& moves, double tolerated_depth)
      : design_(design_w), shank_(shank), path_(path), moves_(moves), passed_(tolerated_depth) {}

  /// Returns the depth along the normal of a vertex, at most the band (mm).
  VertexDepth depth(Index v, double band) const {
    if (band <= passed_) return {};
    const double shift = -0.5 * (band + passed_);
    const Vector3d normal = design_.normals.row(v);
    const Ray ray{design_.vertices.row(v).transpose() + shift * normal, normal,
                  0.5 * (band - passed_)};
    return vertex_depth(shank_, path_, moves_, ray, shift);
  }

  /// Returns the depth of a contact below the nearest point of the part; zero outside the part.
  VertexDepth depth_inside_part(const WallThickness& part, Index v, VertexDepth contact,
                                double band) const {
    const Vector3d point = design_.vertices.row(v), normal = design_.normals.row(v);
    // A shank that passes behind a thin part does not touch it.
    const auto thickness = part.behind(point, normal, 2.0 * band);
    if (thickness && contact.depth > 0.5 * *thickness) contact = depth(v, 0.5 * *thickness);
    if (contact.depth <= 0.0) return {};
    // At an edge the normal of a vertex may run along the face beyond the edge, and so may a shank
    // that does not touch that face. Therefore the distance to the nearest point of the part
    // counts.
    contact.depth = part.nearest(point - contact.depth * normal, contact.depth);
    return contact.depth > passed_ ? contact : VertexDepth{};
  }

 private:
  const Design& design_;
  const Cutter& shank_;
  const CutterMotion& path_;
  const ChunkedMoves& moves_;
  double passed_;
};

}  // namespace

std::vector<NonCuttingSection> non_cutting_sections(const Eigen::MatrixX2d& profile) {
  std::vector<NonCuttingSection> sections;
  for (Index i = 0; i + 1 < profile.rows(); ++i) {
    const double height = profile(i + 1, 1) - profile(i, 1);
    // An outline needs a flat top, so a cone keeps a radius of a millionth.
    const double top_radius = std::max(profile(i + 1, 0), 1e-6 * profile.col(0).maxCoeff());
    if (height > 0.0)
      sections.push_back(
          {form_cutter(outline_from_points({{{profile(i, 0), 0.0}}, {{top_radius, height}}})),
           profile(i, 1)});
  }
  return sections;
}

std::optional<ShankContact> shank_contact(const Design& design_w, const Cutter& cutter,
                                          const CutterMotion& motion, const ShankOptions& options) {
  const double length = options.length - cutter.flank_length;
  const double radius = options.radius.value_or(shank_radius(cutter));
  if (!(length > 0.0)) return std::nullopt;
  return non_cutting_contact(design_w, {{{radius, 0.0, length}, cutter.flank_length}}, motion,
                             options.band);
}

std::optional<ShankContact> non_cutting_contact(const Design& design_w,
                                                const std::vector<NonCuttingSection>& sections,
                                                const CutterMotion& motion, double band) {
  double max_tolerated = rubbing;
  for (const NonCuttingSection& section : sections)
    max_tolerated = std::min(max_tolerated, 0.25 * section.shape.radius);
  AlignedBox3d part;
  for (Index v = 0; v < design_w.vertices.rows(); ++v)
    part.extend(Vector3d(design_w.vertices.row(v)));
  if (part.isEmpty() || !(band > max_tolerated) || motion.tip.rows() == 0) return std::nullopt;

  // A deque, because the elements contain references to themselves and must not move in memory.
  std::deque<MovingSection> moving_sections;
  for (const NonCuttingSection& section : sections) {
    moving_sections.emplace_back(section, motion, expanded(part, band));
    if (moving_sections.back().moves.empty()) moving_sections.pop_back();
  }
  if (moving_sections.empty()) return std::nullopt;
  std::vector<ShankCheck> checks;
  for (const MovingSection& section : moving_sections) {
    check_milling_input(design_w, section.shape, section.path, band);
    checks.emplace_back(design_w, section.shape, section.path, section.moves, max_tolerated);
  }

  std::vector<VertexDepth> depths(std::size_t(design_w.vertices.rows()));
  std::vector<std::vector<VertexDepth>> section_depths(checks.size(), depths);
  const auto visit_vertices = [&](const auto& visit) {
    tbb::parallel_for(tbb::blocked_range<Index>(0, Index(depths.size()), 64), [&](auto& range) {
      for (Index v = range.begin(); v != range.end(); ++v)
        for (std::size_t k = 0; k < checks.size(); ++k)
          visit(v, checks[k], section_depths[k][std::size_t(v)]);
    });
  };
  visit_vertices(
      [&](Index v, const ShankCheck& check, VertexDepth& depth) { depth = check.depth(v, band); });
  const auto is_contact = [](const VertexDepth& d) { return d.depth > 0.0; };
  if (std::ranges::none_of(section_depths,
                           [&](const auto& d) { return std::ranges::any_of(d, is_contact); }))
    return std::nullopt;
  const WallThickness thickness(design_w);
  visit_vertices([&](Index v, const ShankCheck& check, VertexDepth& depth) {
    if (is_contact(depth)) depth = check.depth_inside_part(thickness, v, depth, band);
  });
  for (const std::vector<VertexDepth>& section : section_depths)
    for (std::size_t v = 0; v < depths.size(); ++v)
      if (section[v].depth > depths[v].depth) depths[v] = section[v];
  const ShankContact contact = summarize(depths, max_tolerated);
  return contact.vertices > 0 ? std::optional(contact) : std::nullopt;
}

}  // namespace abbe::cutting
