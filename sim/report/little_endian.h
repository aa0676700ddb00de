#pragma once

#include <bit>
#include <cstring>
#include <string>
#include <type_traits>

/// Numbers as the bytes of a binary file, least first.
namespace abbe::sim {

template <class T>
void append(std::string& bytes, T value) {
  static_assert(std::endian::native == std::endian::little && std::is_arithmetic_v<T>);
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  bytes.append(raw, sizeof value);
}

}  // namespace abbe::sim
