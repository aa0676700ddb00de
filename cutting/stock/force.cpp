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

constexpr double no_chip = 1e-12;    // of the feed; a surface along the feed has a chip of rounding
constexpr double no_extent = 1e-12;  // rad; below it an edge counts as upright

void expect(bool holds, const char* what, double seen) {
  if (!holds) throw std::invalid_argument(fmt::format("expected {}, seen {}", what, seen));
}

// Chip thickness around a slice.

/// The function mean + cos cos(phi) + sin sin(phi).
struct Harmonic {
  double mean = 0.0, cos = 0.0, sin = 0.0;
  double at(double phi) const { return mean + cos * std::cos(phi) + sin * std::sin(phi); }
  Harmonic operator-(const Harmonic& o) const { return {mean - o.mean, cos - o.cos, sin - o.sin}; }
};

/// Returns the displacement of a slice along its outward normal by a feed, mm.
Harmonic feed_part(const EdgeSlice& slice, const Vector3d& feed_t, double feed) {
  const double flank = feed * std::sin(slice.kappa);
  return {-feed * std::cos(slice.kappa) * feed_t.z(), flank * feed_t.x(), flank * feed_t.y()};
}

struct ChipArc {
  double from = 0.0, to = 0.0;  ///< rad
  Harmonic chip;
};

// Appends the angles at which h is zero.
void add_zeros(const Harmonic& h, double from, double to, std::vector<double>& zeros) {
  const double amplitude = std::hypot(h.cos, h.sin);
  if (!(amplitude > std::abs(h.mean))) return;
  const double middle = std::atan2(h.sin, h.cos);
  const double half = std::acos(-h.mean / amplitude);
  for (const double zero : {middle - half, middle + half}) {
    double phi = zero + units::full_turn * std::ceil((from - zero) / units::full_turn);
    for (; phi < to; phi += units::full_turn) zeros.push_back(phi);
  }
}

/// Returns the arcs on which the least of some thicknesses is positive, with that thickness.
/// Between the zeros and the crossings of the thicknesses the least is always the same one.
std::vector<ChipArc> chips(const std::vector<Harmonic>& thicknesses, double from, double to,
                           double feed) {
  std::vector<double> ends{from};
  for (std::size_t m = 0; m < thicknesses.size(); ++m) {
    add_zeros(thicknesses[m], from, to, ends);
    for (std::size_t n = 0; n < m; ++n) add_zeros(thicknesses[m] - thicknesses[n], from, to, ends);
  }
  ends.push_back(to);
  std::sort(ends.begin(), ends.end());
  std::vector<ChipArc> result;
  for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
    const double middle = 0.5 * (ends[i] + ends[i + 1]);
    const Harmonic least = *std::min_element(
        thicknesses.begin(), thicknesses.end(),
        [&](const Harmonic& a, const Harmonic& b) { return a.at(middle) < b.at(middle); });
    if (least.at(middle) > no_chip * feed) result.push_back({ends[i], ends[i + 1], least});
  }
  return result;
}

// Forces of an arc.

/// Means of 1, cos, sin along an edge, and of their products with the chip thickness.
struct Along {
  Vector3d edge;
  Vector3d chip;  ///< mm
};

/// Computes them from the means of cos, sin, cos 2 phi, sin 2 phi.
Along along(const Harmonic& h, double one, const Eigen::Vector4d& of) {
  const double c = of[0], s = of[1], c2 = of[2], s2 = of[3];
  return {
      {one, c, s},
      {h.mean * one + h.cos * c + h.sin * s, h.mean * c + 0.5 * (h.cos * (one + c2) + h.sin * s2),
       h.mean * s + 0.5 * (h.cos * s2 + h.sin * (one - c2))}};
}

