#pragma once

#include "tests/test.h"

namespace abbe::cutting {

/// Numbers, directions and turns, the same for the same seed.
template <class Engine>
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : engine_(seed) {}

  double in(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  /// 10 to the power of something between.
  double decades(double low, double high) { return std::pow(10.0, in(low, high)); }
  /// Now and then nothing, or 1e-9 up to the most there may be.
  double some(double most) { return in(0, 4) < 1 ? 0.0 : most * decades(-8, 0); }
  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(engine_); }
  bool once_in(int n) { return below(n) == 0; }

  Vector3d any() { return {in(-1, 1), in(-1, 1), in(-1, 1)}; }
  Vector3d direction() {
    std::normal_distribution<double> normal;
    return Vector3d(normal(engine_), normal(engine_), normal(engine_)).normalized();
  }
  Vector3d near(const Vector3d& direction, double spread) {
    return (direction + spread * any()).normalized();
  }
  Vector3d turned(const Vector3d& v, double angle) {
    return (std::cos(angle) * v + std::sin(angle) * v.cross(any()).normalized()).normalized();
  }
  /// To every side alike.
  Vector3d turned_evenly(const Vector3d& v, double angle) {
    const Vector3d across = v.cross(direction()).normalized();
    return (std::cos(angle) * v + std::sin(angle) * across).normalized();
  }
  Matrix3d rotation(double largest) {
    const Vector3d v = any() * largest;
    return Eigen::AngleAxisd(v.norm(), v.stableNormalized()).toRotationMatrix();
  }

 private:
  Engine engine_;
};

using Random = RandomNumbers<std::mt19937_64>;
using OracleRandom = RandomNumbers<std::mt19937>;

/// How many times as long a test runs where ABBE_LONG is set.
inline int longer(int factor) { return std::getenv("ABBE_LONG") ? factor : 1; }

}  // namespace abbe::cutting
