#include "sim/report/range_coder.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace abbe::sim {

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
  while (range_ < 1u << 24) {
    range_ <<= 8;
    shift_low();
  }
}

void RangeEncoder::bit(Chance& chance, bool one) {
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
  for (int k = 0; k < 5; ++k) shift_low();
  return bytes_.substr(1);  // the first is the cache as it stood, 0
}

}  // namespace abbe::sim
