#include "cutting/part/design_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <tbb/parallel_invoke.h>
#include <Eigen/Geometry>

#include "cutting/part/index_sets.h"
#include "cutting/part/primitive.h"

namespace abbe::cutting {

using Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr int max_leaf_triangles = 4;
constexpr int min_parallel_triangles = 4096;  // fewer triangles are not worth a separate task
constexpr double ray_slack = 1e-9;            // of a triangle's size, so that no ray passes between
                                              // two triangles
constexpr double contact_tolerance = 1e-9;    // mm; a ray that starts nearer to a triangle touches
                                              // it

/// Returns the numbers of nodes of a tree of n triangles and of one of n + 1. An odd n has halves
/// of both sizes; computing both numbers together keeps the recursion at log n steps.
std::pair<int, int> node_counts(int n) {
  if (n < max_leaf_triangles) return {1, 1};
  const auto [half_nodes, larger_half_nodes] = node_counts(n / 2);
  const int even = 1 + 2 * half_nodes, odd = 1 + half_nodes + larger_half_nodes;
  const int nodes = n <= max_leaf_triangles ? 1 : (n % 2 == 0 ? even : odd);
  return {nodes, n % 2 == 0 ? odd : 1 + 2 * larger_half_nodes};
}

/// Returns true if a ray meets the box within `max_distance`. The box is enlarged because a point
/// on a rim may lie outside it by rounding while the ray runs along a side of the box.
bool ray_meets_box(const AlignedBox3d& box, const Vector3d& start, const Vector3d& direction,
                   double max_distance) {
  double entry = 0.0, exit = max_distance;
  for (int k = 0; k < 3; ++k) {
    const double low = box.min()[k] - contact_tolerance, high = box.max()[k] + contact_tolerance;
    if (direction[k] == 0.0) {
      if (start[k] < low || start[k] > high) return false;
      continue;
    }
    const double a = (low - start[k]) / direction[k], b = (high - start[k]) / direction[k];
    entry = std::max(entry, std::min(a, b));
    exit = std::min(exit, std::max(a, b));
  }
  return entry <= exit;
}

}  // namespace

TriangleTree::TriangleTree(Points vertices, Triangles triangles)
    : vertices_(std::move(vertices)),
      corners_(std::move(triangles)),
      order_(std::size_t(corners_.rows())) {
  std::iota(order_.begin(), order_.end(), 0);
  if (order_.empty()) return;
  Points centroids(corners_.rows(), 3);
  for (Index t = 0; t < corners_.rows(); ++t)
    centroids.row(t) = (vertices_.row(corners_(t, 0)) + vertices_.row(corners_(t, 1)) +
                        vertices_.row(corners_(t, 2))) /
                       3.0;
  nodes_.resize(std::size_t(node_counts(int(order_.size())).first));
  fill_node(0, 0, int(order_.size()), centroids);
}

void TriangleTree::fill_node(int node, int first, int last, const Points& centroids) {
  Node& current = nodes_[std::size_t(node)];
  AlignedBox3d centroid_box;
  for (int i = first; i < last; ++i) {
    const int triangle = order_[std::size_t(i)];
    centroid_box.extend(Vector3d(centroids.row(triangle)));
    for (const int corner : corners_.row(triangle))
      current.box.extend(Vector3d(vertices_.row(corner)));
  }
  current.first = first;
  if (last - first <= max_leaf_triangles) {
    current.count = last - first;
    return;
  }
  int widest_axis = 0;
  centroid_box.sizes().maxCoeff(&widest_axis);
  const int middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) {
                     // Ties by index, so that the tree does not depend on the threads.
                     const double ca = centroids(a, widest_axis), cb = centroids(b, widest_axis);
                     return ca < cb || (ca == cb && a < b);
                   });
  // The positions of the nodes are known in advance, so that both halves can be built in parallel.
  current.second = node + 1 + node_counts(middle - first).first;
  const auto lower = [&] { fill_node(node + 1, first, middle, centroids); };
  const auto upper = [&] { fill_node(current.second, middle, last, centroids); };
  if (last - first > min_parallel_triangles) {
    tbb::parallel_invoke(lower, upper);
  } else {
    lower();
    upper();
  }
}

