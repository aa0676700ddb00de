#include "cutting/face_marks.h"

#include <charconv>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

namespace abbe::cutting {
namespace {

constexpr int most_of_eight_bits = 255, most_of_five_bits = 31;

bool may_be(int written, int channel, FaceColour::Digits digits) {
  switch (digits) {
    case FaceColour::Digits::EightBits:
      return written == channel;
    case FaceColour::Digits::FiveBits:
      return written == channel / 8 ||
             written ==
                 (2 * most_of_five_bits * channel + most_of_eight_bits) / (2 * most_of_eight_bits);
    case FaceColour::Digits::Fraction:
      return std::abs(written - channel) <= 1;
  }
  return false;
}

}  // namespace

bool may_be(const FaceColour& written, const Rgb& colour) {
  for (std::size_t k = 0; k < 3; ++k)
    if (!may_be(written.channels[k], colour[k], written.digits)) return false;
  return true;
}

Rgb spread(const FaceColour& written) {
  if (written.digits != FaceColour::Digits::FiveBits) return written.channels;
  Rgb colour;
  for (std::size_t k = 0; k < 3; ++k)
    colour[k] = (2 * most_of_eight_bits * written.channels[k] + most_of_five_bits) /
                (2 * most_of_five_bits);
  return colour;
}

std::string hex_text(const Rgb& colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2]);
}

std::optional<Rgb> colour_of(const std::string& hex_text) {
  if (hex_text.size() != 7 || hex_text[0] != '#') return std::nullopt;
  Rgb colour;
  for (std::size_t k = 0; k < 3; ++k) {
    const char* first = hex_text.data() + 1 + 2 * k;
    unsigned channel = 0;  // a sign is none of its digits
    const auto [end, error] = std::from_chars(first, first + 2, channel, 16);
    if (error != std::errc() || end != first + 2) return std::nullopt;
    colour[k] = int(channel);
  }
  return colour;
}

}  // namespace abbe::cutting
