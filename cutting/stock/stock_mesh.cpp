#include "cutting/stock/stock_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cutting/stock/stock.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

using Node = std::array<int, 3>;

/// The position of the skin between two nodes, and the program line that cut it there.
struct Crossing {
  double position = 0.0;  ///< mm along the edge's axis from the grid's origin
  std::int32_t program_line = 0;
  bool is_end = false;  ///< true at the end of a run; false if interpolated, clamped or assumed
};

const DexelLine& line_through(const DexelField& field, const Node& node) {
  const int first = (field.along + 1) % 3, second = (field.along + 2) % 3;
  return field.lines[std::size_t(node[std::size_t(first)]) +
                     std::size_t(field.size[0]) * std::size_t(node[std::size_t(second)])];
}

const DexelRun* run_containing(const DexelLine& line, double at) {
  for (const DexelRun& run : line.runs())
    if (run.low < at && at < run.high) return &run;
  return nullptr;
}

/// Returns the program line at the end of a run that is nearest to a position; it is taken as that
/// of the skin there.
std::int32_t program_line_near(const DexelLine& line, double at) {
  double nearest = std::numeric_limits<double>::infinity();
  std::int32_t nearest_program_line = 0;
  const auto compare = [&](double position, std::int32_t program_line) {
    if (std::abs(position - at) >= nearest) return;
    nearest = std::abs(position - at);
    nearest_program_line = program_line;
  };
  for (const DexelRun& run : line.runs()) {
    compare(run.low, run.low_line);
    compare(run.high, run.high_line);
  }
  return nearest_program_line;
}

/// Meshes the dexels by surface nets, i.e. dual contouring with every vertex at the mean of the
/// crossings of its cell; layer by layer, so that only two layers of nodes are in memory.
class SkinMesher {
 public:
  explicit SkinMesher(const Stock& stock, bool keeps_points = false)
      : stock_(stock),
        nx_(stock.nodes[0]),
        ny_(stock.nodes[1]),
        nz_(stock.nodes[2]),
        keeps_points_(keeps_points) {}

  StockMesh mesh() {
    below_ = material_nodes(0);
    if (keeps_points_) edge_points_.assign(5, std::vector<int>(below_.size(), not_computed));
    std::vector<int> cells_below(cell_count(), -1);
    for (int k = 0; k + 1 < nz_; ++k) {
      above_ = material_nodes(k + 1);
      const std::vector<int> cells = make_vertices(k);
      add_vertical_edge_quads(cells);
      if (k > 0) add_horizontal_edge_quads(cells_below, cells);
      cells_below = cells;
      std::swap(below_, above_);
      if (keeps_points_) next_layer();
    }
    return make_mesh();
  }

  StockSkin skin() {
    StockSkin result;
    result.mesh = mesh();
    result.points_w = in_workpiece(points_);
    result.line = std::move(point_lines_);
    result.first = std::move(first_);
    result.first.push_back(int(point_indices_.size()));
    result.point_indices = std::move(point_indices_);
    result.spacing = stock_.spacing;
    result.lattice = stock_.fields.size() == 1 ? StockSkin::Lattice::OneDirection
                                               : StockSkin::Lattice::ThreeDirections;
    result.T_wk = stock_.T_wk * Eigen::Translation3d(stock_.origin_k);
    return result;
  }

 private:
  static constexpr int not_computed = -1,
                       no_point = -2;  // values of `edge_points_` that are not an index

  std::size_t cell_count() const { return std::size_t(nx_ - 1) * std::size_t(ny_ - 1); }
  std::size_t node(int i, int j) const {
    return std::size_t(i) + std::size_t(nx_) * std::size_t(j);
  }
  std::size_t cell(int i, int j) const {
    return std::size_t(i) + std::size_t(nx_ - 1) * std::size_t(j);
  }

