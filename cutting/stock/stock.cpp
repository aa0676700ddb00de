#include "cutting/stock/stock.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cutting/part/compensated_sum.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;
using Eigen::Vector3d;

DexelLine::DexelLine(const DexelLine& other) : count_(other.count_), one_{} {
  if (count_ <= 1) {
    if (count_ == 1) one_ = *other.data();
    return;
  }
  capacity_ = count_;
  many_ = new DexelRun[capacity_];
  std::copy(other.many_, other.many_ + count_, many_);
}

DexelLine::DexelLine(DexelLine&& other) noexcept
    : count_(other.count_), capacity_(other.capacity_), one_{} {
  if (capacity_ == 0)
    one_ = other.one_;
  else
    many_ = std::exchange(other.many_, nullptr);
  other.count_ = 0;
  other.capacity_ = 0;
}

DexelLine& DexelLine::operator=(DexelLine other) noexcept {
  drop();
  count_ = other.count_;
  capacity_ = other.capacity_;
  if (capacity_ == 0)
    one_ = other.one_;
  else
    many_ = std::exchange(other.many_, nullptr);
  other.count_ = 0;
  other.capacity_ = 0;
  return *this;
}

void DexelLine::drop() {
  if (capacity_ > 0) delete[] many_;
  capacity_ = 0;
  count_ = 0;
}

double DexelLine::length() const {
  double sum = 0.0;
  for (const DexelRun& run : runs()) sum += run.high - run.low;
  return sum;
}

double DexelLine::length(double low, double high) const {
  double sum = 0.0;
  for (const DexelRun& run : runs())
    sum += std::max(0.0, std::min(run.high, high) - std::max(run.low, low));
  return sum;
}

double DexelLine::signed_depth(double at) const {
  double most = -std::numeric_limits<double>::infinity();
  for (const DexelRun& run : runs()) most = std::max(most, std::min(at - run.low, run.high - at));
  return most;
}

// Grows by half, so that a line with many runs is copied rarely.
void DexelLine::insert(std::uint32_t place, const DexelRun& run) {
  if (count_ == (capacity_ == 0 ? 1u : capacity_)) {
    const std::uint32_t more = std::max(2u, count_ + count_ / 2);
    auto* runs = new DexelRun[more];
    std::copy(data(), data() + count_, runs);
    if (capacity_ > 0) delete[] many_;
    many_ = runs;
    capacity_ = more;
  }
  DexelRun* const runs = data();
  std::copy_backward(runs + place, runs + count_, runs + count_ + 1);
  runs[place] = run;
  ++count_;
}

void DexelLine::erase(std::uint32_t place) {
  DexelRun* const runs = data();
  std::copy(runs + place + 1, runs + count_, runs + place);
  --count_;
}

void DexelLine::append(const DexelRun& run) {
  if (!(run.high - run.low > touch)) return;
  if (count_ > 0 && run.low <= data()[count_ - 1].high + touch) {
    DexelRun& last = data()[count_ - 1];
    if (run.high <= last.high) return;
    last.high = run.high;
    last.high_line = run.high_line;
    return;
  }
  insert(count_, run);
}

double DexelLine::take(double low, double high, std::int32_t line) {
  double taken = 0.0;
  for (std::uint32_t i = 0; i < count_;) {
    // `touch` on both sides: ends that agree to rounding must leave no slivers
    DexelRun& run = data()[i];
    if (run.low >= high - touch) break;
    if (run.high <= low + touch) {
      ++i;
      continue;
    }
    const bool keeps_low = low > run.low + touch;
    const bool keeps_high = high < run.high - touch;
    if (keeps_low && keeps_high) {
      const DexelRun upper{high, run.high, line, run.high_line};
      run.high = low;
      run.high_line = line;
      insert(i + 1, upper);
      return taken + (high - low);
    }
    if (keeps_low) {
      taken += run.high - low;
      run.high = low;
      run.high_line = line;
      ++i;
    } else if (keeps_high) {
      taken += high - run.low;
      run.low = high;
      run.low_line = line;
      break;
    } else {
      taken += run.high - run.low;
      erase(i);
    }
  }
  return taken;
}

