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
  struct Component {
    Tree tree;
    ClosedMesh mesh;
    bool closed = true;                  // true also for a patch of a closed surface
    std::array<int, 3> cube{};           // cell of a patch
    Vector3d centre = Vector3d::Zero();  // of a ball that contains the component
    double radius = 0.0;
  };
  std::vector<std::shared_ptr<const Component>> components;
};

namespace {

using Component = BodySearch::Component;

/// Returns, for each vertex, the first vertex at the same position. A design has separate vertices
/// on both sides of a sharp edge, whose positions agree to rounding.
std::vector<int> representative_vertices(const Points& vertices) {
  constexpr double resolution = 1e-7;  // mm
  const auto rounded_position = [&](int i) {
    const Eigen::RowVector3d cell = (vertices.row(i) / resolution).array().round() + 0.0;
    return std::array<double, 3>{cell[0], cell[1], cell[2]};
  };
  std::vector<int> order(std::size_t(vertices.rows())), first(order.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, rounded_position);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_new = i == 0 || rounded_position(order[i]) != rounded_position(order[i - 1]);
    first[std::size_t(order[i])] = is_new ? order[i] : first[std::size_t(order[i - 1])];
  }
  return first;
}

bool is_closed(const ClosedMesh& mesh) {
  const std::vector<int> vertex = representative_vertices(mesh.vertices);
  std::vector<std::pair<int, int>> edges;
  for (const auto& triangle : mesh.triangles.rowwise())
    for (int k = 0; k < 3; ++k)
      edges.emplace_back(vertex[std::size_t(triangle[k])],
                         vertex[std::size_t(triangle[(k + 1) % 3])]);
  std::ranges::sort(edges);
  return std::ranges::all_of(edges, [&](const auto& edge) {
    return std::ranges::binary_search(edges, std::pair(edge.second, edge.first));
  });
}

/// Returns the radius, mm, of the smallest ball about a point that contains a mesh and its skin.
double ball_radius(const ClosedMesh& mesh, const Vector3d& centre) {
  return mesh.skin + (mesh.vertices.rowwise() - centre.transpose()).rowwise().norm().maxCoeff();
}

Component make_open_component(const ClosedMesh& mesh) {
  std::vector<fcl::Vector3d> vertices;
  for (const auto& row : mesh.vertices.rowwise()) vertices.emplace_back(row.transpose());
  std::vector<fcl::Triangle> triangles;
  for (const auto& triangle : mesh.triangles.rowwise())
    triangles.emplace_back(std::size_t(triangle[0]), std::size_t(triangle[1]),
                           std::size_t(triangle[2]));
  Component component;
  component.mesh = mesh;
  component.closed = false;
  component.centre =
      0.5 * (mesh.vertices.colwise().minCoeff() + mesh.vertices.colwise().maxCoeff());
  component.radius = ball_radius(mesh, component.centre);
  component.tree.beginModel(int(triangles.size()), int(vertices.size()));
  component.tree.addSubModel(vertices, triangles);
  component.tree.endModel();
  return component;
}

void check(const ClosedMesh& mesh) {
  require(mesh.triangles.rows() > 0, "body: expected at least one triangle");
  require(mesh.vertices.allFinite(), "body: vertices must be finite");
  require(mesh.triangles.minCoeff() >= 0 && mesh.triangles.maxCoeff() < mesh.vertices.rows(),
          "body: a triangle refers to a vertex that does not exist");
  require(mesh.skin >= 0.0, "body: the skin thickness must not be negative");
}

Component make_component(const ClosedMesh& mesh) {
  check(mesh);
  Component component = make_open_component(mesh);
  component.closed = is_closed(mesh);
  return component;
}

}  // namespace

Body make_body(const ClosedMesh& mesh) { return make_body(std::vector<ClosedMesh>{mesh}); }