  /// Returns 1 for every node of a layer that most of the lines through it have in material.
  std::vector<char> material_nodes(int k) const {
    const double h = stock_.spacing;
    std::vector<char> votes(std::size_t(nx_) * std::size_t(ny_), 0);
    for (const DexelField& field : stock_.fields)
      for (int j = 0; j < (field.along == 1 ? 1 : ny_); ++j)
        for (int i = 0; i < (field.along == 0 ? 1 : nx_); ++i) {
          const DexelLine& line = line_through(field, {i, j, k});
          if (field.along == 2) {
            votes[node(i, j)] = char(votes[node(i, j)] + (line.signed_depth(k * h) > 0.0 ? 1 : 0));
            continue;
          }
          for (const DexelRun& run : line.runs()) {
            const int start_node = std::max(0, int(std::floor(run.low / h)) + 1);
            const int last = (field.along == 0 ? nx_ : ny_) - 1;
            const int to = std::min(last, int(std::ceil(run.high / h)) - 1);
            for (int n = start_node; n <= to; ++n) {
              char& vote = votes[field.along == 0 ? node(n, j) : node(i, n)];
              vote = char(vote + 1);
            }
          }
        }
    // One vote with a single direction, two with three directions.
    const char required_votes = stock_.fields.size() == 1 ? 1 : 2;
    for (char& vote : votes) vote = vote >= required_votes ? 1 : 0;
    return votes;
  }

  /// Returns the crossing of the skin with the edge from a node along an axis.
  /// @param rises  true if the material is at the upper end of the edge
  Crossing crossing(const Node& start_node, int axis, bool rises) const {
    const double h = stock_.spacing;
    const double start = start_node[std::size_t(axis)] * h;
    if (stock_.fields.size() == 1 && axis != 2) return interpolated_crossing(start_node, axis);
    const DexelField& field = stock_.fields[stock_.fields.size() == 1 ? 0 : std::size_t(axis)];
    const DexelLine& line = line_through(field, start_node);
    const DexelRun* const run = run_containing(line, rises ? start + h : start);
    if (run == nullptr) return {start + 0.5 * h, program_line_near(line, start + 0.5 * h), false};
    const double end = rises ? run->low : run->high;
    const double at = std::clamp(end, start, start + h);
    return {at, rises ? run->low_line : run->high_line, at == end};
  }

  /// Returns a crossing between neighbouring lines of one direction: the position at which the
  /// depth interpolated between them is zero.
  Crossing interpolated_crossing(const Node& start_node, int axis) const {
    const double h = stock_.spacing;
    Node to = start_node;
    ++to[std::size_t(axis)];
    const double z = start_node[2] * h;
    const DexelLine& a = line_through(stock_.fields[0], start_node);
    const DexelLine& b = line_through(stock_.fields[0], to);
    // Limited as in `depth`, so that mesh and depth field have the same zero.
    const double da = std::clamp(a.signed_depth(z), -4 * h, 4 * h);
    const double db = std::clamp(b.signed_depth(z), -4 * h, 4 * h);
    const double fraction = da != db ? std::clamp(da / (da - db), 0.0, 1.0) : 0.5;
    const DexelLine& outside = da > 0.0 ? b : a;
    return {(start_node[std::size_t(axis)] + fraction) * h, program_line_near(outside, z), false};
  }

  /// Returns the index of the point on an edge, which is addressed by its lower node. The five
  /// arrays hold the edges along x in the lower and in the upper layer of nodes, those along y in
  /// both layers, and those along z.
  int& edge_point(const Node& start_node, int axis, int layer) {
    const std::size_t edge_kind = axis == 2 ? 4 : std::size_t(2 * axis + (start_node[2] - layer));
    return edge_points_[edge_kind][node(start_node[0], start_node[1])];
  }
  void next_layer() {
    std::swap(edge_points_[0], edge_points_[1]);
    std::swap(edge_points_[2], edge_points_[3]);
    for (const std::size_t edge_kind : {1, 3, 4})
      std::ranges::fill(edge_points_[edge_kind], not_computed);
  }
  /// Records a point for a cell; a point is shared by the four cells around its edge.
  void record_point(const Node& start_node, int axis, int layer, const Crossing& skin_crossing,
                    const Vector3d& point) {
    int& number = edge_point(start_node, axis, layer);
    if (number == not_computed) {
      number = skin_crossing.is_end ? int(points_.size()) : no_point;
      if (skin_crossing.is_end) {
        points_.push_back(point);
        point_lines_.push_back(skin_crossing.program_line);
      }
    }
    if (number != no_point) point_indices_.push_back(number);
  }

