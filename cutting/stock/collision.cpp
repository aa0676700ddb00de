#include "cutting/stock/collision.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <queue>
#include <utility>
#include <vector>

#include <fcl/fcl.h>
#include <fcl/math/detail/project.h>
#include <fcl/narrowphase/detail/primitive_shape_algorithm/triangle_distance.h>
#include <tbb/parallel_for.h>

#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::Vector3d;
using Tree = fcl::BVHModel<fcl::OBBRSSd>;
using kinematics::Pose;

struct BodySearch {
  struct Piece {
    Tree tree;
    ClosedMesh mesh;
    bool closed = true;                  // closed itself, or a patch of a closed surface
    std::array<int, 3> cube{};           // of a patch: its cell
    Vector3d centre = Vector3d::Zero();  // of a ball that contains it
    double radius = 0.0;
  };
  std::vector<std::shared_ptr<const Piece>> pieces;
};

namespace {

using Piece = BodySearch::Piece;

/// Returns the first vertex at the position of each vertex. A design has separate vertices on both
/// sides of a sharp edge, whose positions agree to rounding.
std::vector<int> by_place(const Points& vertices) {
  constexpr double grain = 1e-7;  // mm
  const auto place = [&](int i) {
    const Eigen::RowVector3d at = (vertices.row(i) / grain).array().round() + 0.0;
    return std::array<double, 3>{at[0], at[1], at[2]};
  };
  std::vector<int> order(std::size_t(vertices.rows())), first(order.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, place);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_new = i == 0 || place(order[i]) != place(order[i - 1]);
    first[std::size_t(order[i])] = is_new ? order[i] : first[std::size_t(order[i - 1])];
  }
  return first;
}

bool is_closed(const ClosedMesh& mesh) {
  const std::vector<int> vertex = by_place(mesh.vertices);
  std::vector<std::pair<int, int>> edges;
  for (const auto& t : mesh.triangles.rowwise())
    for (int k = 0; k < 3; ++k)
      edges.emplace_back(vertex[std::size_t(t[k])], vertex[std::size_t(t[(k + 1) % 3])]);
  std::ranges::sort(edges);
  return std::ranges::all_of(edges, [&](const auto& edge) {
    return std::ranges::binary_search(edges, std::pair(edge.second, edge.first));
  });
}

/// Returns the radius, mm, of the smallest ball about a point that contains a mesh and its skin.
double ball_radius(const ClosedMesh& mesh, const Vector3d& centre) {
  return mesh.skin + (mesh.vertices.rowwise() - centre.transpose()).rowwise().norm().maxCoeff();
}

Piece open_piece_of(const ClosedMesh& mesh) {
  std::vector<fcl::Vector3d> vertices;
  for (const auto& row : mesh.vertices.rowwise()) vertices.emplace_back(row.transpose());
  std::vector<fcl::Triangle> triangles;
  for (const auto& t : mesh.triangles.rowwise())
    triangles.emplace_back(std::size_t(t[0]), std::size_t(t[1]), std::size_t(t[2]));
  Piece piece;
  piece.mesh = mesh;
  piece.closed = false;
  piece.centre = 0.5 * (mesh.vertices.colwise().minCoeff() + mesh.vertices.colwise().maxCoeff());
  piece.radius = ball_radius(mesh, piece.centre);
  piece.tree.beginModel(int(triangles.size()), int(vertices.size()));
  piece.tree.addSubModel(vertices, triangles);
  piece.tree.endModel();
  return piece;
}

void check(const ClosedMesh& mesh) {
  require(mesh.triangles.rows() > 0, "body: it has no triangles");
  require(mesh.vertices.allFinite(), "body: vertices must be finite");
  require(mesh.triangles.minCoeff() >= 0 && mesh.triangles.maxCoeff() < mesh.vertices.rows(),
          "body: a triangle names a vertex that is not there");
  require(mesh.skin >= 0.0, "body: a skin must not be below zero");
}

Piece piece_of(const ClosedMesh& mesh) {
  check(mesh);
  Piece piece = open_piece_of(mesh);
  piece.closed = is_closed(mesh);
  return piece;
}

}  // namespace

Body make_body(const ClosedMesh& mesh) { return make_body(std::vector<ClosedMesh>{mesh}); }

