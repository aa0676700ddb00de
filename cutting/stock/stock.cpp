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

DexelLine::DexelLine(const DexelLine& other) : count_(other.count_), single_run_{} {
  if (count_ <= 1) {
    if (count_ == 1) single_run_ = *other.data();
    return;
  }
  capacity_ = count_;
  run_array_ = new DexelRun[capacity_];
  std::copy(other.run_array_, other.run_array_ + count_, run_array_);
}

DexelLine::DexelLine(DexelLine&& other) noexcept
    : count_(other.count_), capacity_(other.capacity_), single_run_{} {
  if (capacity_ == 0)
    single_run_ = other.single_run_;
  else
    run_array_ = std::exchange(other.run_array_, nullptr);
  other.count_ = 0;
  other.capacity_ = 0;
}

DexelLine& DexelLine::operator=(DexelLine other) noexcept {
  release();
  count_ = other.count_;
  capacity_ = other.capacity_;
  if (capacity_ == 0)
    single_run_ = other.single_run_;
  else
    run_array_ = std::exchange(other.run_array_, nullptr);
  other.count_ = 0;
  other.capacity_ = 0;
  return *this;
}

void DexelLine::release() {
  if (capacity_ > 0) delete[] run_array_;
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

double DexelLine::signed_depth(double position) const {
  double max_depth = -std::numeric_limits<double>::infinity();
  for (const DexelRun& run : runs())
    max_depth = std::max(max_depth, std::min(position - run.low, run.high - position));
  return max_depth;
}

// The capacity grows by half, so that a line with many runs is rarely copied.
void DexelLine::insert(std::uint32_t index, const DexelRun& run) {
  if (count_ == (capacity_ == 0 ? 1u : capacity_)) {
    const std::uint32_t new_capacity = std::max(2u, count_ + count_ / 2);
    auto* runs = new DexelRun[new_capacity];
    std::copy(data(), data() + count_, runs);
    if (capacity_ > 0) delete[] run_array_;
    run_array_ = runs;
    capacity_ = new_capacity;
  }
  DexelRun* const runs = data();
  std::copy_backward(runs + index, runs + count_, runs + count_ + 1);
  runs[index] = run;
  ++count_;
}

void DexelLine::erase(std::uint32_t index) {
  DexelRun* const runs = data();
  std::copy(runs + index + 1, runs + count_, runs + index);
  --count_;
}

void DexelLine::append(const DexelRun& run) {
  if (!(run.high - run.low > tolerance)) return;
  if (count_ > 0 && run.low <= data()[count_ - 1].high + tolerance) {
    DexelRun& last = data()[count_ - 1];
    if (run.high <= last.high) return;
    last.high = run.high;
    last.high_line = run.high_line;
    return;
  }
  insert(count_, run);
}

double DexelLine::cut(double low, double high, std::int32_t line) {
  double removed = 0.0;
  for (std::uint32_t i = 0; i < count_;) {
    // `tolerance` on both sides, so that ends which agree to rounding leave no slivers.
    DexelRun& run = data()[i];
    if (run.low >= high - tolerance) break;
    if (run.high <= low + tolerance) {
      ++i;
      continue;
    }
    const bool keeps_low = low > run.low + tolerance;
    const bool keeps_high = high < run.high - tolerance;
    if (keeps_low && keeps_high) {
      const DexelRun upper{high, run.high, line, run.high_line};
      run.high = low;
      run.high_line = line;
      insert(i + 1, upper);
      return removed + (high - low);
    }
    if (keeps_low) {
      removed += run.high - low;
      run.high = low;
      run.high_line = line;
      ++i;
    } else if (keeps_high) {
      removed += high - run.low;
      run.low = high;
      run.low_line = line;
      break;
    } else {
      removed += run.high - run.low;
      erase(i);
    }
  }
  return removed;
}

namespace {

// Depths are in spacings; beyond the following limits only their sign is meaningful. The nodes of a
// cell that a plane crosses are at most 3 spacings from the plane along the steepest line.
constexpr float max_depth_of_three = 3.0F;  // with three directions
constexpr float depth_off_edge = 1.0F;      // the same, for a node whose lines have no skin
constexpr double max_depth_of_one = 4.0;    // with one direction
constexpr float no_skin = 1e6F;

const DexelLine& dexel_line(const DexelField& field, int first, int second) {
  return field.lines[std::size_t(first) + std::size_t(field.size[0]) * std::size_t(second)];
}

/// Computes the depths of the nodes of a cell along their lines, in spacings.
template <int along>
void skin_depths(const Stock& stock, const int* cell, float* inside) {
  constexpr int first = (along + 1) % 3, second = (along + 2) % 3;
  const double low = cell[along] * stock.spacing, high = low + stock.spacing;
  const double scale = 1.0 / stock.spacing;
  const DexelField& field = stock.fields[std::size_t(along)];
  const DexelLine* const corner = &dexel_line(field, cell[first], cell[second]);
  const std::size_t offsets[4] = {0, 1, std::size_t(field.size[0]), std::size_t(field.size[0]) + 1};
  for (int k = 0; k < 4; ++k) {
    double depth_low = -2.0 * no_skin * stock.spacing, depth_high = depth_low;
    for (const DexelRun& run : corner[offsets[k]].runs()) {
      depth_low = std::max(depth_low, std::min(low - run.low, run.high - low));
      depth_high = std::max(depth_high, std::min(high - run.low, run.high - high));
    }
    const int node = ((k & 1) << first) | ((k >> 1) << second);
    inside[node] = float(depth_low * scale);
    inside[node | 1 << along] = float(depth_high * scale);
  }
}

}  // namespace

double volume(const Stock& stock) {
  CompensatedSum length;
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
  T_ga_ = T_ka;  // scaled by the next line, so no longer a rigid transform
  T_ga_.matrix().topRows<3>() /= stock.spacing;
}

double DepthProbe::depth(const Vector3d& point_a) {
  const Vector3d grid_point = T_ga_.linear() * point_a + T_ga_.translation();
  int cell[3];
  for (int k = 0; k < 3; ++k) {
    const double last = stock_.nodes[std::size_t(k)] - 1;
    // Written so that a NaN is outside too.
    if (!(grid_point[k] >= 0.0 && grid_point[k] <= last)) return -infinity;
    cell[k] = std::min(int(grid_point[k]), int(last) - 1);
  }
  return stock_.spacing * (stock_.fields.size() == 1 ? depth_in_one_direction(grid_point, cell)
                                                     : depth_in_three_directions(grid_point, cell));
}

/// Interpolates the depths along the four surrounding lines.
double DepthProbe::depth_in_one_direction(const Vector3d& grid_point, const int* cell) const {
  const double u = grid_point.x() - cell[0], v = grid_point.y() - cell[1];
  double depths[2][2];
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const double line_depth = dexel_line(stock_.fields[0], cell[0] + i, cell[1] + j)
                                    .signed_depth(grid_point.z() * stock_.spacing);
      depths[j][i] = std::clamp(line_depth / stock_.spacing, -max_depth_of_one, max_depth_of_one);
    }
  return (1 - v) * ((1 - u) * depths[0][0] + u * depths[0][1]) +
         v * ((1 - u) * depths[1][0] + u * depths[1][1]);
}

