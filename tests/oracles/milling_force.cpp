#include "tests/oracles/milling_force.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace abbe::oracles {
namespace {

constexpr double two_pi = 6.283185307179586;

double tooth_angle(const MillingCut& cut, int tooth, double phi, double z) {
  return phi - tooth * two_pi / cut.teeth - z * std::tan(cut.helix) / cut.radius;
}

/// How far tooth stands out from the spindle's line at height z.
double reach(const MillingCut& cut, int tooth, double z) {
  const double edge = tooth_angle(cut, tooth, 0.0, z);
  return cut.run_out * std::cos(edge - cut.run_out_angle);
}

/// Chip of a tooth where it stands at `at`: the wall in that direction is followed through ten
/// turns of all teeth.
double chip(const MillingCut& cut, int tooth, double at, double z, double sine) {
  double wall = -1e9, taken = 0.0;
  for (int pass = 0; pass < 10 * cut.teeth + tooth + 1; ++pass) {
    const double way = pass * cut.feed * std::sin(at) * sine;
    const double edge = way + reach(cut, pass % cut.teeth, z) * sine;
    taken = std::max(0.0, edge - wall);
    wall = std::max(wall, edge);
  }
  return taken;
}

}  // namespace

MillingForce milling_force_at(const MillingCut& cut, double phi) {
  MillingForce sum;
  const double depth = cut.top - cut.bottom;
  for (int disc = 0; disc < cut.discs; ++disc) {
    // thinner towards the tip of a ball, where its outline lies flat
    const double low = double(disc) / cut.discs, high = double(disc + 1) / cut.discs;
    const double dz = depth * (cut.ball ? high * high - low * low : high - low);
    const double middle = 0.5 * (low + high);
    const double z = cut.bottom + depth * (cut.ball ? middle * middle : middle);
    const bool round = cut.ball && z < cut.radius;
    const double local = round ? std::sqrt(z * (2 * cut.radius - z)) : cut.radius;
    const double sine = local / cut.radius;
    const double cosine = round ? (cut.radius - z) / cut.radius : 0.0;
    const double width = dz / sine;
    for (int tooth = 0; tooth < cut.teeth; ++tooth) {
      const double at = tooth_angle(cut, tooth, phi, z);
      const double immersion = at - two_pi * std::floor(at / two_pi);
      if (immersion < cut.entry || immersion > cut.exit) continue;
      const double h = chip(cut, tooth, at, z, sine);
      if (h <= 0.0) continue;
      const double F_t = (cut.K_tc * h + cut.K_te) * width;
      const double F_r = (cut.K_rc * h + cut.K_re) * width;
      const double F_a = (cut.K_ac * h + cut.K_ae) * width;
      const double s = std::sin(at), c = std::cos(at);
      const Eigen::Vector3d tangent(c, -s, 0), outward(s * sine, c * sine, -cosine);
      const Eigen::Vector3d up(s * cosine, c * cosine, sine);
      const Eigen::Vector3d force = -F_t * tangent - F_r * outward + F_a * up;
      sum.force += force;
      sum.moment += Eigen::Vector3d(local * s, local * c, z).cross(force);
      sum.chip_area += h * width;
    }
  }
  return sum;
}

MillingForce mean_milling_force(const MillingCut& cut, int angles) {
  MillingForce mean;
  for (int i = 0; i < angles; ++i) {
    const MillingForce one = milling_force_at(cut, (i + 0.5) * two_pi / angles);
    mean.force += one.force / angles;
    mean.moment += one.moment / angles;
    mean.chip_area += one.chip_area / angles;
  }
  return mean;
}

}  // namespace abbe::oracles