TriangleTree::NearestPoint TriangleTree::nearest_on_triangle(int triangle,
                                                             const Vector3d& point) const {
  // The Voronoi region that contains the point decides (Ericson, Real-Time Collision Detection,
  // 5.1.5).
  const Vector3d a = vertices_.row(corners_(triangle, 0)), b = vertices_.row(corners_(triangle, 1)),
                 c = vertices_.row(corners_(triangle, 2));
  const Vector3d ab = b - a, ac = c - a, ap = point - a, bp = point - b, cp = point - c;
  const auto nearest_at = [&](double u, double v, double w) {
    const Vector3d nearest_point = u == 1.0   ? a
                                   : v == 1.0 ? b
                                   : w == 1.0 ? c
                                              : Vector3d(a + v * ab + w * ac);
    return NearestPoint{triangle, nearest_point, {u, v, w}, (point - nearest_point).squaredNorm()};
  };
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0.0 && d2 <= 0.0) return nearest_at(1, 0, 0);
  if (d3 >= 0.0 && d4 <= d3) return nearest_at(0, 1, 0);
  if (d6 >= 0.0 && d5 <= d6) return nearest_at(0, 0, 1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3) {
    const double v = d1 / (d1 - d3);
    return nearest_at(1 - v, v, 0);
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6) {
    const double w = d2 / (d2 - d6);
    return nearest_at(1 - w, 0, w);
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return nearest_at(0, 1 - w, w);
  }
  const double sum = va + vb + vc;
  return nearest_at(va / sum, vb / sum, vc / sum);
}

TriangleTree::NearestPoint TriangleTree::nearest(const Vector3d& point, int guess,
                                                 double max_distance) const {
  NearestPoint best;
  best.squared_distance = max_distance * max_distance;
  if (nodes_.empty()) return best;
  // The distance of a triangle without an area may be NaN, which fails the comparison.
  if (guess >= 0)
    if (const NearestPoint candidate = nearest_on_triangle(guess, point);
        candidate.squared_distance <= best.squared_distance)
      best = candidate;
  struct PendingNode {
    int node;
    double squared_distance;
  };
  std::array<PendingNode, 64> pending;  // twice the height of a tree of 2^31 triangles
  int top = 0;
  pending[std::size_t(top++)] = {0, nodes_[0].box.squaredExteriorDistance(point)};
  while (top > 0) {
    const PendingNode next = pending[std::size_t(--top)];
    if (next.squared_distance > best.squared_distance) continue;
    const Node& node = nodes_[std::size_t(next.node)];
    for (int i = node.first; i < node.first + node.count; ++i) {
      const NearestPoint candidate = nearest_on_triangle(order_[std::size_t(i)], point);
      if (candidate.squared_distance < best.squared_distance ||
          (candidate.squared_distance == best.squared_distance &&
           (best.triangle < 0 || candidate.triangle < best.triangle)))
        best = candidate;
    }
    if (node.count > 0) continue;
    PendingNode near{next.node + 1,
                     nodes_[std::size_t(next.node + 1)].box.squaredExteriorDistance(point)};
    PendingNode far{node.second,
                    nodes_[std::size_t(node.second)].box.squaredExteriorDistance(point)};
    // The nearer child is pushed last, so that it is visited first.
    if (far.squared_distance < near.squared_distance) std::swap(near, far);
    if (far.squared_distance <= best.squared_distance) pending[std::size_t(top++)] = far;
    if (near.squared_distance <= best.squared_distance) pending[std::size_t(top++)] = near;
  }
  return best;
}

