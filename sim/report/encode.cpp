#include "sim/report/encode.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "cutting/hilbert.h"
#include "sim/report/zip_archive.h"

namespace abbe::sim {
namespace {

/// Differences within every column, then plane after plane of their bytes.
template <typename Unsigned>
std::string planes_of(const Eigen::Matrix<std::uint32_t, Eigen::Dynamic, Eigen::Dynamic>& numbers) {
  const std::size_t count = std::size_t(numbers.size());
  std::string planes(count * sizeof(Unsigned), '\0');
  std::size_t at = 0;
  for (Eigen::Index column = 0; column < numbers.cols(); ++column) {
    Unsigned last = 0;
    for (Eigen::Index row = 0; row < numbers.rows(); ++row, ++at) {
      const Unsigned number = Unsigned(numbers(row, column));
      const std::uint32_t difference = Unsigned(number - last);
      last = number;
      for (std::size_t k = 0; k < sizeof(Unsigned); ++k)
        planes[k * count + at] = char(difference >> (8 * k) & 0xffu);
    }
  }
  return planes;
}

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
};

Range range_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  Range range;
  for (const double value : values) {
    if (std::isinf(value)) throw std::invalid_argument("a value to pack is infinite");
    if (std::isnan(value)) continue;
    range = {std::min(range.low, value), std::max(range.high, value)};
  }
  return range.low > range.high ? Range{0.0, 0.0} : range;
}

}  // namespace

Packed packed_values(const Eigen::MatrixXd& values, double step) {
  if (!(step > 0.0) || !std::isfinite(step))
    throw std::invalid_argument("a step must be positive, and is " + std::to_string(step));
  Packed packed{"i16", values.rows(), values.cols(), {}, {}, {}};
  double largest = 0.0;
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    const Range range = range_of(values.col(column));
    packed.offset.push_back(range.low / 2.0 + range.high / 2.0);
    packed.step.push_back(step);
    largest = std::max(largest, std::ceil((range.high / 2.0 - range.low / 2.0) / step - 1e-6));
  }
  if (largest > 2147483646.0)
    throw std::invalid_argument("values are too far apart for their step");
  const bool is_short = largest <= 32767.0;
  if (!is_short) packed.type = "i32";
  const double most = is_short ? 32767.0 : 2147483647.0;
  Eigen::Matrix<std::uint32_t, Eigen::Dynamic, Eigen::Dynamic> numbers(values.rows(),
                                                                       values.cols());
  for (Eigen::Index column = 0; column < values.cols(); ++column)
    for (Eigen::Index row = 0; row < values.rows(); ++row) {
      const double value = values(row, column);
      const double number = std::round((value - packed.offset[std::size_t(column)]) / step);
      numbers(row, column) =
          std::uint32_t(std::isnan(value) ? (is_short ? missing_16 : missing_32)
                                          : std::int32_t(std::clamp(number, -most, most)));
    }
  packed.text = base64(
      deflated(is_short ? planes_of<std::uint16_t>(numbers) : planes_of<std::uint32_t>(numbers),
               DeflateHead::Zlib));
  return packed;
}

double step_of_16_bits(const Eigen::MatrixXd& values) {
  double half = 0.0;
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    const Range range = range_of(values.col(column));
    half = std::max(half, range.high / 2.0 - range.low / 2.0);
  }
  return half > 0.0 ? half / 32767.0 : 1.0;
}

Packed packed_numbers(const Eigen::MatrixXi& numbers) {
  if (numbers.size() > 0 && numbers.minCoeff() < 0)
    throw std::invalid_argument("a number to pack is negative");
  return {
      "u32",
      numbers.rows(),
      numbers.cols(),
      {},
      {},
      base64(deflated(planes_of<std::uint32_t>(numbers.cast<std::uint32_t>()), DeflateHead::Zlib))};
}

Packed packed_bytes(std::span<const std::uint8_t> numbers) {
  return {"u8", Eigen::Index(numbers.size()),
          1,    {},
          {},   base64(deflated({numbers.begin(), numbers.end()}, DeflateHead::Zlib))};
}

std::vector<Eigen::Index> order_along_curve(const Eigen::MatrixX3d& points) {
  std::vector<Eigen::Index> order(std::size_t(points.rows()));
  std::iota(order.begin(), order.end(), Eigen::Index(0));
  if (order.empty()) return order;
  const Eigen::RowVector3d low = points.colwise().minCoeff();
  const double size = (points.colwise().maxCoeff() - low).maxCoeff();
  if (!(size > 0.0)) return order;
  std::vector<std::uint64_t> place;
  for (const auto& point : points.rowwise()) {
    const Eigen::RowVector3d at = (point - low) * (65535.0 / size);
    place.push_back(cutting::hilbert_code<16>(std::uint32_t(at[0]), std::uint32_t(at[1]),
                                              std::uint32_t(at[2])));
  }
  std::ranges::stable_sort(order, {}, [&](Eigen::Index k) { return place[std::size_t(k)]; });
  return order;
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

}  // namespace abbe::sim
