#include "cutting/sweep_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <experimental/simd>
#include <limits>
#include <tuple>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "cutting/hilbert.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

namespace stdx = std::experimental;
using Eight = stdx::simd<float, stdx::simd_abi::deduce_t<float, 8>>;
using Mask = Eight::mask_type;

constexpr double max_part_turn = 0.05;  // rad
constexpr std::size_t max_slab_leaves = 512;  // of a child; more of a surface is not flat
constexpr int core_steps = 4;  // towards the nearest point of a tool in a node
constexpr float tiny = 1e-30f;          // keeps quotients of zero lengths finite

Eight load(const float* values) { return Eight(values, stdx::element_aligned); }

struct Vector8 {
  Eight x, y, z;
};

Vector8 load(const float (&v)[3][8]) { return {load(v[0]), load(v[1]), load(v[2])}; }
Vector8 spread(const float (&v)[3]) { return {Eight(v[0]), Eight(v[1]), Eight(v[2])}; }
Vector8 operator-(const Vector8& a, const Vector8& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vector8 operator+(const Vector8& a, const Vector8& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vector8 operator*(const Eight& s, const Vector8& a) { return {s * a.x, s * a.y, s * a.z}; }
Eight dot(const Vector8& a, const Vector8& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Eight root_of_positive(const Eight& x) { return stdx::sqrt(stdx::max(x, Eight(0.0f))); }
Vector8 clamp(const Vector8& p, const Vector8& low, const Vector8& high) {
  return {stdx::min(stdx::max(p.x, low.x), high.x), stdx::min(stdx::max(p.y, low.y), high.y),
          stdx::min(stdx::max(p.z, low.z), high.z)};
}

/// Lane i of the mask as bit i.
[[gnu::always_inline]] inline unsigned bits(const Mask& mask) {
  Eight weight([](int i) { return float(1 << i); });
  stdx::where(!mask, weight) = 0.0f;
  return unsigned(stdx::reduce(weight));
}

float below(double x) {
  const float f = float(x);
  return double(f) <= x ? f : std::nextafterf(f, -std::numeric_limits<float>::infinity());
}
float above(double x) { return -below(-x); }

Move part_of(const CutterMotion& motion, int move, int part, int parts) {
  Move whole = move_after(motion, move);
  if (parts > 1) {
    whole.from = double(part) / parts;
    whole.to = double(part + 1) / parts;
  }
  return whole;
}

}  // namespace

int parts_of(const CutterMotion& motion, int move) {
  const int next = std::min<int>(move + 1, int(motion.tip.rows()) - 1);
  const double chord2 = (motion.axis.row(next) - motion.axis.row(move)).squaredNorm();
  if (chord2 < 0.99 * max_part_turn * max_part_turn) return 1;
  return 1 + int(2 * std::asin(std::min(1.0, 0.5 * std::sqrt(chord2))) / max_part_turn);
}

Move part_of(const CutterMotion& motion, int move, int part) {
  return part_of(motion, move, part, parts_of(motion, move));
}

struct SweepTree::Bounds {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = Vector3d::Constant(-std::numeric_limits<double>::infinity());
  Vector3d cone = Vector3d::UnitZ();
  double spread = 0.0;  // rad, half the opening; pi: any direction
  Vector3d flat = Vector3d::UnitZ();
  double flat_low = -1e9;  // of flat * (k - low)
  double flat_high = 1e9;
};

/// A ray cut off at the best removal so far, as the tests of nodes and leaves need it.
struct SweepTree::Query {
  double point[3];  // where the ray is cut off
  float p[3];       // the same about the tree's centre
  float n[3];       // normal
  float radius, corner, ring, flank;
};

/// What a walk through the tree is for, whose ray is cut off at query.point.
struct SweepTree::Aim {
  const Ray& ray;
  Query query;
  int done_leaf = -1;
  int done_item = -1;
  bool buried = false;
};

struct SweepTree::Search : Aim {
  std::optional<Removal> best;
  int best_item = -1;
};

struct SweepTree::Collection : Aim {
  double limit;  // mm along the ray
  std::vector<Removal> found;
};

// ---- building -----------------------------------------------------------------------------------

SweepTree::SweepTree(const Cutter& cutter, const CutterMotion& motion)
    : cutter_(cutter), motion_(motion) {
  items_ = sorted_items();
  make_leaves();
  make_nodes();
}

std::vector<SweepTree::Item> SweepTree::sorted_items() {
  const int samples = int(motion_.tip.rows());
  const int moves = samples == 1 ? 1 : samples - 1;
  if (samples == 0) return {};
  const Vector3d low = motion_.tip.colwise().minCoeff();
  const Vector3d high = motion_.tip.colwise().maxCoeff();
  const Vector3d centre = 0.5 * (low + high);
  std::copy_n(centre.data(), 3, centre_);
  const double size = (high - low).maxCoeff() + 4 * cutter_.radius;
  doubt_ = float(2e-6 * (size + cutter_.radius + cutter_.flank_length));

  std::vector<int> first(std::size_t(moves) + 1, 0);
  for (int i = 0; i < moves; ++i) first[i + 1] = first[i] + parts_of(motion_, i);
  struct Key {
    std::uint64_t code;
    Item item;
  };
  std::vector<Key> keys(first.back());
  const Vector3d corner = centre - Vector3d::Constant(0.5 * size);
  const auto cell = [&](double x) {
    return std::uint32_t(std::clamp(x / size, 0.0, 1.0) * 65535.0);
  };
  tbb::parallel_for(tbb::blocked_range<int>(0, moves, 4096), [&](const auto& range) {
    for (int i = range.begin(); i < range.end(); ++i) {
      const int next = std::min(i + 1, samples - 1);
      const int parts = first[i + 1] - first[i];
      for (int part = 0; part < parts; ++part) {
        const double t = (part + 0.5) / parts;
        const Vector3d tip = (1 - t) * motion_.tip.row(i) + t * motion_.tip.row(next);
        const Vector3d axis = motion_.axis.row(i) + motion_.axis.row(next);
        const Vector3d k = tip + 0.5 * cutter_.corner_radius * axis - corner;
        keys[first[i] + part] = {hilbert_code(cell(k.x()), cell(k.y()), cell(k.z())),
                                 {i, std::uint16_t(part), std::uint16_t(parts)}};
      }
    }
  });
  tbb::parallel_sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
    return std::tie(a.code, a.item.move, a.item.part) < std::tie(b.code, b.item.move, b.item.part);
  });
  std::vector<Item> items(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) items[i] = keys[i].item;
  return items;
}