Body make_body(const std::vector<ClosedMesh>& pieces) {
  require(!pieces.empty(), "body: it has no pieces");
  auto search = std::make_shared<BodySearch>();
  Eigen::AlignedBox3d box;
  for (const ClosedMesh& mesh : pieces) {
    search->pieces.push_back(std::make_shared<const Piece>(piece_of(mesh)));
    for (const auto& row : mesh.vertices.rowwise()) box.extend(row.transpose());
  }
  Body body;
  body.centre = box.center();
  for (const ClosedMesh& mesh : pieces)
    body.radius = std::max(body.radius, ball_radius(mesh, body.centre));
  body.search = std::move(search);
  return body;
}

namespace {

using Cube = std::array<int, 3>;

/// Splits a mesh into patches by the cubes that contain the centroids of its triangles. Each patch
/// has its own vertices.
/// @param size  mm, edge of a cube
std::map<Cube, ClosedMesh> patches_of(const ClosedMesh& mesh, double size) {
  std::map<Cube, std::vector<Eigen::Index>> in_cube;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    const Eigen::RowVector3d middle =
        (mesh.vertices.row(mesh.triangles(t, 0)) + mesh.vertices.row(mesh.triangles(t, 1)) +
         mesh.vertices.row(mesh.triangles(t, 2))) /
        3.0;
    Cube cube;
    for (int k = 0; k < 3; ++k) cube[std::size_t(k)] = int(std::floor(middle[k] / size));
    in_cube[cube].push_back(t);
  }
  std::map<Cube, ClosedMesh> patches;
  std::vector<int> number(std::size_t(mesh.vertices.rows()), -1);
  for (const auto& [cube, triangles] : in_cube) {
    ClosedMesh& patch = patches[cube];
    patch.skin = mesh.skin;
    patch.triangles.resize(Eigen::Index(triangles.size()), 3);
    std::vector<int> used;
    for (std::size_t i = 0; i < triangles.size(); ++i)
      for (int k = 0; k < 3; ++k) {
        const int vertex = mesh.triangles(triangles[i], k);
        int& own = number[std::size_t(vertex)];
        if (own < 0) {
          own = int(used.size());
          used.push_back(vertex);
        }
        patch.triangles(Eigen::Index(i), k) = own;
      }
    patch.vertices = mesh.vertices(used, Eigen::all);
    for (const int vertex : used) number[std::size_t(vertex)] = -1;
  }
  return patches;
}

bool is_same(const ClosedMesh& a, const ClosedMesh& b) {
  return a.vertices.rows() == b.vertices.rows() && a.triangles.rows() == b.triangles.rows() &&
         a.skin == b.skin && a.triangles == b.triangles && a.vertices == b.vertices;
}

}  // namespace

Body make_patched_body(const ClosedMesh& mesh, double size, const Body& before) {
  require(size > 0.0, "body: patches must have a size");
  check(mesh);
  std::map<Cube, std::shared_ptr<const Piece>> had;
  if (before.search)
    for (const auto& piece : before.search->pieces) had[piece->cube] = piece;
  const std::map<Cube, ClosedMesh> patches = patches_of(mesh, size);
  std::vector<const std::pair<const Cube, ClosedMesh>*> all;
  for (const auto& patch : patches) all.push_back(&patch);
  auto search = std::make_shared<BodySearch>();
  search->pieces.resize(all.size());
  tbb::parallel_for(std::size_t(0), all.size(), [&](std::size_t i) {
    const auto& [cube, patch] = *all[i];
    const auto kept = had.find(cube);
    if (kept != had.end() && is_same(kept->second->mesh, patch)) {
      search->pieces[i] = kept->second;
      return;
    }
    Piece piece = open_piece_of(patch);
    piece.closed = true;
    piece.cube = cube;
    search->pieces[i] = std::make_shared<const Piece>(std::move(piece));
  });
  Body body;
  body.centre = 0.5 * (mesh.vertices.colwise().minCoeff() + mesh.vertices.colwise().maxCoeff());
  body.radius = ball_radius(mesh, body.centre);
  body.search = std::move(search);
  return body;
}

std::vector<Ball> hull_balls(const Body& body, std::size_t most) {
  std::vector<Ball> balls;
  for (const auto& piece : body.search->pieces) {
    if (balls.size() + std::size_t(piece->mesh.vertices.rows()) > most) return {};
    for (const auto& row : piece->mesh.vertices.rowwise())
      balls.push_back({row.transpose(), piece->mesh.skin});
  }
  return balls;
}

