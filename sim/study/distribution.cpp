#include "sim/study/distribution.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/special_functions/erf.hpp>

#include "kinematics/numbers.h"

namespace abbe::sim::study {
namespace {

using Shape = Distribution::Kind;

/// Everything in double: what long double would add is far below the bounds, at five times the
/// time.
using Plain = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

constexpr double least_share = 1e-300;  // below it doubles lose their digits
constexpr double most_log_spread = 10.0;

/// Below and above a number. Their sum is 1; whichever is small has all its digits.
struct Shares {
  double below = 0.0;
  double above = 1.0;
};

Shares of_normal(double score) {
  const double x = std::clamp(score / std::numbers::sqrt2, -30.0, 30.0);  // beyond it is 0 and 1
  return {0.5 * boost::math::erfc(-x, Plain()), 0.5 * boost::math::erfc(x, Plain())};
}

double normal_score(const Shares& shares) {
  const double tail = std::min(shares.below, shares.above);
  const double score =
      tail > 0.0 ? std::numbers::sqrt2 * boost::math::erfc_inv(2.0 * tail, Plain()) : infinity;
  return shares.below < shares.above ? -score : score;
}

/// Shares of the kind itself: a score, or a place of -1 .. 1 for those that end.
Shares shares_at(Shape kind, double z) {
  switch (kind) {
    case Shape::Uniform:
      return {0.5 * (1.0 + z), 0.5 * (1.0 - z)};
    case Shape::Triangular: {
      const double tail = 0.5 * (1.0 - std::abs(z)) * (1.0 - std::abs(z));
      return z < 0.0 ? Shares{tail, 1.0 - tail} : Shares{1.0 - tail, tail};
    }
    default:
      return of_normal(z);
  }
}

double place_of(Shape kind, const Shares& shares) {
  const double tail = std::min(shares.below, shares.above);
  const double side = shares.below < shares.above ? -1.0 : 1.0;
  switch (kind) {
    case Shape::Uniform:
      return side * (1.0 - 2.0 * tail);
    case Shape::Triangular:
      return side * (1.0 - std::sqrt(2.0 * tail));
    default:
      return normal_score(shares);
  }
}

double place_of_value(const Distribution& d, double value) {
  if (d.kind != Shape::LogNormal) return (value - d.centre) / d.spread;
  return value > 0.0 ? std::log(value / d.centre) / d.spread : -infinity;
}

double value_at(const Distribution& d, double z) {
  return d.kind == Shape::LogNormal ? d.centre * std::exp(d.spread * z) : d.centre + d.spread * z;
}

bool ends(Shape kind) { return kind == Shape::Uniform || kind == Shape::Triangular; }

/// What the cut leaves.
struct Window {
  double low = 0.0;  ///< in the distribution's own unit
  double high = 0.0;
  double from = 0.0;  ///< the same as places
  double to = 0.0;
  Shares at_from;
  Shares at_to;
  double share = 0.0;  ///< between them
};

Window window_of(const Distribution& d) {
  const double end = ends(d.kind) ? 1.0 : infinity;
  Window w;
  w.from = std::max(place_of_value(d, d.low), -end);
  w.to = std::min(place_of_value(d, d.high), end);
  w.low = std::max(d.low, value_at(d, -end));
  w.high = std::min(d.high, value_at(d, end));
  w.at_from = shares_at(d.kind, w.from);
  w.at_to = shares_at(d.kind, w.to);
  w.share = w.from > 0.0 ? w.at_from.above - w.at_to.above : w.at_to.below - w.at_from.below;
  return w;
}

double value_in(const Distribution& d, const Window& w, const Shares& within) {
  const Shares shares{w.at_from.below + within.below * w.share,
                      w.at_to.above + within.above * w.share};
  return std::clamp(value_at(d, place_of(d.kind, shares)), w.low, w.high);
}

double quantile_in(const Distribution& d, const Window& w, double p) {
  if (p <= 0.0) return w.low;
  if (p >= 1.0) return w.high;
  return value_in(d, w, {p, 1.0 - p});
}

bool is_cut(const Distribution& d) {
  return d.high < infinity || d.low > (d.kind == Shape::LogNormal ? 0.0 : -infinity);
}

/// Density of the kind at z over that at the likeliest place z0 of its window.
double log_density(Shape kind, double z0, double z) {
  switch (kind) {
    case Shape::Uniform:
      return 0.0;
    case Shape::Triangular:
      return std::log((1.0 - std::abs(z)) / (1.0 - std::abs(z0)));
    default:
      return -0.5 * (z - z0) * (z + z0);
  }
}

/// Where what is left out weighs less than e^-60: its own square in the log-normal included.
double farthest(double z0, double tilt) {
  const double m = z0 - tilt;
  return std::sqrt(m * m + 120.0) - m;
}

/// By Gauss-Legendre rules, as the closed forms lose all digits in narrow windows and far out. All
/// is relative to the likeliest place z0, so nothing cancels.
Moments moments_in(const Distribution& d, const Window& w) {
  const bool logarithm = d.kind == Shape::LogNormal;
  const double z0 = std::clamp(0.0, w.from, w.to);
  const double v0 = value_at(d, z0);
  const auto deviation = [&](double t) {
    return logarithm ? v0 * std::expm1(d.spread * t) : d.spread * t;
  };
  const double first = std::max(w.from - z0, -farthest(-z0, 0.0));
  const double last = std::min(w.to - z0, farthest(z0, logarithm ? 2.0 * d.spread : 0.0));
  const auto integral = [&](const auto& f) {
    // Halves of the density's logarithm on both factors: neither overflows.
    const auto weighed = [&](double t) {
      const double half = std::exp(0.5 * log_density(d.kind, z0, z0 + t));
      return f(t, half);
    };
    const auto side = [&](double from, double to) {
      const int panels = 1 + int((to - from) * (1.0 + std::abs(z0) / 8.0));
      double sum = 0.0;
      for (int i = 0; i < panels; ++i)
        sum += boost::math::quadrature::gauss<double, 20>::integrate(
            weighed, from + (to - from) * i / panels, from + (to - from) * (i + 1) / panels);
      return sum;
    };
    // Split at the mode of the triangle.
    return (first < 0.0 ? side(first, 0.0) : 0.0) + (last > 0.0 ? side(0.0, last) : 0.0);
  };
  const double all = integral([](double, double half) { return half * half; });
  const double mean =
      integral([&](double t, double half) { return deviation(t) * half * half; }) / all;
  const double variance = integral([&](double t, double half) {
                            const double part = (deviation(t) - mean) * half;
                            return part * part;
                          }) /
                          all;
  return {std::clamp(v0 + mean, w.low, w.high), std::sqrt(variance)};
}

}  // namespace

const char* fault_of(const Distribution& d) {
  if (!std::isfinite(d.centre)) return "a finite centre";
  if (!(d.spread > 0.0) || !std::isfinite(d.spread)) return "a spread above 0";
  if (d.kind == Shape::LogNormal) {
    if (d.centre <= 0.0) return "a median above 0, as the distribution is log-normal";
    if (d.spread > most_log_spread) return "a spread of the logarithm of at most 10";
  }
  if (!std::isfinite(d.centre - d.spread) || !std::isfinite(d.centre + d.spread))
    return "a centre and a spread of which the sum is finite";
  if (!(d.low < d.high)) return "a low limit below the high one";
  const Window w = window_of(d);
  if (!(w.from < w.to) || !(w.share > least_share))
    return "some share of the distribution between its low and its high limit";
  return nullptr;
}

double normal_score(double p) { return normal_score(Shares{p, 1.0 - p}); }

double quantile(const Distribution& d, double p) { return quantile_in(d, window_of(d), p); }

double at_score(const Distribution& d, double score) {
  if (!ends(d.kind) && !is_cut(d)) return value_at(d, score);
  return value_in(d, window_of(d), of_normal(score));
}

Eigen::VectorXd quantiles(const Distribution& d, const Eigen::VectorXd& p) {
  const Window w = window_of(d);
  return p.unaryExpr([&](double share) { return quantile_in(d, w, share); });
}

Eigen::VectorXd at_scores(const Distribution& d, const Eigen::VectorXd& scores) {
  if (!ends(d.kind) && !is_cut(d))
    return scores.unaryExpr([&](double score) { return value_at(d, score); });
  const Window w = window_of(d);
  return scores.unaryExpr([&](double score) { return value_in(d, w, of_normal(score)); });
}

double cumulative(const Distribution& d, double value) {
  const Window w = window_of(d);
  if (value <= w.low) return 0.0;
  if (value >= w.high) return 1.0;
  const double z = std::clamp(place_of_value(d, value), w.from, w.to);
  const Shares shares = shares_at(d.kind, z);
  const double below =
      w.from > 0.0 ? w.at_from.above - shares.above : shares.below - w.at_from.below;
  return std::clamp(below / w.share, 0.0, 1.0);
}

Moments moments(const Distribution& d) {
  if (is_cut(d) || ends(d.kind)) return moments_in(d, window_of(d));
  if (d.kind == Shape::Normal) return {d.centre, d.spread};
  const double variance = d.spread * d.spread;
  const double mean = d.centre * std::exp(0.5 * variance);
  return {mean, mean * std::sqrt(std::expm1(variance))};
}

}  // namespace abbe::sim::study
