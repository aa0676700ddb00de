#include "tests/oracles/beam.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>
#include <Eigen/Sparse>

namespace abbe::oracles {
namespace {

/// Cubic Hermite functions on 0 .. h at t = x / h: of the value and slope at 0, then at h.
struct Hermite {
  std::array<double, 4> f, first, second;
};

Hermite hermite(double t, double h) {
  return {
      {1 - 3 * t * t + 2 * t * t * t, h * (t - 2 * t * t + t * t * t), 3 * t * t - 2 * t * t * t,
       h * (t * t * t - t * t)},
      {(-6 * t + 6 * t * t) / h, 1 - 4 * t + 3 * t * t, (6 * t - 6 * t * t) / h, 3 * t * t - 2 * t},
      {(-6 + 12 * t) / (h * h), (-4 + 6 * t) / h, (6 - 12 * t) / (h * h), (6 * t - 2) / h}};
}

constexpr std::array<double, 4> gauss_t{0.06943184420297371, 0.33000947820757187,
                                        0.66999052179242813, 0.93056815579702629};
constexpr std::array<double, 4> gauss_w{0.17392742256872693, 0.32607257743127307,
                                        0.32607257743127307, 0.17392742256872693};

struct Element {
  double length, stiffness;
};

std::vector<Element> elements(std::span<const BeamPiece> pieces, double place) {
  std::vector<Element> result;
  double from = 0.0;
  for (const BeamPiece& piece : pieces) {
    const double to = from + piece.length;
    std::vector<double> ends{from, to};
    const double near = 1e-9 * piece.length;
    if (place > from + near && place < to - near) ends.insert(ends.begin() + 1, place);
    for (std::size_t i = 0; i + 1 < ends.size(); ++i)
      for (int k = 0; k < 4; ++k)
        result.push_back({(ends[i + 1] - ends[i]) / 4.0, piece.bending_stiffness});
    from = to;
  }
  return result;
}

/// Ends of elements from 0 to `length`, the first of them `finest` or a little less.
std::vector<double> graded(double length, double finest) {
  std::vector<double> ends{0.0};
  for (double size = finest; ends.back() < length; size = std::min(1.4 * size, 0.2))
    ends.push_back(ends.back() + size);
  const double shrink = length / ends.back();
  for (double& end : ends) end *= shrink;
  return ends;
}

std::vector<double> graded_about(double s, double finest) {
  std::vector<double> ends;
  const std::vector<double> below = graded(s, finest);
  for (auto d = below.rbegin(); d != below.rend(); ++d) ends.push_back(s - *d);
  ends.front() = 0.0;
  if (s < 1.0) {
    const std::vector<double> above = graded(1.0 - s, finest);
    for (std::size_t i = 1; i < above.size(); ++i) ends.push_back(s + above[i]);
  }
  return ends;
}

using Matrix16 = Eigen::Matrix<double, 16, 16>;

/// Function 4 a + b is function a of x times function b of y.
Matrix16 plate_element(double hx, double hy, double nu) {
  Matrix16 K = Matrix16::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      const Hermite x = hermite(gauss_t[i], hx), y = hermite(gauss_t[j], hy);
      Eigen::Matrix<double, 16, 1> xx, yy, xy;
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < 4; ++b) {
          const Eigen::Index n = Eigen::Index(4 * a + b);
          xx[n] = x.second[a] * y.f[b];
          yy[n] = x.f[a] * y.second[b];
          xy[n] = x.first[a] * y.first[b];
        }
      }
      const double dA = gauss_w[i] * gauss_w[j] * hx * hy;
      K += dA * (xx * xx.transpose() + yy * yy.transpose() +
                 nu * (xx * yy.transpose() + yy * xx.transpose()) +
                 2.0 * (1.0 - nu) * xy * xy.transpose());
    }
  }
  return K;
}

}  // namespace

BeamEnd beam_end(std::span<const BeamPiece> pieces, double place, double force, double couple) {
  // long double: a thick piece beside a thin one is badly conditioned
  using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;
  const std::vector<Element> parts = elements(pieces, place);
  const Eigen::Index n = 2 * Eigen::Index(parts.size() + 1);
  Matrix K = Matrix::Zero(n, n);
  Vector load = Vector::Zero(n);
  double at = 0.0;
  for (std::size_t e = 0; e < parts.size(); ++e) {
    const double h = parts[e].length;
    for (std::size_t g = 0; g < 4; ++g) {
      const Hermite N = hermite(gauss_t[g], h);
      const Eigen::Matrix<long double, 4, 1> B(N.second[0], N.second[1], N.second[2], N.second[3]);
      K.block<4, 4>(2 * Eigen::Index(e), 2 * Eigen::Index(e)) +=
          (static_cast<long double>(gauss_w[g]) * h * parts[e].stiffness) * B * B.transpose();
    }
    at += h;
    if (std::abs(at - place) < 1e-6 * h)
      load.segment<2>(2 * Eigen::Index(e) + 2) = Eigen::Matrix<long double, 2, 1>(force, couple);
  }
  if (load.isZero(0.0)) throw std::logic_error("the load is not on the beam");
  const Vector u = K.bottomRightCorner(n - 2, n - 2).ldlt().solve(load.tail(n - 2));
  return {double(u[n - 4]), double(u[n - 3])};
}

double plate_under_load(double s, double nu, double finest) {
  const std::vector<double> xs = graded(6.0, finest), ys = graded_about(s, finest);
  const int nx = int(xs.size()), ny = int(ys.size());
  // per node: w, w_y, w_x, w_xy; those that a symmetry at x = 0 and the clamp leave free are
  // counted
  std::vector<int> number(std::size_t(nx * ny * 4), -1);
  int free = 0;
  for (int i = 0; i < nx; ++i)
    for (int j = 1; j < ny; ++j)
      for (int k = 0; k < (i == 0 ? 2 : 4); ++k) number[std::size_t((i * ny + j) * 4 + k)] = free++;
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i + 1 < nx; ++i) {
    for (int j = 0; j + 1 < ny; ++j) {
      const Matrix16 K = plate_element(xs[std::size_t(i) + 1] - xs[std::size_t(i)],
                                       ys[std::size_t(j) + 1] - ys[std::size_t(j)], nu);
      std::array<int, 16> at;
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b)
          at[std::size_t(4 * a + b)] =
              number[std::size_t(((i + a / 2) * ny + j + b / 2) * 4 + 2 * (a % 2) + b % 2)];
      for (int a = 0; a < 16; ++a)
        for (int b = 0; b < 16; ++b)
          if (at[std::size_t(a)] >= 0 && at[std::size_t(b)] >= 0)
            entries.emplace_back(at[std::size_t(a)], at[std::size_t(b)], K(a, b));
    }
  }
  Eigen::SparseMatrix<double> K(free, free);
  K.setFromTriplets(entries.begin(), entries.end());
  const auto loaded = std::min_element(
      ys.begin(), ys.end(), [&](double a, double b) { return std::abs(a - s) < std::abs(b - s); });
  const int node = number[std::size_t((loaded - ys.begin()) * 4)];
  Eigen::VectorXd load = Eigen::VectorXd::Zero(free);
  load[node] = 0.5;  // the other half bears the other half
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(K);
  return solver.solve(load)[node];
}

}  // namespace abbe::oracles
