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

constexpr int leaf_most = 4;        // triangles
constexpr int alone = 4096;         // triangles; fewer are not worth a task of their own
constexpr double ray_slack = 1e-9;  // of a triangle's size, so that no ray slips between two
                                    // triangles
constexpr double touch = 1e-9;  // mm, distance of the start of a ray from a triangle below which
                                // they touch

/// Returns the numbers of nodes of a tree of n triangles and of one of n + 1. Both are needed,
/// since an odd n has halves of either size; computing them together keeps the recursion at log n
/// steps.
std::pair<int, int> nodes_of(int n) {
  if (n < leaf_most) return {1, 1};
  const auto [half, more] = nodes_of(n / 2);
  const int even = 1 + 2 * half, odd = 1 + half + more;
  const int here = n <= leaf_most ? 1 : (n % 2 == 0 ? even : odd);
  return {here, n % 2 == 0 ? odd : 1 + 2 * more};
}

/// Returns true if a ray meets the box within `most`. The box is widened because a point on a rim
/// may lie outside it by rounding, with a ray along a side of the box.
bool is_met(const AlignedBox3d& box, const Vector3d& start, const Vector3d& direction,
            double most) {
  double from = 0.0, to = most;
  for (int k = 0; k < 3; ++k) {
    const double low = box.min()[k] - touch, high = box.max()[k] + touch;
    if (direction[k] == 0.0) {
      if (start[k] < low || start[k] > high) return false;
      continue;
    }
    const double a = (low - start[k]) / direction[k], b = (high - start[k]) / direction[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to;
}

}  // namespace

TriangleTree::TriangleTree(Points vertices, Triangles triangles)
    : vertices_(std::move(vertices)),
      corners_(std::move(triangles)),
      order_(std::size_t(corners_.rows())) {
  std::iota(order_.begin(), order_.end(), 0);
  if (order_.empty()) return;
  Points middles(corners_.rows(), 3);
  for (Index t = 0; t < corners_.rows(); ++t)
    middles.row(t) = (vertices_.row(corners_(t, 0)) + vertices_.row(corners_(t, 1)) +
                      vertices_.row(corners_(t, 2))) /
                     3.0;
  nodes_.resize(std::size_t(nodes_of(int(order_.size())).first));
  fill_node(0, 0, int(order_.size()), middles);
}

void TriangleTree::fill_node(int node, int first, int last, const Points& middles) {
  Node& here = nodes_[std::size_t(node)];
  AlignedBox3d spread;
  for (int i = first; i < last; ++i) {
    const int triangle = order_[std::size_t(i)];
    spread.extend(Vector3d(middles.row(triangle)));
    for (const int corner : corners_.row(triangle))
      here.box.extend(Vector3d(vertices_.row(corner)));
  }
  here.first = first;
  if (last - first <= leaf_most) {
    here.count = last - first;
    return;
  }
  int widest = 0;
  spread.sizes().maxCoeff(&widest);
  const int middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) {
                     // ties by number, so that the tree does not depend on the threads
                     const double ca = middles(a, widest), cb = middles(b, widest);
                     return ca < cb || (ca == cb && a < b);
                   });
  // fixed positions of the nodes permit construction in parallel
  here.second = node + 1 + nodes_of(middle - first).first;
  const auto lower = [&] { fill_node(node + 1, first, middle, middles); };
  const auto upper = [&] { fill_node(here.second, middle, last, middles); };
  if (last - first > alone) {
    tbb::parallel_invoke(lower, upper);
  } else {
    lower();
    upper();
  }
}