namespace {

// Depths are in spacings; beyond the following limits only their sign is meaningful. A node of a
// cell that a plane cuts is at most 3 spacings from it along the steepest line.
constexpr float farthest_seen = 3.0F;  // with three directions
constexpr float off_edge = 1.0F;       // the same, for a node whose lines have no skin
constexpr double farthest_up = 4.0;    // with one direction
constexpr float nowhere = 1e6F;

const DexelLine& line_of(const DexelField& field, int first, int second) {
  return field.lines[std::size_t(first) + std::size_t(field.size[0]) * std::size_t(second)];
}

/// Computes for the nodes of a cell the depth along their lines, in spacings.
template <int along>
void skins_along(const Stock& stock, const int* cell, float* inside) {
  constexpr int first = (along + 1) % 3, second = (along + 2) % 3;
  const double low = cell[along] * stock.spacing, high = low + stock.spacing;
  const double scale = 1.0 / stock.spacing;
  const DexelField& field = stock.fields[std::size_t(along)];
  const DexelLine* const corner = &line_of(field, cell[first], cell[second]);
  const std::size_t across[4] = {0, 1, std::size_t(field.size[0]), std::size_t(field.size[0]) + 1};
  for (int k = 0; k < 4; ++k) {
    double at_low = -2.0 * nowhere * stock.spacing, at_high = at_low;
    for (const DexelRun& run : corner[across[k]].runs()) {
      at_low = std::max(at_low, std::min(low - run.low, run.high - low));
      at_high = std::max(at_high, std::min(high - run.low, run.high - high));
    }
    const int node = ((k & 1) << first) | ((k >> 1) << second);
    inside[node] = float(at_low * scale);
    inside[node | 1 << along] = float(at_high * scale);
  }
}

}  // namespace

double volume(const Stock& stock) {
  Sum length;
  for (const DexelField& field : stock.fields)
    for (const DexelLine& line : field.lines) length.add(line.length());
  return length.value() * stock.spacing * stock.spacing /
         double(std::max<std::size_t>(1, stock.fields.size()));
}

double depth(const Stock& stock, const Vector3d& point_w) {
  return DepthProbe(stock, Eigen::Isometry3d::Identity()).depth(point_w);
}

DepthProbe::DepthProbe(const Stock& stock, const Eigen::Isometry3d& T_wa) : stock_(stock) {
  Eigen::Isometry3d T_ka = stock.T_wk.inverse() * T_wa;
  T_ka.translation() -= stock.origin_k;
  T_ga_ = T_ka;  // a scaled rotation, not a rigid one
  T_ga_.matrix().topRows<3>() /= stock.spacing;
}

double DepthProbe::depth(const Vector3d& point_a) {
  const Vector3d place = T_ga_.linear() * point_a + T_ga_.translation();
  int cell[3];
  for (int k = 0; k < 3; ++k) {
    const double last = stock_.nodes[std::size_t(k)] - 1;
    // In this form a NaN is outside too.
    if (!(place[k] >= 0.0 && place[k] <= last)) return -infinity;
    cell[k] = std::min(int(place[k]), int(last) - 1);
  }
  return stock_.spacing *
         (stock_.fields.size() == 1 ? along_one(place, cell) : along_three(place, cell));
}

/// Interpolates the depths along the four surrounding lines.
double DepthProbe::along_one(const Vector3d& place, const int* cell) const {
  const double u = place.x() - cell[0], v = place.y() - cell[1];
  double depths[2][2];
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const double inside = line_of(stock_.fields[0], cell[0] + i, cell[1] + j)
                                .signed_depth(place.z() * stock_.spacing);
      depths[j][i] = std::clamp(inside / stock_.spacing, -farthest_up, farthest_up);
    }
  return (1 - v) * ((1 - u) * depths[0][0] + u * depths[0][1]) +
         v * ((1 - u) * depths[1][0] + u * depths[1][1]);
}

/// Returns for each node of a cell the nearest skin along the three lines through it. For a plane
/// that is its distance divided by the largest component of its normal, at every node: planes of
/// any orientation are therefore exact, and so are walls of a box up to a spacing from its edges.
DepthProbe::Nodes DepthProbe::looked_up(const int* cell) const {
  float inside[3][8];  // by direction and node
  skins_along<0>(stock_, cell, inside[0]);
  skins_along<1>(stock_, cell, inside[1]);
  skins_along<2>(stock_, cell, inside[2]);
  Nodes depths;
  for (std::size_t node = 0; node < depths.size(); ++node) {
    const float x = inside[0][node], y = inside[1][node], z = inside[2][node];
    const float votes = std::copysign(1.0F, x) + std::copysign(1.0F, y) + std::copysign(1.0F, z);
    const float side = std::copysign(1.0F, votes);
    // A line that contradicts the other two touches a skin and is ignored; a node off an edge of
    // the body has no skin on its lines at all.
    const float a = x * side >= 0.0F ? x * side : nowhere;
    const float b = y * side >= 0.0F ? y * side : nowhere;
    const float c = z * side >= 0.0F ? z * side : nowhere;
    const float nearest = std::min(a, std::min(b, c));
    depths[node] = side * (nearest < nowhere ? std::min(nearest, farthest_seen) : off_edge);
  }
  return depths;
}