Body make_body(const std::vector<ClosedMesh>& meshes) {
  require(!meshes.empty(), "body: expected at least one mesh");
  auto search = std::make_shared<BodySearch>();
  Eigen::AlignedBox3d box;
  for (const ClosedMesh& mesh : meshes) {
    search->components.push_back(std::make_shared<const Component>(make_component(mesh)));
    for (const auto& row : mesh.vertices.rowwise()) box.extend(row.transpose());
  }
  Body body;
  body.centre = box.center();
  for (const ClosedMesh& mesh : meshes)
    body.radius = std::max(body.radius, ball_radius(mesh, body.centre));
  body.search = std::move(search);
  return body;
}

namespace {

using Cube = std::array<int, 3>;

/// Splits a mesh into patches by the cubes that contain the centroids of its triangles. Each patch
/// has its own vertices.
/// @param size  mm, edge of a cube
std::map<Cube, ClosedMesh> split_into_patches(const ClosedMesh& mesh, double size) {
  std::map<Cube, std::vector<Eigen::Index>> triangles_by_cube;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    const Eigen::RowVector3d centroid =
        (mesh.vertices.row(mesh.triangles(t, 0)) + mesh.vertices.row(mesh.triangles(t, 1)) +
         mesh.vertices.row(mesh.triangles(t, 2))) /
        3.0;
    Cube cube;
    for (int k = 0; k < 3; ++k) cube[std::size_t(k)] = int(std::floor(centroid[k] / size));
    triangles_by_cube[cube].push_back(t);
  }
  std::map<Cube, ClosedMesh> patches;
  std::vector<int> vertex_numbers(std::size_t(mesh.vertices.rows()), -1);
  for (const auto& [cube, triangles] : triangles_by_cube) {
    ClosedMesh& patch = patches[cube];
    patch.skin = mesh.skin;
    patch.triangles.resize(Eigen::Index(triangles.size()), 3);
    std::vector<int> patch_vertices;
    for (std::size_t i = 0; i < triangles.size(); ++i)
      for (int k = 0; k < 3; ++k) {
        const int vertex = mesh.triangles(triangles[i], k);
        int& patch_vertex = vertex_numbers[std::size_t(vertex)];
        if (patch_vertex < 0) {
          patch_vertex = int(patch_vertices.size());
          patch_vertices.push_back(vertex);
        }
        patch.triangles(Eigen::Index(i), k) = patch_vertex;
      }
    patch.vertices = mesh.vertices(patch_vertices, Eigen::all);
    for (const int vertex : patch_vertices) vertex_numbers[std::size_t(vertex)] = -1;
  }
  return patches;
}

bool is_same(const ClosedMesh& a, const ClosedMesh& b) {
  return a.vertices.rows() == b.vertices.rows() && a.triangles.rows() == b.triangles.rows() &&
         a.skin == b.skin && a.triangles == b.triangles && a.vertices == b.vertices;
}

}  // namespace

Body make_patched_body(const ClosedMesh& mesh, double size, const Body& previous_body) {
  require(size > 0.0, "body: the patch size must be positive");
  check(mesh);
  std::map<Cube, std::shared_ptr<const Component>> previous_components;
  if (previous_body.search)
    for (const auto& component : previous_body.search->components)
      previous_components[component->cube] = component;
  const std::map<Cube, ClosedMesh> patches = split_into_patches(mesh, size);
  std::vector<const std::pair<const Cube, ClosedMesh>*> patch_list;
  for (const auto& patch : patches) patch_list.push_back(&patch);
  auto search = std::make_shared<BodySearch>();
  search->components.resize(patch_list.size());
  tbb::parallel_for(std::size_t(0), patch_list.size(), [&](std::size_t i) {
    const auto& [cube, patch] = *patch_list[i];
    const auto previous = previous_components.find(cube);
    if (previous != previous_components.end() && is_same(previous->second->mesh, patch)) {
      search->components[i] = previous->second;
      return;
    }
    Component component = make_open_component(patch);
    component.closed = true;
    component.cube = cube;
    search->components[i] = std::make_shared<const Component>(std::move(component));
  });
  Body body;
  body.centre = 0.5 * (mesh.vertices.colwise().minCoeff() + mesh.vertices.colwise().maxCoeff());
  body.radius = ball_radius(mesh, body.centre);
  body.search = std::move(search);
  return body;
}

