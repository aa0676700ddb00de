#include "cutting/turned_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "cutting/stock_skin.h"

namespace abbe::cutting {
namespace {

constexpr double flat = 1e-3;  // mm, a profile that bends by less is drawn straight

double along(const TurnedStock& stock, Eigen::Index node) {
  return stock.first + stock.spacing * double(node);
}

/// Nodes that a polyline within `flat` of the profile needs, the ends included.
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

/// Those and every so many others that there are about `most`.
std::vector<Eigen::Index> dense_rings(const TurnedStock& stock, Eigen::Index most) {
  std::vector<Eigen::Index> nodes = thinned(stock);
  const Eigen::Index every = std::max<Eigen::Index>(1, stock.radius.size() / most);
  for (Eigen::Index i = 0; i < stock.radius.size(); i += every) nodes.push_back(i);
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

/// Its z is the axis.
Eigen::Isometry3d axis_frame(const TurnedStock& stock) {
  const Eigen::Vector3d across = stock.direction_w.unitOrthogonal();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << across, stock.direction_w.cross(across), stock.direction_w;
  T.translation() = stock.point_w;
  return T;
}

/// Rings at these nodes, and the middles of the two ends.
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
  constexpr Eigen::Index most_rings = 2000;
  StockSkin skin;
  skin.spacing = stock.spacing;
  skin.lattice = StockSkin::Lattice::Profile;
  skin.T_wk = axis_frame(stock);
  if (stock.radius.size() >= 2) skin.mesh = rings_at(stock, dense_rings(stock, most_rings), around);
  skin.places_w = skin.mesh.vertices_w;
  skin.line = skin.mesh.line;
  skin.first.resize(skin.line.size() + 1);
  std::iota(skin.first.begin(), skin.first.end(), 0);
  skin.place.assign(skin.first.begin(), skin.first.end() - 1);
  return skin;
}

}  // namespace abbe::cutting