std::vector<TriangleTree::NearestPoint> TriangleTree::within(const Vector3d& point,
                                                             double distance) const {
  std::vector<NearestPoint> result;
  const double max_squared_distance = distance * distance;
  for (std::vector<int> pending(nodes_.empty() ? 0 : 1, 0); !pending.empty();) {
    const int node_index = pending.back();
    const Node& node = nodes_[std::size_t(node_index)];
    pending.pop_back();
    if (node.box.squaredExteriorDistance(point) > max_squared_distance) continue;
    if (node.count == 0) {
      pending.push_back(node.second);
      pending.push_back(node_index + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const NearestPoint candidate = nearest_on_triangle(order_[std::size_t(i)], point);
      if (candidate.squared_distance <= max_squared_distance) result.push_back(candidate);
    }
  }
  std::ranges::sort(result, {}, &NearestPoint::triangle);
  return result;
}

std::optional<double> TriangleTree::ray_distance(int triangle, const Vector3d& start,
                                                 const Vector3d& direction, Side side) const {
  const auto corners = corners_.row(triangle);
  const Vector3d a = vertices_.row(corners[0]);
  const Vector3d ab = vertices_.row(corners[1]).transpose() - a;
  const Vector3d ac = vertices_.row(corners[2]).transpose() - a;
  const Vector3d outward = ab.cross(ac);
  const double sign = side == Side::Outer ? -1.0 : 1.0;
  const double direction_component = direction.dot(outward), height = (a - start).dot(outward);
  // The ray comes from the other side or runs along the triangle.
  if (!(sign * direction_component > 0.0)) return std::nullopt;
  if (!(sign * height > contact_tolerance * outward.norm())) return std::nullopt;
  const Vector3d moment = (start - a).cross(direction);
  const double u = -ac.dot(moment) / direction_component, v = ab.dot(moment) / direction_component;
  if (u < -ray_slack || v < -ray_slack || u + v > 1.0 + ray_slack) return std::nullopt;
  return height / direction_component;
}

std::optional<TriangleTree::RayHit> TriangleTree::first_hit(const Vector3d& start,
                                                            const Vector3d& direction, Side side,
                                                            double max_distance) const {
  RayHit hit{max_distance};
  for (std::vector<int> pending(nodes_.empty() ? 0 : 1, 0); !pending.empty();) {
    const int node_index = pending.back();
    const Node& node = nodes_[std::size_t(node_index)];
    pending.pop_back();
    if (!ray_meets_box(node.box, start, direction, hit.along)) continue;
    if (node.count == 0) {
      pending.push_back(node.second);
      pending.push_back(node_index + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const int triangle = order_[std::size_t(i)];
      const auto distance = ray_distance(triangle, start, direction, side);
      if (distance && *distance <= hit.along) hit = {*distance, triangle};
    }
  }
  return hit.triangle >= 0 ? std::optional(hit) : std::nullopt;
}

WallThickness::WallThickness(const Design& design) : tree_(design.vertices, design.triangles) {}

std::optional<double> WallThickness::behind(const Vector3d& point, const Vector3d& normal,
                                            double max_distance) const {
  const auto hit = tree_.first_hit(point, -normal, TriangleTree::Side::Inner, max_distance);
  return hit ? std::optional(hit->along) : std::nullopt;
}

double WallThickness::nearest(const Vector3d& point, double max_distance) const {
  const TriangleTree::NearestPoint nearest_triangle = tree_.nearest(point, -1, max_distance);
  return nearest_triangle.triangle < 0
             ? max_distance
             : std::min(max_distance, std::sqrt(nearest_triangle.squared_distance));
}

bool WallThickness::comes_within(const Vector3d& point, double distance) const {
  return tree_.nearest(point, -1, distance).triangle >= 0;
}

namespace {

using Eigen::Vector2d;

constexpr double kink = 0.01;  // of the profile's size; within this distance of a kink the normal
                               // selects the segment

/// Returns the arc length at which a curve comes nearest to a point of its half plane.
double nearest_arc(const ProfileCurve& s, const Vector2d& p) {
  const Vector2d from = p - s.from;
  const Vector2d left = left_normal(s.tangent);
  const double along = s.tangent.dot(from);
  if (s.curvature == 0.0) return std::clamp(along, 0.0, s.length);
  // The path turns by curvature times arc length, to the right where it is convex. The angle at the
  // centre, which lies at -left / curvature, is computed without the centre itself.
  const double radius_ratio = 1.0 + s.curvature * left.dot(from);
  const double angle = std::atan2(std::abs(s.curvature) * along, radius_ratio);
  return std::clamp(angle / std::abs(s.curvature), 0.0, s.length);
}

/// Returns the point of the surface of revolution at a point of the profile and an azimuth.
Contact revolved_point(const ProfilePoint& profile_point, const Vector2d& azimuth) {
  const Vector2d& n = profile_point.normal;
  return {{profile_point.point.x() * azimuth.x(), profile_point.point.x() * azimuth.y(),
           profile_point.point.y()},
          Vector3d(n.x() * azimuth.x(), n.x() * azimuth.y(), n.y()).normalized()};
}

/// Returns (vertices) the groups of a design that begins with the vertices of a source design. No
/// triangle joins two groups, so connected vertices have the group of the first of them.
std::vector<int> extended_groups(const Design& source, const Design& design) {
  if (source.group.empty()) return {};
  DisjointSets connected(std::size_t(design.vertices.rows()));
  for (const auto& triangle : design.triangles.rowwise()) {
    connected.join(triangle[0], triangle[1]);
    connected.join(triangle[0], triangle[2]);
  }
  std::vector<int> group = source.group;
  for (int i = int(group.size()); i < int(design.vertices.rows()); ++i)
    group.push_back(group[std::size_t(connected.representative(i))]);
  return group;
}

}  // namespace

Contact facet_point(std::span<const Contact> corners, std::span<const double> weights) {
  Contact mean{Vector3d::Zero(), Vector3d::Zero()};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    mean.point += weights[i] * corners[i].point;
    mean.normal += weights[i] * corners[i].normal;
  }
  mean.normal.normalize();
  return mean;
}

Contact smooth_facet_point(std::span<const Contact> corners, std::span<const double> weights) {
  constexpr double smooth_sine = 0.5;  // sin 30 degrees, of a normal to that of the facet
  const Contact flat = facet_point(corners, weights);
  Vector3d lift = Vector3d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d offset = corners[i].point - flat.point, &normal = corners[i].normal;
    if (std::abs(normal.dot(offset)) > smooth_sine * offset.norm()) return flat;
    lift += weights[i] * normal.dot(offset) * normal;
  }
  return {flat.point + 0.5 * lift, flat.normal};
}

