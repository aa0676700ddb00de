#include "cutting/stock/force.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::cutting {

namespace {

using Eigen::Vector3d;

constexpr double min_chip_fraction = 1e-12;   // of the feed; a thinner chip is rounding
constexpr double max_upright_extent = 1e-12;  // rad; an edge with less is upright

void expect(bool holds, const char* expected, double value) {
  if (!holds) throw std::invalid_argument(fmt::format("expected {}, seen {}", expected, value));
}

// The chip thickness around a slice.

/// The function mean + cos cos(phi) + sin sin(phi).
struct Harmonic {
  double mean = 0.0, cos = 0.0, sin = 0.0;
  double at(double phi) const { return mean + cos * std::cos(phi) + sin * std::sin(phi); }
  Harmonic operator-(const Harmonic& o) const { return {mean - o.mean, cos - o.cos, sin - o.sin}; }
};

/// Returns the displacement of a slice along its outward normal by a feed, mm.
Harmonic feed_harmonic(const EdgeSlice& slice, const Vector3d& feed_t, double feed) {
  const double lateral = feed * std::sin(slice.kappa);
  return {-feed * std::cos(slice.kappa) * feed_t.z(), lateral * feed_t.x(), lateral * feed_t.y()};
}

struct ChipArc {
  double from = 0.0, to = 0.0;  ///< rad
  Harmonic chip;
};

/// Appends the angles between `from` and `to` at which h is zero.
void add_zeros(const Harmonic& h, double from, double to, std::vector<double>& zeros) {
  const double amplitude = std::hypot(h.cos, h.sin);
  if (!(amplitude > std::abs(h.mean))) return;
  const double centre = std::atan2(h.sin, h.cos);
  const double half_width = std::acos(-h.mean / amplitude);
  for (const double zero : {centre - half_width, centre + half_width}) {
    double phi = zero + units::full_turn * std::ceil((from - zero) / units::full_turn);
    for (; phi < to; phi += units::full_turn) zeros.push_back(phi);
  }
}

/// Returns the arcs on which the minimum of the thicknesses is positive, with that thickness.
/// Between zeros and intersections of the thicknesses the minimum is always the same one.
std::vector<ChipArc> chip_arcs(const std::vector<Harmonic>& thicknesses, double from, double to,
                               double feed) {
  std::vector<double> angles{from};
  for (std::size_t m = 0; m < thicknesses.size(); ++m) {
    add_zeros(thicknesses[m], from, to, angles);
    for (std::size_t n = 0; n < m; ++n)
      add_zeros(thicknesses[m] - thicknesses[n], from, to, angles);
  }
  angles.push_back(to);
  std::sort(angles.begin(), angles.end());
  std::vector<ChipArc> result;
  for (std::size_t i = 0; i + 1 < angles.size(); ++i) {
    const double middle = 0.5 * (angles[i] + angles[i + 1]);
    const Harmonic minimum = *std::min_element(
        thicknesses.begin(), thicknesses.end(),
        [&](const Harmonic& a, const Harmonic& b) { return a.at(middle) < b.at(middle); });
    if (minimum.at(middle) > min_chip_fraction * feed)
      result.push_back({angles[i], angles[i + 1], minimum});
  }
  return result;
}

// The forces of an arc.

/// Means of 1, cos, sin along an edge, and of their products with the chip thickness.
struct EdgeMeans {
  Vector3d edge;
  Vector3d chip;  ///< mm
};

/// Returns the means for a chip h from those of 1, and of cos, sin, cos 2 phi, sin 2 phi.
EdgeMeans edge_means(const Harmonic& h, double mean_one, const Eigen::Vector4d& harmonic_means) {
  const double c = harmonic_means[0], s = harmonic_means[1], c2 = harmonic_means[2],
               s2 = harmonic_means[3];
  return {{mean_one, c, s},
          {h.mean * mean_one + h.cos * c + h.sin * s,
           h.mean * c + 0.5 * (h.cos * (mean_one + c2) + h.sin * s2),
           h.mean * s + 0.5 * (h.cos * s2 + h.sin * (mean_one - c2))}};
}

/// Returns the means over an arc. Uses its centre and half width, so that a narrow arc loses no
/// digits.
EdgeMeans edge_means(const ChipArc& arc) {
  const double centre = 0.5 * (arc.from + arc.to);
  const double half_width = 0.5 * (arc.to - arc.from);
  const double sinc = half_width > 0.0 ? std::sin(half_width) / half_width : 1.0;
  const double sinc_double =
      half_width > 0.0 ? std::sin(2.0 * half_width) / (2.0 * half_width) : 1.0;
  return edge_means(arc.chip, 1.0,
                    {sinc * std::cos(centre), sinc * std::sin(centre),
                     sinc_double * std::cos(2.0 * centre), sinc_double * std::sin(2.0 * centre)});
}

/// Returns (sin x - x cos x) / x^2; by its series for |x| < 0.1, where the closed form cancels.
double sine_moment(double x) {
  if (std::abs(x) < 0.1) {
    const double squared_x = x * x;
    return x *
           (1.0 / 3.0 - squared_x * (1.0 / 30.0 - squared_x * (1.0 / 840.0 - squared_x / 45360.0)));
  }
  return (std::sin(x) - x * std::cos(x)) / (x * x);
}

/// Returns the same means of the functions times the angle from the centre of the arc.
EdgeMeans edge_moments(const ChipArc& arc) {
  const double centre = 0.5 * (arc.from + arc.to);
  const double half_width = 0.5 * (arc.to - arc.from);
  const double moment = half_width * sine_moment(half_width),
               moment_double = half_width * sine_moment(2.0 * half_width);
  return edge_means(
      arc.chip, 0.0,
      {-moment * std::sin(centre), moment * std::cos(centre),
       -moment_double * std::sin(2.0 * centre), moment_double * std::cos(2.0 * centre)});
}

/// Transforms a vector from (radial, around) to frame t; each component is given by its mean, cos
/// and sin parts.
Vector3d to_frame_t(const Vector3d& radial, const Vector3d& around, double axial) {
  return {radial[1] - around[2], radial[2] + around[1], axial};
}

/// The part of an edge that cuts on one slice.
struct CuttingEdge {
  ChipArc arc;
  double length = 0.0;  ///< mm
  double height = 0.0;  ///< mm above the tip, at the middle of the arc
  double rise = 0.0;    ///< mm of height per rad
};

class LoadSum {
 public:
  LoadSum(const CuttingCoefficients& K, bool clockwise)
      : K_(K), rotation_sign_(clockwise ? 1.0 : -1.0) {}

