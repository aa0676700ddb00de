#include "sim/dialects/vector_lines.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/dialects/fanuc_turning.h"

namespace abbe::sim::dialects {

using kinematics::AxisVector;
using kinematics::Chain;

const RotaryTurning& VectorLines::turning_of(const Chain& chain) {
  if (chain_ != &chain) {
    turning_.emplace(chain);
    chain_ = &chain;
  }
  return *turning_;
}

AxisVector VectorLines::fanuc_axes(const Chain& chain, const Eigen::Vector3d& direction_w,
                                   const program::Cause& cause) {
  const RotaryTurning& turning = turning_of(chain);
  const AxisVector now = run_.canon.position();
  if (!turning.possible()) return now;
  const auto all = turning.positions(direction_w.normalized(), now);
  if (all.empty())
    run_.canon.refuse(
        cause, "a tool vector that the rotary axes reach",
        fmt::format("{:.6g} {:.6g} {:.6g}", direction_w.x(), direction_w.y(), direction_w.z()));
  return fanuc::output_judgement(all, now, fanuc::turning_ranks(chain));
}

bool VectorLines::led_through(const Chain& chain, program::Straight& move) {
  std::optional<fanuc::PolePassage> passage;
  try {
    passage = fanuc::through_pole(chain, run_.canon.position(), move.end, run_.options().pole);
  } catch (const std::invalid_argument& fault) {
    run_.canon.refuse(move.cause, std::string(fault.what()) + ", beside pole = \"fanuc\"",
                      "one with " + run_.canon.letters());
  }
  if (!passage) return false;
  for (const int j : turning_of(chain).rotary()) move.end[j] = passage->end[j];
  ++led_.blocks;
  led_.turned = std::max(led_.turned, passage->turned);
  if (led_.line == 0 || passage->off > led_.off) led_.line = run_.canon.line();
  led_.off = std::max(led_.off, passage->off);
  return true;
}

bool VectorLines::straight_feed(const Chain& chain, program::Straight move) {
  const RotaryTurning& turning = turning_of(chain);
  const AxisVector& start = run_.canon.position();
  const bool turns =
      std::ranges::any_of(turning.rotary(), [&](int j) { return move.end[j] != start[j]; });
  if (!turns) return run_.canon.straight_feed(std::move(move)), true;
  if (rule() == PoleRule::Fanuc && turning.rotary().size() == 2 && led_through(chain, move))
    return run_.canon.straight_feed(std::move(move)), false;
  auto pieces = great_circle_pieces(turning, start, move.end, great_circle_within);
  if (pieces.empty())  // the great circle may end where the axes stand in the other way
    for (const AxisVector& q : turning.positions(turning.direction_w(move.end), start)) {
      AxisVector end = move.end;
      for (const int j : turning.rotary()) end[j] = q[j];
      pieces = great_circle_pieces(turning, start, end, great_circle_within);
      if (pieces.empty()) continue;
      move.end = std::move(end);
      break;
    }
  if (pieces.empty())
    run_.canon.refuse(move.cause,
                      "a turn of the tool on a great circle that the rotary axes follow, beside "
                      "pole = \"fanuc\" or \"siemens\"",
                      "opposite vectors, a pole on the way, or a way beyond their limits");
  feed_in_pieces(run_.canon, turning, pieces, move);
  return true;
}

void VectorLines::finish() {
  if (led_.blocks == 0) return;
  run_.warn_once(fmt::format(
      "{} blocks would pass a pole nearer than {:.6g} deg and are led through it (tool posture "
      "control, parameters 19738 and 19739): their ends are turned about it by up to {:.3g} deg, "
      "and the tool is up to {:.3g} deg off its vector (line {})",
      led_.blocks, run_.options().pole.near / units::deg, led_.turned / units::deg,
      led_.off / units::deg, led_.line));
}

}  // namespace abbe::sim::dialects
