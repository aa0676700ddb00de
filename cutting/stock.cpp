#include "cutting/stock.h"

#include <algorithm>
#include <cmath>

#include "cutting/depth_probe.h"
#include "cutting/sum.h"
#include "kinematics/numbers.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

// In spacings. Beyond these a depth says no more than its side.
// A node of a cell that a plane cuts is at most 3 spacings from it along the steepest line.
constexpr float farthest_seen = 3.0F;  // of three directions
constexpr float off_edge = 1.0F;       // the same, of a node whose lines have no skin
constexpr double farthest_up = 4.0;    // of one direction
constexpr float nowhere = 1e6F;

const DexelLine& line_of(const DexelField& field, int first, int second) {
  return field.lines[std::size_t(first) + std::size_t(field.size[0]) * std::size_t(second)];
}

/// For the nodes of a cell, how far each is inside along its line, in spacings.
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
  T_ga_ = T_ka;  // a scaled rotation; nothing here takes it for a rigid one
  T_ga_.matrix().topRows<3>() /= stock.spacing;
}

double DepthProbe::depth(const Vector3d& point_a) {
  const Vector3d place = T_ga_.linear() * point_a + T_ga_.translation();
  int cell[3];
  for (int k = 0; k < 3; ++k) {
    const double last = stock_.nodes[std::size_t(k)] - 1;
    // not "outside if below": a NaN is outside, too
    if (!(place[k] >= 0.0 && place[k] <= last)) return -infinity;
    cell[k] = std::min(int(place[k]), int(last) - 1);
  }
  return stock_.spacing *
         (stock_.fields.size() == 1 ? along_one(place, cell) : along_three(place, cell));
}

/// Depths along the four lines around, as a point goes from one to the next.
double DepthProbe::along_one(const Vector3d& place, const int* cell) const {
  const double u = place.x() - cell[0], v = place.y() - cell[1];
  double depths[2][2];
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const double inside =
          line_of(stock_.fields[0], cell[0] + i, cell[1] + j).inside_by(place.z() * stock_.spacing);
      depths[j][i] = std::clamp(inside / stock_.spacing, -farthest_up, farthest_up);
    }
  return (1 - v) * ((1 - u) * depths[0][0] + u * depths[0][1]) +
         v * ((1 - u) * depths[1][0] + u * depths[1][1]);
}

/// The nearest skin along the three lines through each node around, interpolated between them. Of a
/// plane that is its distance over the largest part of its normal, at every node: so planes are met
/// exactly, whichever way they lie, and walls of a box up to a spacing from its edges.
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
    // a line that contradicts the other two touches a skin, and has no say; a node off an edge of
    // the body has no skin on its lines at all
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
  constexpr std::uint64_t golden = 0x9E3779B97F4A7C15;  // neighbours fall apart
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

}  // namespace abbe::cutting