BodyBalls split_into_balls(const Body& body) {
  BodyBalls found;
  auto rest = std::make_shared<BodySearch>();
  for (const auto& piece : body.search->pieces) {
    const Points& vertices = piece->mesh.vertices;
    if ((vertices.rowwise() - vertices.row(0)).isZero(0.0))
      found.balls.push_back({vertices.row(0), piece->mesh.skin});
    else
      rest->pieces.push_back(piece);
  }
  if (!rest->pieces.empty()) found.rest = Body{body.centre, body.radius, std::move(rest)};
  return found;
}

Body ball_sweep_body(const Points& centres, double radius) {
  const Eigen::Index lines = centres.rows() - 1;
  require(lines >= 1, "swept ball: expected two places of its centre");
  ClosedMesh mesh{centres, Triangles(lines, 3), radius};
  for (Eigen::Index i = 0; i < lines; ++i) mesh.triangles.row(i) << int(i), int(i + 1), int(i + 1);
  return make_body(mesh);
}

Vector3d support_vertex(const Body& body, const Vector3d& direction) {
  double most = -std::numeric_limits<double>::infinity();
  Vector3d farthest = Vector3d::Zero();
  for (const auto& piece : body.search->pieces) {
    if (!(piece->centre.dot(direction) + piece->radius > most)) continue;
    Eigen::Index vertex = 0;
    const double height = piece->mesh.skin + (piece->mesh.vertices * direction).maxCoeff(&vertex);
    if (height <= most) continue;
    most = height;
    farthest = piece->mesh.vertices.row(vertex).transpose() + piece->mesh.skin * direction;
  }
  return farthest;
}

double extent(const Body& body, const Vector3d& direction) {
  return direction.dot(support_vertex(body, direction));
}

double farthest(const Pose& from, const Pose& to, const Body& body) {
  // The norm is 2 sqrt(2) sin(angle / 2), so this is the chord of a unit circle.
  const double turn = (to.linear() - from.linear()).norm() / std::numbers::sqrt2;
  return (to * body.centre - from * body.centre).norm() + turn * body.radius;
}

namespace {

/// Searches two trees for their nearest triangles, with b posed in the frame of a and skins around
/// both. Used instead of FCL's own search, which has no adjustable tolerance.
class NearestTriangles {
 public:
  /// @param skins  mm, sum of both skins
  /// @param most   mm between the meshes; larger distances are not found
  /// @param share  permitted relative error of the distance
  NearestTriangles(const Tree& a, const Tree& b, const Pose& T_ab, double skins, double most,
                   double share)
      : a_(a),
        b_(b),
        R_(T_ab.linear()),
        t_(T_ab.translation()),
        keep_(1.0 / (1.0 + share)),
        skins_(skins) {
    nearest.distance = most;
    descend(0, 0);
  }

  Gap nearest;  ///< in the frame of a

 private:
  using Node = fcl::BVNode<fcl::OBBRSSd>;
  using Corners = std::array<Vector3d, 3>;

  /// Returns a triangle of a in the frame of b. The last one is cached, because it is compared with
  /// many boxes of b in succession.
  const Corners& seen_from_b(int triangle) {
    if (triangle == last_of_a_) return from_b_;
    last_of_a_ = triangle;
    const fcl::Triangle& s = a_.tri_indices[triangle];
    for (std::size_t k = 0; k < 3; ++k) from_b_[k] = R_.transpose() * (a_.vertices[s[k]] - t_);
    return from_b_;
  }
  const Corners& seen_from_a(int triangle) {
    if (triangle == last_of_b_) return from_a_;
    last_of_b_ = triangle;
    const fcl::Triangle& s = b_.tri_indices[triangle];
    for (std::size_t k = 0; k < 3; ++k) from_a_[k] = R_ * b_.vertices[s[k]] + t_;
    return from_a_;
  }

  static Vector3d nearest_of(const Corners& triangle, const Vector3d& point) {
    if (triangle[0] == triangle[1] && triangle[1] == triangle[2]) return triangle[0];
    const auto found =
        fcl::detail::Project<double>::projectTriangle(triangle[0], triangle[1], triangle[2], point);
    Vector3d nearest = Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) nearest += found.parameterization[k] * triangle[k];
    return nearest;
  }

