#include "errors/series.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace abbe::errors {

HarmonicAt::HarmonicAt(double angle)
    : c(std::cos(angle)), s(std::sin(angle)), first_c(c), first_s(s) {}

namespace {

/// In the order of the functions.
std::vector<double> coefficients_of(const Curve& curve) {
  if (const auto* legendre = std::get_if<Legendre>(&curve.shape))
    return {legendre->c.begin(), legendre->c.end()};
  const auto& fourier = std::get<Fourier>(curve.shape);
  std::vector<double> all;
  for (Eigen::Index k = 0; k < fourier.a.size(); ++k) {
    all.push_back(fourier.a[k]);
    all.push_back(fourier.b[k]);
  }
  return all;
}

}  // namespace

bool SeriesBasis::shares(const SeriesBasis& other) const {
  return kind == other.kind && argument == other.argument && centre == other.centre &&
         range == other.range;
}

std::optional<SeriesBasis> basis_of(const Curve& curve) {
  SeriesBasis basis;
  basis.argument = curve.argument;
  Eigen::Index functions = 0;
  if (const auto* legendre = std::get_if<Legendre>(&curve.shape)) {
    basis.centre = legendre->centre;
    basis.range = legendre->half_range;
    functions = legendre->c.size();
  } else if (const auto* fourier = std::get_if<Fourier>(&curve.shape)) {
    basis.kind = SeriesBasis::Kind::Harmonics;
    basis.range = fourier->period;
    functions = 2 * fourier->a.size();
  } else {
    return std::nullopt;
  }
  if (functions > SeriesBasis::most_functions) return std::nullopt;
  basis.functions = int(functions);
  return basis;
}

int add(const Curve& curve, SeriesGroup& group) {
  const std::vector<double> own = coefficients_of(curve);
  group.basis.functions = std::max(group.basis.functions, int(own.size()));
  group.coefficients.resize(std::size_t(group.basis.functions * SeriesGroup::most), 0.0);
  for (std::size_t k = 0; k < own.size(); ++k)
    group.coefficients[k * SeriesGroup::most + std::size_t(group.count)] = own[k];
  return group.count++;
}

SeriesGroup::Sums sums(const SeriesGroup& group, const CurveState& state) {
  const SeriesBasis& basis = group.basis;
  const double q = basis.argument == Argument::Command ? state.command : state.carriage;
  const double* c = group.coefficients.data();
  const double* const end = c + group.coefficients.size();
  constexpr std::size_t most = SeriesGroup::most;
  SeriesGroup::Sums sum{};
  if (basis.kind == SeriesBasis::Kind::Legendre) {
    LegendreAt at{(q - basis.centre) / basis.range};
    while (c != end) {
      for (std::size_t i = 0; i < most; ++i) sum[i] += c[i] * at.P;
      if ((c += most) != end) at.next();
    }
  } else {
    HarmonicAt at(2.0 * std::numbers::pi * (q / basis.range));
    while (c != end) {
      for (std::size_t i = 0; i < most; ++i) sum[i] += c[i] * at.c + c[most + i] * at.s;
      if ((c += 2 * most) != end) at.next();
    }
  }
  return sum;
}

double factor(const Curve& curve) { return curve.negate ? -curve.scale : curve.scale; }

}  // namespace abbe::errors