Move SweepTree::move_of(const Item& item) const {
  return part_of(motion_, item.move, item.part, item.parts);
}

namespace {

/// Centre of the corner circle's plane and axis at the ends of a move.
struct Ends {
  Vector3d k0, k1, u0, u1;
};

Ends ends_of(const Move& move, double corner_radius) {
  Ends e;
  const auto axis = [&](double t) -> Vector3d {
    return std::cos(t * move.angle) * move.axis + std::sin(t * move.angle) * move.side;
  };
  e.u0 = move.from == 0 ? move.axis : axis(move.from);
  e.u1 = move.angle == 0 ? e.u0 : axis(move.to);
  e.k0 = move.tip + move.from * move.step + corner_radius * e.u0;
  e.k1 = move.tip + move.to * move.step + corner_radius * e.u1;
  return e;
}

}  // namespace

void SweepTree::make_leaves() {
  const int count = int((items_.size() + width - 1) / width);
  leaves_.resize(count);
  origins_.resize(count);
  tbb::parallel_for(tbb::blocked_range<int>(0, count, 256), [&](const auto& range) {
    for (int l = range.begin(); l < range.end(); ++l) {
      Leaf& leaf = leaves_[l];
      LeafOrigin& place = origins_[l];
      place.count = int(std::min<std::size_t>(width, items_.size() - std::size_t(l) * width));
      Vector3d origin = Vector3d::Zero();
      double reach = 0.0;
      double turn2 = 0.0;
      for (int i = 0; i < width; ++i) {
        const int item = l * width + std::min(i, place.count - 1);
        const Ends e = ends_of(move_of(items_[item]), cutter_.corner_radius);
        if (i == 0) origin = e.k0;
        reach = std::max({reach, (e.k0 - origin).norm(), (e.k1 - origin).norm()});
        turn2 = std::max(turn2, (e.u1 - e.u0).squaredNorm());
        for (int d = 0; d < 3; ++d) {
          leaf.k0[d][i] = float(e.k0[d] - origin[d]);
          leaf.k1[d][i] = float(e.k1[d] - origin[d]);
          leaf.u0[d][i] = float(e.u0[d]);
          leaf.u1[d][i] = float(e.u1[d]);
        }
      }
      std::copy_n(origin.data(), 3, place.origin);
      place.reach = float(reach + cutter_.radius + cutter_.flank_length);
      place.slack = float(0.13 * cutter_.corner_radius * turn2) + 2e-7f * place.reach;
    }
  });
}

