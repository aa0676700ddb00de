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

/// The position of the skin between two nodes, and the program line that made it there.
struct Crossing {
  double at = 0.0;  ///< mm along the edge's axis from the grid's origin
  std::int32_t line = 0;
  bool is_end = false;  ///< of a run of material; else the skin was interpolated between lines
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

/// Returns the program line of the nearest end, which is assumed for the skin at a position.
std::int32_t nearest_line(const DexelLine& line, double at) {
  double nearest = std::numeric_limits<double>::infinity();
  std::int32_t found = 0;
  const auto look = [&](double end, std::int32_t by) {
    if (std::abs(end - at) >= nearest) return;
    nearest = std::abs(end - at);
    found = by;
  };
  for (const DexelRun& run : line.runs()) {
    look(run.low, run.low_line);
    look(run.high, run.high_line);
  }
  return found;
}

// Dual contouring of the dexels, layer by layer, so that only two layers of nodes are in memory.
class SkinMesher {
 public:
  explicit SkinMesher(const Stock& stock, bool keeps_places = false)
      : stock_(stock),
        nx_(stock.nodes[0]),
        ny_(stock.nodes[1]),
        nz_(stock.nodes[2]),
        keeps_places_(keeps_places) {}

  StockMesh mesh() {
    below_ = sides(0);
    if (keeps_places_) ends_.assign(5, std::vector<int>(below_.size(), unseen));
    std::vector<int> cells_below(cell_count(), -1);
    for (int k = 0; k + 1 < nz_; ++k) {
      above_ = sides(k + 1);
      const std::vector<int> cells = vertices(k);
      upright_quads(cells);
      if (k > 0) level_quads(cells_below, cells);
      cells_below = cells;
      std::swap(below_, above_);
      if (keeps_places_) next_layer();
    }
    return assembled();
  }

  StockSkin skin() {
    StockSkin result;
    result.mesh = mesh();
    result.places_w = in_workpiece(ends_at_);
    result.line = std::move(ends_line_);
    result.first = std::move(first_);
    result.first.push_back(int(uses_.size()));
    result.place = std::move(uses_);
    result.spacing = stock_.spacing;
    result.lattice = stock_.fields.size() == 1 ? StockSkin::Lattice::OneDirection
                                               : StockSkin::Lattice::ThreeDirections;
    result.T_wk = stock_.T_wk * Eigen::Translation3d(stock_.origin_k);
    return result;
  }

 private:
  static constexpr int unseen = -1, no_end = -2;  // of the edge of a cell, else index of its point

  std::size_t cell_count() const { return std::size_t(nx_ - 1) * std::size_t(ny_ - 1); }
  std::size_t node(int i, int j) const {
    return std::size_t(i) + std::size_t(nx_) * std::size_t(j);
  }
  std::size_t cell(int i, int j) const {
    return std::size_t(i) + std::size_t(nx_ - 1) * std::size_t(j);
  }