const DepthProbe::Nodes& DepthProbe::depths_of(const int* cell) {
  const auto& nodes = stock_.nodes;
  const std::int64_t number =
      cell[0] + std::int64_t(nodes[0]) * (cell[1] + std::int64_t(nodes[1]) * cell[2]);
  constexpr std::uint64_t golden = 0x9E3779B97F4A7C15;  // spreads neighbouring cells over the cache
  Known& known = known_[(std::uint64_t(number) * golden) >> 55];
  if (known.cell != number) known = {number, looked_up(cell)};
  return known.depths;
}

double DepthProbe::along_three(const Vector3d& place, const int* cell) {
  const Nodes& depths = depths_of(cell);
  const double u = place.x() - cell[0], v = place.y() - cell[1], w = place.z() - cell[2];
  double plane[2];
  for (int k = 0; k < 2; ++k) {
    const float* const d = depths.data() + 4 * k;
    plane[k] = (1 - v) * ((1 - u) * d[0] + u * d[1]) + v * ((1 - u) * d[2] + u * d[3]);
  }
  return (1 - w) * plane[0] + w * plane[1];
}

namespace {

struct Bounds {
  Vector3d lower, upper;  // mm, frame k
};

// Edges of a mesh.

using Edge = std::pair<int, int>;

/// Returns the directed edges without an opposite one, with their excess number.
std::map<Edge, int> rim_of(const Triangles& triangles) {
  std::map<Edge, int> open;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const Edge edge{triangles(t, k), triangles(t, (k + 1) % 3)};
      const auto back = open.find({edge.second, edge.first});
      if (back == open.end())
        ++open[edge];
      else if (--back->second == 0)
        open.erase(back);
    }
  return open;
}

double signed_volume(const Points& vertices, const Triangles& triangles) {
  // relative to a vertex, so that the distance from the origin does not cancel
  const Vector3d about = vertices.row(0);
  double six = 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = vertices.row(triangles(t, 0)).transpose() - about;
    const Vector3d b = vertices.row(triangles(t, 1)).transpose() - about;
    const Vector3d c = vertices.row(triangles(t, 2)).transpose() - about;
    six += a.dot(b.cross(c));
  }
  return six / 6.0;
}

// Sizes.

Bounds bounds(const BoxBlank& box) { return {box.lower_k, box.upper_k}; }

Bounds bounds(const CylinderBlank& cylinder) {
  return {{-cylinder.radius, -cylinder.radius, cylinder.lower},
          {cylinder.radius, cylinder.radius, cylinder.upper}};
}

Bounds bounds(const MeshBlank& mesh) {
  if (mesh.vertices_k.rows() == 0 || mesh.triangles.rows() == 0)
    throw std::invalid_argument("blank: expected a mesh with triangles, seen none");
  if (!mesh.vertices_k.allFinite()) throw std::invalid_argument("blank: expected finite vertices");
  if (mesh.triangles.minCoeff() < 0 || mesh.triangles.maxCoeff() >= mesh.vertices_k.rows())
    throw std::invalid_argument("blank: expected triangles between vertices that exist");
  const std::size_t open = rim_of(mesh.triangles).size();
  if (open > 0) {
    throw std::invalid_argument(
        fmt::format("blank: expected a closed mesh, seen {} open edges", open));
  }
  if (!(signed_volume(mesh.vertices_k, mesh.triangles) > 0.0))
    throw std::invalid_argument("blank: expected a mesh that faces outwards and holds a volume");
  return {mesh.vertices_k.colwise().minCoeff(), mesh.vertices_k.colwise().maxCoeff()};
}

// Dexels.

/// The lines of a field with their positions.
struct Lines {
  DexelField& field;
  double spacing;
  Vector3d origin;  // mm, frame k

  int first() const { return (field.along + 1) % 3; }
  int second() const { return (field.along + 2) % 3; }
  double at_first(int i) const { return origin[first()] + i * spacing; }
  double at_second(int j) const { return origin[second()] + j * spacing; }
  DexelLine& at(int i, int j) {
    return field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)];
  }
  void append(int i, int j, double low_k, double high_k) {
    const double start = origin[field.along];
    at(i, j).append({low_k - start, high_k - start, 0, 0});
  }
};

