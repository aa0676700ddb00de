#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/report/page_data.h"

/// What a page does with its data, written from the description of the codes: a second unpacker
/// beside render/report/unpack.js.
namespace abbe::sim::unpack {

inline std::string bytes_of(const std::string& base64) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int have = 0;
  for (const char c : base64) {
    if (c == '=') break;
    bits = bits << 6 | unsigned(digits.find(c));
    have += 6;
    if (have >= 8) bytes += char(bits >> (have -= 8) & 0xffu);
  }
  return bytes;
}

struct Chances {
  std::vector<std::array<std::uint32_t, 2>> of;
  explicit Chances(std::size_t count) : of(count, {1u << 15, 1u << 15}) {}
};

struct Numbers {
  Chances length{24 * 32}, sign{32}, leading{32 * 4};
};

class Decoder {
 public:
  explicit Decoder(std::string bytes) : bytes_(std::move(bytes)) {
    for (int k = 0; k < 4; ++k) code_ = code_ << 8 | next();
  }
  bool bit(std::array<std::uint32_t, 2>& chance) {
    const std::uint32_t zero = (range_ >> 15) * ((chance[0] + chance[1]) >> 2);
    const bool one = code_ >= zero;
    code_ -= one ? zero : 0;
    range_ = one ? range_ - zero : zero;
    const int rate[] = {4, 7};
    for (std::size_t k = 0; k < 2; ++k)
      chance[k] =
          one ? chance[k] - (chance[k] >> rate[k]) : chance[k] + ((65535 - chance[k]) >> rate[k]);
    widen();
    return one;
  }
  std::uint32_t tree(Chances& chances, std::size_t from, int count) {
    std::uint32_t node = 1;
    for (int k = 0; k < count; ++k) node = 2 * node + bit(chances.of[from + node]);
    return node - (1u << count);
  }
  std::int64_t number(Numbers& model, int context, int& length) {
    length = int(tree(model.length, std::size_t(32 * std::min(context, 23)), 5));
    if (length == 0) return 0;
    const bool negative = bit(model.sign.of[std::size_t(length)]);
    const int led = std::min(2, length - 1);
    std::int64_t x = 1 << led | tree(model.leading, std::size_t(4 * length), led);
    for (int k = led + 1; k < length; ++k) {
      range_ >>= 1;
      const bool one = code_ >= range_;
      if (one) code_ -= range_;
      x = 2 * x + one;
      widen();
    }
    return negative ? -x : x;
  }

 private:
  std::uint32_t next() {
    return at_ < bytes_.size() ? static_cast<unsigned char>(bytes_[at_++]) : 0u;
  }
  void widen() {
    for (; range_ < 1u << 24; range_ <<= 8) code_ = code_ << 8 | next();
  }
  std::string bytes_;
  std::size_t at_ = 0;
  std::uint32_t range_ = 0xffffffffu, code_ = 0;
};

/// (rows x columns) with `missing` where there is none.
inline Eigen::MatrixXi numbers(const PackedColumns& packed, const MeshWalk* walk = nullptr,
                               const Eigen::VectorXi* reference = nullptr) {
  Decoder decoder(bytes_of(packed.text));
  Eigen::MatrixXi x(packed.rows, packed.columns), seen = x;
  for (Eigen::Index c = 0; c < x.cols(); ++c) {
    Numbers model;
    Chances is_missing(4);
    std::vector<int> length(std::size_t(x.rows()), 0);
    for (Eigen::Index k = 0; k < x.rows(); ++k) {
      std::array<int, 3> at = {int(k) - 1, int(k) - 1, std::max(0, int(k) - 2)};
      if (walk) at = walk->known[std::size_t(k)];
      const auto combined = [&](const auto& of) -> std::int64_t {
        const std::int64_t a = of[at[0]], b = of[at[1]];
        const Prediction by = packed.by[std::size_t(c)];
        if (by == Prediction::Parallelogram) return a + b - of[at[2]];
        return by == Prediction::Middle ? (a + b - ((a + b) % 2 != 0 && a + b < 0 ? 1 : 0)) / 2 : 0;
      };
      std::int64_t number = reference ? (*reference)[k] : 0;
      int context = 0;
      if (k > 0) {
        number += combined(x.col(c)) - (reference ? combined(*reference) : 0);
        number = std::clamp<std::int64_t>(number, -(1 << 29), 1 << 29);
        context = (length[std::size_t(at[0])] + length[std::size_t(at[1])] +
                   length[std::size_t(k) - 1] + 1) /
                  3;
      }
      const bool near = k > 0 && seen(at[0], c) == missing,
                 far = k > 0 && seen(at[1], c) == missing;
      if (packed.has_missing && decoder.bit(is_missing.of[(near ? 1u : 0u) + (far ? 2u : 0u)])) {
        seen(k, c) = missing;
        x(k, c) = int(number);
        continue;
      }
      seen(k, c) = x(k, c) = int(number + decoder.number(model, context, length[std::size_t(k)]));
    }
  }
  return seen;
}

