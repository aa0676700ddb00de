#pragma once

#include <stdexcept>

namespace abbe {

/// Throws std::invalid_argument of this text unless `holds`.
inline void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

}  // namespace abbe