void fill(Lines lines, const BoxBlank& box) {
  const auto within = [&](int axis, double x) {
    return x >= box.lower_k[axis] && x <= box.upper_k[axis];
  };
  const int along = lines.field.along;
  for (int j = 0; j < lines.field.size[1]; ++j)
    for (int i = 0; i < lines.field.size[0]; ++i)
      if (within(lines.first(), lines.at_first(i)) && within(lines.second(), lines.at_second(j)))
        lines.append(i, j, box.lower_k[along], box.upper_k[along]);
}

void fill(Lines lines, const CylinderBlank& cylinder) {
  for (int j = 0; j < lines.field.size[1]; ++j)
    for (int i = 0; i < lines.field.size[0]; ++i) {
      Vector3d place = Vector3d::Zero();
      place[lines.first()] = lines.at_first(i);
      place[lines.second()] = lines.at_second(j);
      const double square = cylinder.radius * cylinder.radius - place.head<2>().squaredNorm();
      if (square <= 0.0) continue;
      if (lines.field.along == 2)
        lines.append(i, j, cylinder.lower, cylinder.upper);
      else if (place.z() >= cylinder.lower && place.z() <= cylinder.upper)
        lines.append(i, j, -std::sqrt(square), std::sqrt(square));
    }
}

/// The crossings of lines with the triangles of a mesh. A line on an edge is displaced by an
/// infinitesimal amount, in the same direction for both triangles, so that every line enters as
/// often as it leaves.
class LineScan {
 public:
  LineScan(const MeshBlank& mesh, Lines lines) : mesh_(mesh), lines_(lines) {}

  struct Crossing {
    std::size_t line;
    double at;   // mm, frame k
    int enters;  // +1, or -1 where it leaves
  };

  std::vector<Crossing> crossings() {
    for (Eigen::Index t = 0; t < mesh_.triangles.rows(); ++t) scan(t);
    // Entries before exits at the same height, so that touching shells become one run.
    std::sort(found_.begin(), found_.end(), [](const Crossing& a, const Crossing& b) {
      return std::tie(a.line, a.at, b.enters) < std::tie(b.line, b.at, a.enters);
    });
    return std::move(found_);
  }

 private:
  Vector2d flat(int vertex) const {
    return {mesh_.vertices_k(vertex, lines_.first()), mesh_.vertices_k(vertex, lines_.second())};
  }

  /// Returns the side of the edge from a to b on which a point lies. Edges are always evaluated
  /// from the lower vertex, so that both triangles get the same result to the bit.
  int side(int a, int b, const Vector2d& place) const {
    if (a > b) return -side(b, a, place);
    const Vector2d from = flat(a), d = flat(b) - from;
    const double cross = d.x() * (place.y() - from.y()) - d.y() * (place.x() - from.x());
    if (cross != 0.0) return cross > 0.0 ? 1 : -1;
    if (d.y() != 0.0) return d.y() < 0.0 ? 1 : -1;
    return d.x() < 0.0 ? -1 : 1;
  }

  void scan(Eigen::Index t) {
    const int v[3] = {mesh_.triangles(t, 0), mesh_.triangles(t, 1), mesh_.triangles(t, 2)};
    const Vector2d a = flat(v[0]), b = flat(v[1]), c = flat(v[2]);
    const auto range = [&](int k, int size) {
      const double from = std::min({a[k], b[k], c[k]}), to = std::max({a[k], b[k], c[k]});
      const double start = lines_.origin[k == 0 ? lines_.first() : lines_.second()];
      return std::pair{std::max(0, int(std::ceil((from - start) / lines_.spacing - 1e-9))),
                       std::min(size - 1, int(std::floor((to - start) / lines_.spacing + 1e-9)))};
    };
    const auto [i0, i1] = range(0, lines_.field.size[0]);
    const auto [j0, j1] = range(1, lines_.field.size[1]);
    for (int j = j0; j <= j1; ++j)
      for (int i = i0; i <= i1; ++i) {
        const Vector2d place(lines_.at_first(i), lines_.at_second(j));
        const int turn = side(v[0], v[1], place);
        if (side(v[1], v[2], place) != turn || side(v[2], v[0], place) != turn) continue;
        found_.push_back({std::size_t(i) + std::size_t(lines_.field.size[0]) * std::size_t(j),
                          height(v, place), -turn});
      }
  }

