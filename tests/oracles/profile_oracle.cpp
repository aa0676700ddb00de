#include "tests/oracles/profile_oracle.h"

#include <algorithm>
#include <cmath>

namespace abbe::test {
namespace {

/// Lengths of the elements, found from the left.
std::vector<double> brute_elements(const std::vector<double>& z, double above, double below) {
  // what a place is: +1 a hill, -1 a dale, 0 neither; and where the line was crossed since
  std::vector<double> crossings;
  int state = 0;
  double since = -1.0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    const int is = z[i] > above ? 1 : z[i] < -below ? -1 : 0;
    if (i > 0 && since < 0.0 && state * z[i] <= 0.0 && state * z[i - 1] > 0.0)
      since = double(i - 1) + std::abs(z[i - 1]) / (std::abs(z[i - 1]) + std::abs(z[i]));
    if (is == 0) continue;
    if (state != 0 && is != state) crossings.push_back(since);
    state = is;
    since = -1.0;
  }
  std::vector<double> elements;
  for (std::size_t k = 2; k < crossings.size(); k += 2)
    elements.push_back(crossings[k] - crossings[k - 2]);
  return elements;
}

}  // namespace

std::vector<double> brute_mean_line(const std::vector<double>& z, double step, double index) {
  using real = long double;
  const real pi = 3.14159265358979323846264338327950288L;
  const real alpha = std::sqrt(std::log(real(2)) / pi);
  std::vector<double> line;
  for (std::size_t i = 0; i < z.size(); ++i) {
    real sum = 0, middle = 0, mean = 0;
    const auto weight = [&](std::size_t j) {
      const real d = (real(j) - real(i)) * step;
      return std::abs(d) <= index * (1 + 1e-12L)
                 ? std::exp(-pi * (d / (alpha * index)) * (d / (alpha * index)))
                 : real(0);
    };
    for (std::size_t j = 0; j < z.size(); ++j) {
      sum += weight(j);
      middle += weight(j) * real(j);
      mean += weight(j) * z[j];
    }
    middle /= sum;
    mean /= sum;
    real moment = 0, squares = 0;
    for (std::size_t j = 0; j < z.size(); ++j) {
      const real off = real(j) - middle;
      moment += weight(j) * off * (z[j] - mean);
      squares += weight(j) * off * off;
    }
    const real slope = squares > 0 ? moment / squares : 0;
    line.push_back(double(mean + slope * (real(i) - middle)));
  }
  return line;
}

BruteProfile brute_parameters(const std::vector<double>& z, double step, int first, int last,
                              int sections) {
  BruteProfile b{};
  const int n = last - first;
  long double sum[5] = {0, 0, 0, 0, 0};
  for (int i = first; i < last; ++i) {
    const long double h = z[std::size_t(i)];
    sum[0] += std::abs(h);
    for (int k = 2; k <= 4; ++k) sum[k] += std::pow(h, k);
  }
  b.a = double(sum[0] / n);
  b.q = double(std::sqrt(sum[2] / n));
  b.sk = double(sum[3] / n) / std::pow(b.q, 3);
  b.ku = double(sum[4] / n) / std::pow(b.q, 4);
  const std::vector<double> part(z.begin() + first, z.begin() + last);
  std::vector<double> sorted = part;
  std::sort(sorted.begin(), sorted.end());
  b.t = sorted.back() - sorted.front();
  for (int k = 0; k < sections; ++k) {
    std::vector<double> section(part.begin() + k * n / sections,
                                part.begin() + (k + 1) * n / sections);
    std::sort(section.begin(), section.end());
    b.p += section.back() / sections;
    b.v += -section.front() / sections;
    b.zx = std::max(b.zx, section.back() - section.front());
  }
  b.z = b.p + b.v;
  std::vector<double> elements = brute_elements(part, 0.1 * b.p, 0.1 * b.v);
  std::vector<double> back(part.rbegin(), part.rend());
  const std::vector<double> more = brute_elements(back, 0.1 * b.p, 0.1 * b.v);
  elements.insert(elements.end(), more.begin(), more.end());
  for (const double length : elements) b.sm += length * step / double(elements.size());
  int counted = 0;
  for (int i = std::max(first, 3); i < std::min(last, int(z.size()) - 3); ++i, ++counted) {
    // the derivative of the polynomial through seven places
    double slope = 0.0;
    for (int j = -3; j <= 3; ++j) {
      if (j == 0) continue;
      double share = 1.0 / j;
      for (int k = -3; k <= 3; ++k)
        if (k != 0 && k != j) share *= double(-k) / double(j - k);
      slope += share * z[std::size_t(i + j)] / step;
    }
    b.dq += slope * slope;
  }
  b.dq = counted > 0 ? std::sqrt(b.dq / counted) : 0.0;
  return b;
}

}  // namespace abbe::test