/// Computes them from the middle and half the width of an arc, so that a narrow arc loses no
/// digits.
Along along(const ChipArc& stretch) {
  const double middle = 0.5 * (stretch.from + stretch.to);
  const double half = 0.5 * (stretch.to - stretch.from);
  const double one = half > 0.0 ? std::sin(half) / half : 1.0;
  const double two = half > 0.0 ? std::sin(2.0 * half) / (2.0 * half) : 1.0;
  return along(stretch.chip, 1.0,
               {one * std::cos(middle), one * std::sin(middle), two * std::cos(2.0 * middle),
                two * std::sin(2.0 * middle)});
}

/// Returns (sin x - x cos x) / x^2, by its series for |x| < 0.1, where the closed form cancels.
double bow(double x) {
  if (std::abs(x) < 0.1) {
    const double xx = x * x;
    return x * (1.0 / 3.0 - xx * (1.0 / 30.0 - xx * (1.0 / 840.0 - xx / 45360.0)));
  }
  return (std::sin(x) - x * std::cos(x)) / (x * x);
}

/// Returns the same means, each multiplied by the angle from the middle.
Along leaning(const ChipArc& stretch) {
  const double middle = 0.5 * (stretch.from + stretch.to);
  const double half = 0.5 * (stretch.to - stretch.from);
  const double one = half * bow(half), two = half * bow(2.0 * half);
  return along(stretch.chip, 0.0,
               {-one * std::sin(middle), one * std::cos(middle), -two * std::sin(2.0 * middle),
                two * std::cos(2.0 * middle)});
}

/// Transforms a vector from (radial, around) to frame t; each component is given by its mean, cos
/// and sin parts.
Vector3d turned(const Vector3d& radial, const Vector3d& around, double axial) {
  return {radial[1] - around[2], radial[2] + around[1], axial};
}

/// A segment of an edge of a slice in material.
struct CuttingEdge {
  ChipArc stretch;
  double length = 0.0;  ///< mm
  double height = 0.0;  ///< mm above the tip, at the middle of the arc
  double rise = 0.0;    ///< mm of height per rad
};

class LoadSum {
 public:
  LoadSum(const CuttingCoefficients& K, bool clockwise) : K_(K), turning_(clockwise ? 1.0 : -1.0) {}

  void add(const EdgeSlice& slice, const CuttingEdge& piece) {
    const Forces F = forces(slice, piece.length, along(piece.stretch));
    const double r = slice.radius, z = piece.height;
    load_.on_tool_t.head<3>() += turned(F.radial, F.around, F.axial[0]);
    load_.on_tool_t.tail<3>() += turned(-z * F.around, z * F.radial - r * F.axial, r * F.around[0]);
    load_.torque += turning_ * r * F.around[0];
    load_.chip_volume += units::full_turn * r * F.chip;
    load_.contact_t += Vector3d(r * F.amounts[1], r * F.amounts[2], z * F.amounts[0]);
    amount_ += F.amounts[0];
    if (piece.rise == 0.0) return;
    const Forces lean = forces(slice, piece.rise * piece.length, leaning(piece.stretch));
    load_.on_tool_t.tail<3>() += turned(-lean.around, lean.radial, 0.0);
    load_.contact_t.z() += lean.amounts[0];
  }

  CuttingLoad take() {
    if (amount_ > 0.0) load_.contact_t /= amount_;
    return load_;
  }

 private:
  // Force components as functions of the angle.
  struct Forces {
    Vector3d radial, around, axial, amounts;  ///< N: mean, cos and sin parts
    double chip = 0.0;                        ///< mm^2
  };

  Forces forces(const EdgeSlice& slice, double length, const Along& mean) const {
    const Vector3d edge = length * mean.edge, chip = length * mean.chip;
    const double sine = std::sin(slice.kappa), cosine = std::cos(slice.kappa);
    const Vector3d tangential = K_.K_tc * chip + K_.K_te * edge;
    const Vector3d normal = K_.K_rc * chip + K_.K_re * edge;
    const Vector3d upward = K_.K_ac * chip + K_.K_ae * edge;
    return {cosine * upward - sine * normal, turning_ * tangential, cosine * normal + sine * upward,
            (K_.K_tc + K_.K_rc + std::abs(K_.K_ac)) * chip +
                (K_.K_te + K_.K_re + std::abs(K_.K_ae)) * edge,
            chip[0]};
  }