/// Returns, for each node of a cell, the distance of the nearest skin along the three lines through
/// it. For a plane this is the distance divided by the largest component of the normal at every
/// node, so planes of any orientation are exact, and so are the walls of a box up to a spacing from
/// its edges.
DepthProbe::NodeDepths DepthProbe::node_depths(const int* cell) const {
  float inside[3][8];  // by direction and node
  skin_depths<0>(stock_, cell, inside[0]);
  skin_depths<1>(stock_, cell, inside[1]);
  skin_depths<2>(stock_, cell, inside[2]);
  NodeDepths depths;
  for (std::size_t node = 0; node < depths.size(); ++node) {
    const float x = inside[0][node], y = inside[1][node], z = inside[2][node];
    const float votes = std::copysign(1.0F, x) + std::copysign(1.0F, y) + std::copysign(1.0F, z);
    const float sign = std::copysign(1.0F, votes);
    // A line that contradicts the other two grazes a skin and is ignored. A node off an edge of the
    // body has no skin on any of its lines.
    const float a = x * sign >= 0.0F ? x * sign : no_skin;
    const float b = y * sign >= 0.0F ? y * sign : no_skin;
    const float c = z * sign >= 0.0F ? z * sign : no_skin;
    const float min_distance = std::min(a, std::min(b, c));
    depths[node] = sign * (min_distance < no_skin ? std::min(min_distance, max_depth_of_three)
                                                  : depth_off_edge);
  }
  return depths;
}

