#pragma once

#include <limits>

namespace abbe {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
/// A figure that there is none of.
inline constexpr double none = std::numeric_limits<double>::quiet_NaN();

}  // namespace abbe