  /// Returns which nodes of a layer are in material, by the majority of the lines through each.
  std::vector<char> sides(int k) const {
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
            const int from = std::max(0, int(std::floor(run.low / h)) + 1);
            const int last = (field.along == 0 ? nx_ : ny_) - 1;
            const int to = std::min(last, int(std::ceil(run.high / h)) - 1);
            for (int n = from; n <= to; ++n) {
              char& vote = votes[field.along == 0 ? node(n, j) : node(i, n)];
              vote = char(vote + 1);
            }
          }
        }
    // One vote with a single direction, two with three.
    const char needed = stock_.fields.size() == 1 ? 1 : 2;
    for (char& vote : votes) vote = vote >= needed ? 1 : 0;
    return votes;
  }

  Crossing crossing(const Node& from, int axis, bool rises) const {
    const double h = stock_.spacing;
    const double start = from[std::size_t(axis)] * h;
    if (stock_.fields.size() == 1 && axis != 2) return slanted(from, axis);
    const DexelField& field = stock_.fields[stock_.fields.size() == 1 ? 0 : std::size_t(axis)];
    const DexelLine& line = line_through(field, from);
    const DexelRun* const run = run_containing(line, rises ? start + h : start);
    if (run == nullptr) return {start + 0.5 * h, nearest_line(line, start + 0.5 * h), false};
    const double end = rises ? run->low : run->high;
    const double at = std::clamp(end, start, start + h);
    return {at, rises ? run->low_line : run->high_line, at == end};
  }

  /// Returns a crossing between lines of one direction: the point at which the depth along them,
  /// interpolated from one to the next, is zero.
  Crossing slanted(const Node& from, int axis) const {
    const double h = stock_.spacing;
    Node to = from;
    ++to[std::size_t(axis)];
    const double z = from[2] * h;
    const DexelLine& a = line_through(stock_.fields[0], from);
    const DexelLine& b = line_through(stock_.fields[0], to);
    // Limited as in `depth`, so that mesh and depth have the same zero.
    const double da = std::clamp(a.signed_depth(z), -4 * h, 4 * h);
    const double db = std::clamp(b.signed_depth(z), -4 * h, 4 * h);
    const double part = da != db ? std::clamp(da / (da - db), 0.0, 1.0) : 0.5;
    const DexelLine& outside = da > 0.0 ? b : a;
    return {(from[std::size_t(axis)] + part) * h, nearest_line(outside, z), false};
  }

  /// Returns the point of an edge of cells, addressed by its lower node: along x in the lower and
  /// the upper layer of nodes, along y the same, along z.
  int& place_of_edge(const Node& from, int axis, int layer) {
    const std::size_t kind = axis == 2 ? 4 : std::size_t(2 * axis + (from[2] - layer));
    return ends_[kind][node(from[0], from[1])];
  }
  void next_layer() {
    std::swap(ends_[0], ends_[1]);
    std::swap(ends_[2], ends_[3]);
    for (const std::size_t kind : {1, 3, 4}) std::ranges::fill(ends_[kind], unseen);
  }
  /// Records a point for a cell; a point belongs to the four cells around its edge.
  void keep(const Node& from, int axis, int layer, const Crossing& found, const Vector3d& place) {
    int& number = place_of_edge(from, axis, layer);
    if (number == unseen) {
      number = found.is_end ? int(ends_at_.size()) : no_end;
      if (found.is_end) {
        ends_at_.push_back(place);
        ends_line_.push_back(found.line);
      }
    }
    if (number != no_end) uses_.push_back(number);
  }

  /// Returns the vertices of the cells between layers k and k + 1.
  std::vector<int> vertices(int k) {
    std::vector<int> cells(cell_count(), -1);
    for (int j = 0; j + 1 < ny_; ++j) {
      const char *low = &below_[node(0, j)], *low_next = &below_[node(0, j + 1)];
      const char *high = &above_[node(0, j)], *high_next = &above_[node(0, j + 1)];
      for (int i = 0; i + 1 < nx_; ++i) {
        const int inside = low[i] + low[i + 1] + low_next[i] + low_next[i + 1] + high[i] +
                           high[i + 1] + high_next[i] + high_next[i + 1];
        if (inside == 0 || inside == 8) continue;
        const auto in = [&](int corner) {
          const auto& layer = (corner & 4) != 0 ? above_ : below_;
          return layer[node(i + (corner & 1), j + (corner >> 1 & 1))] != 0;
        };
        cells[cell(i, j)] = int(places_.size());
        add_vertex({i, j, k}, in);
        // the triangles, about twice as many, need three corners each within int
        if (places_.size() > std::size_t(std::numeric_limits<int>::max()) / 4)
          throw std::length_error("stock mesh: more than 500 million vertices");
      }
    }
    return cells;
  }

  template <typename Inside>
  void add_vertex(const Node& at, const Inside& in) {
    Vector3d sum = Vector3d::Zero();
    std::array<std::int32_t, 12> lines{};
    int count = 0;
    if (keeps_places_) first_.push_back(int(uses_.size()));
    for (int axis = 0; axis < 3; ++axis)
      for (int corner = 0; corner < 8; ++corner) {
        const int end = corner | 1 << axis;
        if (end == corner || in(corner) == in(end)) continue;
        const Node from{at[0] + (corner & 1), at[1] + (corner >> 1 & 1), at[2] + (corner >> 2)};
        const Crossing found = crossing(from, axis, in(end));
        Vector3d place = stock_.spacing * Vector3d(from[0], from[1], from[2]);
        place[axis] = found.at;
        sum += place;
        if (keeps_places_) keep(from, axis, at[2], found, place);
        lines[std::size_t(count++)] = found.line;
      }
    places_.push_back(sum / count);
    lines_.push_back(max_frequent(lines, count));
  }

  /// Returns the most frequent line; of equally frequent ones the last that cut.
  static std::int32_t max_frequent(const std::array<std::int32_t, 12>& lines, int count) {
    std::int32_t best = 0;
    long most = 0;
    for (int i = 0; i < count; ++i) {
      const std::int32_t line = lines[std::size_t(i)];
      const long times = std::count(lines.begin(), lines.begin() + count, line);
      if (times > most || (times == most && std::abs(line) > std::abs(best))) {
        most = times;
        best = line;
      }
    }
    return best;
  }

  /// Adds the quadrilaterals around the edges between the two layers of nodes.
  void upright_quads(const std::vector<int>& cells) {
    for (int j = 1; j + 1 < ny_; ++j)
      for (int i = 1; i + 1 < nx_; ++i) {
        const bool low = below_[node(i, j)] != 0, high = above_[node(i, j)] != 0;
        if (low == high) continue;
        quad({cells[cell(i - 1, j - 1)], cells[cell(i, j - 1)], cells[cell(i, j)],
              cells[cell(i - 1, j)]},
             low);
      }
  }

  /// Adds the quadrilaterals around the edges in the layer of nodes below, between two layers of
  /// cells.
  void level_quads(const std::vector<int>& lower, const std::vector<int>& upper) {
    for (int j = 1; j + 1 < ny_; ++j)
      for (int i = 1; i + 1 < nx_; ++i) {
        const bool here = below_[node(i, j)] != 0;
        if (here != (below_[node(i + 1, j)] != 0))
          quad({lower[cell(i, j - 1)], lower[cell(i, j)], upper[cell(i, j)], upper[cell(i, j - 1)]},
               here);
        if (here != (below_[node(i, j + 1)] != 0))
          quad({lower[cell(i - 1, j)], upper[cell(i - 1, j)], upper[cell(i, j)], lower[cell(i, j)]},
               here);
        // The edges from the nodes of the border, which are outside, to these.
        if (i == 1 && here)
          quad({lower[cell(0, j - 1)], lower[cell(0, j)], upper[cell(0, j)], upper[cell(0, j - 1)]},
               false);
        if (j == 1 && here)
          quad({lower[cell(i - 1, 0)], upper[cell(i - 1, 0)], upper[cell(i, 0)], lower[cell(i, 0)]},
               false);
      }
  }

  /// Adds two triangles, split along the shorter diagonal, which follows curved skin more closely.
  void quad(std::array<int, 4> v, bool faces_up) {
    if (!faces_up) std::reverse(v.begin(), v.end());
    const auto place = [&](int i) -> const Vector3d& {
      return places_[std::size_t(v[std::size_t(i)])];
    };
    if ((place(2) - place(0)).squaredNorm() <= (place(3) - place(1)).squaredNorm()) {
      triangles_.push_back({v[0], v[1], v[2]});
      triangles_.push_back({v[0], v[2], v[3]});
    } else {
      triangles_.push_back({v[1], v[2], v[3]});
      triangles_.push_back({v[1], v[3], v[0]});
    }
  }

  Points in_workpiece(const std::vector<Vector3d>& places) const {
    Points result(Eigen::Index(places.size()), 3);
    for (std::size_t i = 0; i < places.size(); ++i)
      result.row(Eigen::Index(i)) = stock_.T_wk * Vector3d(stock_.origin_k + places[i]);
    return result;
  }

  StockMesh assembled() {
    StockMesh result;
    result.vertices_w = in_workpiece(places_);
    result.triangles.resize(Eigen::Index(triangles_.size()), 3);
    for (std::size_t t = 0; t < triangles_.size(); ++t)
      for (int k = 0; k < 3; ++k)
        result.triangles(Eigen::Index(t), k) = triangles_[t][std::size_t(k)];
    result.line = std::move(lines_);
    return result;
  }

  const Stock& stock_;
  int nx_, ny_, nz_;
  std::vector<char> below_, above_;  // inside or outside, for two layers of nodes
  std::vector<Vector3d> places_;     // mm from the grid's origin
  std::vector<std::int32_t> lines_;
  std::vector<std::array<int, 3>> triangles_;

  bool keeps_places_;
  std::vector<std::vector<int>> ends_;  // indices of the points on the edges of a layer of cells
  std::vector<Vector3d> ends_at_;       // mm from the grid's origin
  std::vector<std::int32_t> ends_line_;
  std::vector<int> first_, uses_;
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