const DepthProbe::NodeDepths& DepthProbe::cached_depths(const int* cell) {
  const auto& nodes = stock_.nodes;
  const std::int64_t cell_number =
      cell[0] + std::int64_t(nodes[0]) * (cell[1] + std::int64_t(nodes[1]) * cell[2]);
  // Spreads neighbouring cells over the cache.
  constexpr std::uint64_t hash_factor = 0x9E3779B97F4A7C15;
  CachedCell& entry = cache_[(std::uint64_t(cell_number) * hash_factor) >> 55];
  if (entry.cell != cell_number) entry = {cell_number, node_depths(cell)};
  return entry.depths;
}

double DepthProbe::depth_in_three_directions(const Vector3d& grid_point, const int* cell) {
  const NodeDepths& depths = cached_depths(cell);
  const double u = grid_point.x() - cell[0], v = grid_point.y() - cell[1],
               w = grid_point.z() - cell[2];
  double layers[2];
  for (int k = 0; k < 2; ++k) {
    const float* const d = depths.data() + 4 * k;
    layers[k] = (1 - v) * ((1 - u) * d[0] + u * d[1]) + v * ((1 - u) * d[2] + u * d[3]);
  }
  return (1 - w) * layers[0] + w * layers[1];
}

namespace {

struct Bounds {
  Vector3d lower, upper;  // mm, frame k
};

// Edges of a mesh.

using Edge = std::pair<int, int>;

/// Returns the directed edges without an opposite edge, with their excess number.
std::map<Edge, int> rim_edges(const Triangles& triangles) {
  std::map<Edge, int> rim;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const Edge edge{triangles(t, k), triangles(t, (k + 1) % 3)};
      const auto opposite = rim.find({edge.second, edge.first});
      if (opposite == rim.end())
        ++rim[edge];
      else if (--opposite->second == 0)
        rim.erase(opposite);
    }
  return rim;
}

double signed_volume(const Points& vertices, const Triangles& triangles) {
  // Relative to a vertex, so that a distant origin causes no cancellation.
  const Vector3d origin = vertices.row(0);
  double sixfold_volume = 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = vertices.row(triangles(t, 0)).transpose() - origin;
    const Vector3d b = vertices.row(triangles(t, 1)).transpose() - origin;
    const Vector3d c = vertices.row(triangles(t, 2)).transpose() - origin;
    sixfold_volume += a.dot(b.cross(c));
  }
  return sixfold_volume / 6.0;
}

// Sizes.

Bounds bounds(const BoxBlank& box) { return {box.lower_k, box.upper_k}; }

Bounds bounds(const CylinderBlank& cylinder) {
  return {{-cylinder.radius, -cylinder.radius, cylinder.lower},
          {cylinder.radius, cylinder.radius, cylinder.upper}};
}

Bounds bounds(const MeshBlank& mesh) {
  if (mesh.vertices_k.rows() == 0 || mesh.triangles.rows() == 0)
    throw std::invalid_argument("blank: expected a mesh with triangles, seen an empty mesh");
  if (!mesh.vertices_k.allFinite()) throw std::invalid_argument("blank: expected finite vertices");
  if (mesh.triangles.minCoeff() < 0 || mesh.triangles.maxCoeff() >= mesh.vertices_k.rows())
    throw std::invalid_argument("blank: expected triangles between vertices that exist");
  const std::size_t open_edges = rim_edges(mesh.triangles).size();
  if (open_edges > 0) {
    throw std::invalid_argument(
        fmt::format("blank: expected a closed mesh, seen {} open edges", open_edges));
  }
  if (!(signed_volume(mesh.vertices_k, mesh.triangles) > 0.0))
    throw std::invalid_argument("blank: expected a mesh with outward normals and a volume above 0");
  return {mesh.vertices_k.colwise().minCoeff(), mesh.vertices_k.colwise().maxCoeff()};
}

