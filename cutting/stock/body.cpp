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
int sides_around(double radius, double sag) {
  // the upper limit protects the memory from a sag near rounding
  constexpr double least = 8.0, most = 1e5;
  const double half = std::acos(radius / (radius + sag));
  return int(std::clamp(std::ceil(std::numbers::pi / half), least, most));
}

ClosedMesh mesh_of(const std::vector<Vector3d>& vertices,
                   const std::vector<std::array<int, 3>>& triangles) {
  ClosedMesh mesh{Points(Index(vertices.size()), 3), Triangles(Index(triangles.size()), 3), 0.0};
  for (std::size_t i = 0; i < vertices.size(); ++i)
    mesh.vertices.row(Index(i)) = vertices[i].transpose();
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) mesh.triangles(Index(t), Index(k)) = triangles[t][k];
  return mesh;
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
  require(profile.rows() >= 2 && profile.allFinite(), "revolution: two finite points at least");
  require((profile.col(0).array() >= 0.0).all() && profile.col(0).maxCoeff() > 0.0,
          "revolution: radii must not be below zero, nor all zero");
  require(std::isfinite(sag) && sag > 0.0, "revolution: the sag must be positive");
  const std::vector<Eigen::Vector2d> points = closed_profile(profile);
  const int n = sides_around(profile.col(0).maxCoeff(), sag);
  // the sides of the polygon touch the circle from outside
  const double outwards = 1.0 / std::cos(std::numbers::pi / n);
  std::vector<Vector3d> vertices;
  std::vector<std::array<int, 2>> ring;  // first vertex, and the step to the next: 0 on the axis
  for (const Eigen::Vector2d& point : points) {
    const bool on_axis = point.x() == 0.0;
    ring.push_back({int(vertices.size()), on_axis ? 0 : 1});
    for (int k = 0; k < (on_axis ? 1 : n); ++k) {
      const double angle = 2.0 * std::numbers::pi * k / n, r = outwards * point.x();
      vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), point.y());
    }
  }
  std::vector<std::array<int, 3>> triangles;
  const auto corner = [&](std::size_t i, int k) { return ring[i][0] + ring[i][1] * (k % n); };
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    require(points[i] != points[i + 1], "revolution: neighbouring points must differ");
    require(points[i].y() <= points[i + 1].y(), "revolution: heights must not fall");
    require(ring[i][1] + ring[i + 1][1] > 0, "revolution: the profile must leave the axis once");
    for (int k = 0; k < n; ++k) {
      const int a = corner(i, k), b = corner(i, k + 1), c = corner(i + 1, k + 1),
                d = corner(i + 1, k);
      if (a != b) triangles.push_back({a, b, c});
      if (c != d) triangles.push_back({a, c, d});
    }
  }
  return mesh_of(vertices, triangles);
}

ClosedMesh sphere_mesh(double radius, double sag) {
  require(std::isfinite(radius) && radius > 0.0, "sphere: the radius must be positive");
  require(std::isfinite(sag) && sag > 0.0, "sphere: the sag must be positive");
  // half of the sag for the profile, half for the facets around it
  const int n = (sides_around(radius, 0.5 * sag) + 1) / 2;
  const double r = radius / std::cos(0.5 * std::numbers::pi / n);
  Eigen::MatrixX2d profile(n + 1, 2);
  for (int i = 0; i <= n; ++i) {
    const double angle = std::numbers::pi * i / n;
    profile.row(i) << (i == 0 || i == n ? 0.0 : r * std::sin(angle)), -r * std::cos(angle);
  }
  return revolved_mesh(profile, 0.5 * sag);
}