  /// Returns how far a box lies behind a plane of support of a triangle, the one through its point
  /// nearest to the centre of the box: a lower bound of their distance.
  static double parted(const Corners& triangle, const fcl::OBBd& box) {
    const Vector3d way = box.To - nearest_of(triangle, box.To);
    const double distance = way.norm();
    if (!(distance > 0.0)) return 0.0;
    return distance - box.extent.dot((box.axis.transpose() * way).cwiseAbs()) / distance;
  }

  /// Returns a lower bound of the distance between the contents of two nodes. For a single triangle
  /// the bound of FCL is loose, because it encloses the triangle in a rectangle.
  double bound(int i, int j) {
    const Node &of_a = a_.getBV(i), &of_b = b_.getBV(j);
    if (of_a.isLeaf() && of_b.isLeaf()) return 0.0;
    if (of_a.isLeaf()) return parted(seen_from_b(of_a.primitiveId()), of_b.bv.obb);
    if (of_b.isLeaf()) return parted(seen_from_a(of_b.primitiveId()), of_a.bv.obb);
    return fcl::distance(R_, t_, of_a.bv, of_b.bv);
  }

  void descend(int i, int j) {
    const auto &of_a = a_.getBV(i), &of_b = b_.getBV(j);
    if (of_a.isLeaf() && of_b.isLeaf()) return look(of_a.primitiveId(), of_b.primitiveId());
    // The larger box is divided, so that both shrink at the same rate. The nearer half is visited
    // first, because it gives the tighter limit for the other.
    const bool divide_a = of_b.isLeaf() || (!of_a.isLeaf() && of_a.bv.size() > of_b.bv.size());
    std::array<std::array<int, 2>, 2> next = {{{i, of_b.first_child}, {i, of_b.first_child + 1}}};
    if (divide_a) next = {{{of_a.first_child, j}, {of_a.first_child + 1, j}}};
    std::array<double, 2> least = {bound(next[0][0], next[0][1]), bound(next[1][0], next[1][1])};
    if (least[1] < least[0]) {
      std::swap(least[0], least[1]);
      std::swap(next[0], next[1]);
    }
    for (std::size_t k = 0; k < 2; ++k)
      if (least[k] - skins_ < keep_ * (nearest.distance - skins_)) descend(next[k][0], next[k][1]);
  }

  void look(int i, int j) {
    const fcl::Triangle &s = a_.tri_indices[i], &t = b_.tri_indices[j];
    Vector3d on_a, on_b;
    const double distance = fcl::detail::TriangleDistanced::triDistance(
        a_.vertices[s[0]], a_.vertices[s[1]], a_.vertices[s[2]], b_.vertices[t[0]],
        b_.vertices[t[1]], b_.vertices[t[2]], R_, t_, on_a, on_b);
    if (distance < nearest.distance) nearest = {distance, on_a, on_b};
  }

  const Tree &a_, &b_;
  Eigen::Matrix3d R_;
  Vector3d t_;
  double keep_, skins_;
  int last_of_a_ = -1, last_of_b_ = -1;
  Corners from_a_, from_b_;
};

/// Two pieces and a lower bound of their distance, mm.
struct PiecePair {
  const Piece* one;
  const Piece* other;
  double apart;
};

/// Returns all pairs of pieces by ascending lower bound.
std::vector<PiecePair> piece_pairs(const Body& a, const Body& b, const Pose& T_ab) {
  std::vector<PiecePair> pairs;
  pairs.reserve(a.search->pieces.size() * b.search->pieces.size());
  for (const auto& other : b.search->pieces) {
    const Vector3d centre = T_ab * other->centre;
    for (const auto& one : a.search->pieces)
      pairs.push_back(
          {one.get(), other.get(), (one->centre - centre).norm() - one->radius - other->radius});
  }
  if (pairs.size() > 1) std::ranges::stable_sort(pairs, {}, &PiecePair::apart);
  return pairs;
}

}  // namespace

