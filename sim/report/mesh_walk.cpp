#include "sim/report/mesh_walk.h"

#include <algorithm>
#include <utility>

#include "sim/report/range_coder.h"

namespace abbe::sim {
namespace {

using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// What lies beyond an edge of the border: nothing, a vertex not met before, that before or after
/// the edge on the border, or another one.
enum class Beyond : std::uint32_t { Nothing, New, Before, After, Other };

/// A vertex of the border and its edge to the next.
struct Edge {
  int vertex = 0, opposite = 0;
  int next = 0, previous = 0;
  bool is_open = true, waits = true;
};

class Walker {
 public:
  Walker(const Triangles& triangles, Eigen::Index vertices)
      : triangles_(triangles),
        first_(std::size_t(vertices) + 1, 0),
        around_(std::size_t(triangles.size())),
        number_(std::size_t(vertices), -1),
        is_done_(std::size_t(triangles.rows()), false) {
    for (const int v : triangles.reshaped()) ++first_[std::size_t(v) + 1];
    for (std::size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
    std::vector<int> at = first_;
    for (Eigen::Index t = 0; t < triangles.rows(); ++t)
      for (const int v : triangles.row(t)) around_[std::size_t(at[std::size_t(v)]++)] = int(t);
  }

  MeshWalk walked() && {
    for (Eigen::Index t = 0; t < triangles_.rows(); ++t) {
      if (is_done_[std::size_t(t)]) continue;
      start(t);
      for (std::size_t next = 0; next < waiting_.size(); ++next) conquer(waiting_[next]);
      waiting_.clear();
    }
    for (std::size_t v = 0; v < number_.size(); ++v)
      if (number_[v] < 0) meet(int(v), before());
    walk_.code = coder_.finished();
    return std::move(walk_);
  }

 private:
  std::array<int, 3> before() const {
    const int last = std::max(0, int(walk_.order.size()) - 1);
    return {last, last, last};
  }

  int meet(int old, const std::array<int, 3>& known) {
    walk_.order.push_back(old);
    walk_.known.push_back(known);
    at_.push_back(-1);
    triangles_at_.push_back(0);
    return number_[std::size_t(old)] = int(walk_.order.size()) - 1;
  }

  int add(const Edge& edge) {
    edges_.push_back(edge);
    waiting_.push_back(int(edges_.size()) - 1);
    return at_[std::size_t(edge.vertex)] = waiting_.back();
  }

  void link(int a, int b) {
    edges_[std::size_t(a)].next = b;
    edges_[std::size_t(b)].previous = a;
  }

  void wait(int i) {
    Edge& edge = edges_[std::size_t(i)];
    if (!edge.waits) waiting_.push_back(i);
    edge.waits = true;
  }

  void code_other(int vertex) {
    coder_.number(number_model_, 0, int(walk_.order.size()) - 1 - vertex);
  }

  void start(Eigen::Index t) {
    is_done_[std::size_t(t)] = true;
    std::array<int, 3> v;
    for (int k = 0; k < 3; ++k) {
      const int old = triangles_(t, k), known = number_[std::size_t(old)];
      coder_.bit(start_model_, known >= 0);
      if (known >= 0) code_other(known);
      v[std::size_t(k)] = known >= 0 ? known : meet(old, before());
    }
    const int a = add({v[0], v[2]}), b = add({v[1], v[0]}), c = add({v[2], v[1]});
    link(a, b), link(b, c), link(c, a);
    for (const int one : v) ++triangles_at_[std::size_t(one)];
  }

  /// The old number of what lies beyond the edge from `from` to `to`; -1: nothing.
  int beyond(int from, int to) {
    const int a = int(walk_.order[std::size_t(to)]), b = int(walk_.order[std::size_t(from)]);
    for (int k = first_[std::size_t(a)]; k < first_[std::size_t(a) + 1]; ++k) {
      const int t = around_[std::size_t(k)];
      if (is_done_[std::size_t(t)]) continue;
      for (int c = 0; c < 3; ++c)
        if (triangles_(t, c) == a && triangles_(t, (c + 1) % 3) == b) {
          is_done_[std::size_t(t)] = true;
          return triangles_(t, (c + 2) % 3);
        }
    }
    return -1;
  }

  void code(Beyond what, int from, int to) {
    const int many = 8;
    const auto at = [&](int v) { return std::min(many - 1, triangles_at_[std::size_t(v)]); };
    auto& model = models_[std::size_t((at(from) * many + at(to)) * 5) + std::size_t(last_)];
    coder_.tree(model.data(), std::uint32_t(what), 3);
    last_ = what;
  }

  void conquer(int i) {
    const Edge edge = edges_[std::size_t(i)];
    edges_[std::size_t(i)].waits = false;
    if (!edge.is_open) return;
    const int n = edge.next, p = edge.previous, s = edge.vertex, e = edges_[std::size_t(n)].vertex,
              old = beyond(s, e);
    const int after = edges_[std::size_t(n)].next;
    int w = old < 0 ? -1 : number_[std::size_t(old)];
    const Beyond what = old < 0                                  ? Beyond::Nothing
                        : w < 0                                  ? Beyond::New
                        : w == edges_[std::size_t(p)].vertex     ? Beyond::Before
                        : w == edges_[std::size_t(after)].vertex ? Beyond::After
                                                                 : Beyond::Other;
    code(what, s, e);
    if (what == Beyond::Nothing) return;
    if (what == Beyond::New) w = meet(old, {s, e, edge.opposite});
    if (what == Beyond::Other) code_other(w);
    for (const int v : {s, e, w}) ++triangles_at_[std::size_t(v)];
    if (what == Beyond::Before) return close(i, p, n, s);
    if (what == Beyond::After) return close(n, i, after, e);
    open(i, w);
  }

  /// The edges `kept` and `gone` became one, from `kept` to `next`, with the corner `opposite` it.
  void close(int gone, int kept, int next, int opposite) {
    edges_[std::size_t(gone)].is_open = false;
    edges_[std::size_t(kept)].opposite = opposite;
    link(kept, next);
    if (edges_[std::size_t(next)].next == kept)
      edges_[std::size_t(kept)].is_open = edges_[std::size_t(next)].is_open = false;
    else
      wait(kept);
  }

  /// Vertex w comes between the ends of edge i; the border is parted where it was on it already.
  void open(int i, int w) {
    const Edge edge = edges_[std::size_t(i)];
    const int n = edge.next, e = edges_[std::size_t(n)].vertex, there = at_[std::size_t(w)];
    edges_[std::size_t(i)].opposite = e;
    wait(i);
    const bool parts = there >= 0 && edges_[std::size_t(there)].is_open;
    const int before = parts ? edges_[std::size_t(there)].previous : i;
    const int k = add({w, edge.vertex});
    if (parts) link(i, there);
    link(before, k);
    link(k, n);
  }

  const Triangles& triangles_;
  std::vector<int> first_, around_;  ///< triangles at each vertex
  std::vector<int> number_;          ///< new one of each old vertex, -1: not met
  std::vector<bool> is_done_;
  std::vector<Edge> edges_;
  std::vector<int> waiting_;
  std::vector<int> at_, triangles_at_;  ///< (new numbers) the last edge from it; triangles so far
  MeshWalk walk_;
  RangeEncoder coder_;
  NumberModel number_model_;
  Chance start_model_;
  std::vector<std::array<Chance, 8>> models_ = std::vector<std::array<Chance, 8>>(8 * 8 * 5);
  Beyond last_ = Beyond::Nothing;
};

}  // namespace

MeshWalk mesh_walk(const Triangles& triangles, Eigen::Index vertices) {
  return Walker(triangles, vertices).walked();
}

}  // namespace abbe::sim