constexpr double flat = 1e-3;  // mm; a profile that bends by less is drawn straight

double along(const TurnedStock& stock, Eigen::Index node) {
  return stock.first + stock.spacing * double(node);
}

/// Returns the nodes that a polyline within `flat` of the profile needs, the ends included. In one
/// pass: the slopes that keep all nodes since the last kept one within `flat` form an interval that
/// narrows.
std::vector<Eigen::Index> thinned(const TurnedStock& stock) {
  std::vector<Eigen::Index> kept{0};
  const Eigen::Index n = stock.radius.size();
  double steepest_from = -INFINITY, steepest_to = INFINITY;
  for (Eigen::Index i = 1; i < n; ++i) {
    const double from = stock.radius[kept.back()];
    const double run = double(i - kept.back());
    const double slope = (stock.radius[i] - from) / run;
    const auto kind = [&](Eigen::Index k) { return std::clamp(stock.line[std::size_t(k)], -1, 1); };
    if (slope < steepest_from || slope > steepest_to || kind(i) != kind(i - 1)) {
      if (kept.back() != i - 1) kept.push_back(i - 1);
      steepest_from = stock.radius[i] - stock.radius[i - 1] - flat;
      steepest_to = stock.radius[i] - stock.radius[i - 1] + flat;
      continue;
    }
    steepest_from = std::max(steepest_from, slope - flat / run);
    steepest_to = std::min(steepest_to, slope + flat / run);
  }
  if (kept.back() != n - 1) kept.push_back(n - 1);
  return kept;
}