Gap gap(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b, const GapOptions& options) {
  const Pose T_ab = T_a.inverse() * T_b;
  Gap nearest;
  nearest.distance = options.most;
  for (const auto& [one, other, apart] : piece_pairs(a, b, T_ab)) {
    if (!(apart < nearest.distance)) break;
    const double skins = one->mesh.skin + other->mesh.skin;
    const double most = nearest.distance + skins;
    Gap found = NearestTriangles(one->tree, other->tree, T_ab, skins, most, options.share).nearest;
    if (!(found.distance < most)) continue;
    // The nearest points are moved from the meshes to the surfaces of the skins.
    const Vector3d way = found.on_b - found.on_a;
    if (const double length = way.norm(); length > 0.0) {
      found.on_a += std::min(one->mesh.skin, length) / length * way;
      found.on_b -= std::min(other->mesh.skin, length) / length * way;
    }
    nearest = {std::max(0.0, found.distance - skins), T_a * found.on_a, T_a * found.on_b};
    if (nearest.distance == 0.0) return nearest;
  }
  return nearest;
}

namespace {

/// Collects pairs of triangles of two trees that are no farther apart than `within`, with b posed
/// in the frame of a.
class NearTriangles {
 public:
  NearTriangles(const Piece& a, const Piece& b, const Pose& T_ab, double within, std::size_t most)
      : a_(a),
        b_(b),
        R_(T_ab.linear()),
        t_(T_ab.translation()),
        skins_(a.mesh.skin + b.mesh.skin),
        within_(within + skins_) {
    descend(0, 0, most);
  }

  std::vector<TrianglePair> found;

 private:
  /// Returns true if a plane parallel to a face of either box separates them. The test of these six
  /// axes misses some separated boxes but is much faster than all fifteen as in FCL.
  bool are_separated(const fcl::OBBd& one, const fcl::OBBd& other) const {
    const Eigen::Matrix3d R = one.axis.transpose() * (R_ * other.axis), size = R.cwiseAbs();
    const Vector3d way = R_ * other.To + (t_ - one.To), t = one.axis.transpose() * way;
    const Vector3d extent = other.extent + Vector3d::Constant(within_);
    if (((t.cwiseAbs() - one.extent - size * extent).array() > 0.0).any()) return true;
    const Vector3d back = R.transpose() * t;
    return ((back.cwiseAbs() - extent - size.transpose() * one.extent).array() > 0.0).any();
  }

  /// Limits the first half to half of the pairs wanted, so that they do not all come from one
  /// corner.
  void descend(int i, int j, std::size_t most) {
    const auto &of_a = a_.tree.getBV(i), &of_b = b_.tree.getBV(j);
    if (most == 0 || are_separated(of_a.bv.obb, of_b.bv.obb)) return;
    if (of_a.isLeaf() && of_b.isLeaf()) return look(of_a.primitiveId(), of_b.primitiveId());
    const bool divide_a = of_b.isLeaf() || (!of_a.isLeaf() && of_a.bv.size() > of_b.bv.size());
    const std::size_t before = found.size();
    divide_a ? descend(of_a.first_child, j, (most + 1) / 2)
             : descend(i, of_b.first_child, (most + 1) / 2);
    most -= found.size() - before;
    divide_a ? descend(of_a.first_child + 1, j, most) : descend(i, of_b.first_child + 1, most);
  }

  void look(int i, int j) {
    const fcl::Triangle &s = a_.tree.tri_indices[i], &t = b_.tree.tri_indices[j];
    TrianglePair pair;
    pair.skins = skins_;
    for (std::size_t k = 0; k < 3; ++k) {
      pair.of_a[k] = a_.tree.vertices[s[k]];
      pair.of_b[k] = R_ * b_.tree.vertices[t[k]] + t_;
    }
    if (gap(pair, Vector3d::Zero()).distance <= within_ - skins_) found.push_back(pair);
  }

  const Piece &a_, &b_;
  Eigen::Matrix3d R_;
  Vector3d t_;
  double skins_, within_;
};

}  // namespace

std::vector<TrianglePair> near_pairs(const Body& a, const Body& b, const Pose& T_ab, double within,
                                     std::size_t most) {
  std::vector<std::pair<const Piece*, const Piece*>> pieces;
  for (const auto& other : b.search->pieces) {
    const Vector3d centre = T_ab * other->centre;
    for (const auto& one : a.search->pieces)
      if ((one->centre - centre).norm() - one->radius - other->radius <= within)
        pieces.emplace_back(one.get(), other.get());
  }
  std::vector<TrianglePair> all;
  for (std::size_t i = 0; i < pieces.size() && all.size() < most; ++i) {
    const std::size_t left = pieces.size() - i, share = (most - all.size() + left - 1) / left;
    const auto& [one, other] = pieces[i];
    const std::vector<TrianglePair> found = NearTriangles(*one, *other, T_ab, within, share).found;
    all.insert(all.end(), found.begin(), found.end());
  }
  return all;
}