ClosedMesh extruded_mesh(const Eigen::MatrixX2d& outline, double height) {
  require(outline.rows() >= 3 && outline.allFinite(), "extrusion: three finite corners at least");
  require(std::isfinite(height) && height > 0.0, "extrusion: the height must be positive");
  const int n = int(outline.rows());
  double twice_area = 0.0;
  std::vector<Vector3d> corners;
  for (int i = 0; i < n; ++i) {
    const Eigen::RowVector2d a = outline.row(i), b = outline.row((i + 1) % n);
    twice_area += a.x() * b.y() - a.y() * b.x();
    corners.emplace_back(a.x(), a.y(), 0.0);
  }
  const std::vector<std::array<int, 3>> top = triangulated(corners);
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
  return mesh_of(vertices, triangles);
}

namespace {

/// Returns the profile of a form cutter whose arcs are replaced by polygons of their tangents,
/// which contain them.
Eigen::MatrixX2d profile_around(const ToolOutline& outline, double sag) {
  std::vector<Eigen::Vector2d> points{outline.pieces.front().from};
  for (const OutlinePiece& piece : outline.pieces) {
    const double turn = std::acos(std::clamp(piece.normal_from.dot(piece.normal_to), -1.0, 1.0));
    const int sides = piece.radius > 0.0 ? sides_around(piece.radius, sag) : 1;
    const int tangents = std::max(1, int(std::ceil(turn * sides / (2.0 * std::numbers::pi))));
    const double half = 0.5 * turn / tangents;
    for (int k = 0; k < tangents && piece.radius > 0.0; ++k) {
      const Eigen::Vector2d middle =
          Eigen::Rotation2Dd((2 * k + 1) * half) * piece.normal_from / std::cos(half);
      points.push_back(piece.from + piece.radius * (middle - piece.normal_from));
    }
    points.push_back(piece.to);
  }
  Eigen::MatrixX2d profile(Index(points.size()), 2);
  Index count = 0;
  for (const Eigen::Vector2d& point : points) {
    // The profile begins and ends at the axis, and rounding must not make a height fall.
    const Eigen::RowVector2d next(
        std::max(0.0, point.x()),
        std::clamp(point.y(), count > 0 ? profile(count - 1, 1) : 0.0, outline.height));
    if (count == 0 || next != profile.row(count - 1)) profile.row(count++) = next;
  }
  return profile.topRows(count);
}

}  // namespace

