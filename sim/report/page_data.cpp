#include "sim/report/page_data.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

namespace abbe::sim {

using nlohmann::ordered_json;

/// Probability that a bit is 0, in units of 2^-16, estimated at two rates from the bits so far: the
/// fast one follows changes, the slow one is more exact.
struct Chance {
  std::uint16_t fast = 1u << 15, slow = 1u << 15;
};

/// Adaptive model of numbers of one kind: the bit length of their magnitude by a context, their
/// signs and the two bits below the leading one.
struct NumberModel {
  static constexpr int contexts = 24;
  std::array<std::array<Chance, 32>, contexts> length;
  std::array<Chance, 32> sign;
  std::array<std::array<Chance, 4>, 32> leading;
};

/// Range coder: writes bits in nearly as few bytes as their probabilities allow. A page decodes
/// them with the same models.
/// Source: the carry-propagating coder of Martin 1979, as in the LZMA specification.
class RangeEncoder {
 public:
  void bit(Chance& chance, bool one);

  /// Writes the lowest `count` bits, each with probability 1/2.
  void bits(std::uint32_t value, int count);

  /// Writes the lowest `count` bits with a tree of 2^count probabilities, the highest bit first.
  void tree(Chance* chances, std::uint32_t value, int count);

  /// Writes an integer with |number| < 2^31.
  /// @return the bit length of its magnitude, which is the context of its neighbours
  int number(NumberModel& model, int context, std::int64_t number);

  /// Returns all bytes; the encoder cannot be used afterwards.
  std::string finished();