  void add(const EdgeSlice& slice, const CuttingEdge& cutting_edge) {
    const Forces F = forces(slice, cutting_edge.length, edge_means(cutting_edge.arc));
    const double r = slice.radius, z = cutting_edge.height;
    load_.tool_wrench_t.head<3>() += to_frame_t(F.radial, F.around, F.axial[0]);
    load_.tool_wrench_t.tail<3>() +=
        to_frame_t(-z * F.around, z * F.radial - r * F.axial, r * F.around[0]);
    load_.torque += rotation_sign_ * r * F.around[0];
    load_.chip_volume += units::full_turn * r * F.chip;
    load_.contact_t += Vector3d(r * F.weights[1], r * F.weights[2], z * F.weights[0]);
    weight_sum_ += F.weights[0];
    if (cutting_edge.rise == 0.0) return;
    const Forces moment =
        forces(slice, cutting_edge.rise * cutting_edge.length, edge_moments(cutting_edge.arc));
    load_.tool_wrench_t.tail<3>() += to_frame_t(-moment.around, moment.radial, 0.0);
    load_.contact_t.z() += moment.weights[0];
  }

  CuttingLoad load() {
    if (weight_sum_ > 0.0) load_.contact_t /= weight_sum_;
    return load_;
  }

 private:
  // The force components as functions of the angle.
  struct Forces {
    Vector3d radial, around, axial, weights;  ///< N: mean, cos and sin parts
    double chip = 0.0;                        ///< mm^2
  };

  Forces forces(const EdgeSlice& slice, double length, const EdgeMeans& means) const {
    const Vector3d edge = length * means.edge, chip = length * means.chip;
    const double sine = std::sin(slice.kappa), cosine = std::cos(slice.kappa);
    const Vector3d tangential = K_.K_tc * chip + K_.K_te * edge;
    const Vector3d normal = K_.K_rc * chip + K_.K_re * edge;
    const Vector3d upward = K_.K_ac * chip + K_.K_ae * edge;
    return {cosine * upward - sine * normal, rotation_sign_ * tangential,
            cosine * normal + sine * upward,
            (K_.K_tc + K_.K_rc + std::abs(K_.K_ac)) * chip +
                (K_.K_te + K_.K_re + std::abs(K_.K_ae)) * edge,
            chip[0]};
  }