  const CuttingCoefficients& K_;
  double turning_;  // +1: the force around is counter-clockwise, against a clockwise spindle
  double amount_ = 0.0;
  CuttingLoad load_;
};

void check_milling(const CuttingCoefficients& coefficients, const Flutes& flutes, double feed) {
  validate(coefficients);
  validate(flutes);
  expect(std::isfinite(feed) && feed >= 0.0, "a feed per tooth of 0 mm or more", feed);
}

const EdgeSlice& slice_of(const Engagement& engagement, const EngagedArc& arc) {
  assert(arc.slice >= 0 && std::size_t(arc.slice) < engagement.slices.size());
  return engagement.slices[std::size_t(arc.slice)];
}

// The load at a spindle angle.

/// The edge of one flute on one slice.
struct FluteEdge {
  double middle = 0.0;       ///< rad about z
  double half_extent = 0.0;  ///< rad, from its middle to its upper end
  double half_height = 0.0;  ///< mm
  bool is_upright() const { return std::abs(half_extent) < no_extent; }
};

/// Returns the chip thicknesses of a tooth on a slice: one relative to each of the teeth before it.
std::vector<Harmonic> thicknesses(const EdgeSlice& slice, const Vector3d& feed_t, double feed,
                                  const Flutes& flutes, double spindle_angle) {
  const Harmonic part = feed_part(slice, feed_t, feed);
  if (flutes.run_out == 0.0) return {part};
  // The tooth and its predecessors pass the same position at different times, so each radius is a
  // harmonic of that position.
  const double out = flutes.run_out * std::sin(slice.kappa);
  const double now = spindle_angle + flutes.run_out_angle;
  std::vector<Harmonic> result;
  for (int m = 1; m <= flutes.count; ++m) {
    const double then =
        now + (flutes.clockwise ? units::full_turn : -units::full_turn) * m / flutes.count;
    const bool itself = m == flutes.count;
    result.push_back({m * part.mean,
                      m * part.cos + (itself ? 0.0 : out * (std::cos(now) - std::cos(then))),
                      m * part.sin + (itself ? 0.0 : out * (std::sin(now) - std::sin(then)))});
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
    for (const ChipArc& one : chips(thicknesses, from, upright ? from : to, feed)) {
      const double off = 0.5 * (one.from + one.to) - edge.middle;
      const double share = upright ? 1.0 : (one.to - one.from) / (high - low);
      sum.add(slice, {one, slice.length * share, slice.height + rise * off, rise});
    }
  }
}

}  // namespace

void validate(const CuttingCoefficients& K) {
  const auto check = [](const char* name, double value, bool may_be_negative) {
    if (std::isfinite(value) && (may_be_negative || value >= 0.0)) return;
    throw std::invalid_argument(fmt::format("{}: expected a finite number{}, seen {}", name,
                                            may_be_negative ? "" : " of 0 or more", value));
  };
  check("K_tc", K.K_tc, false);
  check("K_rc", K.K_rc, false);
  check("K_ac", K.K_ac, true);
  check("K_te", K.K_te, false);
  check("K_re", K.K_re, false);
  check("K_ae", K.K_ae, true);
}

void validate(const Flutes& flutes) {
  expect(flutes.count >= 1 && flutes.count <= 100, "1 to 100 flutes", flutes.count);
  expect(std::abs(flutes.helix) < 0.5 * pi, "a helix between -90 and 90 degrees (in rad)",
         flutes.helix);
  expect(std::isfinite(flutes.run_out) && flutes.run_out >= 0.0, "a run-out of 0 mm or more",
         flutes.run_out);
  expect(std::isfinite(flutes.run_out_angle), "a finite run-out angle", flutes.run_out_angle);
}