 private:
  void narrow();
  void shift_low();

  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xffffffffu;
  std::uint8_t cache_ = 0;
  std::uint64_t pending_ = 1;  ///< number of bytes that a carry may still change: the cache and
                               ///< following 0xff
  std::string bytes_;
};

void RangeEncoder::shift_low() {
  if (low_ < 0xff000000u || low_ > 0xffffffffu) {
    const auto carry = std::uint8_t(low_ >> 32);
    for (; pending_ > 0; --pending_) {
      bytes_ += char(cache_ + carry);
      cache_ = 0xff;
    }
    cache_ = std::uint8_t(low_ >> 24);
  }
  ++pending_;
  low_ = (low_ & 0x00ffffffu) << 8;
}

void RangeEncoder::narrow() {
  // The range keeps at least 24 bits, so that 15-bit probabilities never vanish.
  while (range_ < 1u << 24) {
    range_ <<= 8;
    shift_low();
  }
}

void RangeEncoder::bit(Chance& chance, bool one) {
  // The two 16-bit estimates are averaged to 15 bits.
  const std::uint32_t zero = (range_ >> 15) * ((std::uint32_t(chance.fast) + chance.slow) >> 2);
  if (one) {
    low_ += zero;
    range_ -= zero;
    chance.fast = std::uint16_t(chance.fast - (chance.fast >> 4));
    chance.slow = std::uint16_t(chance.slow - (chance.slow >> 7));
  } else {
    range_ = zero;
    chance.fast = std::uint16_t(chance.fast + ((65535 - chance.fast) >> 4));
    chance.slow = std::uint16_t(chance.slow + ((65535 - chance.slow) >> 7));
  }
  narrow();
}

void RangeEncoder::bits(std::uint32_t value, int count) {
  for (int k = count - 1; k >= 0; --k) {
    range_ >>= 1;
    if (value >> k & 1u) low_ += range_;
    narrow();
  }
}

void RangeEncoder::tree(Chance* chances, std::uint32_t value, int count) {
  std::uint32_t node = 1;
  for (int k = count - 1; k >= 0; --k) {
    const bool one = value >> k & 1u;
    bit(chances[node], one);
    node = 2 * node + one;
  }
}

int RangeEncoder::number(NumberModel& model, int context, std::int64_t number) {
  const auto magnitude = std::uint32_t(number < 0 ? -number : number);
  const int length = int(std::bit_width(magnitude));
  assert(length < 32);
  tree(model.length[std::size_t(std::min(context, NumberModel::contexts - 1))].data(),
       std::uint32_t(length), 5);
  if (length == 0) return 0;
  bit(model.sign[std::size_t(length)], number < 0);
  const int led = std::min(2, length - 1), rest = length - 1 - led;
  tree(model.leading[std::size_t(length)].data(), magnitude >> rest & ((1u << led) - 1u), led);
  bits(magnitude, rest);
  return length;
}

std::string RangeEncoder::finished() {
  // Five bytes flush the cache and the 32 bits of `low_`.
  for (int k = 0; k < 5; ++k) shift_low();
  return bytes_.substr(1);  // the first byte is the initial cache, 0
}

namespace {

using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Vertex beyond a border edge: none, a new one, the one before or after the edge on the border, or
/// any other.
enum class Beyond : std::uint32_t { Nothing, New, Before, After, Other };

/// A border vertex with its edge to the next one.
struct Edge {
  int vertex = 0, opposite = 0;
  int next = 0, previous = 0;
  bool is_open = true, waits = true;
};

class MeshTraversal {
 public:
  MeshTraversal(const Triangles& triangles, Eigen::Index vertices)
      : triangles_(triangles),
        first_(std::size_t(vertices) + 1, 0),
        around_(std::size_t(triangles.size())),
        number_(std::size_t(vertices), -1),
        is_done_(std::size_t(triangles.rows()), false) {
    for (const int v : triangles.reshaped()) ++first_[std::size_t(v) + 1];
    for (std::size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
    std::vector<int> at = first_;
    for (Eigen::Index t = 0; t < triangles.rows(); ++t)
      for (const int v : triangles.row(t)) around_[std::size_t(at[std::size_t(v)]++)] = int(t);
  }

  MeshWalk walked() && {
    for (Eigen::Index t = 0; t < triangles_.rows(); ++t) {
      if (is_done_[std::size_t(t)]) continue;
      start(t);
      for (std::size_t next = 0; next < waiting_.size(); ++next) conquer(waiting_[next]);
      waiting_.clear();
    }
    // Vertices without a triangle come last.
    for (std::size_t v = 0; v < number_.size(); ++v)
      if (number_[v] < 0) meet(int(v), before());
    walk_.code = coder_.finished();
    return std::move(walk_);
  }

 private:
  std::array<int, 3> before() const {
    const int last = std::max(0, int(walk_.order.size()) - 1);
    return {last, last, last};
  }

  // Gives a vertex its new number and stores the vertices that predict it.
  int meet(int old, const std::array<int, 3>& known) {
    walk_.order.push_back(old);
    walk_.known.push_back(known);
    at_.push_back(-1);
    triangles_at_.push_back(0);
    return number_[std::size_t(old)] = int(walk_.order.size()) - 1;
  }

  // Adds an edge to the border and to the queue.
  int add(const Edge& edge) {
    edges_.push_back(edge);
    waiting_.push_back(int(edges_.size()) - 1);
    return at_[std::size_t(edge.vertex)] = waiting_.back();
  }

  void link(int a, int b) {
    edges_[std::size_t(a)].next = b;
    edges_[std::size_t(b)].previous = a;
  }

  // Puts an edge back into the queue after its neighbourhood changed.
  void wait(int i) {
    Edge& edge = edges_[std::size_t(i)];
    if (!edge.waits) waiting_.push_back(i);
    edge.waits = true;
  }

  // Writes a vertex that is already known by its distance from the newest one.
  void encode_other(int vertex) {
    coder_.number(number_model_, 0, int(walk_.order.size()) - 1 - vertex);
  }

  // Begins a connected part with a triangle.
  void start(Eigen::Index t) {
    is_done_[std::size_t(t)] = true;
    std::array<int, 3> v;
    for (int k = 0; k < 3; ++k) {
      const int old = triangles_(t, k), known = number_[std::size_t(old)];
      coder_.bit(start_model_, known >= 0);
      if (known >= 0) encode_other(known);
      v[std::size_t(k)] = known >= 0 ? known : meet(old, before());
    }
    const int a = add({v[0], v[2]}), b = add({v[1], v[0]}), c = add({v[2], v[1]});
    link(a, b), link(b, c), link(c, a);
    for (const int one : v) ++triangles_at_[std::size_t(one)];
  }

  /// Returns the old number of the vertex beyond the edge from `from` to `to`; -1 if there is none.
  int beyond(int from, int to) {
    const int a = int(walk_.order[std::size_t(to)]), b = int(walk_.order[std::size_t(from)]);
    for (int k = first_[std::size_t(a)]; k < first_[std::size_t(a) + 1]; ++k) {
      const int t = around_[std::size_t(k)];
      if (is_done_[std::size_t(t)]) continue;
      for (int c = 0; c < 3; ++c)
        if (triangles_(t, c) == a && triangles_(t, (c + 1) % 3) == b) {
          is_done_[std::size_t(t)] = true;
          return triangles_(t, (c + 2) % 3);
        }
    }
    return -1;
  }

  // Writes the kind of the vertex beyond an edge. Its model depends on the valences at both ends
  // and on the preceding kind.
  void code(Beyond what, int from, int to) {
    // Triangles at a vertex say how likely the next one closes its fan; more than 7 are rare.
    const int many = 8;
    const auto at = [&](int v) { return std::min(many - 1, triangles_at_[std::size_t(v)]); };
    auto& model = models_[std::size_t((at(from) * many + at(to)) * 5) + std::size_t(last_)];
    coder_.tree(model.data(), std::uint32_t(what), 3);
    last_ = what;
  }

  // Adds the triangle beyond an edge of the border, if there is one.
  void conquer(int i) {
    const Edge edge = edges_[std::size_t(i)];
    edges_[std::size_t(i)].waits = false;
    if (!edge.is_open) return;
    const int n = edge.next, p = edge.previous, s = edge.vertex, e = edges_[std::size_t(n)].vertex,
              old = beyond(s, e);
    const int after = edges_[std::size_t(n)].next;
    int w = old < 0 ? -1 : number_[std::size_t(old)];
    const Beyond what = old < 0                                  ? Beyond::Nothing
                        : w < 0                                  ? Beyond::New
                        : w == edges_[std::size_t(p)].vertex     ? Beyond::Before
                        : w == edges_[std::size_t(after)].vertex ? Beyond::After
                                                                 : Beyond::Other;
    code(what, s, e);
    if (what == Beyond::Nothing) return;
    if (what == Beyond::New) w = meet(old, {s, e, edge.opposite});
    if (what == Beyond::Other) encode_other(w);
    for (const int v : {s, e, w}) ++triangles_at_[std::size_t(v)];
    if (what == Beyond::Before) return close(i, p, n, s);
    if (what == Beyond::After) return close(n, i, after, e);
    open(i, w);
  }

  /// Joins the edges `kept` and `gone` into one, from `kept` to `next`, with the corner `opposite`
  /// it.
  void close(int gone, int kept, int next, int opposite) {
    edges_[std::size_t(gone)].is_open = false;
    edges_[std::size_t(kept)].opposite = opposite;
    link(kept, next);
    if (edges_[std::size_t(next)].next == kept)
      edges_[std::size_t(kept)].is_open = edges_[std::size_t(next)].is_open = false;
    else
      wait(kept);
  }

  /// Inserts vertex w between the ends of edge i; the border splits if w was on it already.
  void open(int i, int w) {
    const Edge edge = edges_[std::size_t(i)];
    const int n = edge.next, e = edges_[std::size_t(n)].vertex, there = at_[std::size_t(w)];
    edges_[std::size_t(i)].opposite = e;
    wait(i);
    const bool parts = there >= 0 && edges_[std::size_t(there)].is_open;
    const int before = parts ? edges_[std::size_t(there)].previous : i;
    const int k = add({w, edge.vertex});
    if (parts) link(i, there);
    link(before, k);
    link(k, n);
  }

  const Triangles& triangles_;
  std::vector<int> first_, around_;  ///< triangles at each vertex, by index ranges
  std::vector<int> number_;          ///< new number of each old vertex, -1: not yet met
  std::vector<bool> is_done_;
  std::vector<Edge> edges_;
  std::vector<int> waiting_;
  std::vector<int> at_, triangles_at_;  ///< (new numbers) last edge from it; triangles so far
  MeshWalk walk_;
  RangeEncoder coder_;
  NumberModel number_model_;
  Chance start_model_;
  std::vector<std::array<Chance, 8>> models_ = std::vector<std::array<Chance, 8>>(8 * 8 * 5);
  Beyond last_ = Beyond::Nothing;
};

}  // namespace

MeshWalk mesh_walk(const Triangles& triangles, Eigen::Index vertices) {
  return MeshTraversal(triangles, vertices).walked();
}

namespace {

struct ColumnRange {
  double low = std::numeric_limits<double>::infinity(), high = -low;
};

/// Returns the range of the values that are not NaN; zero without any.
ColumnRange range_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  ColumnRange range;
  for (const double value : values) {
    if (std::isinf(value)) throw std::invalid_argument("a value to pack is infinite");
    if (std::isnan(value)) continue;
    range = {std::min(range.low, value), std::max(range.high, value)};
  }
  return range.low > range.high ? ColumnRange{0.0, 0.0} : range;
}

/// Returns the rows that are known when row k is coded.
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

/// Prediction of a column.
struct Way {
  Prediction by = Prediction::Parallelogram;
  const int* reference = nullptr;
};

std::int64_t predicted(const Way& way, const int* x, int k, const MeshWalk* walk) {
  if (k == 0) return way.reference ? way.reference[0] : 0;
  const std::array<int, 3> at = known_at(walk, k);
  std::int64_t number = combined(way.by, x, at);
  if (way.reference) number += way.reference[k] - combined(way.by, way.reference, at);
  return std::clamp<std::int64_t>(number, -max_packed, max_packed);
}

/// Returns an estimate of the bits of a column.
double bits_of(const Way& way, const std::vector<int>& x, const PackOptions& options) {
  double bits = 0.0;
  for (int k = 0; k < int(x.size()); ++k)
    bits += std::log2(
        1.0 + std::abs(double(x[std::size_t(k)] - predicted(way, x.data(), k, options.walk))));
  return bits;
}

/// Returns the numbers with every missing one replaced by its prediction, from which later ones are
/// predicted.
std::vector<int> filled(const Eigen::Ref<const Eigen::VectorXi>& numbers, const Way& way,
                        const PackOptions& options) {
  std::vector<int> x(numbers.begin(), numbers.end());
  for (int k = 0; k < int(x.size()); ++k)
    if (int& one = x[std::size_t(k)]; one == missing)
      one = int(predicted(way, x.data(), k, options.walk));
  return x;
}

/// Writes a column.
/// @return the numbers as `filled`
std::vector<int> code(RangeEncoder& coder, const Eigen::Ref<const Eigen::VectorXi>& numbers,
                      const Way& way, const PackOptions& options, bool has_missing) {
  std::vector<int> x = filled(numbers, way, options);
  NumberModel model;
  std::array<Chance, 4> is_missing;
  std::vector<int> length(x.size(), 0);
  for (int k = 0; k < int(x.size()); ++k) {
    std::array<int, 3> at{};
    // The magnitude of a difference resembles that of its neighbours, so their mean length is its
    // context.
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

/// A prediction with the index of its reference.
struct Candidate {
  Way way;
  int reference = -1;
};

/// Returns the prediction that takes the fewest bits for the first numbers of the column.
Candidate best_predictor(const Eigen::Ref<const Eigen::VectorXi>& numbers,
                         const PackOptions& options) {
  constexpr Eigen::Index enough = 1 << 15;  // numbers represent the whole column
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

PackedColumns pack_numbers(const Eigen::MatrixXi& numbers, const PackOptions& options) {
  PackedColumns packed{numbers.rows(), numbers.cols(), {}, {}, {}, -1, false, numbers, {}};
  for (const int number : numbers.reshaped()) {
    if (number != missing && std::abs(number) > max_packed)
      throw std::invalid_argument("a number to pack is too large: " + std::to_string(number));
    packed.has_missing = packed.has_missing || number == missing;
  }
  assert(options.references.empty() || numbers.cols() == 1);
  RangeEncoder coder;
  for (Eigen::Index c = 0; c < numbers.cols(); ++c) {
    const auto [way, reference] = best_predictor(numbers.col(c), options);
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
      if (std::abs(number) > double(max_packed))
        throw std::invalid_argument("a value is infinite or too far from others for its step");
      numbers(row, column) = std::isnan(number) ? missing : int(number);
    }
  return numbers;
}

PackedColumns pack_values(const Eigen::MatrixXd& values, double step, const PackOptions& options) {
  std::vector<double> offset;
  for (const auto& column : values.colwise()) {
    const ColumnRange range = range_of(column);
    // The offset is the middle of the range, so that signed 16 bits suffice. Both ends are halved
    // before the sum, which could overflow.
    offset.push_back(range.low / 2.0 + range.high / 2.0);
  }
  PackedColumns packed = pack_numbers(numbers_of(values, step, offset), options);
  packed.step.assign(offset.size(), step);
  packed.offset = std::move(offset);
  return packed;
}

double step_for_16_bits(const Eigen::MatrixXd& values) {
  double half = 0.0;
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    const ColumnRange range = range_of(values.col(column));
    half = std::max(half, range.high / 2.0 - range.low / 2.0);
  }
  // Numbers from -32767 to 32767 about the middle of the range.
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

void add_block(PageData& data, const std::string& name, const std::string& text) {
  data.blocks += "<script type=\"text/plain\" id=\"a:" + name + "\">" + text + "</script>\n";
}

void add(PageData& data, const PageArray& array, const PackedColumns& packed) {
  ordered_json about{{"n", packed.rows}, {"components", packed.columns}, {"mesh", array.on_mesh}};
  for (const Prediction by : packed.by) about["by"].push_back(int(by));
  if (packed.reference >= 0) about["reference"] = array.references[std::size_t(packed.reference)];
  if (packed.has_missing) about["missing"] = true;
  if (!packed.step.empty()) {
    about["offset"] = packed.offset;
    about["step"] = packed.step;
  }
  data.index["arrays"][array.name] = about;
  add_block(data, array.name, packed.text);
}

ordered_json to_json(const Eigen::Isometry3d& T) {
  const Eigen::Matrix4d m = T.matrix();
  return std::vector<double>(m.data(), m.data() + m.size());
}

ordered_json to_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace abbe::sim