ClosedMesh cutter_mesh(const Cutter& cutter, double sag) {
  check_cutter(cutter);
  require(std::isfinite(sag) && sag > 0.0, "cutter: the sag must be positive");
  if (cutter.outline) return revolved_mesh(profile_around(*cutter.outline, 0.5 * sag), 0.5 * sag);
  const double r = cutter.corner_radius, flat = cutter.radius - r, quarter = 0.5 * std::numbers::pi;
  // The corner is inside the polygon of its tangents.
  const int pieces = r > 0.0 ? std::max(1, (sides_around(r, 0.5 * sag) + 3) / 4) : 0;
  std::vector<Eigen::Vector2d> points{{flat, 0.0}};
  const double out = pieces > 0 ? r / std::cos(0.5 * quarter / pieces) : 0.0;
  for (int k = 0; k < pieces; ++k) {
    const double angle = quarter * (k + 0.5) / pieces;
    points.emplace_back(flat + out * std::sin(angle), std::max(0.0, r - out * std::cos(angle)));
  }
  points.emplace_back(cutter.radius, r);
  if (cutter.flank_length > r) points.emplace_back(cutter.radius, cutter.flank_length);
  const auto same = std::ranges::unique(points);
  points.erase(same.begin(), same.end());
  Eigen::MatrixX2d profile(Index(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) profile.row(Index(i)) = points[i].transpose();
  return revolved_mesh(profile, pieces > 0 ? 0.5 * sag : sag);
}

std::vector<ClosedMesh> cutter_pieces(const Cutter& cutter, double sag) {
  check_cutter(cutter);
  if (is_hollow(cutter)) {
    std::vector<ClosedMesh> pieces;
    for (const Cutter& part : convex_parts(cutter)) pieces.push_back(cutter_mesh(part, sag));
    return pieces;
  }
  if (cutter.outline) return {cutter_mesh(cutter, sag)};
  const double r = cutter.corner_radius, flat = cutter.radius - r;
  std::vector<ClosedMesh> pieces;
  if (cutter.flank_length > r) {
    Eigen::MatrixX2d flank(2, 2);
    flank << cutter.radius, r, cutter.radius, cutter.flank_length;
    pieces.push_back(revolved_mesh(flank, sag));
  }
  if (r == 0.0) return pieces;
  std::vector<Vector3d> corners{{0.0, 0.0, r}};
  std::vector<std::array<int, 3>> fan;
  const int n = flat > 0.0 ? sides_around(flat, sag) : 0;
  for (int k = 0; k < n; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / n,
                 out = flat / std::cos(std::numbers::pi / n);
    corners.emplace_back(out * std::cos(angle), out * std::sin(angle), r);
    fan.push_back({0, 1 + k, 1 + (k + 1) % n});
  }
  // A degenerate triangle with a skin is a ball.
  if (n == 0) fan.push_back({0, 0, 0});
  pieces.push_back(mesh_of(corners, fan));
  pieces.back().skin = r;
  return pieces;
}

ClosedMesh moved(ClosedMesh mesh, const kinematics::Pose& T) {
  mesh.vertices = (mesh.vertices * T.linear().transpose()).rowwise() + T.translation().transpose();
  return mesh;
}

namespace {

constexpr std::size_t chunk_size = 64;  // moves that share a box

/// Returns the motion of the lower end of the shank.
CutterMotion raised(const CutterMotion& motion, double by) {
  CutterMotion up = motion;
  up.tip += by * motion.axis;
  return up;
}

AlignedBox3d grown(const AlignedBox3d& box, double by) {
  const Vector3d margin = Vector3d::Constant(by);
  return {box.min() - margin, box.max() + margin};
}

/// Returns the box of the segment of a shank's axis that lies in `room`; empty if none does.
AlignedBox3d stretch_in(const AlignedBox3d& room, const Vector3d& low_end, const Vector3d& axis,
                        double length) {
  double from = 0.0, to = length;
  for (int k = 0; k < 3; ++k) {
    if (axis[k] == 0.0) {
      if (low_end[k] < room.min()[k] || low_end[k] > room.max()[k]) return {};
      continue;
    }
    const double a = (room.min()[k] - low_end[k]) / axis[k];
    const double b = (room.max()[k] - low_end[k]) / axis[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  AlignedBox3d box;
  if (from <= to) box.extend(low_end + from * axis).extend(low_end + to * axis);
  return box;
}

/// The moves during which a shank enters the box around the part, with boxes around the segments
/// that do. A long shank may lean over much of a part, but the segment of it that is low enough is
/// short.
class ChunkedMoves {
 public:
  ChunkedMoves(const Cutter& shank, const CutterMotion& path, const AlignedBox3d& part) {
    for (Index i = 0; i < path.tip.rows(); ++i) {
      const Index next = std::min<Index>(i + 1, path.tip.rows() - 1);
      const AlignedBox3d box = box_of(shank, path, {i, next}, part);
      if (!box.isEmpty()) moves_.push_back({box, int(i)});
    }
    for (std::size_t first = 0; first < moves_.size(); first += chunk_size) {
      AlignedBox3d all;
      for (std::size_t i = first; i < std::min(first + chunk_size, moves_.size()); ++i)
        all.extend(moves_[i].box);
      chunks_.push_back(all);
    }
  }

  bool empty() const { return moves_.empty(); }

  /// Calls use(move) for the moves whose box intersects this one, until it returns false.
  template <class Use>
  void each(const AlignedBox3d& box, const Use& use) const {
    for (std::size_t c = 0; c < chunks_.size(); ++c) {
      if (!chunks_[c].intersects(box)) continue;
      const std::size_t first = c * chunk_size, last = std::min(first + chunk_size, moves_.size());
      for (std::size_t i = first; i < last; ++i)
        if (moves_[i].box.intersects(box) && !use(moves_[i].move)) return;
    }
  }

 private:
  /// Poses between two samples are nowhere farther from one of them than `margin`.
  static AlignedBox3d box_of(const Cutter& shank, const CutterMotion& path,
                             const std::array<Index, 2>& ends, const AlignedBox3d& part) {
    const double length = shank.flank_length;
    const double margin =
        shank.radius + (path.tip.row(ends[1]) - path.tip.row(ends[0])).norm() +
        2.0 * (length + shank.radius) * (path.axis.row(ends[1]) - path.axis.row(ends[0])).norm();
    AlignedBox3d box;
    for (const Index i : ends) {
      const AlignedBox3d one =
          stretch_in(grown(part, margin), path.tip.row(i), path.axis.row(i), length);
      if (!one.isEmpty()) box.extend(grown(one, margin));
    }
    return box;
  }

  struct Near {
    AlignedBox3d box;
    int move;
  };
  std::vector<Near> moves_;
  std::vector<AlignedBox3d> chunks_;
};

/// A piece with its path through the room around the part.
struct Passing {
  Cutter shape;
  CutterMotion path;
  ChunkedMoves moves;

  Passing(const NonCuttingPiece& piece, const CutterMotion& motion, const AlignedBox3d& room)
      : shape(piece.shape), path(raised(motion, piece.base)), moves(shape, path, room) {}
};

/// mm below the design, and the program line; 0 without contact.
struct Depth {
  double depth = 0.0;
  int line = 0;
  bool deeper = false;  ///< the ray ends inside the shank
};

ShankContact summed(const std::vector<Depth>& depths, double passed) {
  ShankContact contact;
  contact.passed = passed;
  for (const Depth& one : depths) {
    if (one.depth <= 0.0) continue;
    contact.deeper |= one.deeper;
    if (contact.vertices++ == 0 || one.line < contact.first_line) contact.first_line = one.line;
    if (one.depth <= contact.deepest) continue;
    contact.deepest = one.depth;
    contact.line = one.line;
  }
  return contact;
}

/// Returns the depth of a shank at a vertex, at most to the far end of the ray.
Depth depth_at(const Cutter& shank, const CutterMotion& path, const ChunkedMoves& moves,
               const Ray& ray, double middle) {
  AlignedBox3d box;
  box.extend(ray.point - ray.band * ray.normal).extend(ray.point + ray.band * ray.normal);
  Depth deepest;
  double limit = ray.band;
  moves.each(box, [&](int move) {
    const std::optional<Entry> met = first_entry(shank, move_after(path, move), ray, limit);
    if (!met) return true;
    if (met->s >= limit && deepest.depth > 0.0) return true;
    limit = met->s;
    const Index next = std::min<Index>(move + 1, path.tip.rows() - 1);
    deepest = {std::min(-(met->s + middle), ray.band - middle), path.line[std::size_t(next)],
               met->s <= -ray.band};
    return met->s > -ray.band;
  });
  return deepest;
}

/// The check of one moving shank against the vertices of a design.
class ShankCheck {
 public:
  /// @param passed  mm, tolerated depth
  ShankCheck(const Design& design_w, const Cutter& shank, const CutterMotion& path,
             const ChunkedMoves& moves, double passed)
      : design_(design_w), shank_(shank), path_(path), moves_(moves), passed_(passed) {}

  /// Returns the depth along the normal of a vertex.
  Depth depth(Index v, double band) const {
    if (band <= passed_) return {};
    const double middle = -0.5 * (band + passed_);
    const Vector3d normal = design_.normals.row(v);
    const Ray ray{design_.vertices.row(v).transpose() + middle * normal, normal,
                  0.5 * (band - passed_)};
    return depth_at(shank_, path_, moves_, ray, middle);
  }

  /// Returns the depth of a contact along a normal that is inside the part; zero if it is not.
  Depth within(const Thickness& part, Index v, Depth found, double band) const {
    const Vector3d place = design_.vertices.row(v), normal = design_.normals.row(v);
    // A shank that passes behind a thin part does not touch it.
    const auto behind = part.behind(place, normal, 2.0 * band);
    if (behind && found.depth > 0.5 * *behind) found = depth(v, 0.5 * *behind);
    if (found.depth <= 0.0) return {};
    // The normal of a vertex on an edge runs along the face beyond it, as a shank beside that face
    // does. The depth is therefore the distance from the nearest point of the part.
    found.depth = part.nearest(place - found.depth * normal, found.depth);
    return found.depth > passed_ ? found : Depth{};
  }

 private:
  const Design& design_;
  const Cutter& shank_;
  const CutterMotion& path_;
  const ChunkedMoves& moves_;
  double passed_;
};

}  // namespace

std::vector<NonCuttingPiece> non_cutting_pieces(const Eigen::MatrixX2d& profile) {
  std::vector<NonCuttingPiece> pieces;
  for (Index i = 0; i + 1 < profile.rows(); ++i) {
    const double height = profile(i + 1, 1) - profile(i, 1);
    // An outline needs a flat top, so a cone keeps a radius of a millionth.
    const double top = std::max(profile(i + 1, 0), 1e-6 * profile.col(0).maxCoeff());
    if (height > 0.0)
      pieces.push_back({form_cutter(outline_from_points({{{profile(i, 0), 0.0}}, {{top, height}}})),
                        profile(i, 1)});
  }
  return pieces;
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
                                                const std::vector<NonCuttingPiece>& pieces,
                                                const CutterMotion& motion, double band) {
  double passed = rubbing;
  for (const NonCuttingPiece& piece : pieces) passed = std::min(passed, 0.25 * piece.shape.radius);
  AlignedBox3d part;
  for (Index v = 0; v < design_w.vertices.rows(); ++v)
    part.extend(Vector3d(design_w.vertices.row(v)));
  if (part.isEmpty() || !(band > passed) || motion.tip.rows() == 0) return std::nullopt;

  // a deque, because the elements contain references to themselves and must not move
  std::deque<Passing> passing;
  for (const NonCuttingPiece& piece : pieces) {
    passing.emplace_back(piece, motion, grown(part, band));
    if (passing.back().moves.empty()) passing.pop_back();
  }
  if (passing.empty()) return std::nullopt;
  std::vector<ShankCheck> held;
  for (const Passing& one : passing) {
    check_milled(design_w, one.shape, one.path, band);
    held.emplace_back(design_w, one.shape, one.path, one.moves, passed);
  }

  std::vector<Depth> depths(std::size_t(design_w.vertices.rows()));
  std::vector<std::vector<Depth>> of_pieces(held.size(), depths);
  const auto each = [&](const auto& act) {
    tbb::parallel_for(tbb::blocked_range<Index>(0, Index(depths.size()), 64), [&](auto& range) {
      for (Index v = range.begin(); v != range.end(); ++v)
        for (std::size_t k = 0; k < held.size(); ++k) act(v, held[k], of_pieces[k][std::size_t(v)]);
    });
  };
  each([&](Index v, const ShankCheck& one, Depth& depth) { depth = one.depth(v, band); });
  const auto goes_in = [](const Depth& d) { return d.depth > 0.0; };
  if (std::ranges::none_of(of_pieces,
                           [&](const auto& d) { return std::ranges::any_of(d, goes_in); }))
    return std::nullopt;
  const Thickness thickness(design_w);
  each([&](Index v, const ShankCheck& one, Depth& depth) {
    if (goes_in(depth)) depth = one.within(thickness, v, depth, band);
  });
  for (const std::vector<Depth>& one : of_pieces)
    for (std::size_t v = 0; v < depths.size(); ++v)
      if (one[v].depth > depths[v].depth) depths[v] = one[v];
  const ShankContact contact = summed(depths, passed);
  return contact.vertices > 0 ? std::optional(contact) : std::nullopt;
}

}  // namespace abbe::cutting