  const CuttingCoefficients& K_;
  double rotation_sign_;  // +1: the force around is counter-clockwise, against a clockwise spindle
  double weight_sum_ = 0.0;
  CuttingLoad load_;
};

void check_milling(const CuttingCoefficients& coefficients, const Flutes& flutes, double feed) {
  validate(coefficients);
  validate(flutes);
  expect(std::isfinite(feed) && feed >= 0.0, "a feed per tooth of at least 0 mm", feed);
}

const EdgeSlice& engaged_slice(const Engagement& engagement, const EngagedArc& arc) {
  assert(arc.slice >= 0 && std::size_t(arc.slice) < engagement.slices.size());
  return engagement.slices[std::size_t(arc.slice)];
}

// The load at a spindle angle.

/// The edge of one flute on one slice.
struct FluteEdge {
  double middle = 0.0;       ///< rad about z
  double half_extent = 0.0;  ///< rad, from the middle to the upper end
  double half_height = 0.0;  ///< mm
  bool is_upright() const { return std::abs(half_extent) < max_upright_extent; }
};

/// Returns the chip thicknesses of a tooth on a slice, one relative to each of the preceding teeth.
std::vector<Harmonic> thicknesses(const EdgeSlice& slice, const Vector3d& feed_t, double feed,
                                  const Flutes& flutes, double spindle_angle) {
  const Harmonic feed_term = feed_harmonic(slice, feed_t, feed);
  if (flutes.run_out == 0.0) return {feed_term};
  // The tooth and its predecessors pass the same position at different spindle angles, so the
  // radius of each is a harmonic of that position.
  const double run_out = flutes.run_out * std::sin(slice.kappa);
  const double angle = spindle_angle + flutes.run_out_angle;
  std::vector<Harmonic> result;
  for (int m = 1; m <= flutes.count; ++m) {
    const double previous_angle =
        angle + (flutes.clockwise ? units::full_turn : -units::full_turn) * m / flutes.count;
    const bool is_same_tooth = m == flutes.count;
    result.push_back(
        {m * feed_term.mean,
         m * feed_term.cos +
             (is_same_tooth ? 0.0 : run_out * (std::cos(angle) - std::cos(previous_angle))),
         m * feed_term.sin +
             (is_same_tooth ? 0.0 : run_out * (std::sin(angle) - std::sin(previous_angle)))});
  }
  return result;
}

void add_edge(const FluteEdge& edge, const EdgeSlice& slice, const EngagedArc& arc,
              const std::vector<Harmonic>& thicknesses, double feed, LoadSum& sum) {
  const double low = edge.middle - std::abs(edge.half_extent);
  const double high = edge.middle + std::abs(edge.half_extent);
  const bool upright = edge.is_upright();
  const double rise = upright ? 0.0 : edge.half_height / edge.half_extent;
  double shift = units::full_turn * std::ceil((low - arc.to) / units::full_turn);
  for (; arc.from + shift <= high; shift += units::full_turn) {
    const double from = std::max(low, arc.from + shift), to = std::min(high, arc.to + shift);
    if (upright ? !(edge.middle < arc.to + shift) : !(from < to)) continue;
    for (const ChipArc& chip_arc : chip_arcs(thicknesses, from, upright ? from : to, feed)) {
      const double offset = 0.5 * (chip_arc.from + chip_arc.to) - edge.middle;
      const double fraction = upright ? 1.0 : (chip_arc.to - chip_arc.from) / (high - low);
      sum.add(slice, {chip_arc, slice.length * fraction, slice.height + rise * offset, rise});
    }
  }
}

}  // namespace

void validate(const CuttingCoefficients& K) {
  const auto check_number = [](const char* name, double value, bool may_be_negative) {
    if (std::isfinite(value) && (may_be_negative || value >= 0.0)) return;
    throw std::invalid_argument(fmt::format("{}: expected a finite number{}, seen {}", name,
                                            may_be_negative ? "" : " of at least 0", value));
  };
  check_number("K_tc", K.K_tc, false);
  check_number("K_rc", K.K_rc, false);
  check_number("K_ac", K.K_ac, true);
  check_number("K_te", K.K_te, false);
  check_number("K_re", K.K_re, false);
  check_number("K_ae", K.K_ae, true);
}

void validate(const Flutes& flutes) {
  expect(flutes.count >= 1 && flutes.count <= 100, "1 to 100 flutes", flutes.count);
  expect(std::abs(flutes.helix) < 0.5 * pi, "a helix angle (in rad) between -90 and 90 degrees",
         flutes.helix);
  expect(std::isfinite(flutes.run_out) && flutes.run_out >= 0.0, "a run-out of at least 0 mm",
         flutes.run_out);
  expect(std::isfinite(flutes.run_out_angle), "a finite run-out angle", flutes.run_out_angle);
}