std::vector<Ball> hull_balls(const Body& body, std::size_t max_balls) {
  std::vector<Ball> balls;
  for (const auto& component : body.search->components) {
    if (balls.size() + std::size_t(component->mesh.vertices.rows()) > max_balls) return {};
    for (const auto& row : component->mesh.vertices.rowwise())
      balls.push_back({row.transpose(), component->mesh.skin});
  }
  return balls;
}

BodyBalls split_into_balls(const Body& body) {
  BodyBalls result;
  auto other_components = std::make_shared<BodySearch>();
  for (const auto& component : body.search->components) {
    const Points& vertices = component->mesh.vertices;
    if ((vertices.rowwise() - vertices.row(0)).isZero(0.0))
      result.balls.push_back({vertices.row(0), component->mesh.skin});
    else
      other_components->components.push_back(component);
  }
  if (!other_components->components.empty())
    result.rest = Body{body.centre, body.radius, std::move(other_components)};
  return result;
}

Body ball_sweep_body(const Points& centres, double radius) {
  const Eigen::Index segment_count = centres.rows() - 1;
  require(segment_count >= 1, "swept ball: expected at least two positions of its centre");
  ClosedMesh mesh{centres, Triangles(segment_count, 3), radius};
  for (Eigen::Index i = 0; i < segment_count; ++i)
    mesh.triangles.row(i) << int(i), int(i + 1), int(i + 1);
  return make_body(mesh);
}

Vector3d support_vertex(const Body& body, const Vector3d& direction) {
  double max_height = -std::numeric_limits<double>::infinity();
  Vector3d support_point = Vector3d::Zero();
  for (const auto& component : body.search->components) {
    if (!(component->centre.dot(direction) + component->radius > max_height)) continue;
    Eigen::Index vertex = 0;
    const double height =
        component->mesh.skin + (component->mesh.vertices * direction).maxCoeff(&vertex);
    if (height <= max_height) continue;
    max_height = height;
    support_point =
        component->mesh.vertices.row(vertex).transpose() + component->mesh.skin * direction;
  }
  return support_point;
}

double extent(const Body& body, const Vector3d& direction) {
  return direction.dot(support_vertex(body, direction));
}

double max_displacement(const Pose& from, const Pose& to, const Body& body) {
  // The norm is 2 sqrt(2) sin(angle / 2), so this is the chord of a unit circle.
  const double rotation_chord = (to.linear() - from.linear()).norm() / std::numbers::sqrt2;
  return (to * body.centre - from * body.centre).norm() + rotation_chord * body.radius;
}

namespace {

/// Search for the nearest triangles of two trees with skins, with b posed in the frame of a. FCL's
/// own search has no adjustable tolerance.
class NearestTriangles {
 public:
  /// @param skins           mm, sum of both skins
  /// @param max_distance    mm between the meshes; larger distances are not found
  /// @param relative_error  permitted error of the distance
  NearestTriangles(const Tree& a, const Tree& b, const Pose& T_ab, double skins,
                   double max_distance, double relative_error)
      : a_(a),
        b_(b),
        R_(T_ab.linear()),
        t_(T_ab.translation()),
        improvement_factor_(1.0 / (1.0 + relative_error)),
        skins_(skins) {
    nearest.distance = max_distance;
    descend(0, 0);
  }

  Gap nearest;  ///< in the frame of a

 private:
  using Node = fcl::BVNode<fcl::OBBRSSd>;
  using Corners = std::array<Vector3d, 3>;

