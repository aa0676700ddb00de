#pragma once

#include <algorithm>
#include <random>
#include <string>

namespace abbe {

/// A text with some small injuries, at least one: bytes changed, lost, doubled, or added.
/// @param fodder  what is put in, bytes that mean something in such a text
/// @param most    injuries
inline std::string injured(std::string text, const std::string& fodder, std::size_t most,
                           std::mt19937& random) {
  const auto upto = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n)(random);
  };
  for (std::size_t k = upto(most - 1) + 1; k > 0; --k) {
    if (text.empty()) return text;
    const std::size_t at = upto(text.size() - 1), length = std::min(upto(12), text.size() - at);
    switch (upto(4)) {
      case 0:
        text[at] = char(upto(255));
        break;
      case 1:
        text[at] = fodder[upto(fodder.size() - 1)];
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        text.insert(upto(text.size()), text.substr(at, length));
        break;
      default:
        text.insert(at, 1, fodder[upto(fodder.size() - 1)]);
    }
  }
  return text;
}

}  // namespace abbe