namespace {

Vector3d at(const float (&v)[3][8], int i) { return {v[0][i], v[1][i], v[2][i]}; }

/// Direction in which points of that covariance spread least.
Vector3d flattest(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  const Vector3d direction = solver.eigenvectors().col(0);
  return direction.allFinite() && direction.norm() > 0.5 ? direction.normalized()
                                                         : Vector3d::UnitZ().eval();
}

}  // namespace

void SweepTree::add_slab(Bounds& b, std::size_t first_leaf, std::size_t end_leaf) const {
  const auto each_end = [&](const auto& use) {
    for (std::size_t l = first_leaf; l < end_leaf; ++l) {
      const Vector3d offset = Vector3d(origins_[l].origin) - b.low;
      for (int i = 0; i < origins_[l].count; ++i) {
        use(at(leaves_[l].k0, i) + offset);
        use(at(leaves_[l].k1, i) + offset);
      }
    }
  };
  const Vector3d middle = 0.5 * (b.high - b.low);
  Vector3d sum = Vector3d::Zero();
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  double count = 0.0;
  double slack = 0.0;
  for (std::size_t l = first_leaf; l < end_leaf; ++l)
    slack = std::max(slack, double(origins_[l].slack));
  each_end([&](const Vector3d& k) {
    const Vector3d d = k - middle;
    sum += d;
    square += d * d.transpose();
    count += 1.0;
  });
  const Vector3d flat = flattest(square / count - sum * sum.transpose() / (count * count));
  b.flat = flat.cast<float>().cast<double>();
  b.flat_low = std::numeric_limits<double>::infinity();
  b.flat_high = -b.flat_low;
  each_end([&](const Vector3d& k) {
    const double height = b.flat.dot(k);
    b.flat_low = std::min(b.flat_low, height);
    b.flat_high = std::max(b.flat_high, height);
  });
  b.flat_low -= slack;
  b.flat_high += slack;
}

SweepTree::Bounds SweepTree::leaf_bounds(int l) const {
  const Leaf& leaf = leaves_[l];
  const LeafOrigin& place = origins_[l];
  Bounds b;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < place.count; ++i) {
    for (const Vector3d& k : {at(leaf.k0, i), at(leaf.k1, i)}) {
      b.low = b.low.cwiseMin(k);
      b.high = b.high.cwiseMax(k);
    }
    sum += at(leaf.u0, i) + at(leaf.u1, i);
  }
  const Vector3d origin(place.origin);
  b.low += origin - Vector3d::Constant(place.slack);
  b.high += origin + Vector3d::Constant(place.slack);
  add_slab(b, std::size_t(l), std::size_t(l) + 1);
  if (sum.norm() < 1e-3 * place.count) {
    b.spread = pi;
    return b;
  }
  b.cone = sum.normalized();
  for (int i = 0; i < place.count; ++i)
    for (const Vector3d& u : {at(leaf.u0, i), at(leaf.u1, i)})
      b.spread = std::max(b.spread, std::atan2(u.cross(b.cone).norm(), u.dot(b.cone)));
  b.spread += 1e-6;
  return b;
}