  /// Returns a triangle of a in the frame of b. Caches the last one, because it is compared with
  /// many boxes of b in succession.
  const Corners& triangle_of_a_in_b(int triangle) {
    if (triangle == cached_of_a_) return corners_in_b_;
    cached_of_a_ = triangle;
    const fcl::Triangle& s = a_.tri_indices[triangle];
    for (std::size_t k = 0; k < 3; ++k)
      corners_in_b_[k] = R_.transpose() * (a_.vertices[s[k]] - t_);
    return corners_in_b_;
  }
  const Corners& triangle_of_b_in_a(int triangle) {
    if (triangle == cached_of_b_) return corners_in_a_;
    cached_of_b_ = triangle;
    const fcl::Triangle& s = b_.tri_indices[triangle];
    for (std::size_t k = 0; k < 3; ++k) corners_in_a_[k] = R_ * b_.vertices[s[k]] + t_;
    return corners_in_a_;
  }

  static Vector3d nearest_point(const Corners& triangle, const Vector3d& point) {
    if (triangle[0] == triangle[1] && triangle[1] == triangle[2]) return triangle[0];
    const auto projection =
        fcl::detail::Project<double>::projectTriangle(triangle[0], triangle[1], triangle[2], point);
    Vector3d nearest = Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) nearest += projection.parameterization[k] * triangle[k];
    return nearest;
  }

  /// Returns a lower bound of the distance between a triangle and a box: the distance of the box
  /// from the plane through the triangle's point nearest to the centre of the box, normal to their
  /// connection.
  static double box_distance_bound(const Corners& triangle, const fcl::OBBd& box) {
    const Vector3d displacement = box.To - nearest_point(triangle, box.To);
    const double distance = displacement.norm();
    if (!(distance > 0.0)) return 0.0;
    return distance - box.extent.dot((box.axis.transpose() * displacement).cwiseAbs()) / distance;
  }

  /// Returns a lower bound of the distance between the contents of two nodes. For a single triangle
  /// the bound of FCL is loose, because it encloses the triangle in a rectangle.
  double bound(int i, int j) {
    const Node &node_a = a_.getBV(i), &node_b = b_.getBV(j);
    if (node_a.isLeaf() && node_b.isLeaf()) return 0.0;
    if (node_a.isLeaf())
      return box_distance_bound(triangle_of_a_in_b(node_a.primitiveId()), node_b.bv.obb);
    if (node_b.isLeaf())
      return box_distance_bound(triangle_of_b_in_a(node_b.primitiveId()), node_a.bv.obb);
    return fcl::distance(R_, t_, node_a.bv, node_b.bv);
  }

  void descend(int i, int j) {
    const auto &node_a = a_.getBV(i), &node_b = b_.getBV(j);
    if (node_a.isLeaf() && node_b.isLeaf())
      return compare_triangles(node_a.primitiveId(), node_b.primitiveId());
    // The larger box is divided, so that both shrink at the same rate. The nearer half is visited
    // first, because it gives the tighter limit for the other.
    const bool splits_a =
        node_b.isLeaf() || (!node_a.isLeaf() && node_a.bv.size() > node_b.bv.size());
    std::array<std::array<int, 2>, 2> pairs = {
        {{i, node_b.first_child}, {i, node_b.first_child + 1}}};
    if (splits_a) pairs = {{{node_a.first_child, j}, {node_a.first_child + 1, j}}};
    std::array<double, 2> bounds = {bound(pairs[0][0], pairs[0][1]),
                                    bound(pairs[1][0], pairs[1][1])};
    if (bounds[1] < bounds[0]) {
      std::swap(bounds[0], bounds[1]);
      std::swap(pairs[0], pairs[1]);
    }
    for (std::size_t k = 0; k < 2; ++k)
      if (bounds[k] - skins_ < improvement_factor_ * (nearest.distance - skins_))
        descend(pairs[k][0], pairs[k][1]);
  }