/// Returns those nodes and further ones at equal distances, about `most` of them.
std::vector<Eigen::Index> dense_rings(const TurnedStock& stock, Eigen::Index most) {
  std::vector<Eigen::Index> nodes = thinned(stock);
  const Eigen::Index every = std::max<Eigen::Index>(1, stock.radius.size() / most);
  for (Eigen::Index i = 0; i < stock.radius.size(); i += every) nodes.push_back(i);
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

/// Returns the mesh of rings at these nodes, closed by the centres of the two ends.
StockMesh rings_at(const TurnedStock& stock, const std::vector<Eigen::Index>& nodes, int around) {
  StockMesh mesh;
  const Eigen::Isometry3d axis = axis_frame(stock);
  const Eigen::Vector3d across = axis.linear().col(0), third = axis.linear().col(1);
  const int rings = int(nodes.size());
  mesh.vertices_w.resize(rings * around + 2, 3);
  mesh.triangles.resize(2 * (rings - 1) * around + 2 * around, 3);
  const int first_centre = rings * around, last_centre = first_centre + 1;
  int row = 0;
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < around; ++k) {
      const double angle = 2 * std::numbers::pi * k / around;
      const double r = stock.radius[nodes[std::size_t(i)]];
      mesh.vertices_w.row(i * around + k) =
          (stock.point_w + along(stock, nodes[std::size_t(i)]) * stock.direction_w +
           r * (std::cos(angle) * across + std::sin(angle) * third))
              .transpose();
      const int a = i * around + k, b = i * around + (k + 1) % around;
      if (i + 1 < rings) {
        mesh.triangles.row(row++) << a, b, b + around;
        mesh.triangles.row(row++) << a, b + around, a + around;
      }
    }
  mesh.vertices_w.row(first_centre) =
      (stock.point_w + along(stock, nodes.front()) * stock.direction_w).transpose();
  mesh.vertices_w.row(last_centre) =
      (stock.point_w + along(stock, nodes.back()) * stock.direction_w).transpose();
  for (int k = 0; k < around; ++k) {
    const int next = (k + 1) % around, top = (rings - 1) * around;
    mesh.triangles.row(row++) << first_centre, next, k;
    mesh.triangles.row(row++) << last_centre, top + k, top + next;
  }
  for (const Eigen::Index node : nodes)
    mesh.line.insert(mesh.line.end(), std::size_t(around), stock.line[std::size_t(node)]);
  mesh.line.push_back(stock.line[std::size_t(nodes.front())]);
  mesh.line.push_back(stock.line[std::size_t(nodes.back())]);
  return mesh;
}

}  // namespace

StockMesh stock_mesh(const TurnedStock& stock, int around) {
  if (around < 3) throw std::invalid_argument("expected at least 3 vertices on a circle");
  return stock.radius.size() < 2 ? StockMesh{} : rings_at(stock, thinned(stock), around);
}

StockSkin stock_skin(const TurnedStock& stock, int around) {
  if (around < 3) throw std::invalid_argument("expected at least 3 vertices on a circle");
  constexpr Eigen::Index max_rings = 2000;
  StockSkin skin;
  skin.spacing = stock.spacing;
  skin.lattice = StockSkin::Lattice::Profile;
  skin.T_wk = axis_frame(stock);
  if (stock.radius.size() >= 2) skin.mesh = rings_at(stock, dense_rings(stock, max_rings), around);
  skin.places_w = skin.mesh.vertices_w;
  skin.line = skin.mesh.line;
  skin.first.resize(skin.line.size() + 1);
  std::iota(skin.first.begin(), skin.first.end(), 0);
  skin.place.assign(skin.first.begin(), skin.first.end() - 1);
  return skin;
}

}  // namespace abbe::cutting