SweepTree::Bounds SweepTree::node_bounds(const Node& node, int child_count, std::size_t first_leaf,
                                         std::size_t end_leaf) const {
  Bounds b;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < child_count; ++i) {
    for (int d = 0; d < 3; ++d) {
      b.low[d] = std::min(b.low[d], double(node.low[d][i]) + centre_[d]);
      b.high[d] = std::max(b.high[d], double(node.high[d][i]) + centre_[d]);
      sum[d] += node.cone[d][i];
    }
  }
  if (end_leaf - first_leaf <= max_slab_leaves) add_slab(b, first_leaf, end_leaf);
  if (sum.norm() < 1e-3 * child_count) {
    b.spread = pi;
    return b;
  }
  b.cone = sum.normalized();
  for (int i = 0; i < child_count; ++i) {
    const Vector3d c(node.cone[0][i], node.cone[1][i], node.cone[2][i]);
    const double own = std::atan2(double(node.sin_spread[i]), double(node.cos_spread[i]));
    b.spread = std::max(b.spread, own + std::atan2(c.cross(b.cone).norm(), c.dot(b.cone)));
  }
  b.spread += 1e-6;
  return b;
}

void SweepTree::place(Node& node, int child, const Bounds& b) const {
  for (int d = 0; d < 3; ++d) {
    node.low[d][child] = below(b.low[d] - centre_[d] - 1e-9);
    node.high[d][child] = above(b.high[d] - centre_[d] + 1e-9);
    node.cone[d][child] = float(b.cone[d]);
    node.flat[d][child] = float(b.flat[d]);
  }
  const Vector3d rounding = b.low - Vector3d(at(node.low, child) + Vector3d(centre_));
  node.flat_low[child] = below(b.flat_low + b.flat.dot(rounding) - 1e-9);
  node.flat_high[child] = above(b.flat_high + b.flat.dot(rounding) + 1e-9);
  const bool any = b.spread > 1.5;
  node.cos_spread[child] = any ? -1.0f : float(std::cos(b.spread));
  node.sin_spread[child] = any ? 0.0f : float(std::sin(b.spread));
}

int SweepTree::children(std::size_t level, int node) const {
  const std::size_t all = level == 0 ? leaves_.size() : levels_[level - 1].size();
  return int(std::min<std::size_t>(width, all - std::size_t(node) * width));
}

void SweepTree::make_nodes() {
  std::size_t below_count = leaves_.size();
  while (below_count > 0 && (levels_.empty() || below_count > 1)) {
    const std::size_t level = levels_.size();
    std::vector<Node> nodes((below_count + width - 1) / width);
    levels_.emplace_back();
    const std::size_t leaves_a_child = std::size_t(1) << (3 * level);
    tbb::parallel_for(tbb::blocked_range<int>(0, int(nodes.size()), 64), [&](const auto& range) {
      for (int n = range.begin(); n < range.end(); ++n) {
        const int used = children(level, n);
        for (int i = 0; i < width; ++i) {
          const std::size_t child = std::size_t(n * width + std::min(i, used - 1));
          place(nodes[n], i,
                level == 0 ? leaf_bounds(int(child))
                           : node_bounds(levels_[level - 1][child], children(level - 1, int(child)),
                                         child * leaves_a_child,
                                         std::min((child + 1) * leaves_a_child, leaves_.size())));
        }
      }
    });
    below_count = nodes.size();
    levels_[level] = std::move(nodes);
  }
}

// ---- searching ----------------------------------------------------------------------------------
//
// With q the point where the ray is cut off, a plane through q with normal m, m n <= 0, has the
// whole ray up to q on its outer side. Nothing before q is removed by tools that all lie on the
// inner side:
// m q > max m k + h(m), where h is the support of the tool about k. With u the axis,
//   h = r + ring sin(m, u) if m u <= 0, (flank - r) m u + radius sin(m, u) if m u > 0.
// m is the direction to q from the nearest point of the tool's core, turned across n if need be.

