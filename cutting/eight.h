#pragma once

#include <experimental/simd>

/// Eight numbers in single precision at a time, and eight vectors of three.
namespace abbe::cutting {

namespace stdx = std::experimental;
using Eight = stdx::simd<float, stdx::simd_abi::deduce_t<float, 8>>;
using Mask8 = Eight::mask_type;

inline constexpr float tiny = 1e-30f;  ///< keeps quotients of zero lengths finite

inline Eight load(const float* values) { return Eight(values, stdx::element_aligned); }

struct Vector8 {
  Eight x, y, z;
};

inline Vector8 load(const float (&v)[3][8]) { return {load(v[0]), load(v[1]), load(v[2])}; }
inline Vector8 spread(const float (&v)[3]) { return {Eight(v[0]), Eight(v[1]), Eight(v[2])}; }
[[gnu::always_inline]] inline Vector8 operator-(const Vector8& a, const Vector8& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
[[gnu::always_inline]] inline Vector8 operator+(const Vector8& a, const Vector8& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
[[gnu::always_inline]] inline Vector8 operator*(const Eight& s, const Vector8& a) {
  return {s * a.x, s * a.y, s * a.z};
}
[[gnu::always_inline]] inline Eight dot(const Vector8& a, const Vector8& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
[[gnu::always_inline]] inline Vector8 cross(const Vector8& a, const Vector8& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Never zero, for the squares of tiny parts may vanish: then too large.
[[gnu::always_inline]] inline Eight length_of(const Vector8& a) {
  return stdx::sqrt(dot(a, a) + tiny);
}
[[gnu::always_inline]] inline Vector8 clamp(const Vector8& p, const Vector8& low,
                                            const Vector8& high) {
  return {stdx::min(stdx::max(p.x, low.x), high.x), stdx::min(stdx::max(p.y, low.y), high.y),
          stdx::min(stdx::max(p.z, low.z), high.z)};
}

/// Lane i of the mask as bit i.
[[gnu::always_inline]] inline unsigned bits(const Mask8& mask) {
  return unsigned(mask.__to_bitset().to_ulong());  // libstdc++'s own: one instruction
}

}  // namespace abbe::cutting