  /// Returns the vertices of the cells between layers k and k + 1.
  std::vector<int> make_vertices(int k) {
    std::vector<int> cells(cell_count(), -1);
    for (int j = 0; j + 1 < ny_; ++j) {
      const char *low = &below_[node(0, j)], *low_next = &below_[node(0, j + 1)];
      const char *high = &above_[node(0, j)], *high_next = &above_[node(0, j + 1)];
      for (int i = 0; i + 1 < nx_; ++i) {
        const int inside = low[i] + low[i + 1] + low_next[i] + low_next[i + 1] + high[i] +
                           high[i + 1] + high_next[i] + high_next[i + 1];
        if (inside == 0 || inside == 8) continue;
        const auto is_inside = [&](int corner) {
          const auto& layer = (corner & 4) != 0 ? above_ : below_;
          return layer[node(i + (corner & 1), j + (corner >> 1 & 1))] != 0;
        };
        cells[cell(i, j)] = int(vertex_positions_.size());
        add_vertex({i, j, k}, is_inside);
        // There are about twice as many triangles, whose number must also fit in int.
        if (vertex_positions_.size() > std::size_t(std::numeric_limits<int>::max()) / 4)
          throw std::length_error("stock mesh: more than 500 million vertices");
      }
    }
    return cells;
  }

  template <typename Inside>
  void add_vertex(const Node& cell_node, const Inside& is_inside) {
    Vector3d sum = Vector3d::Zero();
    std::array<std::int32_t, 12> lines{};
    int count = 0;
    if (keeps_points_) first_.push_back(int(point_indices_.size()));
    for (int axis = 0; axis < 3; ++axis)
      for (int corner = 0; corner < 8; ++corner) {
        const int end = corner | 1 << axis;
        if (end == corner || is_inside(corner) == is_inside(end)) continue;
        const Node start_node{cell_node[0] + (corner & 1), cell_node[1] + (corner >> 1 & 1),
                              cell_node[2] + (corner >> 2)};
        const Crossing skin_crossing = crossing(start_node, axis, is_inside(end));
        Vector3d point = stock_.spacing * Vector3d(start_node[0], start_node[1], start_node[2]);
        point[axis] = skin_crossing.position;
        sum += point;
        if (keeps_points_) record_point(start_node, axis, cell_node[2], skin_crossing, point);
        lines[std::size_t(count++)] = skin_crossing.program_line;
      }
    vertex_positions_.push_back(sum / count);
    lines_.push_back(most_frequent(lines, count));
  }

  /// Returns the most frequent line; of equally frequent lines the one that cut last.
  static std::int32_t most_frequent(const std::array<std::int32_t, 12>& lines, int count) {
    std::int32_t best = 0;
    long max_count = 0;
    for (int i = 0; i < count; ++i) {
      const std::int32_t line = lines[std::size_t(i)];
      const long frequency = std::count(lines.begin(), lines.begin() + count, line);
      if (frequency > max_count || (frequency == max_count && std::abs(line) > std::abs(best))) {
        max_count = frequency;
        best = line;
      }
    }
    return best;
  }

  /// Adds the quadrilaterals around the edges between the two layers of nodes.
  void add_vertical_edge_quads(const std::vector<int>& cells) {
    for (int j = 1; j + 1 < ny_; ++j)
      for (int i = 1; i + 1 < nx_; ++i) {
        const bool low = below_[node(i, j)] != 0, high = above_[node(i, j)] != 0;
        if (low == high) continue;
        add_quad({cells[cell(i - 1, j - 1)], cells[cell(i, j - 1)], cells[cell(i, j)],
                  cells[cell(i - 1, j)]},
                 low);
      }
  }

  /// Adds the quadrilaterals around the edges in a layer of nodes, between two layers of cells.
  void add_horizontal_edge_quads(const std::vector<int>& lower, const std::vector<int>& upper) {
    for (int j = 1; j + 1 < ny_; ++j)
      for (int i = 1; i + 1 < nx_; ++i) {
        const bool is_material = below_[node(i, j)] != 0;
        if (is_material != (below_[node(i + 1, j)] != 0))
          add_quad(
              {lower[cell(i, j - 1)], lower[cell(i, j)], upper[cell(i, j)], upper[cell(i, j - 1)]},
              is_material);
        if (is_material != (below_[node(i, j + 1)] != 0))
          add_quad(
              {lower[cell(i - 1, j)], upper[cell(i - 1, j)], upper[cell(i, j)], lower[cell(i, j)]},
              is_material);
        // The edges between these nodes and the border nodes, which are outside.
        if (i == 1 && is_material)
          add_quad(
              {lower[cell(0, j - 1)], lower[cell(0, j)], upper[cell(0, j)], upper[cell(0, j - 1)]},
              false);
        if (j == 1 && is_material)
          add_quad(
              {lower[cell(i - 1, 0)], upper[cell(i - 1, 0)], upper[cell(i, 0)], lower[cell(i, 0)]},
              false);
      }
  }

