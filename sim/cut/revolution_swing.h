#pragma once

#include <optional>

#include "sim/cut/process.h"

namespace abbe::sim {

/// A cut whose depth does not settle from one revolution of the work to the next.
struct RevolutionSwing {
  int revolutions = 0;  ///< in turn, where it is widest
  int line = 0;         ///< of the first of them
  double low = 0.0;     ///< N, least and
  double high = 0.0;    ///< largest force among them
  double gain = 0.0;    ///< a change of the force returns so many times as large, at the most
  int leaps = 0;  ///< how often the tool leaps out of the work and back, where it does not swing;
                  ///< the gain is then that within a revolution
};

/// Looks for it in the forces of a turned part; none if every change dies out.
/// With c, mm/N, how far the force moves the tool into the work, and a, N/mm, by how much the force
/// grows as it goes deeper, the loop within a revolution has the gain c a. But what one revolution
/// takes too deep is missing to the next: with b <= a, the part of a that is counted from what the
/// revolution before left, a change of depth returns as -c b / (1 - c a) times itself. That grows
/// where c (a + b) > 1, so a machine that the cut draws in (c > 0) swings from half of the gain on
/// at which it would run away; one that gives way (c < 0) never does. The gain is read off ten
/// changes of alternating sign, each above 1 % of the force: the second five against the first,
/// with c a >= 1/2 among them, as b <= a. Far beyond, the tool digs in, cuts itself free for some
/// revolutions and digs in again: three such leaps within forty revolutions of one line, a
/// contraction of the loop of 1 and more among them.
std::optional<RevolutionSwing> revolution_swing(const Process& process);

}  // namespace abbe::sim
