#include "sim/report/page_data.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "sim/report/map_formats.h"

namespace abbe::sim {

using nlohmann::ordered_json;

namespace {

/// Returns a 10-bit number with two zero bits after each bit.
std::uint32_t spread_bits(std::uint32_t number) {
  std::uint32_t spread = 0;
  for (int k = 0; k < 10; ++k) spread |= (number >> k & 1u) << 3 * k;
  return spread;
}

}  // namespace

std::vector<Eigen::Index> morton_order(const Eigen::MatrixX3d& vertices) {
  std::vector<Eigen::Index> order(std::size_t(vertices.rows()));
  if (order.empty()) return order;
  const Eigen::RowVector3d corner = vertices.colwise().minCoeff();
  const double size = (vertices.colwise().maxCoeff() - corner).maxCoeff();
  const double cells_per_mm = size > 0.0 ? 1023.0 / size : 0.0;
  std::vector<std::uint32_t> code;
  for (const auto& vertex : vertices.rowwise()) {
    const Eigen::RowVector3d cell = (vertex - corner) * cells_per_mm;
    code.push_back(spread_bits(std::uint32_t(cell.x())) |
                   spread_bits(std::uint32_t(cell.y())) << 1 |
                   spread_bits(std::uint32_t(cell.z())) << 2);
  }
  std::iota(order.begin(), order.end(), Eigen::Index(0));
  std::ranges::stable_sort(order, {}, [&](Eigen::Index v) { return code[std::size_t(v)]; });
  return order;
}

Eigen::MatrixXi sorted_triangles(const cutting::Triangles& triangles,
                                 const std::vector<Eigen::Index>& order) {
  std::vector<int> number(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) number[std::size_t(order[k])] = int(k);
  std::vector<std::array<int, 3>> sorted;
  for (const auto& triangle : triangles.rowwise()) {
    std::array<int, 3> corners;
    for (int k = 0; k < 3; ++k) corners[std::size_t(k)] = number[std::size_t(triangle[k])];
    std::ranges::rotate(corners, std::ranges::min_element(corners));
    sorted.push_back(corners);
  }
  std::ranges::sort(sorted);
  Eigen::MatrixXi result(triangles.rows(), 3);
  for (Eigen::Index t = 0; t < result.rows(); ++t)
    for (int k = 0; k < 3; ++k) result(t, k) = sorted[std::size_t(t)][std::size_t(k)];
  return result;
}

namespace {

/// Returns a signed difference as an unsigned number, small for a small magnitude, so that the
/// higher bytes are mostly zero.
std::uint32_t zigzag(std::int32_t difference) {
  return std::uint32_t(difference) << 1 ^ std::uint32_t(difference >> 31);
}

/// Returns the differences of consecutive numbers, column by column.
/// @param reference  (n) subtracted from the numbers first; null: none
std::vector<std::uint32_t> coded_differences(const Eigen::MatrixXi& numbers,
                                             const Eigen::VectorXi* reference) {
  constexpr std::uint32_t missing_code = 0xffffffffu;
  std::vector<std::uint32_t> codes;
  codes.reserve(std::size_t(numbers.size()));
  for (const auto& column : numbers.colwise()) {
    int preceding = 0;
    for (Eigen::Index row = 0; row < numbers.rows(); ++row) {
      if (column[row] == missing) {
        codes.push_back(missing_code);
        continue;
      }
      const bool has_reference = reference && (*reference)[row] != missing;
      const int number = column[row] - (has_reference ? (*reference)[row] : 0);
      codes.push_back(zigzag(number - preceding));
      preceding = number;
    }
  }
  return codes;
}

/// Returns the zlib stream of the bytes of all codes, the lowest bytes first. Bytes of one weight
/// resemble each other, so that deflate finds repetitions.
std::string deflated(const std::vector<std::uint32_t>& codes) {
  std::string bytes;
  bytes.reserve(4 * codes.size());
  for (int shift = 0; shift < 32; shift += 8)
    for (const std::uint32_t code : codes) bytes += char(code >> shift & 0xffu);
  return deflate_bytes(bytes, DeflateHeader::Zlib);
}

struct ColumnRange {
  double low = std::numeric_limits<double>::infinity(), high = -low;
};

/// Returns the range of the values that are not NaN; zero if there are none.
ColumnRange value_range(const Eigen::Ref<const Eigen::VectorXd>& values) {
  ColumnRange range;
  for (const double value : values) {
    if (std::isinf(value)) throw std::invalid_argument("a value to pack is infinite");
    if (std::isnan(value)) continue;
    range = {std::min(range.low, value), std::max(range.high, value)};
  }
  return range.low > range.high ? ColumnRange{0.0, 0.0} : range;
}

}  // namespace

PackedColumns pack_numbers(const Eigen::MatrixXi& numbers,
                           const std::vector<const Eigen::VectorXi*>& references) {
  for (const int number : numbers.reshaped())
    if (number != missing && std::abs(number) > max_packed)
      throw std::invalid_argument("a number to pack is too large: " + std::to_string(number));
  PackedColumns packed{numbers.rows(), numbers.cols(), {}, {}, -1, {}};
  std::string smallest = deflated(coded_differences(numbers, nullptr));
  for (std::size_t r = 0; r < references.size(); ++r) {
    std::string bytes = deflated(coded_differences(numbers, references[r]));
    if (bytes.size() >= smallest.size()) continue;
    smallest = std::move(bytes);
    packed.reference = int(r);
  }
  packed.text = base64(smallest);
  return packed;
}

Eigen::MatrixXi numbers_of(const Eigen::MatrixXd& values, double step,
                           const std::vector<double>& offset) {
  if (!(step > 0.0) || !std::isfinite(step))
    throw std::invalid_argument("the step must be positive, but is " + std::to_string(step));
  Eigen::MatrixXi numbers(values.rows(), values.cols());
  for (Eigen::Index column = 0; column < values.cols(); ++column)
    for (Eigen::Index row = 0; row < values.rows(); ++row) {
      const double number = std::round((values(row, column) - offset[std::size_t(column)]) / step);
      if (std::abs(number) > double(max_packed))
        throw std::invalid_argument(
            "a value is infinite, or too far from the others for this step");
      numbers(row, column) = std::isnan(number) ? missing : int(number);
    }
  return numbers;
}

PackedColumns pack_values(const Eigen::MatrixXd& values, double step) {
  std::vector<double> offset;
  for (const auto& column : values.colwise()) {
    const ColumnRange range = value_range(column);
    // The offset is the middle of the range, so that signed 16 bits suffice. Both ends are halved
    // before the sum, which could overflow.
    offset.push_back(range.low / 2.0 + range.high / 2.0);
  }
  PackedColumns packed = pack_numbers(numbers_of(values, step, offset));
  packed.step.assign(offset.size(), step);
  packed.offset = std::move(offset);
  return packed;
}

double step_for_16_bits(const Eigen::MatrixXd& values) {
  double half_range = 0.0;
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    const ColumnRange range = value_range(values.col(column));
    half_range = std::max(half_range, range.high / 2.0 - range.low / 2.0);
  }
  // Numbers from -32767 to 32767 about the middle of the range.
  return half_range > 0.0 ? half_range / 32767.0 : 1.0;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view digits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return i + k < bytes.size() ? std::uint32_t(static_cast<unsigned char>(bytes[i + k])) : 0u;
    };
    const std::uint32_t three = byte(0) << 16 | byte(1) << 8 | byte(2);
    text += digits[three >> 18];
    text += digits[three >> 12 & 63];
    text += i + 1 < bytes.size() ? digits[three >> 6 & 63] : '=';
    text += i + 2 < bytes.size() ? digits[three & 63] : '=';
  }
  return text;
}

void add(PageData& data, const std::string& name, const PackedColumns& packed,
         const std::vector<std::string>& references) {
  ordered_json description{{"n", packed.rows}, {"components", packed.columns}};
  if (packed.reference >= 0) description["reference"] = references[std::size_t(packed.reference)];
  if (!packed.step.empty()) {
    description["offset"] = packed.offset;
    description["step"] = packed.step;
  }
  data.index["arrays"][name] = description;
  data.blocks += "<script type=\"text/plain\" id=\"a:" + name + "\">" + packed.text + "</script>\n";
}

ordered_json to_json(const Eigen::Isometry3d& T) {
  const Eigen::Matrix4d m = T.matrix();
  return std::vector<double>(m.data(), m.data() + m.size());
}

ordered_json to_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace abbe::sim