  /// Adds two triangles, split along the shorter diagonal, which is closer to a curved skin.
  void add_quad(std::array<int, 4> v, bool faces_up) {
    if (!faces_up) std::reverse(v.begin(), v.end());
    const auto corner = [&](int i) -> const Vector3d& {
      return vertex_positions_[std::size_t(v[std::size_t(i)])];
    };
    if ((corner(2) - corner(0)).squaredNorm() <= (corner(3) - corner(1)).squaredNorm()) {
      triangles_.push_back({v[0], v[1], v[2]});
      triangles_.push_back({v[0], v[2], v[3]});
    } else {
      triangles_.push_back({v[1], v[2], v[3]});
      triangles_.push_back({v[1], v[3], v[0]});
    }
  }

  Points in_workpiece(const std::vector<Vector3d>& positions) const {
    Points result(Eigen::Index(positions.size()), 3);
    for (std::size_t i = 0; i < positions.size(); ++i)
      result.row(Eigen::Index(i)) = stock_.T_wk * Vector3d(stock_.origin_k + positions[i]);
    return result;
  }

  StockMesh make_mesh() {
    return {in_workpiece(vertex_positions_), triangle_matrix(triangles_), std::move(lines_)};
  }

  const Stock& stock_;
  int nx_, ny_, nz_;
  std::vector<char> below_, above_;         // 1: in material, for two layers of nodes
  std::vector<Vector3d> vertex_positions_;  // mm from the grid's origin
  std::vector<std::int32_t> lines_;
  std::vector<std::array<int, 3>> triangles_;

  bool keeps_points_;
  std::vector<std::vector<int>>
      edge_points_;               // indices of the points on the edges of a layer of cells
  std::vector<Vector3d> points_;  // mm from the grid's origin
  std::vector<std::int32_t> point_lines_;
  std::vector<int> first_, point_indices_;
};

}  // namespace

StockMesh stock_mesh(const Stock& stock) {
  if (stock.fields.empty()) return {};
  return SkinMesher(stock).mesh();
}

StockSkin stock_skin(const Stock& stock) {
  if (stock.fields.empty()) {
    StockSkin none;
    none.first = {0};
    none.spacing = stock.spacing;
    return none;
  }
  return SkinMesher(stock, true).skin();
}