SurfaceInterpolator primitive_interpolator(const Primitive& primitive, const Eigen::Isometry3d& T) {
  return [primitive, T, back = T.inverse()](std::span<const Contact> corners,
                                            std::span<const double> weights) {
    const Contact flat = facet_point(corners, weights);
    const Contact contact = nearest(primitive, back * flat.point, back.linear() * flat.normal);
    return Contact{T * contact.point, T.linear() * contact.normal};
  };
}

Contact nearest(const Primitive& primitive, const Vector3d& point, const Vector3d& normal) {
  if (const auto* plane = std::get_if<RectanglePlane>(&primitive)) {
    const double x = 0.5 * plane->length_x, y = 0.5 * plane->length_y;
    return {{std::clamp(point.x(), -x, x), std::clamp(point.y(), -y, y), 0.0}, Vector3d::UnitZ()};
  }
  const double r = point.head<2>().norm();
  const Vector2d azimuth = r > 0.0 ? Vector2d(point.head<2>() / r) : Vector2d::UnitX();
  const Vector2d at_rz(r, point.z());
  const Vector2d normal_rz(normal.head<2>().dot(azimuth), normal.z());
  const double normal_size = std::max(normal_rz.norm(), 1e-300);
  const RevolvedProfile outline = profile(primitive);
  Eigen::AlignedBox2d box(outline.profile_segments.front().from);
  for (const RevolvedProfile::ProfileSegment& piece : outline.profile_segments)
    box.extend(piece.to);
  const double kink_distance = kink * box.diagonal().norm();
  ProfilePoint best_point{};
  double min_cost = std::numeric_limits<double>::infinity();
  for (const RevolvedProfile::ProfileSegment& piece : outline.profile_segments) {
    const ProfileCurve s = profile_curve(piece);
    const ProfilePoint profile_point = profile_point_at(s, nearest_arc(s, at_rz));
    // Away from kinks the distance dominates the cost, near them the normal.
    const double cost =
        (profile_point.point - at_rz).squaredNorm() / (kink_distance * kink_distance) +
        (profile_point.normal - normal_rz / normal_size).squaredNorm();
    if (cost >= min_cost) continue;
    best_point = profile_point;
    min_cost = cost;
  }
  return revolved_point(best_point, azimuth);
}

Design resampled_design(const Design& source, const std::vector<Contact>& contacts,
                        Triangles triangles, std::vector<std::uint8_t> judged) {
  const auto count = Eigen::Index(contacts.size());
  Design design;
  design.vertices.resize(count, 3);
  design.normals.resize(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    design.vertices.row(i) = contacts[std::size_t(i)].point;
    design.normals.row(i) = contacts[std::size_t(i)].normal;
  }
  design.area = vertex_area(design.vertices, triangles);
  design.triangles = std::move(triangles);
  design.facet_error = Eigen::VectorXd::Zero(count);
  design.facet_error.head(source.facet_error.size()) = source.facet_error;
  design.judged = std::move(judged);
  design.group = extended_groups(source, design);
  if (!source.face.empty())
    for (const Contact& contact : contacts) design.face.push_back(contact.face);
  design.seams = source.seams;
  return design;
}