/// The triangles of a walk by its new numbers.
class Mesh {
 public:
  Mesh(const std::string& code, std::size_t triangles) : decoder_(code) {
    while (all.size() < triangles) {
      std::array<int, 3> v;
      for (int& one : v) one = decoder_.bit(start_.of[0]) ? other() : meet();
      add(v);
      const int first = int(border_.size());
      for (int k = 0; k < 3; ++k)
        border_.push_back({v[std::size_t(k)], first + (k + 1) % 3, first + (k + 2) % 3});
      for (int k = 0; k < 3; ++k) last_edge_[std::size_t(v[std::size_t(k)])] = first + k;
      for (const int k : {first, first + 1, first + 2}) queue_.push_back(k);
      for (std::size_t k = 0; k < queue_.size(); ++k) go_over(queue_[k]);
      queue_.clear();
    }
  }
  std::vector<std::array<int, 3>> all;

 private:
  struct Edge {
    int vertex, next, previous;
    bool open = true, queued = true;
  };
  Edge& edge(int i) { return border_[std::size_t(i)]; }
  int meet() {
    last_edge_.push_back(-1);
    around_.push_back(0);
    return int(last_edge_.size()) - 1;
  }
  int other() {
    int length = 0;
    return int(last_edge_.size()) - 1 - int(decoder_.number(numbers_, 0, length));
  }
  void add(const std::array<int, 3>& v) {
    all.push_back(v);
    for (const int one : v) ++around_[std::size_t(one)];
  }
  void enqueue(int i) {
    if (!edge(i).queued) queue_.push_back(i);
    edge(i).queued = true;
  }
  void join(int a, int b) {
    edge(a).next = b;
    edge(b).previous = a;
  }
  void shorten(int gone, int kept, int to) {
    edge(gone).open = false;
    join(kept, to);
    if (edge(to).next == kept)
      edge(kept).open = edge(to).open = false;
    else
      enqueue(kept);
  }
  void go_over(int i) {
    edge(i).queued = false;
    if (!edge(i).open) return;
    const int n = edge(i).next, s = edge(i).vertex, e = edge(n).vertex, p = edge(i).previous;
    const auto many = [&](int v) { return std::size_t(std::min(7, around_[std::size_t(v)])); };
    last_ = decoder_.tree(what_, ((many(s) * 8 + many(e)) * 5 + last_) * 8, 3);
    if (last_ == 0) return;
    const int after = edge(n).next, w = last_ == 1   ? meet()
                                        : last_ == 2 ? edge(p).vertex
                                        : last_ == 3 ? edge(after).vertex
                                                     : other();
    add({e, s, w});
    if (last_ == 2) return shorten(i, p, n);
    if (last_ == 3) return shorten(n, i, after);
    enqueue(i);
    const int there = last_edge_[std::size_t(w)];
    const bool parts = there >= 0 && edge(there).open;
    const int before = parts ? edge(there).previous : i, k = int(border_.size());
    border_.push_back({w, n, before});
    queue_.push_back(k);
    last_edge_[std::size_t(w)] = k;
    if (parts) join(i, there);
    join(before, k);
    join(k, n);
  }
  Decoder decoder_;
  Chances start_{1}, what_{8 * 8 * 5 * 8};
  Numbers numbers_;
  std::vector<Edge> border_;
  std::vector<int> queue_, last_edge_, around_;
  std::size_t last_ = 0;
};

}  // namespace abbe::sim::unpack
