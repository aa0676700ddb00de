#pragma once

#include "tests/test.h"

namespace abbe::errors {

/// What an act is refused with; nothing if it is not.
inline std::string refusal(const std::function<void()>& act) {
  try {
    act();
  } catch (const std::invalid_argument& fault) {
    return fault.what();
  } catch (const BadInput& fault) {
    return fault.what();
  }
  return {};
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace abbe::errors
