#include "cutting/subdivide.h"

#include <array>
#include <cmath>
#include <queue>
#include <tuple>

#include "cutting/triangle_mesh.h"
#include "kinematics/require.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;

/// An edge in the order in which edges are halved.
struct Long {
  double length;
  int edge;
  bool operator<(const Long& other) const {
    return std::tuple(length, -edge) < std::tuple(other.length, -other.edge);
  }
};

}  // namespace

Design subdivided(const Design& design, const OnSurface& on_surface,
                  const SubdivideOptions& options) {
  require(std::isfinite(options.spacing) && options.spacing > 0.0,
          "subdivided: the spacing must be positive");
  TriangleMesh mesh(design.triangles, design.vertices.rows());
  std::vector<Contact> places = places_of(design);
  std::vector<std::uint8_t> judged = design.judged;
  judged.resize(places.size(), 1);
  std::priority_queue<Long> queue;
  const auto add = [&](int edge) {
    const auto [a, b] = mesh.ends(edge);
    if (!judged[std::size_t(a)] || !judged[std::size_t(b)]) return;
    const double length = (places[std::size_t(a)].point - places[std::size_t(b)].point).norm();
    if (length > options.spacing) queue.push({length, edge});
  };
  for (int edge = 0; edge < mesh.edges(); ++edge) add(edge);
  for (; !queue.empty() && Index(places.size()) < options.points; queue.pop()) {
    const auto [length, edge] = queue.top();
    const auto [a, b] = mesh.ends(edge);
    const std::array<Contact, 2> halves = {places[std::size_t(a)], places[std::size_t(b)]};
    if (length != (halves[0].point - halves[1].point).norm()) continue;  // halved since
    places.push_back(on_surface(halves, std::array<double, 2>{0.5, 0.5}));
    judged.push_back(1);
    for (const auto made : mesh.split_edge(edge)) add(made);
  }
  return design_on(design, places, mesh.triangles(), std::move(judged));
}

}  // namespace abbe::cutting
