#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include <Eigen/Core>

namespace abbe::test {

/// The surface on which surfalize holds its parameters and filters
/// (github.com/fredericjs/surfalize, tests/conftest.py): a rippled wave with normal noise of
/// NumPy's legacy generator, seed 0, every 0.1 mm along x, then along y.
struct RippledWave {
  static constexpr int columns = 1000, rows = 700;
  Eigen::MatrixX2d xy;  ///< mm
  Eigen::VectorXd z;    ///< um
};

inline RippledWave rippled_wave() {
  constexpr double turn = 2.0 * std::numbers::pi;
  std::mt19937 bits(0);
  const auto uniform = [&] {
    const std::uint32_t high = bits() >> 5u, low = bits() >> 6u;
    return (high * 67108864.0 + low) / 9007199254740992.0;
  };
  double kept = 0.0;
  bool keeps = false;
  const auto normal = [&] {  // Marsaglia's polar method, the second of a pair first
    if (keeps) {
      keeps = false;
      return kept;
    }
    double x = 0.0, y = 0.0, square = 0.0;
    do {
      x = 2.0 * uniform() - 1.0;
      y = 2.0 * uniform() - 1.0;
      square = x * x + y * y;
    } while (square >= 1.0 || square == 0.0);
    const double f = std::sqrt(-2.0 * std::log(square) / square);
    kept = f * x;
    keeps = true;
    return f * y;
  };
  constexpr int n = RippledWave::columns * RippledWave::rows;
  RippledWave wave{Eigen::MatrixX2d(n, 2), Eigen::VectorXd(n)};
  for (int k = 0; k < n; ++k) {
    const double i = k % RippledWave::columns, j = k / RippledWave::columns, period = 200.0;
    wave.xy.row(k) << 0.1 * i, 0.1 * j;
    wave.z[k] = std::sin(i / period * turn) +
                0.15 * (std::sin((i - 0.5 * period) / period * turn) + 1.0) *
                    std::sin((std::sin(j / 10.0) + i) / 10.0 * turn) +
                normal() / 5.0;
  }
  return wave;
}

}  // namespace abbe::test