template <bool ball>
unsigned SweepTree::open_children(const Node& node, const Query& query, float* separation) const {
  const Vector8 p = spread(query.p);
  const Vector8 n = spread(query.n);
  const Vector8 low = load(node.low);
  const Vector8 high = load(node.high);
  const Vector8 cone = load(node.cone);
  const Eight cos_spread = load(node.cos_spread);
  const Eight sin_spread = load(node.sin_spread);
  const Vector8 flat = load(node.flat);
  const Eight flat_low = load(node.flat_low);
  const Eight flat_high = load(node.flat_high);
  const auto from_nearest = [&](const Vector8& point) __attribute__((always_inline)) {
    const Eight height = dot(point - low, flat);
    const Eight lift = stdx::min(stdx::max(height, flat_low), flat_high) - height;
    return point - clamp(point + lift * flat, low, high);
  };
  Vector8 m = from_nearest(p);
  if constexpr (!ball) {
    Vector8 w = m;  // to p from the nearest place of k
    Vector8 last_step = m;
    for (int i = 0; i < core_steps; ++i) {
      const Eight rise = dot(w, cone);
      const Vector8 across = w - rise * cone;
      const Eight rho = stdx::sqrt(dot(across, across) + tiny);
      const Vector8 core = stdx::min(Eight(1.0f), query.ring / rho) * across +
                           stdx::max(rise, Eight(0.0f)) * cone;
      m = from_nearest(p - core);
      const Vector8 next = m + core;
      const Vector8 step = next - w;
      w = next;
      if (i == 1) {  // the steps shrink evenly: jump to their limit
        const Eight ratio = dot(step, last_step) / (dot(last_step, last_step) + tiny);
        w = w + stdx::min(stdx::max(ratio / (1.0f - ratio), Eight(0.0f)), Eight(30.0f)) * step;
      }
      last_step = step;
    }
  }
  m = m - stdx::max(dot(m, n), Eight(0.0f)) * n;
  // Both parts of m, across the slab and the rest, are bounded on their own.
  const Vector8 from_low = p - low;
  const Vector8 from_high = p - high;
  const Eight steep = dot(m, flat);
  const Eight height = dot(from_low, flat);
  const Vector8 rest = m - steep * flat;
  const Eight apart = stdx::min(steep * (height - flat_low), steep * (height - flat_high)) +
                      stdx::min(rest.x * from_low.x, rest.x * from_high.x) +
                      stdx::min(rest.y * from_low.y, rest.y * from_high.y) +
                      stdx::min(rest.z * from_low.z, rest.z * from_high.z);
  const Eight length2 = dot(m, m);
  const Eight length = stdx::sqrt(length2);
  const Eight along = dot(m, cone);
  Eight upward = along * cos_spread + root_of_positive(length2 - along * along) * sin_spread;
  stdx::where(along > length * cos_spread, upward) = length;
  Eight support = query.corner * length;
  if constexpr (!ball) support += query.ring * root_of_positive(length2 - upward * upward);
  stdx::where(upward > 0.0f, support) =
      query.radius * length + (query.flank - query.corner) * upward;
  const Eight room = apart - support - doubt_ * length;
  room.copy_to(separation, stdx::element_aligned);
  return bits(!(room > 0.0f));
}