Contact vertex_contact(const Design& design, int vertex) {
  return {design.vertices.row(vertex), design.normals.row(vertex),
          design.face.empty() ? -1 : design.face[std::size_t(vertex)]};
}

std::vector<Contact> vertex_contacts(const Design& design) {
  std::vector<Contact> contacts;
  contacts.reserve(std::size_t(design.vertices.rows()));
  for (int i = 0; i < int(design.vertices.rows()); ++i)
    contacts.push_back(vertex_contact(design, i));
  return contacts;
}

Design design_from_points(const std::vector<Contact>& contacts) {
  Design design;
  const auto count = Eigen::Index(contacts.size());
  design.vertices.resize(count, 3);
  design.normals.resize(count, 3);
  design.triangles.resize(0, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    design.vertices.row(i) = contacts[std::size_t(i)].point;
    design.normals.row(i) = contacts[std::size_t(i)].normal;
  }
  return design;
}

namespace {

constexpr double smooth_cosine = 0.8660254037844386;  // cos 30 degrees
constexpr double edge_slack = 1e-12;  // barycentric, so that there is no gap between neighbours

/// The corners of a triangle.
struct Corners {
  std::array<Vector3d, 3> p;
  Vector3d cross;  ///< twice the area, outward
};

Corners corners(const Design& design, int triangle) {
  Corners c;
  for (int k = 0; k < 3; ++k)
    c.p[static_cast<std::size_t>(k)] = design.vertices.row(design.triangles(triangle, k));
  c.cross = (c.p[1] - c.p[0]).cross(c.p[2] - c.p[0]);
  return c;
}

bool faces_upwards(const Corners& c) { return c.cross.z() > 1e-9 * c.cross.norm(); }

double twice_signed_area(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Returns the barycentric weights of the corners at a position in x and y; empty if the position
/// is farther outside than the gap.
std::optional<Vector3d> weights(const Corners& c, const Vector2d& position, double gap) {
  Vector3d w;
  for (int k = 0; k < 3; ++k) {
    const Vector2d a = c.p[static_cast<std::size_t>((k + 1) % 3)].head<2>() - position;
    const Vector2d b = c.p[static_cast<std::size_t>((k + 2) % 3)].head<2>() - position;
    w[k] = twice_signed_area(a, b) / c.cross.z();
    if (w[k] < -edge_slack - gap * (b - a).norm() / c.cross.z()) return std::nullopt;
  }
  return w;
}

/// Returns the point of the smooth surface on a triangle at a position in x and y.
Contact smooth_point(const Design& design, int triangle, const Corners& c, const Vector2d& position,
                     const Vector3d& w) {
  const Vector3d flat_normal = c.cross.normalized();
  const double flat = w[0] * c.p[0].z() + w[1] * c.p[1].z() + w[2] * c.p[2].z();
  double tangent = 0.0;
  Vector2d slope = Vector2d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vector3d n = design.normals.row(design.triangles(triangle, k));
    // 1e-3: a normal that is almost horizontal has no usable slope.
    if (n.dot(flat_normal) < smooth_cosine || n.z() < 1e-3)
      return {Vector3d(position.x(), position.y(), flat), flat_normal};
    const Vector3d& p = c.p[static_cast<std::size_t>(k)];
    const Vector2d gradient = -n.head<2>() / n.z();
    tangent += w[k] * (p.z() + gradient.dot(position - p.head<2>()));
    slope += w[k] * gradient;
  }
  return {Vector3d(position.x(), position.y(), 0.5 * (flat + tangent)),
          Vector3d(-slope.x(), -slope.y(), 1.0).normalized()};
}

/// Returns the point of a face at the x and y of p, near its height; empty if the face is vertical
/// there.
std::optional<Contact> face_above(const AnalyticPatch& face, Vector3d p) {
  constexpr int max_iterations = 20;
  // 1e-3 rad from vertical, as stated in the header.
  constexpr double min_z = 1e-3, convergence_tolerance = 1e-13;
  // Newton's method along z.
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Vector3d n = outward(face, p);
    if (!(std::abs(n.z()) > min_z)) return std::nullopt;
    const double step = distance_of(face, p) / n.z();
    p.z() -= step;
    if (std::abs(step) <= convergence_tolerance * std::abs(p.z()) + convergence_tolerance) break;
  }
  return Contact{p, face.sign * outward(face, p)};
}

}  // namespace

