#include "cutting/rival_shape.h"

#include <cmath>

#include <Eigen/Geometry>

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

constexpr double edge_turn = 0.5;  // change of slope over one step
constexpr double standing = 1e-3;  // share of the way that lies along the surface

struct Difference {
  double slope = 0.0;
  double bend = 0.0;  // 1/mm
};

Difference difference(const PassProbe& probe, const PassDistance& distance,
                      const Vector3d& direction) {
  const std::optional<double> before = distance(-probe.step * direction);
  const std::optional<double> after = distance(probe.step * direction);
  const double fall = before ? (probe.distance - *before) / probe.step : 0.0;
  const double rise = after ? (*after - probe.distance) / probe.step : 0.0;
  if (!before || !after) return {before ? fall : rise, 0.0};
  if (std::abs(rise - fall) > edge_turn)
    return {std::abs(rise) < std::abs(fall) ? rise : fall, 0.0};
  return {0.5 * (rise + fall), (rise - fall) / probe.step};
}

/// Unit vector of the tangent plane along the feed, if that has one.
std::optional<Vector3d> along_surface(const PassProbe& probe) {
  if (!probe.feed) return std::nullopt;
  const Vector3d along = *probe.feed - probe.feed->dot(probe.normal) * probe.normal;
  if (!(along.norm() > standing * probe.feed->norm())) return std::nullopt;
  return along.normalized();
}

}  // namespace

PassShape pass_shape(const PassProbe& probe, const PassDistance& distance) {
  const std::optional<Vector3d> along = along_surface(probe);
  const Vector3d e = along ? *along : probe.normal.unitOrthogonal();
  const Vector3d f = probe.normal.cross(e);
  const Difference on_e = difference(probe, distance, e);
  const Difference on_f = difference(probe, distance, f);
  PassShape shape{probe.normal - on_e.slope * e - on_f.slope * f, f, on_f.bend};
  // A straight feed draws the surface along itself, so it curves across it only.
  if (along) return shape;
  const Difference between = difference(probe, distance, (e + f) / std::sqrt(2.0));
  const double mixed = between.bend - 0.5 * (on_e.bend + on_f.bend);
  const double half = 0.5 * (on_e.bend - on_f.bend);
  const double mean = 0.5 * (on_e.bend + on_f.bend);
  const double angle = 0.5 * std::atan2(mixed, half);  // of the larger eigenvalue, from e
  const double spread = std::hypot(half, mixed);
  const bool upward = mean >= 0.0;
  shape.curvature = upward ? mean + spread : mean - spread;
  shape.across = upward ? Vector3d(std::cos(angle) * e + std::sin(angle) * f)
                        : Vector3d(std::cos(angle) * f - std::sin(angle) * e);
  return shape;
}

std::vector<Rival> in_order_of_vertices(const std::vector<std::vector<Rival>>& of_vertex) {
  std::size_t count = 0;
  for (const std::vector<Rival>& rivals : of_vertex) count += rivals.size();
  std::vector<Rival> all;
  all.reserve(count);
  for (std::size_t i = 0; i < of_vertex.size(); ++i) {
    for (Rival rival : of_vertex[i]) {
      rival.vertex = int(i);
      all.push_back(rival);
    }
  }
  return all;
}

}  // namespace abbe::cutting