  double height(const int* v, const Vector2d& place) const {
    const Vector2d a = flat(v[0]), b = flat(v[1]) - a, c = flat(v[2]) - a, p = place - a;
    const int along = lines_.field.along;
    const double h0 = mesh_.vertices_k(v[0], along);
    const double h1 = mesh_.vertices_k(v[1], along) - h0, h2 = mesh_.vertices_k(v[2], along) - h0;
    const double twice = b.x() * c.y() - b.y() * c.x();
    const double x = (p.x() * c.y() - p.y() * c.x()) / twice;
    const double y = (b.x() * p.y() - b.y() * p.x()) / twice;
    const double found = x * h1 + y * h2;
    // The formula is ill-conditioned for a triangle seen edge-on, so its result is limited to the
    // triangle.
    return h0 + (std::isfinite(found)
                     ? std::clamp(found, std::min({0.0, h1, h2}), std::max({0.0, h1, h2}))
                     : 0.0);
  }

  const MeshBlank& mesh_;
  Lines lines_;
  std::vector<Crossing> found_;
};

void fill(Lines lines, const MeshBlank& mesh) {
  const auto crossings = LineScan(mesh, lines).crossings();
  int within = 0;
  double entered = 0.0;
  for (std::size_t i = 0; i < crossings.size(); ++i) {
    const auto& now = crossings[i];
    if (i == 0 || crossings[i - 1].line != now.line) within = 0;
    // Material is where the count is positive, which also joins overlapping shells.
    const int before = within;
    within += now.enters;
    if (before <= 0 && within > 0) entered = now.at;
    if (before > 0 && within <= 0) {
      const double start = lines.origin[lines.field.along];
      lines.field.lines[now.line].append({entered - start, now.at - start, 0, 0});
    }
  }
}

void check(const StockOptions& options, const Bounds& of) {
  if (!(std::isfinite(options.spacing) && options.spacing > 0.0))
    throw std::invalid_argument(
        fmt::format("stock spacing: expected more than 0 mm, seen {}", options.spacing));
  const Vector3d extent = of.upper - of.lower;
  if (!extent.allFinite() || !of.lower.allFinite() || !(extent.minCoeff() > 0.0))
    throw std::invalid_argument(
        fmt::format("blank: expected a body of finite size, seen {} x {} x {} mm", extent.x(),
                    extent.y(), extent.z()));
}

/// Returns the number of nodes along one axis: those in the blank, and one outside at either end.
double node_count(double extent, double spacing) {
  return std::max(1.0, std::round(extent / spacing)) + 2.0;
}

void refuse_beyond(const StockOptions& options, const Vector3d& nodes) {
  // Twice the line itself, for the runs that cutting splits and for crossings while a mesh is
  // scanned.
  constexpr double bytes_a_line = 2.0 * sizeof(DexelLine);
  double lines = nodes.x() * nodes.y();
  if (options.three_directions) lines += nodes.z() * (nodes.x() + nodes.y());
  const double bytes = lines * bytes_a_line;
  if (bytes <= double(options.max_bytes) && nodes.maxCoeff() < 1e9) return;
  constexpr double MiB = 1024.0 * 1024.0;
  throw std::length_error(
      fmt::format("stock of {:.6g} x {:.6g} x {:.6g} nodes would take {:.3g} MiB, more than the "
                  "{:.0f} allowed: a wider spacing, or one direction",
                  nodes.x(), nodes.y(), nodes.z(), bytes / MiB, double(options.max_bytes) / MiB));
}

}  // namespace

Stock make_stock(const Blank& blank, const Eigen::Isometry3d& T_wk, const StockOptions& options) {
  const Bounds of = std::visit([](const auto& body) { return bounds(body); }, blank);
  check(options, of);
  if (!T_wk.matrix().allFinite()) throw std::invalid_argument("blank: expected a finite pose");
  Vector3d nodes;
  for (int k = 0; k < 3; ++k) nodes[k] = node_count(of.upper[k] - of.lower[k], options.spacing);
  refuse_beyond(options, nodes);
  Stock stock;
  stock.T_wk = T_wk;
  stock.spacing = options.spacing;
  stock.origin_k = 0.5 * (of.lower + of.upper) - 0.5 * options.spacing * (nodes - Vector3d::Ones());
  for (int k = 0; k < 3; ++k) stock.nodes[std::size_t(k)] = int(nodes[k]);
  for (int along = options.three_directions ? 0 : 2; along < 3; ++along) {
    DexelField field;
    field.along = along;
    field.size = {stock.nodes[std::size_t((along + 1) % 3)],
                  stock.nodes[std::size_t((along + 2) % 3)]};
    field.lines.resize(std::size_t(field.size[0]) * std::size_t(field.size[1]));
    const Lines lines{field, stock.spacing, stock.origin_k};
    std::visit([&](const auto& body) { fill(lines, body); }, blank);
    stock.fields.push_back(std::move(field));
  }
  return stock;
}

