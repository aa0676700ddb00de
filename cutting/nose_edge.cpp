#include "cutting/nose_edge.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace abbe::cutting {

using Eigen::Vector2d;

NoseEdge::NoseEdge(const Nose& nose) : nose_(nose) {
  double steepest = 0.0;
  for (const NoseWave& wave : nose.waves) {
    if (!std::isfinite(wave.amplitude) || !std::isfinite(wave.phase)) {
      throw std::invalid_argument("nose wave: expected finite amplitude and phase");
    }
    wave_sum_ += std::abs(wave.amplitude);
    steepest += std::abs(double(wave.order) * wave.amplitude);
  }
  if (!std::isfinite(nose.radius) || nose.radius <= wave_sum_) {
    throw std::invalid_argument("nose: expected a radius larger than the sum of its waves");
  }
  if (nose.profile && !nose.waves.empty())
    throw std::invalid_argument("nose: expected waves on a round edge, seen them on an insert");
  lipschitz_ = 1.0 + steepest / (nose.radius - wave_sum_);
}

double NoseEdge::outside_by(const Vector2d& point) const {
  if (nose_.profile) return beyond(point);
  double edge = nose_.radius;
  if (!nose_.waves.empty()) {
    const double psi = std::atan2(point.y(), point.x());
    for (const NoseWave& wave : nose_.waves) {
      edge += wave.amplitude * std::cos(wave.order * psi + wave.phase);
    }
  }
  return point.norm() - edge;
}

std::optional<double> NoseEdge::entry(const Vector2d& point, const Vector2d& step,
                                      double from) const {
  const double aa = step.squaredNorm();
  if (aa < 1e-24) {  // the line is a point in this plane
    return contains(point) ? std::optional(from) : std::nullopt;
  }
  if (nose_.profile) {
    const std::optional<Chord> inside = chord(*nose_.profile, point, step);
    if (!inside || inside->end < from) return std::nullopt;
    return std::max(from, inside->begin);
  }
  const double closest = -point.dot(step) / aa;
  // The distance to the line from the cross product: it does not cancel as b^2 - ac does.
  const double distance = (point.x() * step.y() - point.y() * step.x()) / std::sqrt(aa);
  const double radius = outer_radius();
  const double square = (radius - distance) * (radius + distance);
  if (square < 0.0) return std::nullopt;
  const double half = std::sqrt(square / aa);
  const double begin = std::max(from, closest - half);
  if (begin > closest + half) return std::nullopt;
  if (nose_.waves.empty()) return begin;
  return waved_entry(point, step, begin, closest + half);
}

double NoseEdge::nearest(const Vector2d& point, const Vector2d& step, double from) const {
  const double aa = step.squaredNorm();
  if (!nose_.profile) return -point.dot(step) / aa;
  if (chord(*nose_.profile, point, step)) return from;
  const Vector2d across(-step.y(), step.x());
  // the origin is inside, so the line lies where it does from there
  const Vector2d towards = across.dot(point) > 0.0 ? Vector2d(across) : Vector2d(-across);
  const double s = (foremost(*nose_.profile, towards) - point).dot(step) / aa;
  return std::max(from, s);
}

std::optional<double> NoseEdge::waved_entry(const Vector2d& point, const Vector2d& step,
                                            double begin, double end) const {
  const double speed = step.norm();
  double outside = begin;
  double f_outside = outside_by(point + begin * step);
  if (f_outside <= 0.0) return begin;
  // Steps that the Lipschitz constant allows cannot pass over a crossing; the least step only ends
  // the crawl onto one, the bracket then finishes it.
  double inside = begin;
  double f_inside = f_outside;
  while (f_inside > 0.0) {
    if (inside >= end) return std::nullopt;
    outside = inside;
    f_outside = f_inside;
    inside = std::min(end, outside + std::max(f_outside / lipschitz_, 1e-6) / speed);
    f_inside = outside_by(point + inside * step);
  }
  for (int i = 0; i < 60 && (inside - outside) * speed > 1e-13; ++i) {
    const double secant = outside + (inside - outside) * f_outside / (f_outside - f_inside);
    const double middle = 0.5 * (outside + inside);
    const double trial = i % 3 == 2 || !(secant > outside && secant < inside) ? middle : secant;
    const double f = outside_by(point + trial * step);
    (f > 0.0 ? outside : inside) = trial;
    (f > 0.0 ? f_outside : f_inside) = f;
    if (f == 0.0) break;
  }
  return inside;
}

}  // namespace abbe::cutting