CuttingLoad mean_force(const Engagement& engagement, const CuttingCoefficients& coefficients,
                       const Flutes& flutes, double feed_per_tooth) {
  check_milling(coefficients, flutes, feed_per_tooth);
  LoadSum sum(coefficients, flutes.clockwise);
  for (const EngagedArc& arc : engagement.arcs) {
    const EdgeSlice& slice = engaged_slice(engagement, arc);
    const Harmonic chip = feed_harmonic(slice, engagement.feed_t, feed_per_tooth);
    for (const ChipArc& chip_arc : chip_arcs({chip}, arc.from, arc.to, feed_per_tooth)) {
      // Mean number of teeth on the arc.
      const double teeth = flutes.count * (chip_arc.to - chip_arc.from) / units::full_turn;
      sum.add(slice, {chip_arc, teeth * slice.length, slice.height, 0.0});
    }
  }
  return sum.load();
}

CuttingLoad instantaneous_force(const Engagement& engagement,
                                const CuttingCoefficients& coefficients, const Flutes& flutes,
                                double feed_per_tooth, double spindle_angle) {
  check_milling(coefficients, flutes, feed_per_tooth);
  expect(std::isfinite(spindle_angle), "a finite spindle angle", spindle_angle);
  double radius = 0.0;
  for (const EdgeSlice& slice : engagement.slices) radius = std::max(radius, slice.radius);
  const double lag = radius > 0.0 ? std::tan(flutes.helix) / radius : 0.0;
  const double pitch = (flutes.clockwise ? units::full_turn : -units::full_turn) /
                       flutes.count;  // to the following tooth
  LoadSum sum(coefficients, flutes.clockwise);
  for (const EngagedArc& arc : engagement.arcs) {
    const EdgeSlice& slice = engaged_slice(engagement, arc);
    const std::vector<Harmonic> chip =
        thicknesses(slice, engagement.feed_t, feed_per_tooth, flutes, spindle_angle);
    const double half_height = 0.5 * slice.length * std::sin(slice.kappa);
    for (int flute = 0; flute < flutes.count; ++flute) {
      const FluteEdge edge{spindle_angle + flute * pitch + lag * slice.height, lag * half_height,
                           half_height};
      add_edge(edge, slice, arc, chip, feed_per_tooth, sum);
    }
  }
  return sum.load();
}

namespace {

/// A point of a turning tool's edge in frame t, mm, with its outward normal.
struct TurningEdge {
  Vector3d point, normal;
};
TurningEdge turning_edge(const Nose& nose, double psi) {
  if (nose.profile) {
    const EdgePoint edge = edge_point(*nose.profile, psi);
    return {{edge.at.x(), 0.0, edge.at.y()}, {edge.outward.x(), 0.0, edge.outward.y()}};
  }
  double radius = nose.radius, slope = 0.0;
  for (const NoseWave& wave : nose.waves) {
    radius += wave.amplitude * std::cos(wave.order * psi + wave.phase);
    slope -= wave.order * wave.amplitude * std::sin(wave.order * psi + wave.phase);
  }
  const Vector3d outward(std::cos(psi), 0.0, std::sin(psi));
  const Vector3d tangent(-std::sin(psi), 0.0, std::cos(psi));
  return {radius * outward, (radius * outward - slope * tangent).normalized()};
}

}  // namespace

CuttingLoad turning_force(const std::vector<EngagedEdge>& edges, const Nose& nose,
                          const CuttingCoefficients& K, double work_radius) {
  validate(K);
  expect(std::isfinite(work_radius) && work_radius >= 0.0, "a work radius of at least 0 mm",
         work_radius);
  CuttingLoad load;
  double weight_sum = 0.0;
  for (const EngagedEdge& edge : edges) {
    if (!(edge.chip > 0.0) || !(edge.length > 0.0)) continue;
    const auto [point, normal] = turning_edge(nose, edge.psi);
    const double tangential = (K.K_tc * edge.chip + K.K_te) * edge.length;
    const double radial = (K.K_rc * edge.chip + K.K_re) * edge.length;
    const Vector3d force = -tangential * Vector3d::UnitY() - radial * normal;
    load.tool_wrench_t.head<3>() += force;
    load.tool_wrench_t.tail<3>() += point.cross(force);
    load.torque += tangential * work_radius;
    load.chip_volume += units::full_turn * work_radius * edge.chip * edge.length;
    load.contact_t += (tangential + radial) * point;
    weight_sum += tangential + radial;
  }
  if (weight_sum > 0.0) load.contact_t /= weight_sum;
  return load;
}

}  // namespace abbe::cutting
