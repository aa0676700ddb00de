#if ABBE_RENDER

#include "sim/report/collision_pictures.h"

#include <algorithm>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "sim/cut/bodies.h"

namespace abbe::sim {
namespace {

constexpr render::Colour red{0.82, 0.16, 0.12}, grey{0.78, 0.82, 0.88};

}  // namespace

const Collision* first_of(const Collisions& collisions) {
  const Collision* nearest = nullptr;
  for (const Collision& one : collisions.list) {
    if (one.contact) return &one;
    if (nearest == nullptr || one.distance < nearest->distance) nearest = &one;
  }
  return nearest;
}

render::MachinePicture collision_picture(const Job& job, const Collisions& collisions,
                                         const Collision& event) {
  const Job& part = parts_of(job)[event.part];
  const std::vector<kinematics::Pose> T =
      carrier_poses(part.truth.actual, event.state.q, deviations(part.truth, event.state).joints);
  render::MachinePicture picture;
  picture.title = fmt::format("{}: {} and {}", job.scene.title, event.a, event.b);
  for (const SolidBody& solid : bodies_of(part)) {
    const bool is_met = solid.name == event.a || solid.name == event.b;
    const kinematics::Pose& T_b = T[std::size_t(solid.frame)];
    if (solid.kind == SolidBody::Kind::Part) {
      const cutting::ClosedMesh& shape = event.stock ? *event.stock : solid.mesh;
      picture.part_vertices = cutting::moved(shape, T_b).vertices;
      picture.part_triangles = shape.triangles;
      if (event.stock) picture.part_name = "stock";
      if (is_met || event.stock) picture.part_colour = red;
      continue;
    }
    render::Body body;
    body.label = solid.name;
    body.T = T_b;
    body.shape = render::SolidShape{solid.mesh.vertices, solid.mesh.triangles};
    body.colour = is_met ? red : grey;
    body.opacity = is_met ? 1.0 : 0.35;
    body.close = is_met || solid.frame == Carriers{part.truth.actual.size()}.tool();
    picture.bodies.push_back(std::move(body));
  }
  const Eigen::Vector3d &w = event.place_w, &b = event.place_b;
  picture.caption = {
      fmt::format("{}, case {}; the two in red", event_text(event, collisions.more_files),
                  collisions.commands),
      fmt::format("at ({:.2f}, {:.2f}, {:.2f}) mm of the workpiece, ({:.2f}, {:.2f}, {:.2f}) mm of "
                  "the bed",
                  w.x(), w.y(), w.z(), b.x(), b.y(), b.z())};
  return picture;
}

render::Panel clearance_panel(const Collisions& collisions) {
  constexpr std::size_t most_pairs = 6;
  const auto n = Eigen::Index(collisions.blocks.size());
  std::map<int, std::size_t> blocks_of;
  for (const BlockClearance& one : collisions.blocks)
    if (one.pair >= 0) ++blocks_of[one.pair];
  std::vector<std::pair<int, std::size_t>> pairs(blocks_of.begin(), blocks_of.end());
  std::ranges::stable_sort(pairs, std::greater<>{}, [](const auto& one) { return one.second; });
  if (pairs.size() > most_pairs) pairs.resize(most_pairs);
  render::Panel panel;
  panel.x_label = "time / s";
  panel.y_label = "clearance / mm";
  for (const auto& [pair, count] : pairs) {
    const Clearance& named = collisions.clearances[std::size_t(pair)];
    // every block is a step from its beginning to its end
    render::Series series;
    series.name = named.a + " - " + named.b;
    series.x.resize(2 * n);
    series.y.resize(2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const BlockClearance& one = collisions.blocks[std::size_t(i)];
      series.x.segment<2>(2 * i) << one.place.time_s, one.end_s;
      series.y.segment<2>(2 * i).setConstant(
          one.pair == pair ? one.at_least : std::numeric_limits<double>::quiet_NaN());
    }
    panel.series.push_back(std::move(series));
  }
  if (blocks_of.size() > pairs.size())
    panel.note.push_back(fmt::format("and {} more pairs", blocks_of.size() - pairs.size()));
  return panel;
}

}  // namespace abbe::sim

#endif