Gap gap(const TrianglePair& pair, const Vector3d& moved) {
  const auto &a = pair.of_a, &b = pair.of_b;
  Gap found;
  found.distance = fcl::detail::TriangleDistanced::triDistance(
      a[0], a[1], a[2], b[0] + moved, b[1] + moved, b[2] + moved, found.on_a, found.on_b);
  found.distance -= pair.skins;
  return found;
}

namespace {

/// Computes the winding number of a closed surface about a point from the crossings of a ray. The
/// point is on the same side of an edge, bit for bit, for both of its triangles, so no crossing is
/// missed or counted twice.
class Crossings {
 public:
  /// @param frame  rotation whose third column is the direction of the ray
  Crossings(const Piece& shell, const Vector3d& point, const Eigen::Matrix3d& frame)
      : shell_(shell), point_(point), across_(frame.transpose()) {
    descend(0);
  }

  int sum = 0;
  bool is_sure = true;  ///< false if the ray hits an edge, so that `sum` means nothing

 private:
  bool is_met(const fcl::OBBd& box) const {
    const Vector3d from = box.axis.transpose() * (point_ - box.To),
                   along = box.axis.transpose() * across_.row(2).transpose();
    double first = 0.0, last = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      // Enlarged, so that rounding loses no crossing.
      const double extent = box.extent[k] + 1e-9 * (1.0 + box.extent.maxCoeff());
      const double one = (-extent - from[k]) / along[k], other = (extent - from[k]) / along[k];
      first = std::max(first, std::min(one, other));
      last = std::min(last, std::max(one, other));
    }
    return first <= last;
  }

  void descend(int i) {
    const auto& node = shell_.tree.getBV(i);
    if (!is_sure || !is_met(node.bv.obb)) return;
    if (node.isLeaf()) return look(node.primitiveId());
    descend(node.first_child);
    descend(node.first_child + 1);
  }

  void look(int triangle) {
    const fcl::Triangle& t = shell_.tree.tri_indices[triangle];
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = across_ * (shell_.tree.vertices[t[k]] - point_);
    Vector3d side;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d &a = p[(k + 1) % 3], &b = p[(k + 2) % 3];
      side[Eigen::Index(k)] = a.x() * b.y() - a.y() * b.x();
    }
    if ((side.array() > 0.0).any() && (side.array() < 0.0).any()) return;
    const double area = side.sum();
    const double ahead = side.dot(Vector3d(p[0].z(), p[1].z(), p[2].z())) / area;
    if ((side.array() == 0.0).any()) {
      is_sure = false;
      return;
    }
    if (ahead > 0.0) sum += area > 0.0 ? 1 : -1;
  }

  const Piece& shell_;
  Vector3d point_;
  Eigen::Matrix3d across_;
};

/// Returns the winding number of a mesh about a point from the solid angles of its triangles.
double windings(const ClosedMesh& mesh, const Vector3d& point) {
  double solid_angle = 0.0;
  for (const auto& t : mesh.triangles.rowwise()) {
    const Vector3d a = mesh.vertices.row(t[0]).transpose() - point,
                   b = mesh.vertices.row(t[1]).transpose() - point,
                   c = mesh.vertices.row(t[2]).transpose() - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2.0 * std::atan2(a.dot(b.cross(c)),
                                    la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4.0 * std::numbers::pi);
}

bool is_around(const Body& outer, const Vector3d& point) {
  // Arbitrary directions, to which edges and faces of a part are unlikely to be parallel.
  for (const Vector3d& turn : {Vector3d(0.41, 0.83, -0.29), Vector3d(-1.13, 0.37, 0.71)}) {
    const Eigen::Matrix3d frame =
        Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    int sum = 0;
    bool is_sure = true;
    for (const auto& shell : outer.search->pieces) {
      if (!shell->closed) continue;
      const Crossings crossings(*shell, point, frame);
      sum += crossings.sum;
      is_sure = is_sure && crossings.is_sure;
    }
    if (is_sure) return sum != 0;
  }
  // Both rays hit an edge: solid angles are slower, but always decide.
  double sum = 0.0;
  for (const auto& shell : outer.search->pieces)
    if (shell->closed) sum += windings(shell->mesh, point);
  return std::abs(sum) > 0.5;
}

/// Returns true if one body encloses a piece of the other.
bool holds(const Body& outer, const Body& inner, const Pose& T) {
  return std::ranges::any_of(inner.search->pieces, [&](const auto& piece) {
    const Vector3d point = T * Vector3d(piece->mesh.vertices.row(0).transpose());
    return (point - outer.centre).norm() <= outer.radius && is_around(outer, point);
  });
}

}  // namespace

