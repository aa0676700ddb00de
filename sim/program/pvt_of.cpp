#include "sim/program/pvt_of.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/program/block_axes.h"
#include "sim/program/chords.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

/// How far one position is from another, mm, spindles left out.
double distance(const Chain& control, const AxisVector& a, const AxisVector& b, double lever) {
  double squared = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    const auto& joint = control.joints()[std::size_t(j)];
    if (joint.motion == Motion::Spindle || joint.name == 'S') continue;
    const double way = (b[j] - a[j]) * (joint.motion == Motion::Linear ? 1.0 : lever);
    squared += way * way;
  }
  return std::sqrt(squared);
}

/// A block in its equal parts, and how fast it begins and ends, mm/s.
struct Parts {
  std::size_t block = 0, n = 1;
  double seconds = 0.0, first_speed = 0.0, last_speed = 0.0;
};

std::vector<Parts> parts_of(const Path& path, const Chain& control, const PvtOfOptions& options) {
  std::vector<Parts> all;
  double rows = 1.0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const Block& block = path.blocks[i];
    if (!(block.end_s > block.start_s)) continue;
    Parts parts{i, chords_of(path, block, control, options.within), block.end_s - block.start_s};
    const double n = double(parts.n);
    rows += n + 2.0;
    if (rows > double(options.max_rows))
      throw BadInput(path.file, block.line, 0,
                     fmt::format("a program of at most {} rows within {:.4g} um", options.max_rows,
                                 options.within / units::um),
                     "more; a larger tolerance needs fewer");
    const auto speed = [&](double from, double to) {
      return distance(control, axes_at(path, block, control, from),
                      axes_at(path, block, control, to), options.lever) *
             n / parts.seconds;
    };
    if (block.interpolation != Interpolation::Dwell) {
      parts.first_speed = speed(0.0, 1.0 / n);
      parts.last_speed = speed(1.0 - 1.0 / n, 1.0);
    }
    all.push_back(parts);
  }
  return all;
}

/// Share of a block between a corner and the row beside it: the tool goes no farther than what is
/// allowed in that time, at the higher speed of the two moves that meet.
double beside(const Parts& parts, double speed_before, double speed_after, double within) {
  const double speed = std::max(speed_before, speed_after);
  const double most = 0.25 / double(parts.n);
  return speed > 0.0 ? std::min(most, within / speed / parts.seconds) : most;
}

/// Fractions of a block at which rows stand, ascending to 1.
std::vector<double> fractions_of(const std::vector<Parts>& all, std::size_t i, double within) {
  const Parts& parts = all[i];
  const double before = i > 0 ? all[i - 1].last_speed : 0.0;
  const double after = i + 1 < all.size() ? all[i + 1].first_speed : 0.0;
  std::vector<double> u{beside(parts, before, parts.first_speed, within)};
  for (std::size_t k = 1; k < parts.n; ++k) u.push_back(double(k) / double(parts.n));
  u.push_back(1.0 - beside(parts, parts.last_speed, after, within));
  u.push_back(1.0);
  return u;
}

/// The Hermite cubic between two rows at a share of their time.
AxisVector cubic_at(const PvtRow& a, const PvtRow& b, double u) {
  const double T = b.time_s - a.time_s;
  const AxisVector way = b.position - a.position;
  return a.position + u * way +
         u * (1 - u) * ((1 - u) * (T * a.velocity - way) - u * (T * b.velocity - way));
}

}  // namespace

PvtOf pvt_of(const Path& path, const Chain& control, const PvtOfOptions& options) {
  PvtOf made;
  std::vector<std::size_t> block_of;  // of the stretch that ends at a row
  const std::vector<Parts> parts = parts_of(path, control, options);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Block& block = path.blocks[parts[i].block];
    if (i == 0) {
      made.rows.push_back({block.start_s, axes_at(path, block, control, 0.0), {}});
      block_of.push_back(parts[i].block);
    }
    for (const double u : fractions_of(parts, i, options.within)) {
      const double time_s = u == 1.0 ? block.end_s : block.start_s + u * parts[i].seconds;
      if (!(time_s > made.rows.back().time_s)) continue;
      made.rows.push_back({time_s, axes_at(path, block, control, u), {}});
      block_of.push_back(parts[i].block);
    }
  }
  if (made.rows.size() < 2) throw BadInput(path.file, 0, 0, "a program that moves", "none");
  const std::vector<AxisVector> velocities = rates(made.rows);
  for (std::size_t k = 0; k < made.rows.size(); ++k) made.rows[k].velocity = velocities[k];
  for (std::size_t k = 1; k < made.rows.size(); ++k) {
    const PvtRow &a = made.rows[k - 1], &b = made.rows[k];
    const Block& block = path.blocks[block_of[k]];
    for (const double u : {0.25, 0.5, 0.75}) {
      const double time_s = a.time_s + u * (b.time_s - a.time_s);
      const double at = (time_s - block.start_s) / (block.end_s - block.start_s);
      made.off = std::max(made.off, distance(control, axes_at(path, block, control, at),
                                             cubic_at(a, b, u), options.lever));
    }
  }
  return made;
}

}  // namespace abbe::sim::program