// Dexels.

/// The lines of a dexel field with their positions.
struct FieldLines {
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

void fill(FieldLines lines, const BoxBlank& box) {
  const auto is_within = [&](int axis, double x) {
    return x >= box.lower_k[axis] && x <= box.upper_k[axis];
  };
  const int along = lines.field.along;
  for (int j = 0; j < lines.field.size[1]; ++j)
    for (int i = 0; i < lines.field.size[0]; ++i)
      if (is_within(lines.first(), lines.at_first(i)) &&
          is_within(lines.second(), lines.at_second(j)))
        lines.append(i, j, box.lower_k[along], box.upper_k[along]);
}

void fill(FieldLines lines, const CylinderBlank& cylinder) {
  for (int j = 0; j < lines.field.size[1]; ++j)
    for (int i = 0; i < lines.field.size[0]; ++i) {
      Vector3d point = Vector3d::Zero();
      point[lines.first()] = lines.at_first(i);
      point[lines.second()] = lines.at_second(j);
      const double squared_half_chord =
          cylinder.radius * cylinder.radius - point.head<2>().squaredNorm();
      if (squared_half_chord <= 0.0) continue;
      if (lines.field.along == 2)
        lines.append(i, j, cylinder.lower, cylinder.upper);
      else if (point.z() >= cylinder.lower && point.z() <= cylinder.upper)
        lines.append(i, j, -std::sqrt(squared_half_chord), std::sqrt(squared_half_chord));
    }
}

/// Search for the crossings of lines with the triangles of a mesh. A line on an edge is displaced
/// by an infinitesimal amount, in the same direction for both triangles, so that every line enters
/// the body as often as it leaves it.
class MeshScan {
 public:
  MeshScan(const MeshBlank& mesh, FieldLines lines) : mesh_(mesh), lines_(lines) {}

  struct Crossing {
    std::size_t line;
    double at;  // mm, frame k
    int sign;   // +1 where the line enters the body, -1 where it leaves
  };

  std::vector<Crossing> crossings() {
    for (Eigen::Index t = 0; t < mesh_.triangles.rows(); ++t) scan(t);
    // Entries before exits at the same height, so that touching shells become one run.
    std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& a, const Crossing& b) {
      return std::tie(a.line, a.at, b.sign) < std::tie(b.line, b.at, a.sign);
    });
    return std::move(crossings_);
  }

 private:
  Vector2d projection(int vertex) const {
    return {mesh_.vertices_k(vertex, lines_.first()), mesh_.vertices_k(vertex, lines_.second())};
  }

  /// Returns the side, +1 or -1, of the edge from a to b on which a point lies. Always evaluates
  /// the edge from the lower vertex number, so that both triangles get the same bits.
  int side(int a, int b, const Vector2d& point) const {
    if (a > b) return -side(b, a, point);
    const Vector2d from = projection(a), edge = projection(b) - from;
    const double cross = edge.x() * (point.y() - from.y()) - edge.y() * (point.x() - from.x());
    if (cross != 0.0) return cross > 0.0 ? 1 : -1;
    if (edge.y() != 0.0) return edge.y() < 0.0 ? 1 : -1;
    return edge.x() < 0.0 ? -1 : 1;
  }

  void scan(Eigen::Index t) {
    const int v[3] = {mesh_.triangles(t, 0), mesh_.triangles(t, 1), mesh_.triangles(t, 2)};
    const Vector2d a = projection(v[0]), b = projection(v[1]), c = projection(v[2]);
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
        const Vector2d point(lines_.at_first(i), lines_.at_second(j));
        const int orientation = side(v[0], v[1], point);
        if (side(v[1], v[2], point) != orientation || side(v[2], v[0], point) != orientation)
          continue;
        crossings_.push_back({std::size_t(i) + std::size_t(lines_.field.size[0]) * std::size_t(j),
                              height_above(v, point), -orientation});
      }
  }

  double height_above(const int* v, const Vector2d& point) const {
    const Vector2d a = projection(v[0]), b = projection(v[1]) - a, c = projection(v[2]) - a,
                   p = point - a;
    const int along = lines_.field.along;
    const double h0 = mesh_.vertices_k(v[0], along);
    const double h1 = mesh_.vertices_k(v[1], along) - h0, h2 = mesh_.vertices_k(v[2], along) - h0;
    const double twice_area = b.x() * c.y() - b.y() * c.x();
    const double x = (p.x() * c.y() - p.y() * c.x()) / twice_area;
    const double y = (b.x() * p.y() - b.y() * p.x()) / twice_area;
    const double rise = x * h1 + y * h2;
    // For a triangle parallel to the line the formula is ill-conditioned, so the result is limited
    // to the heights of the triangle.
    return h0 + (std::isfinite(rise)
                     ? std::clamp(rise, std::min({0.0, h1, h2}), std::max({0.0, h1, h2}))
                     : 0.0);
  }

  const MeshBlank& mesh_;
  FieldLines lines_;
  std::vector<Crossing> crossings_;
};

