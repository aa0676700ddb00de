#pragma once

#include "sim/scene/scene.h"
#include "sim/scene/toml.h"
#include "tests/test.h"

namespace abbe::sim {

/// What a reader says when it refuses; empty if it does not.
template <typename Read>
std::string refusal_by(const Read& read) {
  return thrown_text<BadInput, BadScene>([&] { read(); });
}

/// Faults as one text, each on its line; empty if there are none.
inline std::string text_of(const InputErrors& input_errors) {
  std::string text;
  for (const BadInput& fault : input_errors.list()) text += std::string(fault.what()) + "\n";
  return text;
}

/// A text with its first `from`, which it must have, replaced.
inline std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

}  // namespace abbe::sim