TriangleTree::Nearest TriangleTree::nearest_of(int triangle, const Vector3d& place) const {
  // Ericson, Real-Time Collision Detection, 5.1.5: by the Voronoi region that contains the point.
  const Vector3d a = vertices_.row(corners_(triangle, 0)), b = vertices_.row(corners_(triangle, 1)),
                 c = vertices_.row(corners_(triangle, 2));
  const Vector3d ab = b - a, ac = c - a, ap = place - a, bp = place - b, cp = place - c;
  const auto at = [&](double u, double v, double w) {
    const Vector3d point = u == 1.0   ? a
                           : v == 1.0 ? b
                           : w == 1.0 ? c
                                      : Vector3d(a + v * ab + w * ac);
    return Nearest{triangle, point, {u, v, w}, (place - point).squaredNorm()};
  };
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0.0 && d2 <= 0.0) return at(1, 0, 0);
  if (d3 >= 0.0 && d4 <= d3) return at(0, 1, 0);
  if (d6 >= 0.0 && d5 <= d6) return at(0, 0, 1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3) {
    const double v = d1 / (d1 - d3);
    return at(1 - v, v, 0);
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6) {
    const double w = d2 / (d2 - d6);
    return at(1 - w, 0, w);
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return at(0, 1 - w, w);
  }
  const double all = va + vb + vc;
  return at(va / all, vb / all, vc / all);
}

TriangleTree::Nearest TriangleTree::nearest(const Vector3d& place, int guess, double most) const {
  Nearest best;
  best.squared = most * most;
  if (nodes_.empty()) return best;
  // The distance of a triangle without an area may be NaN, which fails the comparison.
  if (guess >= 0)
    if (const Nearest near = nearest_of(guess, place); near.squared <= best.squared) best = near;
  struct Open {
    int node;
    double squared;
  };
  std::array<Open, 64> open;  // twice the height of a tree of 2^31 triangles
  int top = 0;
  open[std::size_t(top++)] = {0, nodes_[0].box.squaredExteriorDistance(place)};
  while (top > 0) {
    const Open next = open[std::size_t(--top)];
    if (next.squared > best.squared) continue;
    const Node& node = nodes_[std::size_t(next.node)];
    for (int i = node.first; i < node.first + node.count; ++i) {
      const Nearest one = nearest_of(order_[std::size_t(i)], place);
      if (one.squared < best.squared ||
          (one.squared == best.squared && (best.triangle < 0 || one.triangle < best.triangle)))
        best = one;
    }
    if (node.count > 0) continue;
    Open near{next.node + 1, nodes_[std::size_t(next.node + 1)].box.squaredExteriorDistance(place)};
    Open far{node.second, nodes_[std::size_t(node.second)].box.squaredExteriorDistance(place)};
    // the nearer child is pushed last and so visited first
    if (far.squared < near.squared) std::swap(near, far);
    if (far.squared <= best.squared) open[std::size_t(top++)] = far;
    if (near.squared <= best.squared) open[std::size_t(top++)] = near;
  }
  return best;
}

std::vector<TriangleTree::Nearest> TriangleTree::within(const Vector3d& place,
                                                        double distance) const {
  std::vector<Nearest> all;
  const double most = distance * distance;
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const int number = open.back();
    const Node& node = nodes_[std::size_t(number)];
    open.pop_back();
    if (node.box.squaredExteriorDistance(place) > most) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(number + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const Nearest one = nearest_of(order_[std::size_t(i)], place);
      if (one.squared <= most) all.push_back(one);
    }
  }
  std::ranges::sort(all, {}, &Nearest::triangle);
  return all;
}

std::optional<double> TriangleTree::met(int triangle, const Vector3d& start,
                                        const Vector3d& direction, Side side) const {
  const auto corners = corners_.row(triangle);
  const Vector3d a = vertices_.row(corners[0]);
  const Vector3d ab = vertices_.row(corners[1]).transpose() - a;
  const Vector3d ac = vertices_.row(corners[2]).transpose() - a;
  const Vector3d outward = ab.cross(ac);
  const double sign = side == Side::Outer ? -1.0 : 1.0;
  const double out = direction.dot(outward), height = (a - start).dot(outward);
  // it arrives from the other side, or runs along the triangle
  if (!(sign * out > 0.0)) return std::nullopt;
  if (!(sign * height > touch * outward.norm())) return std::nullopt;
  const Vector3d turned = (start - a).cross(direction);
  const double u = -ac.dot(turned) / out, v = ab.dot(turned) / out;
  if (u < -ray_slack || v < -ray_slack || u + v > 1.0 + ray_slack) return std::nullopt;
  return height / out;
}