void fill(FieldLines lines, const MeshBlank& mesh) {
  const auto crossings = MeshScan(mesh, lines).crossings();
  int shell_count = 0;
  double entry = 0.0;
  for (std::size_t i = 0; i < crossings.size(); ++i) {
    const auto& crossing = crossings[i];
    if (i == 0 || crossings[i - 1].line != crossing.line) shell_count = 0;
    // Material is where the count is positive, which also joins overlapping shells.
    const int previous_count = shell_count;
    shell_count += crossing.sign;
    if (previous_count <= 0 && shell_count > 0) entry = crossing.at;
    if (previous_count > 0 && shell_count <= 0) {
      const double start = lines.origin[lines.field.along];
      lines.field.lines[crossing.line].append({entry - start, crossing.at - start, 0, 0});
    }
  }
}

void check(const StockOptions& options, const Bounds& bounds) {
  if (!(std::isfinite(options.spacing) && options.spacing > 0.0))
    throw std::invalid_argument(
        fmt::format("stock spacing: expected more than 0 mm, seen {}", options.spacing));
  const Vector3d extent = bounds.upper - bounds.lower;
  if (!extent.allFinite() || !bounds.lower.allFinite() || !(extent.minCoeff() > 0.0))
    throw std::invalid_argument(
        fmt::format("blank: expected a body of finite size, seen {} x {} x {} mm", extent.x(),
                    extent.y(), extent.z()));
}

/// Returns the number of nodes along one axis: those inside the blank and one outside at either
/// end.
double node_count(double extent, double spacing) {
  return std::max(1.0, std::round(extent / spacing)) + 2.0;
}

void check_memory(const StockOptions& options, const Vector3d& nodes) {
  // Twice the size of a line, for the runs that cutting splits and the crossings of a mesh scan.
  constexpr double bytes_per_line = 2.0 * sizeof(DexelLine);
  double lines = nodes.x() * nodes.y();
  if (options.three_directions) lines += nodes.z() * (nodes.x() + nodes.y());
  const double bytes = lines * bytes_per_line;
  if (bytes <= double(options.max_bytes) && nodes.maxCoeff() < 1e9) return;
  constexpr double MiB = 1024.0 * 1024.0;
  throw std::length_error(
      fmt::format("stock of {:.6g} x {:.6g} x {:.6g} nodes would take {:.3g} MiB, more than the "
                  "{:.0f} allowed: use a larger spacing or one direction",
                  nodes.x(), nodes.y(), nodes.z(), bytes / MiB, double(options.max_bytes) / MiB));
}

}  // namespace

