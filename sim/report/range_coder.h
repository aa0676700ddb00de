#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::sim {

/// How likely a binary choice is 0, learnt at two rates from the choices made so far.
struct Chance {
  std::uint16_t fast = 1u << 15, slow = 1u << 15;
};

/// What numbers of one kind have been like: the bit length of their magnitude by a context, their
/// signs and the two bits below the leading one.
struct NumberModel {
  static constexpr int contexts = 24;
  std::array<std::array<Chance, 32>, contexts> length;
  std::array<Chance, 32> sign;
  std::array<std::array<Chance, 4>, 32> leading;
};

/// Binary choices in as few bytes as their chances allow. A page decodes them by the same models.
/// Source: the carry-propagating coder of Martin 1979, as the LZMA specification describes it.
class RangeEncoder {
 public:
  void bit(Chance& chance, bool one);

  /// The lowest `count` bits, each as likely 0 as 1.
  void bits(std::uint32_t value, int count);

  /// The lowest `count` bits by a tree of 2^count chances, the highest bit first.
  void tree(Chance* chances, std::uint32_t value, int count);

  /// A whole number with |number| < 2^31.
  /// @return the bit length of its magnitude, the context of its neighbours
  int number(NumberModel& model, int context, std::int64_t number);

  /// All that was coded; the encoder is then used up.
  std::string finished();

 private:
  void narrow();
  void shift_low();

  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xffffffffu;
  std::uint8_t cache_ = 0;
  std::uint64_t pending_ = 1;  ///< the byte of the cache and those of 0xff that a carry may change
  std::string bytes_;
};

}  // namespace abbe::sim