// Offsets of a design.

namespace {

using Coordinates = std::tuple<double, double, double>;

Coordinates coordinates_of(const Points& points, int i) {
  return {points(i, 0), points(i, 1), points(i, 2)};
}

/// Adds quadrilaterals between raised rims that coincided before: a kink of the design has separate
/// vertices for its two normals and opens when it is raised.
void bridge_kinks(const Points& before, const std::map<Edge, int>& rim,
                  std::vector<std::array<int, 3>>& triangles) {
  std::map<std::pair<Coordinates, Coordinates>, Edge> by_place;
  for (const auto& [edge, count] : rim)
    by_place[{coordinates_of(before, edge.first), coordinates_of(before, edge.second)}] = edge;
  for (const auto& [places, edge] : by_place) {
    const auto other = by_place.find({places.second, places.first});
    if (other == by_place.end() || !(edge < other->second)) continue;
    const auto [a, b] = edge;
    const auto [c, d] = other->second;  // c over b, d over a
    if (c != b) triangles.push_back({b, a, c});
    if (d != a) triangles.push_back({a, d, c});
  }
}

Triangles to_triangles(const std::vector<std::array<int, 3>>& list) {
  Triangles triangles(Eigen::Index(list.size()), 3);
  for (std::size_t t = 0; t < list.size(); ++t)
    for (int k = 0; k < 3; ++k) triangles(Eigen::Index(t), k) = list[t][std::size_t(k)];
  return triangles;
}

void check_raised(const Points& raised, const Triangles& triangles, double floor) {
  if (!(raised.col(2).minCoeff() > floor))
    throw std::invalid_argument(
        fmt::format("offset blank: expected a floor below the raised surface, whose lowest place "
                    "is z = {} mm; seen {} mm",
                    raised.col(2).minCoeff(), floor));
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = raised.row(triangles(t, 0)), b = raised.row(triangles(t, 1)),
                   c = raised.row(triangles(t, 2));
    const Vector3d cross = (b - a).cross(c - a);
    // 1e-9: an upright triangle may face down by rounding
    if (cross.z() < -1e-9 * cross.norm())
      throw std::invalid_argument(
          "offset blank: expected an open design that faces +z without folds when it is raised");
  }
}

}  // namespace

MeshBlank offset_blank(const Design& design_k, double allowance, double floor) {
  if (!std::isfinite(allowance) || design_k.vertices.rows() == 0 ||
      design_k.triangles.rows() == 0 || design_k.normals.rows() != design_k.vertices.rows())
    throw std::invalid_argument("offset blank: expected a design and a finite allowance");
  const Points raised = design_k.vertices + allowance * design_k.normals;
  const auto rim = rim_of(design_k.triangles);
  if (rim.empty()) return {raised, design_k.triangles};
  if (!std::isfinite(floor)) throw std::invalid_argument("offset blank: expected a finite floor");
  check_raised(raised, design_k.triangles, floor);

  std::vector<std::array<int, 3>> top;
  for (Eigen::Index t = 0; t < design_k.triangles.rows(); ++t)
    top.push_back({design_k.triangles(t, 0), design_k.triangles(t, 1), design_k.triangles(t, 2)});
  bridge_kinks(design_k.vertices, rim, top);

  const int n = int(raised.rows());
  MeshBlank body;
  body.vertices_k.resize(2 * n, 3);
  body.vertices_k << raised, raised;
  body.vertices_k.bottomRows(n).col(2).setConstant(floor);
  std::vector<std::array<int, 3>> all = top;
  for (const auto& [a, b, c] : top) all.push_back({n + a, n + c, n + b});
  for (const auto& [edge, count] : rim_of(to_triangles(top)))
    for (int i = 0; i < count; ++i) {
      all.push_back({edge.second, edge.first, n + edge.first});
      all.push_back({edge.second, n + edge.first, n + edge.second});
    }
  body.triangles = to_triangles(all);
  return body;
}

}  // namespace abbe::cutting
