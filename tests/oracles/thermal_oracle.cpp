#include "tests/oracles/thermal_oracle.h"

#include <cmath>
#include <cstddef>

namespace abbe::oracles {
namespace {

__extension__ using Quad = __float128;

/// Square matrix, row by row.
struct Matrix {
  std::size_t n = 0;
  std::vector<Quad> a;

  explicit Matrix(std::size_t size) : n(size), a(size * size, Quad(0)) {}
  Quad& operator()(std::size_t i, std::size_t j) { return a[i * n + j]; }
  Quad operator()(std::size_t i, std::size_t j) const { return a[i * n + j]; }
};

Matrix product(const Matrix& x, const Matrix& y) {
  Matrix z(x.n);
  for (std::size_t i = 0; i < x.n; ++i)
    for (std::size_t k = 0; k < x.n; ++k) {
      const Quad factor = x(i, k);
      if (factor == Quad(0)) continue;
      for (std::size_t j = 0; j < x.n; ++j) z(i, j) += factor * y(k, j);
    }
  return z;
}

double norm(const Matrix& m) {
  double most = 0.0;
  for (std::size_t i = 0; i < m.n; ++i) {
    double sum = 0.0;
    for (std::size_t j = 0; j < m.n; ++j) sum += std::abs(double(m(i, j)));
    most = std::max(most, sum);
  }
  return most;
}

/// Scaled until the Taylor series is short, then squared back.
Matrix exponential(Matrix m) {
  int squarings = 0;
  Quad scale = 1;
  for (double size = norm(m); size > 0.25; size /= 2.0, ++squarings) scale /= 2;
  for (Quad& entry : m.a) entry *= scale;
  Matrix sum(m.n), term(m.n);
  for (std::size_t i = 0; i < m.n; ++i) sum(i, i) = term(i, i) = 1;
  for (int k = 1; k <= 26; ++k) {  // 0.25^26 / 26! is 1e-42
    term = product(term, m);
    for (std::size_t i = 0; i < m.a.size(); ++i) sum.a[i] += (term.a[i] /= k);
  }
  for (int k = 0; k < squarings; ++k) sum = product(sum, sum);
  return sum;
}

/// Rows and columns: n temperatures, the sensor, n integrals, 1, time over the whole stretch.
Matrix augmented(const HeatNetwork& network, const HeatInput& start, const HeatInput& end,
                 double seconds) {
  const std::size_t n = network.capacity.size();
  const std::size_t one = 2 * n + 1, part = one + 1;
  Matrix m(part + 1);
  const auto flow = [&](std::size_t node, Quad at_start, Quad at_end) {
    m(node, one) += at_start;
    m(node, part) += at_end - at_start;
  };
  for (std::size_t i = 0; i < n; ++i) flow(i, start.heat[i], end.heat[i]);
  for (const HeatLink& link : network.links) {
    const Quad g = link.conductance;
    const std::size_t a = std::size_t(link.a);
    m(a, a) -= g;
    if (link.b < 0) {
      const std::size_t outside = std::size_t(-1 - link.b);
      flow(a, g * start.outside[outside], g * end.outside[outside]);
    } else {
      const std::size_t b = std::size_t(link.b);
      m(b, b) -= g;
      m(a, b) += g;
      m(b, a) += g;
    }
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j <= part; ++j) m(i, j) /= Quad(network.capacity[i]);
  m(n, std::size_t(network.sensed)) = Quad(1) / Quad(network.lag);
  m(n, n) = -Quad(1) / Quad(network.lag);
  for (std::size_t i = 0; i < n; ++i) m(n + 1 + i, i) = 1;
  for (Quad& entry : m.a) entry *= Quad(seconds);
  m(part, one) = 1;
  return m;
}

}  // namespace

HeatAnswer heat_after(const HeatNetwork& network, const HeatState& from, const HeatInput& start,
                      const HeatInput& end, double seconds) {
  const std::size_t n = network.capacity.size();
  const Matrix e = exponential(augmented(network, start, end, seconds));
  const auto row = [&](std::size_t i) {
    Quad sum = e(i, n) * Quad(from.sensor) + e(i, 2 * n + 1);
    for (std::size_t j = 0; j < n; ++j) sum += e(i, j) * Quad(from.T[j]);
    return double(sum);
  };
  HeatAnswer answer;
  for (std::size_t i = 0; i < n; ++i) {
    answer.state.T.push_back(row(i));
    answer.integral.push_back(row(n + 1 + i));
  }
  answer.state.sensor = row(n);
  return answer;
}

}  // namespace abbe::oracles
