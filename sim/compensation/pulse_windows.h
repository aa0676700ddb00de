#pragma once

#include <vector>

#include "sim/compensation/course.h"

namespace abbe::sim::compensation {

inline constexpr double most_counts = 1e15;  ///< a quarter of a count is still resolved

/// Times at which an inserted pair can begin, `windows` many of equal length, `spacing_s` apart.
struct PulseWindows {
  double begin_s = 0.0;  ///< of the first; -inf where the axis rests so before its course
  double end_s = 0.0;    ///< of the first: a pair that begins later would not pass; +inf at rest
                         ///< after its course
  double spacing_s = 0.0;
  double windows = 1.0;
};

/// When both trains of an encoder are low and stay so for the length of a pair, in order. At most
/// three entries for a line of the motion, however many signal periods it passes.
/// @param motion  valid
/// @param phase   in counts, as in `quadrature`
/// @throws std::invalid_argument for positions beyond 1e15 counts
std::vector<PulseWindows> pulse_windows(const Course& motion, Eigen::Index column, double count,
                                        double phase, double pulse_s);

}  // namespace abbe::sim::compensation