template <bool ball>
unsigned SweepTree::open_moves(int l, const Query& query) const {
  const Leaf& leaf = leaves_[l];
  const LeafOrigin& place = origins_[l];
  const float local[3] = {float(query.point[0] - place.origin[0]),
                          float(query.point[1] - place.origin[1]),
                          float(query.point[2] - place.origin[2])};
  const float distance = std::abs(local[0]) + std::abs(local[1]) + std::abs(local[2]);
  const Eight doubt(2e-6f * (distance + place.reach));
  const Vector8 p = spread(local);
  const Vector8 n = spread(query.n);
  const Vector8 k0 = load(leaf.k0);
  const Vector8 k1 = load(leaf.k1);
  const Vector8 u0 = load(leaf.u0);
  const Vector8 u1 = load(leaf.u1);
  const Vector8 step = k1 - k0;
  const Vector8 turn = u1 - u0;
  const Eight per_length2 = 1.0f / (dot(step, step) + tiny);
  const auto from_nearest = [&](const Vector8& point, Eight& t) __attribute__((always_inline)) {
    const Vector8 w = point - k0;
    t = stdx::min(stdx::max(dot(w, step) * per_length2, Eight(0.0f)), Eight(1.0f));
    return w - t * step;
  };
  Eight t;
  Vector8 m = from_nearest(p, t);
  if constexpr (!ball) {
    Eight t0 = t;
    Eight t1 = t;
    for (int i = 0; i < 4; ++i) {
      const Vector8 u = u0 + t * turn;
      const Vector8 w = p - k0 - t * step;
      const Eight height = dot(w, u);
      const Vector8 across = w - height * u;
      const Eight rho = stdx::sqrt(dot(across, across) + tiny);
      const Vector8 core =
          stdx::min(Eight(1.0f), query.ring / rho) * across + stdx::max(height, Eight(0.0f)) * u;
      t0 = t1;
      t1 = t;
      m = from_nearest(p - core, t);
      if (i == 1) {  // the steps shrink evenly: jump to their limit
        const Eight bend = t - 2.0f * t1 + t0;
        const Eight limit = t - (t - t1) * (t - t1) / bend;
        stdx::where(stdx::abs(bend) > 1e-6f, t) =
            stdx::min(stdx::max(limit, Eight(0.0f)), Eight(1.0f));
      }
    }
  }
  m = m - stdx::max(dot(m, n), Eight(0.0f)) * n;
  const Eight length2 = dot(m, m);
  const Eight length = stdx::sqrt(length2);
  Eight upward = -length;
  const auto farthest = [&](const Vector8& k, const Vector8& u) __attribute__((always_inline)) {
    const Eight along = dot(m, u);
    upward = stdx::max(upward, along);
    const Eight across = root_of_positive(length2 - along * along);
    Eight h = query.corner * length + query.ring * across;
    const Eight top = (query.flank - query.corner) * along + query.radius * across;
    stdx::where(along > 0.0f, h) = top;
    return dot(m, k) + h;
  };
  const Eight most = stdx::max(farthest(k0, u0), farthest(k1, u1));
  Eight arm(query.radius);  // the path of a point of the tool leaves its chord by arm angle^2 / 8
  stdx::where(upward > 0.0f, arm) = Eight(query.radius + query.flank);
  const Eight room = dot(m, p) - most - (arm * (0.13f * dot(turn, turn)) + doubt) * length;
  return bits(!(room > 0.0f)) & ((1u << place.count) - 1u);
}

void SweepTree::try_item(int item, Search& search) const {
  const Item& it = items_[item];
  const double best = search.best ? search.best->s : search.ray.band;
  const double limit = std::min(best + entry_margin, search.ray.band);
  const std::optional<Entry> entry = first_entry(cutter_, move_of(it), search.ray, limit);
  if (!entry || entry->s > search.ray.band) return;
  const auto order = [](double s, int move, int part) { return std::tuple(s, move, part); };
  if (search.best && order(search.best->s, search.best->move, search.best->part) <=
                         order(entry->s, it.move, it.part))
    return;
  search.best = Removal{entry->s, entry->t, it.move, it.part};
  search.best_item = item;
  search.buried = entry->s <= -search.ray.band;
  for (int d = 0; d < 3; ++d) {
    const double cut_off = std::min(entry->s + entry_margin, search.ray.band);
    search.query.point[d] = search.ray.point[d] + cut_off * search.ray.normal[d];
    search.query.p[d] = float(search.query.point[d] - centre_[d]);
  }
}

