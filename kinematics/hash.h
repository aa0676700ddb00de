#pragma once

#include <cstdint>
#include <string_view>

/// 64 bits made of bytes or of a seed, the same on every computer: check sums, identities, chance.
namespace abbe {

inline constexpr std::uint64_t fnv_1a_basis = 0xcbf29ce484222325u;

/// Hash FNV-1a (Fowler, Noll, Vo) of bytes.
/// @param hash  of the bytes before them, or a basis of one's own
constexpr std::uint64_t fnv_1a(std::string_view bytes, std::uint64_t hash = fnv_1a_basis) {
  for (const char byte : bytes) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
  return hash;
}

/// SplitMix64 (Steele, Lea, Flood 2014): a state that grows by `golden`, each seen `mixed`.
namespace split_mix {

inline constexpr std::uint64_t golden = 0x9e3779b97f4a7c15u;  ///< 2^64 / golden ratio, odd

/// Every bit of a state stirs every bit of the result.
constexpr std::uint64_t mixed(std::uint64_t state) {
  state = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9u;
  state = (state ^ (state >> 27)) * 0x94d049bb133111ebu;
  return state ^ (state >> 31);
}

/// State from which one of the streams of a seed begins; neighbours have nothing in common.
constexpr std::uint64_t stream(std::uint64_t seed, std::uint64_t number) {
  return mixed(mixed(seed + golden) + golden * number);
}

/// 0 to 1, without 1, of the upper 53 bits.
constexpr double unit(std::uint64_t bits) { return double(bits >> 11) * 0x1p-53; }

}  // namespace split_mix
}  // namespace abbe
