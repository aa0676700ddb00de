#pragma once

#include <zlib.h>
#include "sim/report/page_data.h"
#include "tests/test.h"

/// What a page does with its data, written from the description in page_data.h: a second unpacker
/// beside render/report/unpack.js.
namespace abbe::sim::unpack {

inline std::string bytes_of(const std::string& base64) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : base64) {
    if (c == '=') break;
    bits = bits << 6 | unsigned(digits.find(c));
    count += 6;
    if (count >= 8) bytes += char(bits >> (count -= 8) & 0xffu);
  }
  return bytes;
}

/// Returns the columns (rows x columns), `missing` where there is no number.
inline Eigen::MatrixXi numbers(const PackedColumns& packed,
                               const Eigen::VectorXi* reference = nullptr) {
  const std::string deflated = bytes_of(packed.text);
  const auto size = std::size_t(packed.rows * packed.columns);
  std::string bytes(4 * size, '\0');
  uLongf length = uLongf(bytes.size());
  if (uncompress(reinterpret_cast<Bytef*>(bytes.data()), &length,
                 reinterpret_cast<const Bytef*>(deflated.data()), uLong(deflated.size())) != Z_OK ||
      length != bytes.size())
    throw std::runtime_error("the packed columns are no zlib stream of their size");
  Eigen::MatrixXi result(packed.rows, packed.columns);
  for (Index c = 0; c < packed.columns; ++c) {
    std::int64_t sum = 0;
    for (Index r = 0; r < packed.rows; ++r) {
      std::uint64_t code = 0;
      for (std::size_t k = 0; k < 4; ++k)
        code |= std::uint64_t(
                    static_cast<unsigned char>(bytes[k * size + std::size_t(c * packed.rows + r)]))
                << 8 * k;
      if (code == 0xffffffffu) {
        result(r, c) = missing;
        continue;
      }
      sum += code % 2 == 0 ? std::int64_t(code / 2) : -std::int64_t(code / 2) - 1;
      const bool is_referred = reference && (*reference)[r] != missing;
      result(r, c) = int(sum + (is_referred ? (*reference)[r] : 0));
    }
  }
  return result;
}

}  // namespace abbe::sim::unpack