  void compare_triangles(int i, int j) {
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
  double improvement_factor_, skins_;
  int cached_of_a_ = -1, cached_of_b_ = -1;
  Corners corners_in_a_, corners_in_b_;
};

/// Two components and a lower bound of their distance, mm.
struct ComponentPair {
  const Component* component_a;
  const Component* component_b;
  double min_distance;
};

/// Returns all pairs of components in the order of their lower bounds.
std::vector<ComponentPair> component_pairs(const Body& a, const Body& b, const Pose& T_ab) {
  std::vector<ComponentPair> pairs;
  pairs.reserve(a.search->components.size() * b.search->components.size());
  for (const auto& component_b : b.search->components) {
    const Vector3d centre = T_ab * component_b->centre;
    for (const auto& component_a : a.search->components)
      pairs.push_back(
          {component_a.get(), component_b.get(),
           (component_a->centre - centre).norm() - component_a->radius - component_b->radius});
  }
  if (pairs.size() > 1) std::ranges::stable_sort(pairs, {}, &ComponentPair::min_distance);
  return pairs;
}

}  // namespace

Gap gap(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b, const GapOptions& options) {
  const Pose T_ab = T_a.inverse() * T_b;
  Gap nearest;
  nearest.distance = options.max_distance;
  for (const auto& [component_a, component_b, min_distance] : component_pairs(a, b, T_ab)) {
    if (!(min_distance < nearest.distance)) break;
    const double skins = component_a->mesh.skin + component_b->mesh.skin;
    const double max_distance = nearest.distance + skins;
    Gap candidate = NearestTriangles(component_a->tree, component_b->tree, T_ab, skins,
                                     max_distance, options.relative_error)
                        .nearest;
    if (!(candidate.distance < max_distance)) continue;
    // Move the nearest points from the meshes to the surfaces of the skins.
    const Vector3d displacement = candidate.on_b - candidate.on_a;
    if (const double length = displacement.norm(); length > 0.0) {
      candidate.on_a += std::min(component_a->mesh.skin, length) / length * displacement;
      candidate.on_b -= std::min(component_b->mesh.skin, length) / length * displacement;
    }
    nearest = {std::max(0.0, candidate.distance - skins), T_a * candidate.on_a,
               T_a * candidate.on_b};
    if (nearest.distance == 0.0) return nearest;
  }
  return nearest;
}

namespace {

/// The pairs of triangles of two trees whose distance is at most `max_distance`, with b posed in
/// the frame of a.
class NearTriangles {
 public:
  NearTriangles(const Component& a, const Component& b, const Pose& T_ab, double max_distance,
                std::size_t max_pairs)
      : a_(a),
        b_(b),
        R_(T_ab.linear()),
        t_(T_ab.translation()),
        skins_(a.mesh.skin + b.mesh.skin),
        max_distance_(max_distance + skins_) {
    descend(0, 0, max_pairs);
  }

  std::vector<TrianglePair> pairs;

 private:
  /// Returns true if a plane parallel to a face of either box separates the boxes. Testing these
  /// six axes misses some separated boxes, but is much faster than all fifteen as in FCL.
  bool are_separated(const fcl::OBBd& box_a, const fcl::OBBd& box_b) const {
    const Eigen::Matrix3d R = box_a.axis.transpose() * (R_ * box_b.axis), abs_R = R.cwiseAbs();
    const Vector3d displacement = R_ * box_b.To + (t_ - box_a.To),
                   t = box_a.axis.transpose() * displacement;
    const Vector3d extent = box_b.extent + Vector3d::Constant(max_distance_);
    if (((t.cwiseAbs() - box_a.extent - abs_R * extent).array() > 0.0).any()) return true;
    const Vector3d displacement_in_b = R.transpose() * t;
    return ((displacement_in_b.cwiseAbs() - extent - abs_R.transpose() * box_a.extent).array() >
            0.0)
        .any();
  }