CuttingLoad mean_force(const Engagement& engagement, const CuttingCoefficients& coefficients,
                       const Flutes& flutes, double feed_per_tooth) {
  check_milling(coefficients, flutes, feed_per_tooth);
  LoadSum sum(coefficients, flutes.clockwise);
  for (const EngagedArc& arc : engagement.arcs) {
    const EdgeSlice& slice = slice_of(engagement, arc);
    const Harmonic chip = feed_part(slice, engagement.feed_t, feed_per_tooth);
    for (const ChipArc& one : chips({chip}, arc.from, arc.to, feed_per_tooth)) {
      // number of teeth on the arc on average
      const double teeth = flutes.count * (one.to - one.from) / units::full_turn;
      sum.add(slice, {one, teeth * slice.length, slice.height, 0.0});
    }
  }
  return sum.take();
}

CuttingLoad force_at(const Engagement& engagement, const CuttingCoefficients& coefficients,
                     const Flutes& flutes, double feed_per_tooth, double spindle_angle) {
  check_milling(coefficients, flutes, feed_per_tooth);
  expect(std::isfinite(spindle_angle), "a finite spindle angle", spindle_angle);
  double radius = 0.0;
  for (const EdgeSlice& slice : engagement.slices) radius = std::max(radius, slice.radius);
  const double lag = radius > 0.0 ? std::tan(flutes.helix) / radius : 0.0;
  const double pitch = (flutes.clockwise ? units::full_turn : -units::full_turn) /
                       flutes.count;  // to the following tooth
  LoadSum sum(coefficients, flutes.clockwise);
  for (const EngagedArc& arc : engagement.arcs) {
    const EdgeSlice& slice = slice_of(engagement, arc);
    const std::vector<Harmonic> chip =
        thicknesses(slice, engagement.feed_t, feed_per_tooth, flutes, spindle_angle);
    const double half_height = 0.5 * slice.length * std::sin(slice.kappa);
    for (int flute = 0; flute < flutes.count; ++flute) {
      const FluteEdge edge{spindle_angle + flute * pitch + lag * slice.height, lag * half_height,
                           half_height};
      add_edge(edge, slice, arc, chip, feed_per_tooth, sum);
    }
  }
  return sum.take();
}

namespace {

/// A point of a turning tool's edge in frame t, and the outward normal there.
struct TurningEdge {
  Vector3d place, normal;
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
  const Vector3d onward(-std::sin(psi), 0.0, std::cos(psi));
  return {radius * outward, (radius * outward - slope * onward).normalized()};
}

}  // namespace

CuttingLoad turning_force(const std::vector<EngagedEdge>& edges, const Nose& nose,
                          const CuttingCoefficients& K, double work_radius) {
  validate(K);
  expect(std::isfinite(work_radius) && work_radius >= 0.0, "a work radius of 0 mm or more",
         work_radius);
  CuttingLoad load;
  double amount = 0.0;
  for (const EngagedEdge& edge : edges) {
    if (!(edge.chip > 0.0) || !(edge.length > 0.0)) continue;
    const auto [place, normal] = turning_edge(nose, edge.psi);
    const double tangential = (K.K_tc * edge.chip + K.K_te) * edge.length;
    const double radial = (K.K_rc * edge.chip + K.K_re) * edge.length;
    const Vector3d force = -tangential * Vector3d::UnitY() - radial * normal;
    load.on_tool_t.head<3>() += force;
    load.on_tool_t.tail<3>() += place.cross(force);
    load.torque += tangential * work_radius;
    load.chip_volume += units::full_turn * work_radius * edge.chip * edge.length;
    load.contact_t += (tangential + radial) * place;
    amount += tangential + radial;
  }
  if (amount > 0.0) load.contact_t /= amount;
  return load;
}

}  // namespace abbe::cutting
