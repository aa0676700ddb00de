#pragma once

#include <stdexcept>
#include <string>

namespace abbe {

/// Throws std::invalid_argument of this text unless `holds`.
inline void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}
inline void require(bool holds, const std::string& what) { require(holds, what.c_str()); }

}  // namespace abbe