Stock make_stock(const Blank& blank, const Eigen::Isometry3d& T_wk, const StockOptions& options) {
  const Bounds blank_bounds = std::visit([](const auto& body) { return bounds(body); }, blank);
  check(options, blank_bounds);
  if (!T_wk.matrix().allFinite()) throw std::invalid_argument("blank: expected a finite pose");
  Vector3d nodes;
  for (int k = 0; k < 3; ++k)
    nodes[k] = node_count(blank_bounds.upper[k] - blank_bounds.lower[k], options.spacing);
  check_memory(options, nodes);
  Stock stock;
  stock.T_wk = T_wk;
  stock.spacing = options.spacing;
  stock.origin_k = 0.5 * (blank_bounds.lower + blank_bounds.upper) -
                   0.5 * options.spacing * (nodes - Vector3d::Ones());
  for (int k = 0; k < 3; ++k) stock.nodes[std::size_t(k)] = int(nodes[k]);
  for (int along = options.three_directions ? 0 : 2; along < 3; ++along) {
    DexelField field;
    field.along = along;
    field.size = {stock.nodes[std::size_t((along + 1) % 3)],
                  stock.nodes[std::size_t((along + 2) % 3)]};
    field.lines.resize(std::size_t(field.size[0]) * std::size_t(field.size[1]));
    const FieldLines lines{field, stock.spacing, stock.origin_k};
    std::visit([&](const auto& body) { fill(lines, body); }, blank);
    stock.fields.push_back(std::move(field));
  }
  return stock;
}

// Offsets of a design.

namespace {

using Coordinates = std::tuple<double, double, double>;

Coordinates coordinates(const Points& points, int i) {
  return {points(i, 0), points(i, 1), points(i, 2)};
}

/// Adds quadrilaterals between rims that coincided before the surface was raised: a kink of the
/// design has separate vertices for its two normals, which move apart.
void bridge_kinks(const Points& before, const std::map<Edge, int>& rim,
                  std::vector<std::array<int, 3>>& triangles) {
  std::map<std::pair<Coordinates, Coordinates>, Edge> edges_by_position;
  for (const auto& [edge, count] : rim)
    edges_by_position[{coordinates(before, edge.first), coordinates(before, edge.second)}] = edge;
  for (const auto& [positions, edge] : edges_by_position) {
    const auto opposite = edges_by_position.find({positions.second, positions.first});
    if (opposite == edges_by_position.end() || !(edge < opposite->second)) continue;
    const auto [a, b] = edge;
    const auto [c, d] = opposite->second;  // c over b, d over a
    if (c != b) triangles.push_back({b, a, c});
    if (d != a) triangles.push_back({a, d, c});
  }
}

void check_raised_surface(const Points& raised, const Triangles& triangles, double floor) {
  if (!(raised.col(2).minCoeff() > floor))
    throw std::invalid_argument(
        fmt::format("offset blank: expected a floor below the raised surface, whose lowest point "
                    "is at z = {} mm, seen {} mm",
                    raised.col(2).minCoeff(), floor));
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = raised.row(triangles(t, 0)), b = raised.row(triangles(t, 1)),
                   c = raised.row(triangles(t, 2));
    const Vector3d cross = (b - a).cross(c - a);
    // 1e-9, since rounding may make a vertical triangle face down.
    if (cross.z() < -1e-9 * cross.norm())
      throw std::invalid_argument(
          "offset blank: expected an open design that faces +z and does not fold when raised");
  }
}

}  // namespace

MeshBlank offset_blank(const Design& design_k, double allowance, double floor) {
  if (!std::isfinite(allowance) || design_k.vertices.rows() == 0 ||
      design_k.triangles.rows() == 0 || design_k.normals.rows() != design_k.vertices.rows())
    throw std::invalid_argument("offset blank: expected a design and a finite allowance");
  const Points raised = design_k.vertices + allowance * design_k.normals;
  const auto rim = rim_edges(design_k.triangles);
  if (rim.empty()) return {raised, design_k.triangles};
  if (!std::isfinite(floor)) throw std::invalid_argument("offset blank: expected a finite floor");
  check_raised_surface(raised, design_k.triangles, floor);

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
  for (const auto& [edge, count] : rim_edges(triangle_matrix(top)))
    for (int i = 0; i < count; ++i) {
      all.push_back({edge.second, edge.first, n + edge.first});
      all.push_back({edge.second, n + edge.first, n + edge.second});
    }
  body.triangles = triangle_matrix(all);
  return body;
}

}  // namespace abbe::cutting
