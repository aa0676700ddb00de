#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

/// Numbers packed into the text of a page: wrapping differences of whole numbers, byte planes (all
/// lowest bytes, then all second ones), zlib, base64. A browser unpacks it with
/// DecompressionStream.
namespace abbe::sim {

/// Columns of whole numbers, packed one after the other; a value is offset + step times its number.
struct Packed {
  std::string type;  ///< "u8", "i16", "i32" or "u32", little endian
  Eigen::Index rows = 0, columns = 0;
  std::vector<double> offset, step;  ///< (columns); empty where the numbers are the values
  std::string text;                  ///< base64
};

/// The number that stands for NaN, the least of its type.
inline constexpr std::int32_t missing_16 = -32768, missing_32 = -2147483647 - 1;

/// Values (n x m) to within half a step; 16 bits a number where they suffice, else 32.
/// @throws std::invalid_argument if the step is not positive, a value is infinite, or 32 bits do
///         not suffice
Packed packed_values(const Eigen::MatrixXd& values, double step);

/// The least step with which 16 bits suffice for every column; 1 where all values are one.
double step_of_16_bits(const Eigen::MatrixXd& values);

/// Whole numbers (n x m) as they are. @throws std::invalid_argument if one is negative
Packed packed_numbers(const Eigen::MatrixXi& numbers);

/// One byte a number, without differences.
Packed packed_bytes(std::span<const std::uint8_t> numbers);

/// Rows of points (n x 3) in the order of a Hilbert curve through their box, so that neighbours in
/// the order are neighbours in space and their differences small. Source: Skilling 2004.
std::vector<Eigen::Index> order_along_curve(const Eigen::MatrixX3d& points);

/// RFC 4648, padded.
std::string base64(std::string_view bytes);

}  // namespace abbe::sim