MeshHeightMap::MeshHeightMap(Design design, std::vector<AnalyticPatch> faces)
    : design_(std::move(design)), faces_(std::move(faces)) {
  for (const AnalyticPatch& face : faces_) gap_ = std::max(gap_, 2.0 * face.off);
  if (!design_.vertices.allFinite() || !design_.normals.allFinite())
    throw std::invalid_argument("MeshContact: a vertex or a normal is not finite");
  if (design_.vertices.rows() == 0) return;
  lower_ = design_.vertices.leftCols<2>().colwise().minCoeff();
  const Vector2d size = design_.vertices.leftCols<2>().colwise().maxCoeff().transpose() - lower_;
  const double triangles = std::max<double>(1.0, double(design_.triangles.rows()));
  // Two triangles per cell on average; the bound of 4096 cells along the longer side prevents a
  // huge grid for a thin part.
  cell_ =
      std::max({std::sqrt(size.x() * size.y() / triangles * 2.0), size.maxCoeff() / 4096.0, 1e-9});
  columns_ = static_cast<int>(size.x() / cell_) + 1;
  rows_ = static_cast<int>(size.y() / cell_) + 1;

  const double slack = 1e-9 + 2.0 * gap_;
  const auto each_cell = [&](auto&& visit) {
    for (int t = 0; t < design_.triangles.rows(); ++t) {
      const Corners c = corners(design_, t);
      if (!faces_upwards(c)) continue;
      const auto [x0, x1] = std::minmax({c.p[0].x(), c.p[1].x(), c.p[2].x()});
      const auto [y0, y1] = std::minmax({c.p[0].y(), c.p[1].y(), c.p[2].y()});
      for (int j = row(y0 - slack); j <= row(y1 + slack); ++j)
        for (int i = column(x0 - slack); i <= column(x1 + slack); ++i)
          visit(static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_) +
                    static_cast<std::size_t>(i),
                t);
    }
  };
  first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  each_cell([&](std::size_t cell, int) { ++first_[cell + 1]; });
  for (std::size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
  triangles_.resize(static_cast<std::size_t>(first_.back()));
  std::vector<int> fill(first_.begin(), first_.end() - 1);
  each_cell(
      [&](std::size_t cell, int t) { triangles_[static_cast<std::size_t>(fill[cell]++)] = t; });
}

int MeshHeightMap::column(double x) const {
  return static_cast<int>(std::clamp((x - lower_.x()) / cell_, 0.0, double(columns_ - 1)));
}

int MeshHeightMap::row(double y) const {
  return static_cast<int>(std::clamp((y - lower_.y()) / cell_, 0.0, double(rows_ - 1)));
}

std::optional<Contact> highest_surface_point(const MeshHeightMap& mesh, double x, double y) {
  if (mesh.triangles_.empty() || !std::isfinite(x) || !std::isfinite(y)) return std::nullopt;
  const auto cell =
      static_cast<std::size_t>(mesh.row(y)) * static_cast<std::size_t>(mesh.columns_) +
      static_cast<std::size_t>(mesh.column(x));
  std::optional<Contact> highest;
  for (int k = mesh.first_[cell]; k < mesh.first_[cell + 1]; ++k) {
    const int triangle = mesh.triangles_[static_cast<std::size_t>(k)];
    const Corners c = corners(mesh.design_, triangle);
    const auto w = weights(c, {x, y}, mesh.gap_);
    if (!w) continue;
    Contact contact = smooth_point(mesh.design_, triangle, c, {x, y}, *w);
    const int face = vertex_contact(mesh.design_, mesh.design_.triangles(triangle, 0)).face;
    if (face >= 0 && !mesh.faces_.empty())
      contact = face_above(mesh.faces_[std::size_t(face)], contact.point).value_or(contact);
    if (!highest || contact.point.z() > highest->point.z()) highest = contact;
  }
  return highest;
}

}  // namespace abbe::cutting
