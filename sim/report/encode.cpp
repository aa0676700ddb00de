#include "sim/report/encode.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "sim/report/range_coder.h"

namespace abbe::sim {
namespace {

struct ColumnRange {
  double low = std::numeric_limits<double>::infinity(), high = -low;
};

ColumnRange range_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  ColumnRange range;
  for (const double value : values) {
    if (std::isinf(value)) throw std::invalid_argument("a value to pack is infinite");
    if (std::isnan(value)) continue;
    range = {std::min(range.low, value), std::max(range.high, value)};
  }
  return range.low > range.high ? ColumnRange{0.0, 0.0} : range;
}

/// Which numbers are known where row k is coded.
std::array<int, 3> known_at(const MeshWalk* walk, int k) {
  if (walk) return walk->known[std::size_t(k)];
  return {k - 1, k - 1, std::max(0, k - 2)};
}

std::int64_t combined(Prediction by, const int* x, const std::array<int, 3>& at) {
  const std::int64_t a = x[at[0]], b = x[at[1]];
  switch (by) {
    case Prediction::Parallelogram:
      return a + b - x[at[2]];
    case Prediction::Middle:
      return (a + b) >> 1;
    case Prediction::Reference:
      break;
  }
  return 0;
}

/// How a column is predicted.
struct Way {
  Prediction by = Prediction::Parallelogram;
  const int* reference = nullptr;
};

std::int64_t predicted(const Way& way, const int* x, int k, const MeshWalk* walk) {
  if (k == 0) return way.reference ? way.reference[0] : 0;
  const std::array<int, 3> at = known_at(walk, k);
  std::int64_t number = combined(way.by, x, at);
  if (way.reference) number += way.reference[k] - combined(way.by, way.reference, at);
  return std::clamp<std::int64_t>(number, -largest_packed, largest_packed);
}

/// About how many bits a column takes.
double bits_of(const Way& way, const std::vector<int>& x, const PackOptions& options) {
  double bits = 0.0;
  for (int k = 0; k < int(x.size()); ++k)
    bits += std::log2(
        1.0 + std::abs(double(x[std::size_t(k)] - predicted(way, x.data(), k, options.walk))));
  return bits;
}

/// A missing number stands, for those after it, for what was predicted of itself.
std::vector<int> filled(const Eigen::Ref<const Eigen::VectorXi>& numbers, const Way& way,
                        const PackOptions& options) {
  std::vector<int> x(numbers.begin(), numbers.end());
  for (int k = 0; k < int(x.size()); ++k)
    if (int& one = x[std::size_t(k)]; one == missing)
      one = int(predicted(way, x.data(), k, options.walk));
  return x;
}

/// @return the numbers as `filled`
std::vector<int> code(RangeEncoder& coder, const Eigen::Ref<const Eigen::VectorXi>& numbers,
                      const Way& way, const PackOptions& options, bool has_missing) {
  std::vector<int> x = filled(numbers, way, options);
  NumberModel model;
  std::array<Chance, 4> is_missing;
  std::vector<int> length(x.size(), 0);
  for (int k = 0; k < int(x.size()); ++k) {
    std::array<int, 3> at{};
    int context = 0;
    if (k > 0) {
      at = known_at(options.walk, k);
      context = (length[std::size_t(at[0])] + length[std::size_t(at[1])] +
                 length[std::size_t(k) - 1] + 1) /
                3;
    }
    if (has_missing) {
      const bool before = k > 0 && numbers[at[0]] == missing,
                 beside = k > 0 && numbers[at[1]] == missing;
      coder.bit(is_missing[std::size_t(before) + 2 * std::size_t(beside)], numbers[k] == missing);
      if (numbers[k] == missing) continue;
    }
    length[std::size_t(k)] =
        coder.number(model, context, x[std::size_t(k)] - predicted(way, x.data(), k, options.walk));
  }
  return x;
}

/// A way, and the number of its reference.
struct Candidate {
  Way way;
  int reference = -1;
};

/// The way that takes the fewest bits, by the first numbers of the column.
Candidate best_way(const Eigen::Ref<const Eigen::VectorXi>& numbers, const PackOptions& options) {
  constexpr Eigen::Index enough = 1 << 15;
  const auto first = numbers.head(std::min(enough, numbers.size()));
  std::vector<Candidate> candidates;
  for (int r = -1; r < int(options.references.size()); ++r)
    for (const Prediction by :
         {Prediction::Parallelogram, Prediction::Middle, Prediction::Reference})
      if (r >= 0 || by != Prediction::Reference)
        candidates.push_back(
            {{by, r < 0 ? nullptr : options.references[std::size_t(r)]->data()}, r});
  std::vector<double> bits(candidates.size());
  tbb::parallel_for(std::size_t(0), candidates.size(), [&](std::size_t k) {
    const Way& way = candidates[k].way;
    bits[k] = bits_of(way, filled(first, way, options), options);
  });
  return candidates[std::size_t(std::ranges::min_element(bits) - bits.begin())];
}

}  // namespace

Packed packed_numbers(const Eigen::MatrixXi& numbers, const PackOptions& options) {
  Packed packed{numbers.rows(), numbers.cols(), {}, {}, {}, -1, false, numbers, {}};
  for (const int number : numbers.reshaped()) {
    if (number != missing && std::abs(number) > largest_packed)
      throw std::invalid_argument("a number to pack is too large: " + std::to_string(number));
    packed.has_missing = packed.has_missing || number == missing;
  }
  assert(options.references.empty() || numbers.cols() == 1);
  RangeEncoder coder;
  for (Eigen::Index c = 0; c < numbers.cols(); ++c) {
    const auto [way, reference] = best_way(numbers.col(c), options);
    packed.by.push_back(way.by);
    packed.reference = reference;
    const std::vector<int> coded = code(coder, numbers.col(c), way, options, packed.has_missing);
    packed.numbers.col(c) = Eigen::Map<const Eigen::VectorXi>(coded.data(), numbers.rows());
  }
  packed.text = base64(coder.finished());
  return packed;
}

Eigen::MatrixXi numbers_of(const Eigen::MatrixXd& values, double step,
                           const std::vector<double>& offset) {
  if (!(step > 0.0) || !std::isfinite(step))
    throw std::invalid_argument("a step must be positive, and is " + std::to_string(step));
  Eigen::MatrixXi numbers(values.rows(), values.cols());
  for (Eigen::Index column = 0; column < values.cols(); ++column)
    for (Eigen::Index row = 0; row < values.rows(); ++row) {
      const double number = std::round((values(row, column) - offset[std::size_t(column)]) / step);
      if (std::abs(number) > double(largest_packed))
        throw std::invalid_argument("a value is infinite or too far from others for its step");
      numbers(row, column) = std::isnan(number) ? missing : int(number);
    }
  return numbers;
}

Packed packed_values(const Eigen::MatrixXd& values, double step, const PackOptions& options) {
  std::vector<double> offset;
  for (const auto& column : values.colwise()) {
    const ColumnRange range = range_of(column);
    offset.push_back(range.low / 2.0 + range.high / 2.0);
  }
  Packed packed = packed_numbers(numbers_of(values, step, offset), options);
  packed.step.assign(offset.size(), step);
  packed.offset = std::move(offset);
  return packed;
}

double step_of_16_bits(const Eigen::MatrixXd& values) {
  double half = 0.0;
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    const ColumnRange range = range_of(values.col(column));
    half = std::max(half, range.high / 2.0 - range.low / 2.0);
  }
  return half > 0.0 ? half / 32767.0 : 1.0;
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