  /// Collects the pairs below two nodes. The first half may take only half of the limit, so that
  /// the pairs do not all come from one corner.
  void descend(int i, int j, std::size_t max_pairs) {
    const auto &node_a = a_.tree.getBV(i), &node_b = b_.tree.getBV(j);
    if (max_pairs == 0 || are_separated(node_a.bv.obb, node_b.bv.obb)) return;
    if (node_a.isLeaf() && node_b.isLeaf())
      return test_pair(node_a.primitiveId(), node_b.primitiveId());
    const bool splits_a =
        node_b.isLeaf() || (!node_a.isLeaf() && node_a.bv.size() > node_b.bv.size());
    const std::size_t previous_count = pairs.size();
    splits_a ? descend(node_a.first_child, j, (max_pairs + 1) / 2)
             : descend(i, node_b.first_child, (max_pairs + 1) / 2);
    max_pairs -= pairs.size() - previous_count;
    splits_a ? descend(node_a.first_child + 1, j, max_pairs)
             : descend(i, node_b.first_child + 1, max_pairs);
  }

  void test_pair(int i, int j) {
    const fcl::Triangle &s = a_.tree.tri_indices[i], &t = b_.tree.tri_indices[j];
    TrianglePair pair;
    pair.skins = skins_;
    for (std::size_t k = 0; k < 3; ++k) {
      pair.of_a[k] = a_.tree.vertices[s[k]];
      pair.of_b[k] = R_ * b_.tree.vertices[t[k]] + t_;
    }
    if (gap(pair, Vector3d::Zero()).distance <= max_distance_ - skins_) pairs.push_back(pair);
  }

  const Component &a_, &b_;
  Eigen::Matrix3d R_;
  Vector3d t_;
  double skins_, max_distance_;
};

}  // namespace

std::vector<TrianglePair> near_pairs(const Body& a, const Body& b, const Pose& T_ab,
                                     double max_distance, std::size_t max_pairs) {
  std::vector<std::pair<const Component*, const Component*>> component_pairs;
  for (const auto& component_b : b.search->components) {
    const Vector3d centre = T_ab * component_b->centre;
    for (const auto& component_a : a.search->components)
      if ((component_a->centre - centre).norm() - component_a->radius - component_b->radius <=
          max_distance)
        component_pairs.emplace_back(component_a.get(), component_b.get());
  }
  std::vector<TrianglePair> pairs;
  for (std::size_t i = 0; i < component_pairs.size() && pairs.size() < max_pairs; ++i) {
    const std::size_t remaining = component_pairs.size() - i,
                      quota = (max_pairs - pairs.size() + remaining - 1) / remaining;
    const auto& [component_a, component_b] = component_pairs[i];
    const std::vector<TrianglePair> near =
        NearTriangles(*component_a, *component_b, T_ab, max_distance, quota).pairs;
    pairs.insert(pairs.end(), near.begin(), near.end());
  }
  return pairs;
}

Gap gap(const TrianglePair& pair, const Vector3d& translation) {
  const auto &a = pair.of_a, &b = pair.of_b;
  Gap result;
  result.distance = fcl::detail::TriangleDistanced::triDistance(
      a[0], a[1], a[2], b[0] + translation, b[1] + translation, b[2] + translation, result.on_a,
      result.on_b);
  result.distance -= pair.skins;
  return result;
}

namespace {

/// The winding number of a closed surface about a point from the crossings of a ray. For both
/// triangles of an edge the ray is on the same side of the edge, bit for bit, so no crossing is
/// missed or counted twice.
class RayCrossings {
 public:
  /// @param frame  rotation whose third column is the direction of the ray
  RayCrossings(const Component& component, const Vector3d& point, const Eigen::Matrix3d& frame)
      : component_(component), point_(point), to_frame_(frame.transpose()) {
    descend(0);
  }

  int sum = 0;
  bool is_sure = true;  ///< false if the ray hits an edge, so that `sum` is not valid