std::optional<TriangleTree::RayHit> TriangleTree::first_hit(const Vector3d& start,
                                                            const Vector3d& direction, Side side,
                                                            double most) const {
  RayHit first{most};
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const int number = open.back();
    const Node& node = nodes_[std::size_t(number)];
    open.pop_back();
    if (!is_met(node.box, start, direction, first.along)) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(number + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const int triangle = order_[std::size_t(i)];
      const auto along = met(triangle, start, direction, side);
      if (along && *along <= first.along) first = {*along, triangle};
    }
  }
  return first.triangle >= 0 ? std::optional(first) : std::nullopt;
}

Thickness::Thickness(const Design& design) : tree_(design.vertices, design.triangles) {}

std::optional<double> Thickness::behind(const Vector3d& place, const Vector3d& normal,
                                        double most) const {
  const auto met = tree_.first_hit(place, -normal, TriangleTree::Side::Inner, most);
  return met ? std::optional(met->along) : std::nullopt;
}

double Thickness::nearest(const Vector3d& place, double most) const {
  const TriangleTree::Nearest found = tree_.nearest(place, -1, most);
  return found.triangle < 0 ? most : std::min(most, std::sqrt(found.squared));
}

bool Thickness::comes_within(const Vector3d& place, double distance) const {
  return tree_.nearest(place, -1, distance).triangle >= 0;
}

namespace {

using Eigen::Vector2d;

constexpr double kink = 0.01;  // of the profile's size: within this distance of a kink the normal
                               // decides

/// Returns the arc length at which a section comes nearest to a point of its half plane.
double nearest_arc(const Section& s, const Vector2d& p) {
  const Vector2d from = p - s.from;
  const Vector2d left = left_of(s.tangent);
  const double along = s.tangent.dot(from);
  if (s.curvature == 0.0) return std::clamp(along, 0.0, s.length);
  // The path turns by curvature times arc length, to the right where it is convex. The angle is
  // computed as seen from the centre, which lies at -left / curvature, without forming the centre.
  const double out = 1.0 + s.curvature * left.dot(from);
  const double turned = std::atan2(std::abs(s.curvature) * along, out);
  return std::clamp(turned / std::abs(s.curvature), 0.0, s.length);
}

// Returns a station of the profile turned to an azimuth.
Contact turned_to(const Station& station, const Vector2d& azimuth) {
  const Vector2d& n = station.normal;
  return {{station.point.x() * azimuth.x(), station.point.x() * azimuth.y(), station.point.y()},
          Vector3d(n.x() * azimuth.x(), n.x() * azimuth.y(), n.y()).normalized()};
}

/// Returns (vertices) the groups of a design whose first vertices are those of another. No triangle
/// joins two groups, so all vertices connected by triangles have the group of the first of them.
std::vector<int> groups_on(const Design& from, const Design& made) {
  if (from.group.empty()) return {};
  DisjointSets joined(std::size_t(made.vertices.rows()));
  for (const auto& triangle : made.triangles.rowwise()) {
    joined.join(triangle[0], triangle[1]);
    joined.join(triangle[0], triangle[2]);
  }
  std::vector<int> group = from.group;
  for (int i = int(group.size()); i < int(made.vertices.rows()); ++i)
    group.push_back(group[std::size_t(joined.name_of(i))]);
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
  // of the normal against the plane of the facet: sin 30 degrees
  constexpr double smooth_sine = 0.5;
  const Contact flat = facet_point(corners, weights);
  Vector3d lift = Vector3d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d from = corners[i].point - flat.point, &normal = corners[i].normal;
    if (std::abs(normal.dot(from)) > smooth_sine * from.norm()) return flat;
    lift += weights[i] * normal.dot(from) * normal;
  }
  return {flat.point + 0.5 * lift, flat.normal};
}

