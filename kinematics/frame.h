#pragma once

#include <array>

#include <experimental/simd>
#ifdef __AVX__
#include <immintrin.h>
#endif

#include <Eigen/Geometry>

#include "kinematics/chain.h"

/// Rigid transforms as four columns of four numbers (SIMD), for transforms composed by the million.
/// Sums are formed in the order in which Eigen forms them for a Pose, so that both give the same
/// bits: the three products of the upper two rows are accumulated one after another, fused where
/// the processor supports it; the lowest row is a + (b + c).
namespace abbe::kinematics {

namespace stdx = std::experimental;
using Vector4 = stdx::simd<double, stdx::simd_abi::deduce_t<double, 4>>;

/// A rigid transform: columns of its rotation, and its translation. The fourth numbers are zero.
struct Frame {
  Vector4 x, y, z, p;
};

inline Vector4 vector4(double a, double b, double c, double d) {
  const std::array<double, 4> elements{a, b, c, d};
  return Vector4([&](auto i) { return elements[i]; });
}

inline Frame identity_frame() {
  return {vector4(1, 0, 0, 0), vector4(0, 1, 0, 0), vector4(0, 0, 1, 0), Vector4(0.0)};
}

inline Frame to_frame(const Pose& T) {
  const auto column = [&](int k) { return vector4(T(0, k), T(1, k), T(2, k), 0.0); };
  return {column(0), column(1), column(2), column(3)};
}

inline Pose to_pose(const Frame& T) {
  Pose pose;
  double* const m = pose.data();
  T.x.copy_to(m, stdx::element_aligned);
  T.y.copy_to(m + 4, stdx::element_aligned);
  T.z.copy_to(m + 8, stdx::element_aligned);
  T.p.copy_to(m + 12, stdx::element_aligned);
  m[15] = 1.0;
  return pose;
}

inline Eigen::Vector3d vector(const Vector4& v) { return {v[0], v[1], v[2]}; }

/// Returns a * b + c, fused where Eigen fuses it.
[[gnu::always_inline]] inline Vector4 fused(const Vector4& a, const Vector4& b, const Vector4& c) {
#ifdef __FMA__
  return Vector4(_mm256_fmadd_pd(__m256d(a), __m256d(b), __m256d(c)));
#else
  return a * b + c;
#endif
}

/// Returns the first two elements of a and the last two of b.
[[gnu::always_inline]] inline Vector4 blend_halves(const Vector4& a, const Vector4& b) {
#ifdef __AVX__
  return Vector4(_mm256_blend_pd(__m256d(a), __m256d(b), 0b1100));
#else
  return vector4(a[0], a[1], b[2], b[3]);
#endif
}

/// Returns R * v, R the rotation of T.
[[gnu::always_inline]] inline Vector4 rotate(const Frame& T, double v_x, double v_y, double v_z) {
  const Vector4 x = T.x * v_x;
  return blend_halves(fused(T.z, Vector4(v_z), fused(T.y, Vector4(v_y), x)),
                      x + (T.y * v_y + T.z * v_z));
}
inline Vector4 rotate(const Frame& T, const Eigen::Vector3d& v) {
  return rotate(T, v.x(), v.y(), v.z());
}

/// Returns T * point.
inline Eigen::Vector3d transform(const Frame& T, const Eigen::Vector3d& point) {
  const Vector4 sum =
      fused(T.z, Vector4(point.z()), fused(T.y, Vector4(point.y()), T.x * point.x()));
  return vector(sum + T.p);
}

inline Frame operator*(const Frame& a, const Frame& b) {
  return {rotate(a, b.x[0], b.x[1], b.x[2]), rotate(a, b.y[0], b.y[1], b.y[2]),
          rotate(a, b.z[0], b.z[1], b.z[2]), rotate(a, b.p[0], b.p[1], b.p[2]) + a.p};
}

inline Frame inverse(const Frame& T) {
  const auto row = [&](int k) { return vector4(T.x[k], T.y[k], T.z[k], 0.0); };
  Frame result{row(0), row(1), row(2), Vector4(0.0)};
  const Frame negative{-result.x, -result.y, -result.z, Vector4(0.0)};
  result.p = rotate(negative, T.p[0], T.p[1], T.p[2]);
  return result;
}

// Functions that move a frame are always inlined: the frame then stays in registers along the
// chain.

/// Returns T followed by a rotation about a line.
[[gnu::always_inline]] inline Frame rotate_about_line(const Frame& T,
                                                      const Eigen::Vector3d& direction,
                                                      const Eigen::Vector3d& point, double angle) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, direction).toRotationMatrix();
  const Eigen::Vector3d shift = point - R * point;
  return {rotate(T, R.col(0)), rotate(T, R.col(1)), rotate(T, R.col(2)), T.p + rotate(T, shift)};
}

/// Returns T followed by the nominal motion of a joint along a direction.
/// @param travel  of the carriage itself, mm or rad
[[gnu::always_inline]] inline Frame apply_motion(const Frame& T, const Joint& joint,
                                                 const Eigen::Vector3d& direction, double travel) {
  if (joint.motion == Motion::Rotary) return rotate_about_line(T, direction, joint.point_b, travel);
  Frame result = T;
  if (joint.motion == Motion::Linear) result.p += rotate(T, travel * direction);
  return result;
}

}  // namespace abbe::kinematics