 private:
  bool intersects(const fcl::OBBd& box) const {
    const Vector3d offset = box.axis.transpose() * (point_ - box.To),
                   direction = box.axis.transpose() * to_frame_.row(2).transpose();
    double line_begin = 0.0, line_end = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      // Enlarged so that rounding misses no crossing.
      const double extent = box.extent[k] + 1e-9 * (1.0 + box.extent.maxCoeff());
      const double entry = (-extent - offset[k]) / direction[k],
                   exit = (extent - offset[k]) / direction[k];
      line_begin = std::max(line_begin, std::min(entry, exit));
      line_end = std::min(line_end, std::max(entry, exit));
    }
    return line_begin <= line_end;
  }

  void descend(int i) {
    const auto& node = component_.tree.getBV(i);
    if (!is_sure || !intersects(node.bv.obb)) return;
    if (node.isLeaf()) return count_crossing(node.primitiveId());
    descend(node.first_child);
    descend(node.first_child + 1);
  }

  void count_crossing(int triangle) {
    const fcl::Triangle& t = component_.tree.tri_indices[triangle];
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k)
      p[k] = to_frame_ * (component_.tree.vertices[t[k]] - point_);
    Vector3d side;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d &a = p[(k + 1) % 3], &b = p[(k + 2) % 3];
      side[Eigen::Index(k)] = a.x() * b.y() - a.y() * b.x();
    }
    if ((side.array() > 0.0).any() && (side.array() < 0.0).any()) return;
    const double area = side.sum();
    const double height = side.dot(Vector3d(p[0].z(), p[1].z(), p[2].z())) / area;
    if ((side.array() == 0.0).any()) {
      is_sure = false;
      return;
    }
    if (height > 0.0) sum += area > 0.0 ? 1 : -1;
  }

  const Component& component_;
  Vector3d point_;
  Eigen::Matrix3d to_frame_;
};

/// Returns the winding number of a mesh about a point from the solid angles of its triangles.
double winding_number(const ClosedMesh& mesh, const Vector3d& point) {
  double solid_angle = 0.0;
  for (const auto& triangle : mesh.triangles.rowwise()) {
    const Vector3d a = mesh.vertices.row(triangle[0]).transpose() - point,
                   b = mesh.vertices.row(triangle[1]).transpose() - point,
                   c = mesh.vertices.row(triangle[2]).transpose() - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2.0 * std::atan2(a.dot(b.cross(c)),
                                    la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4.0 * std::numbers::pi);
}

bool encloses_point(const Body& outer, const Vector3d& point) {
  // Arbitrary directions that are unlikely to be parallel to edges and faces of a part.
  for (const Vector3d& rotation : {Vector3d(0.41, 0.83, -0.29), Vector3d(-1.13, 0.37, 0.71)}) {
    const Eigen::Matrix3d frame =
        Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
    int sum = 0;
    bool is_sure = true;
    for (const auto& component : outer.search->components) {
      if (!component->closed) continue;
      const RayCrossings crossings(*component, point, frame);
      sum += crossings.sum;
      is_sure = is_sure && crossings.is_sure;
    }
    if (is_sure) return sum != 0;
  }
  // If both rays hit an edge, solid angles decide; they are slower, but always valid.
  double sum = 0.0;
  for (const auto& component : outer.search->components)
    if (component->closed) sum += winding_number(component->mesh, point);
  return std::abs(sum) > 0.5;
}

/// Returns true if one body encloses a component of the other.
bool encloses_component(const Body& outer, const Body& inner, const Pose& T) {
  return std::ranges::any_of(inner.search->components, [&](const auto& component) {
    const Vector3d point = T * Vector3d(component->mesh.vertices.row(0).transpose());
    return (point - outer.centre).norm() <= outer.radius && encloses_point(outer, point);
  });
}

}  // namespace

bool is_inside(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b) {
  // Contact of the surfaces is not inclusion. The distance itself does not matter, so it is
  // limited.
  constexpr double max_query_distance = 1e-6;  // mm
  return gap(a, T_a, b, T_b, {0.0, max_query_distance}).distance > 0.0 &&
         is_inside_disjoint(a, b, T_a.inverse() * T_b);
}

