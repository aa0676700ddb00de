#pragma once

#include <cstdint>
#include <string_view>

/// 64-bit hashes that are the same on every computer, for checksums, identifiers and random
/// numbers.
namespace abbe {

inline constexpr std::uint64_t fnv_1a_basis = 0xcbf29ce484222325u;

/// Returns the FNV-1a hash (Fowler, Noll, Vo) of the bytes.
/// @param hash  hash of the preceding bytes, or another initial value
constexpr std::uint64_t fnv_1a(std::string_view bytes, std::uint64_t hash = fnv_1a_basis) {
  for (const char byte : bytes) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
  return hash;
}

/// The random generator SplitMix64 (Steele, Lea, Flood 2014): each step adds `golden` to the state
/// and outputs `mixed(state)`.
namespace split_mix {

inline constexpr std::uint64_t golden = 0x9e3779b97f4a7c15u;  ///< 2^64 / golden ratio, odd

/// Returns the output for a state; every bit of the state affects every bit of the output.
constexpr std::uint64_t mixed(std::uint64_t state) {
  state = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9u;
  state = (state ^ (state >> 27)) * 0x94d049bb133111ebu;
  return state ^ (state >> 31);
}

/// Returns the initial state of the stream of random numbers with this number and seed. Streams of
/// neighbouring numbers or seeds are uncorrelated.
constexpr std::uint64_t stream(std::uint64_t seed, std::uint64_t number) {
  return mixed(mixed(seed + golden) + golden * number);
}

/// Returns the upper 53 bits as a number in [0, 1).
constexpr double unit(std::uint64_t bits) { return double(bits >> 11) * 0x1p-53; }

}  // namespace split_mix
}  // namespace abbe
