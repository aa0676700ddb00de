#pragma once

#include <limits>

namespace abbe {

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

}  // namespace abbe