SurfaceInterpolator primitive_interpolator(const Primitive& primitive, const Eigen::Isometry3d& T) {
  return [primitive, T, back = T.inverse()](std::span<const Contact> corners,
                                            std::span<const double> weights) {
    const Contact flat = facet_point(corners, weights);
    const Contact at = nearest(primitive, back * flat.point, back.linear() * flat.normal);
    return Contact{T * at.point, T.linear() * at.normal};
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
  const double size = std::max(normal_rz.norm(), 1e-300);
  const RevolvedProfile outline = profile(primitive);
  Eigen::AlignedBox2d box(outline.pieces.front().from);
  for (const RevolvedProfile::Piece& piece : outline.pieces) box.extend(piece.to);
  const double near = kink * box.diagonal().norm();
  Station best{};
  double least = std::numeric_limits<double>::infinity();
  for (const RevolvedProfile::Piece& piece : outline.pieces) {
    const Section s = section(piece);
    const Station here = at(s, nearest_arc(s, at_rz));
    // distance and normal together: away from kinks the distance dominates, near them the normal
    const double off = (here.point - at_rz).squaredNorm() / (near * near) +
                       (here.normal - normal_rz / size).squaredNorm();
    if (off >= least) continue;
    best = here;
    least = off;
  }
  return turned_to(best, azimuth);
}

Design resampled_design(const Design& from, const std::vector<Contact>& places, Triangles triangles,
                        std::vector<std::uint8_t> judged) {
  const auto n = Eigen::Index(places.size());
  Design made;
  made.vertices.resize(n, 3);
  made.normals.resize(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    made.vertices.row(i) = places[std::size_t(i)].point;
    made.normals.row(i) = places[std::size_t(i)].normal;
  }
  made.area = vertex_area(made.vertices, triangles);
  made.triangles = std::move(triangles);
  made.facet_error = Eigen::VectorXd::Zero(n);
  made.facet_error.head(from.facet_error.size()) = from.facet_error;
  made.judged = std::move(judged);
  made.group = groups_on(from, made);
  if (!from.face.empty())
    for (const Contact& place : places) made.face.push_back(place.face);
  made.seams = from.seams;
  return made;
}

Contact place_of(const Design& design, int vertex) {
  return {design.vertices.row(vertex), design.normals.row(vertex),
          design.face.empty() ? -1 : design.face[std::size_t(vertex)]};
}

std::vector<Contact> places_of(const Design& design) {
  std::vector<Contact> places;
  places.reserve(std::size_t(design.vertices.rows()));
  for (int i = 0; i < int(design.vertices.rows()); ++i) places.push_back(place_of(design, i));
  return places;
}

Design design_from_points(const std::vector<Contact>& places) {
  Design at;
  const auto n = Eigen::Index(places.size());
  at.vertices.resize(n, 3);
  at.normals.resize(n, 3);
  at.triangles.resize(0, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    at.vertices.row(i) = places[std::size_t(i)].point;
    at.normals.row(i) = places[std::size_t(i)].normal;
  }
  return at;
}

namespace {

constexpr double smooth_cosine = 0.8660254037844386;  // cos 30 degrees
constexpr double edge_slack = 1e-12;  // of a plan coordinate, so that there is no gap between
                                      // neighbours

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

bool looks_up(const Corners& c) { return c.cross.z() > 1e-9 * c.cross.norm(); }

double area2(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Returns the weights of the corners at (x, y) in plan; nothing if the point is farther outside
/// than the gap.
std::optional<Vector3d> weights(const Corners& c, const Vector2d& at, double gap) {
  Vector3d w;
  for (int k = 0; k < 3; ++k) {
    const Vector2d a = c.p[static_cast<std::size_t>((k + 1) % 3)].head<2>() - at;
    const Vector2d b = c.p[static_cast<std::size_t>((k + 2) % 3)].head<2>() - at;
    w[k] = area2(a, b) / c.cross.z();
    if (w[k] < -edge_slack - gap * (b - a).norm() / c.cross.z()) return std::nullopt;
  }
  return w;
}

// Returns the point of the smooth surface on a triangle at (x, y).
Contact smooth_point(const Design& design, int triangle, const Corners& c, const Vector2d& at,
                     const Vector3d& w) {
  const Vector3d flat_normal = c.cross.normalized();
  const double flat = w[0] * c.p[0].z() + w[1] * c.p[1].z() + w[2] * c.p[2].z();
  double tangent = 0.0;
  Vector2d slope = Vector2d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vector3d n = design.normals.row(design.triangles(triangle, k));
    // 1e-3: an almost upright normal has no usable slope
    if (n.dot(flat_normal) < smooth_cosine || n.z() < 1e-3)
      return {Vector3d(at.x(), at.y(), flat), flat_normal};
    const Vector3d& p = c.p[static_cast<std::size_t>(k)];
    const Vector2d gradient = -n.head<2>() / n.z();
    tangent += w[k] * (p.z() + gradient.dot(at - p.head<2>()));
    slope += w[k] * gradient;
  }
  return {Vector3d(at.x(), at.y(), 0.5 * (flat + tangent)),
          Vector3d(-slope.x(), -slope.y(), 1.0).normalized()};
}

/// Returns the point of a face above a position, near the height of p; nothing where the face is
/// upright.
std::optional<Contact> face_above(const AnalyticPatch& face, Vector3d p) {
  constexpr int rounds = 20;
  // 1e-3: within that of upright a face has no point above, as stated in the header
  constexpr double min_z = 1e-3, still = 1e-13;
  // Newton's method along z
  for (int round = 0; round < rounds; ++round) {
    const Vector3d n = outward(face, p);
    if (!(std::abs(n.z()) > min_z)) return std::nullopt;
    const double off = distance_of(face, p) / n.z();
    p.z() -= off;
    if (std::abs(off) <= still * std::abs(p.z()) + still) break;
  }
  return Contact{p, face.sign * outward(face, p)};
}

}  // namespace

MeshContact::MeshContact(Design design, std::vector<AnalyticPatch> faces)
    : design_(std::move(design)), faces_(std::move(faces)) {
  for (const AnalyticPatch& one : faces_) gap_ = std::max(gap_, 2.0 * one.off);
  if (!design_.vertices.allFinite() || !design_.normals.allFinite())
    throw std::invalid_argument("MeshContact: a vertex or a normal is not finite");
  if (design_.vertices.rows() == 0) return;
  lower_ = design_.vertices.leftCols<2>().colwise().minCoeff();
  const Vector2d size = design_.vertices.leftCols<2>().colwise().maxCoeff().transpose() - lower_;
  const double triangles = std::max<double>(1.0, double(design_.triangles.rows()));
  // Two triangles per cell on average; the bound of 4096 cells prevents a huge grid for a thin
  // part.
  cell_ =
      std::max({std::sqrt(size.x() * size.y() / triangles * 2.0), size.maxCoeff() / 4096.0, 1e-9});
  columns_ = static_cast<int>(size.x() / cell_) + 1;
  rows_ = static_cast<int>(size.y() / cell_) + 1;

  const double slack = 1e-9 + 2.0 * gap_;
  const auto each_cell = [&](auto&& visit) {
    for (int t = 0; t < design_.triangles.rows(); ++t) {
      const Corners c = corners(design_, t);
      if (!looks_up(c)) continue;
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

int MeshContact::column(double x) const {
  return static_cast<int>(std::clamp((x - lower_.x()) / cell_, 0.0, double(columns_ - 1)));
}

int MeshContact::row(double y) const {
  return static_cast<int>(std::clamp((y - lower_.y()) / cell_, 0.0, double(rows_ - 1)));
}

std::optional<Contact> surface_point_above(const MeshContact& mesh, double x, double y) {
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
    Contact here = smooth_point(mesh.design_, triangle, c, {x, y}, *w);
    const int face = place_of(mesh.design_, mesh.design_.triangles(triangle, 0)).face;
    if (face >= 0 && !mesh.faces_.empty())
      here = face_above(mesh.faces_[std::size_t(face)], here.point).value_or(here);
    if (!highest || here.point.z() > highest->point.z()) highest = here;
  }
  return highest;
}

}  // namespace abbe::cutting
