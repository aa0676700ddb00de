#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace abbe::sim::dialects {

/// A code of a block, such as G43.4.
template <typename Word>
struct CodeOf {
  int tenths = -1;  ///< of the number: G43.4 is 434; -1 where the block has none
  Word word;
  explicit operator bool() const { return tenths >= 0; }
};

/// Words of a block by letter, or codes by group. Of many a block has few: only these are cleared.
template <typename T, std::size_t n>
class Slots {
  static_assert(n <= 32);

 public:
  const T& operator[](std::size_t i) const { return all_[i]; }
  void put(std::size_t i, const T& one) {
    all_[i] = one;
    used_ |= std::uint32_t(1) << i;
  }
  auto begin() const { return all_.begin(); }
  auto end() const { return all_.end(); }
  bool empty() const { return used_ == 0; }
  void clear() {
    for (std::size_t i = 0; i < n && used_ >> i; ++i)
      if ((used_ >> i) & 1u) all_[i] = {};
    used_ = 0;
  }

 private:
  std::array<T, n> all_{};
  std::uint32_t used_ = 0;  ///< bits by slot
};

}  // namespace abbe::sim::dialects