bool is_inside(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b) {
  // Contact of the surfaces is not inclusion; how large a distance is does not matter here.
  constexpr double any = 1e-6;  // mm
  return gap(a, T_a, b, T_b, {0.0, any}).distance > 0.0 &&
         is_inside_disjoint(a, b, T_a.inverse() * T_b);
}

bool is_inside_disjoint(const Body& a, const Body& b, const Pose& T_ab) {
  return holds(a, b, T_ab) || holds(b, a, T_ab.inverse());
}

namespace {

/// A lower bound of the distance at time u.
struct Looked {
  double u, distance;
};

/// An interval of time and a lower bound of the distance in it.
struct Stretch {
  Looked from, to;
  double least;
};

// The distance changes at most at `speed`, so it is nowhere below the point where lines of that
// slope from both ends meet.
Stretch stretch(const Looked& from, const Looked& to, double speed) {
  return {from, to, 0.5 * (from.distance + to.distance - speed * (to.u - from.u))};
}

}  // namespace

Approach approach(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                  const ApproachOptions& options) {
  require(options.resolution > 0.0 && options.within > 0.0 && options.share >= 0.0,
          "approach: resolution and within must be positive, the share not negative");
  require(options.rough == 0.0 || (options.rough > 0.0 && options.rough < options.share),
          "approach: distances must be less rough than the share");
  const double speed = kinematics::fastest(b_in_a, b.centre, b.radius);
  Approach nearest;
  nearest.gap.distance = std::numeric_limits<double>::infinity();
  const auto look = [&](double u) -> Looked {
    GapOptions wanted{options.rough};
    // A distance that b cannot cover any more need not be exact.
    if (options.contact_only)
      wanted.most = (1.0 + options.rough) * speed * (1.0 - u) + 2.0 * options.resolution;
    const Gap here = gap(a, Pose::Identity(), b, kinematics::pose_at(b_in_a, u), wanted);
    ++nearest.queries;
    if (here.distance < nearest.gap.distance)
      nearest = {here.distance <= options.resolution, u, here, nearest.queries};
    return {u, here.distance / (1.0 + options.rough)};
  };
  const auto further = [](const Stretch& one, const Stretch& other) {
    return one.least > other.least;
  };
  std::priority_queue<Stretch, std::vector<Stretch>, decltype(further)> open(further);
  for (Looked last = look(0.0); !nearest.contact && last.u < 1.0;) {
    const bool to_the_end = speed * (1.0 - last.u) <= last.distance;
    const Looked next = look(to_the_end ? 1.0 : last.u + last.distance / speed);
    open.push(stretch(last, next, speed));
    last = next;
  }
  const auto allowed = [&] {
    return std::max(options.within, options.share * nearest.gap.distance);
  };
  while (!nearest.contact && !options.contact_only &&
         open.top().least < nearest.gap.distance - allowed()) {
    const auto [from, to, least] = open.top();
    open.pop();
    const Looked middle = look(0.5 * (from.u + to.u));
    open.push(stretch(from, middle, speed));
    open.push(stretch(middle, to, speed));
  }
  return nearest;
}

std::optional<double> comes_within(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                                   double distance, double tolerance) {
  require(tolerance > 0.0, "comes_within: the tolerance must be positive");
  const double speed = kinematics::fastest(b_in_a, b.centre, b.radius);
  for (double u = 0.0;;) {
    const GapOptions wanted{0.0, speed * (1.0 - u) + distance + 2.0 * tolerance};
    const Gap here = gap(a, Pose::Identity(), b, kinematics::pose_at(b_in_a, u), wanted);
    if (here.distance <= distance + tolerance) return u;
    const double room = here.distance - distance;
    if (u >= 1.0 || room > speed * (1.0 - u)) return {};
    u = std::min(u + room / speed, 1.0);
  }
}

}  // namespace abbe::cutting
