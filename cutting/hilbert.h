#pragma once

#include <cstdint>

namespace abbe::cutting {

/// Of a cell number in the grid of `hilbert_code`.
inline constexpr int hilbert_bits = 10;
inline constexpr std::uint32_t hilbert_cells = 1u << hilbert_bits;  ///< a side

/// Place of a cell along the Hilbert curve of a grid of 2^bits cells a side, so that neighbours
/// along the curve are neighbours in space.
/// @param x, y, z  cell numbers, below 2^bits
/// @return 3 bits for each of them
/// Source: J. Skilling, Programming the Hilbert curve, AIP Conf. Proc. 707 (2004) 381.
template <int bits = hilbert_bits>
constexpr std::uint64_t hilbert_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  static_assert(bits > 0 && 3 * bits <= 64);
  constexpr std::uint32_t top = 1u << (bits - 1);
  std::uint32_t axis[3] = {x, y, z};
  for (std::uint32_t bit = top; bit > 1; bit >>= 1) {
    const std::uint32_t below = bit - 1;
    for (std::uint32_t& a : axis) {
      if (a & bit) {
        axis[0] ^= below;
      } else {
        const std::uint32_t swapped = (axis[0] ^ a) & below;
        axis[0] ^= swapped;
        a ^= swapped;
      }
    }
  }
  axis[1] ^= axis[0];
  axis[2] ^= axis[1];
  std::uint32_t gray = 0;
  for (std::uint32_t bit = top; bit > 1; bit >>= 1)
    if (axis[2] & bit) gray ^= bit - 1;
  std::uint64_t code = 0;
  for (int bit = bits - 1; bit >= 0; --bit)
    for (const std::uint32_t a : axis) code = (code << 1) | (((a ^ gray) >> bit) & 1u);
  return code;
}

}  // namespace abbe::cutting