void SweepTree::try_item(int item, Collection& collection) const {
  const Item& it = items_[item];
  const std::optional<Entry> entry =
      first_entry(cutter_, move_of(it), collection.ray, collection.limit);
  if (entry) collection.found.push_back({entry->s, entry->t, it.move, it.part});
}

template <bool ball, class Wanted>
void SweepTree::search_leaf(int leaf, Wanted& wanted) const {
  unsigned open = open_moves<ball>(leaf, wanted.query);
  while (open != 0 && !wanted.buried) {
    const int item = leaf * width + std::countr_zero(open);
    open &= open - 1;
    if (item != wanted.done_item) try_item(item, wanted);
  }
}

template <bool ball, class Wanted>
void SweepTree::descend(Wanted& wanted) const {
  struct Visit {
    int level;  // -1: a leaf
    int index;
  };
  std::array<Visit, 8 * 12> stack;
  int size = 0;
  stack[size++] = {int(levels_.size()) - 1, 0};
  while (size > 0 && !wanted.buried) {
    const Visit visit = stack[--size];
    if (visit.level < 0) {
      if (visit.index != wanted.done_leaf) search_leaf<ball>(visit.index, wanted);
      continue;
    }
    alignas(32) float separation[width];
    const Node& node = levels_[visit.level][visit.index];
    unsigned open = open_children<ball>(node, wanted.query, separation);
    open &= (1u << children(visit.level, visit.index)) - 1u;
    // The nearest child comes last, to be visited first.
    const int bottom = size;
    for (; open != 0; open &= open - 1) {
      const int child = std::countr_zero(open);
      int at = size++;
      for (; at > bottom && separation[stack[at - 1].index % width] < separation[child]; --at)
        stack[at] = stack[at - 1];
      stack[at] = {visit.level - 1, visit.index * width + child};
    }
  }
}

SweepTree::Query SweepTree::query_of(const Ray& ray, double cut_off) const {
  Query query;
  query.radius = above(cutter_.radius);
  query.corner = above(cutter_.corner_radius);
  query.ring = above(cutter_.radius - cutter_.corner_radius);
  query.flank = above(cutter_.flank_length);
  for (int d = 0; d < 3; ++d) {
    query.n[d] = float(ray.normal[d]);
    query.point[d] = ray.point[d] + cut_off * ray.normal[d];
    query.p[d] = float(query.point[d] - centre_[d]);
  }
  return query;
}

std::optional<Removal> SweepTree::first_removal(const Ray& ray, Hint& hint) const {
  if (items_.empty()) return std::nullopt;
  Search search{{.ray = ray, .query = query_of(ray, ray.band)}, std::nullopt};
  const bool ball = cutter_.radius == cutter_.corner_radius;
  if (hint.item >= 0) {
    try_item(hint.item, search);
    search.done_item = hint.item;
    const int leaf = hint.item / width;
    ball ? search_leaf<true>(leaf, search) : search_leaf<false>(leaf, search);
    search.done_leaf = leaf;
  }
  ball ? descend<true>(search) : descend<false>(search);
  if (search.best) hint.item = search.best_item;
  return search.best;
}

std::vector<Removal> SweepTree::removals_within(const Ray& ray, double reach, Hint& hint) const {
  const std::optional<Removal> first = first_removal(ray, hint);
  if (!first || first->s <= -ray.band) return {};
  const double limit = std::min(first->s + reach, ray.band);
  const double cut_off = std::min(limit + entry_margin, ray.band);
  Collection collection{{.ray = ray, .query = query_of(ray, cut_off)}, limit, {}};
  cutter_.radius == cutter_.corner_radius ? descend<true>(collection) : descend<false>(collection);
  std::vector<Removal>& found = collection.found;
  std::sort(found.begin(), found.end(), [](const Removal& a, const Removal& b) {
    return std::tie(a.move, a.part) < std::tie(b.move, b.part);
  });
  return std::move(found);
}

}  // namespace abbe::cutting