bool is_inside_disjoint(const Body& a, const Body& b, const Pose& T_ab) {
  return encloses_component(a, b, T_ab) || encloses_component(b, a, T_ab.inverse());
}

namespace {

/// A lower bound of the distance, mm, at time u.
struct DistanceSample {
  double u, distance;
};

/// An interval of time with a lower bound of the distance.
struct TimeSegment {
  DistanceSample from, to;
  double min_distance;
};

// The distance changes at most at `speed`, so lines of that slope from both ends bound it; their
// intersection is the minimum.
TimeSegment make_segment(const DistanceSample& from, const DistanceSample& to, double speed) {
  return {from, to, 0.5 * (from.distance + to.distance - speed * (to.u - from.u))};
}

}  // namespace

Approach approach(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                  const ApproachOptions& options) {
  require(options.resolution > 0.0 && options.within > 0.0 && options.share >= 0.0,
          "approach: resolution and within must be positive, the share not negative");
  require(options.query_error == 0.0 ||
              (options.query_error > 0.0 && options.query_error < options.share),
          "approach: query_error must be between 0 and share");
  const double speed = kinematics::max_speed(b_in_a, b.centre, b.radius);
  Approach nearest;
  nearest.gap.distance = std::numeric_limits<double>::infinity();
  const auto sample = [&](double u) -> DistanceSample {
    GapOptions gap_options{options.query_error};
    // A distance that b cannot cover until the end need not be exact.
    if (options.contact_only)
      gap_options.max_distance =
          (1.0 + options.query_error) * speed * (1.0 - u) + 2.0 * options.resolution;
    const Gap current_gap =
        gap(a, Pose::Identity(), b, kinematics::pose_at(b_in_a, u), gap_options);
    ++nearest.queries;
    if (current_gap.distance < nearest.gap.distance)
      nearest = {current_gap.distance <= options.resolution, u, current_gap, nearest.queries};
    return {u, current_gap.distance / (1.0 + options.query_error)};
  };
  const auto has_larger_bound = [](const TimeSegment& first, const TimeSegment& second) {
    return first.min_distance > second.min_distance;
  };
  std::priority_queue<TimeSegment, std::vector<TimeSegment>, decltype(has_larger_bound)> queue(
      has_larger_bound);
  for (DistanceSample previous = sample(0.0); !nearest.contact && previous.u < 1.0;) {
    const bool reaches_end = speed * (1.0 - previous.u) <= previous.distance;
    const DistanceSample next = sample(reaches_end ? 1.0 : previous.u + previous.distance / speed);
    queue.push(make_segment(previous, next, speed));
    previous = next;
  }
  const auto tolerance = [&] {
    return std::max(options.within, options.share * nearest.gap.distance);
  };
  while (!nearest.contact && !options.contact_only &&
         queue.top().min_distance < nearest.gap.distance - tolerance()) {
    const auto [from, to, min_distance] = queue.top();
    queue.pop();
    const DistanceSample middle = sample(0.5 * (from.u + to.u));
    queue.push(make_segment(from, middle, speed));
    queue.push(make_segment(middle, to, speed));
  }
  return nearest;
}

std::optional<double> first_time_within(const Body& a, const Body& b,
                                        const kinematics::Screw& b_in_a, double distance,
                                        double tolerance) {
  require(tolerance > 0.0, "first_time_within: the tolerance must be positive");
  const double speed = kinematics::max_speed(b_in_a, b.centre, b.radius);
  for (double u = 0.0;;) {
    const GapOptions gap_options{0.0, speed * (1.0 - u) + distance + 2.0 * tolerance};
    const Gap current_gap =
        gap(a, Pose::Identity(), b, kinematics::pose_at(b_in_a, u), gap_options);
    if (current_gap.distance <= distance + tolerance) return u;
    const double margin = current_gap.distance - distance;
    if (u >= 1.0 || margin > speed * (1.0 - u)) return {};
    u = std::min(u + margin / speed, 1.0);
  }
}

}  // namespace abbe::cutting