namespace {

// mm; the polyline of a profile deviates from it by at most this.
constexpr double polyline_tolerance = 1e-3;

double position(const TurnedStock& stock, Eigen::Index node) {
  return stock.first + stock.spacing * double(node);
}

/// Returns the nodes of a polyline within `polyline_tolerance` of the profile, ends included.
/// A single pass suffices: the slopes that keep all nodes since the last vertex within
/// `polyline_tolerance` form an interval, which narrows from node to node.
std::vector<Eigen::Index> thinned_nodes(const TurnedStock& stock) {
  std::vector<Eigen::Index> nodes{0};
  const Eigen::Index n = stock.radius.size();
  double min_slope = -INFINITY, max_slope = INFINITY;
  for (Eigen::Index i = 1; i < n; ++i) {
    const double start_radius = stock.radius[nodes.back()];
    const double node_distance = double(i - nodes.back());
    const double slope = (stock.radius[i] - start_radius) / node_distance;
    // 1: cut by the program, 0: never cut, -1: cut in a crash.
    const auto surface_kind = [&](Eigen::Index k) {
      return std::clamp(stock.line[std::size_t(k)], -1, 1);
    };
    if (slope < min_slope || slope > max_slope || surface_kind(i) != surface_kind(i - 1)) {
      if (nodes.back() != i - 1) nodes.push_back(i - 1);
      min_slope = stock.radius[i] - stock.radius[i - 1] - polyline_tolerance;
      max_slope = stock.radius[i] - stock.radius[i - 1] + polyline_tolerance;
      continue;
    }
    min_slope = std::max(min_slope, slope - polyline_tolerance / node_distance);
    max_slope = std::min(max_slope, slope + polyline_tolerance / node_distance);
  }
  if (nodes.back() != n - 1) nodes.push_back(n - 1);
  return nodes;
}

/// Returns the nodes of `thinned_nodes` and about `max_rings` more at equal distances.
std::vector<Eigen::Index> dense_rings(const TurnedStock& stock, Eigen::Index max_rings) {
  std::vector<Eigen::Index> nodes = thinned_nodes(stock);
  const Eigen::Index stride = std::max<Eigen::Index>(1, stock.radius.size() / max_rings);
  for (Eigen::Index i = 0; i < stock.radius.size(); i += stride) nodes.push_back(i);
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

/// Returns the frame of the spindle line; its z is the axis.
Eigen::Isometry3d axis_frame(const TurnedStock& stock) {
  const Eigen::Vector3d across = stock.direction_w.unitOrthogonal();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << across, stock.direction_w.cross(across), stock.direction_w;
  T.translation() = stock.point_w;
  return T;
}

/// Returns the mesh of rings at the nodes, closed by centre vertices at the two ends.
StockMesh ring_mesh(const TurnedStock& stock, const std::vector<Eigen::Index>& nodes,
                    int vertices_per_ring) {
  StockMesh mesh;
  const Eigen::Isometry3d axis = axis_frame(stock);
  const Eigen::Vector3d first_axis = axis.linear().col(0), second_axis = axis.linear().col(1);
  const int ring_count = int(nodes.size());
  mesh.vertices_w.resize(ring_count * vertices_per_ring + 2, 3);
  mesh.triangles.resize(2 * (ring_count - 1) * vertices_per_ring + 2 * vertices_per_ring, 3);
  const int first_centre = ring_count * vertices_per_ring, last_centre = first_centre + 1;
  int row = 0;
  for (int i = 0; i < ring_count; ++i)
    for (int k = 0; k < vertices_per_ring; ++k) {
      const double angle = 2 * std::numbers::pi * k / vertices_per_ring;
      const double r = stock.radius[nodes[std::size_t(i)]];
      mesh.vertices_w.row(i * vertices_per_ring + k) =
          (stock.point_w + position(stock, nodes[std::size_t(i)]) * stock.direction_w +
           r * (std::cos(angle) * first_axis + std::sin(angle) * second_axis))
              .transpose();
      const int a = i * vertices_per_ring + k,
                b = i * vertices_per_ring + (k + 1) % vertices_per_ring;
      if (i + 1 < ring_count) {
        mesh.triangles.row(row++) << a, b, b + vertices_per_ring;
        mesh.triangles.row(row++) << a, b + vertices_per_ring, a + vertices_per_ring;
      }
    }
  mesh.vertices_w.row(first_centre) =
      (stock.point_w + position(stock, nodes.front()) * stock.direction_w).transpose();
  mesh.vertices_w.row(last_centre) =
      (stock.point_w + position(stock, nodes.back()) * stock.direction_w).transpose();
  for (int k = 0; k < vertices_per_ring; ++k) {
    const int next = (k + 1) % vertices_per_ring, top = (ring_count - 1) * vertices_per_ring;
    mesh.triangles.row(row++) << first_centre, next, k;
    mesh.triangles.row(row++) << last_centre, top + k, top + next;
  }
  for (const Eigen::Index node : nodes)
    mesh.line.insert(mesh.line.end(), std::size_t(vertices_per_ring),
                     stock.line[std::size_t(node)]);
  mesh.line.push_back(stock.line[std::size_t(nodes.front())]);
  mesh.line.push_back(stock.line[std::size_t(nodes.back())]);
  return mesh;
}

}  // namespace

StockMesh stock_mesh(const TurnedStock& stock, int vertices_per_ring) {
  if (vertices_per_ring < 3)
    throw std::invalid_argument("expected at least 3 vertices on a circle");
  return stock.radius.size() < 2 ? StockMesh{}
                                 : ring_mesh(stock, thinned_nodes(stock), vertices_per_ring);
}

StockSkin stock_skin(const TurnedStock& stock, int vertices_per_ring) {
  if (vertices_per_ring < 3)
    throw std::invalid_argument("expected at least 3 vertices on a circle");
  constexpr Eigen::Index max_rings = 2000;
  StockSkin skin;
  skin.spacing = stock.spacing;
  skin.lattice = StockSkin::Lattice::Profile;
  skin.T_wk = axis_frame(stock);
  if (stock.radius.size() >= 2)
    skin.mesh = ring_mesh(stock, dense_rings(stock, max_rings), vertices_per_ring);
  skin.points_w = skin.mesh.vertices_w;
  skin.line = skin.mesh.line;
  skin.first.resize(skin.line.size() + 1);
  std::iota(skin.first.begin(), skin.first.end(), 0);
  skin.point_indices.assign(skin.first.begin(), skin.first.end() - 1);
  return skin;
}

}  // namespace abbe::cutting
