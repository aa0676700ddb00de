#pragma once

#include <experimental/simd>

/// Eight numbers in single precision at a time, and eight vectors of three.
namespace abbe::cutting {

namespace stdx = std::experimental;
using Eight = stdx::simd<float, stdx::simd_abi::deduce_t<float, 8>>;
using Mask8 = Eight::mask_type;

inline constexpr float tiny = 1e-30f;  ///< keeps quotients of zero lengths finite

inline Eight load(const float* values) { return Eight(values, stdx::element_aligned); }

/// Vectors of three, in several lanes.
template <class T>
struct Triple {
  T x, y, z;
};
using Vector8 = Triple<Eight>;

inline Vector8 load(const float (&v)[3][8]) { return {load(v[0]), load(v[1]), load(v[2])}; }
inline Vector8 spread(const float (&v)[3]) { return {Eight(v[0]), Eight(v[1]), Eight(v[2])}; }
template <class T>
[[gnu::always_inline]] inline Triple<T> operator-(const Triple<T>& a, const Triple<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
[[gnu::always_inline]] inline Triple<T> operator+(const Triple<T>& a, const Triple<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
[[gnu::always_inline]] inline Triple<T> operator*(const T& s, const Triple<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
[[gnu::always_inline]] inline T dot(const Triple<T>& a, const Triple<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
[[gnu::always_inline]] inline Triple<T> cross(const Triple<T>& a, const Triple<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Never zero, for the squares of tiny parts may vanish: then too large.
template <class T>
[[gnu::always_inline]] inline T length_of(const Triple<T>& a) {
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
