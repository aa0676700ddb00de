#include "cutting/removal.h"

#include <algorithm>
#include <cmath>

#include "kinematics/require.h"

namespace abbe::cutting {

namespace {

constexpr double max_part_turn = 0.05;  // rad

template <class Use>
void each_removal(const Cutter& cutter, const CutterMotion& motion, const Ray& ray, double limit,
                  const Use& use) {
  require(!is_hollow(cutter), "removal: expected a convex cutter, seen a hollow one");
  const int samples = int(motion.tip.rows());
  const int moves = samples == 1 ? 1 : samples - 1;
  for (int move = 0; move < moves; ++move) {
    const int parts = parts_of(motion, move);
    for (int part = 0; part < parts; ++part)
      if (const auto entry = first_entry(cutter, part_of(motion, move, part, parts), ray, limit))
        use(Removal{entry->s, entry->t, move, part});
  }
}

}  // namespace

int parts_of(const CutterMotion& motion, int move) {
  const int next = std::min<int>(move + 1, int(motion.tip.rows()) - 1);
  const double chord2 = (motion.axis.row(next) - motion.axis.row(move)).squaredNorm();
  if (chord2 < 0.99 * max_part_turn * max_part_turn) return 1;
  return 1 + int(2 * std::asin(std::min(1.0, 0.5 * std::sqrt(chord2))) / max_part_turn);
}

Move part_of(const CutterMotion& motion, int move, int part, int parts) {
  Move whole = move_after(motion, move);
  if (parts > 1) {
    whole.from = double(part) / parts;
    whole.to = double(part + 1) / parts;
  }
  return whole;
}

Move part_of(const CutterMotion& motion, int move, int part) {
  return part_of(motion, move, part, parts_of(motion, move));
}

std::optional<Removal> first_of_every_move(const Cutter& cutter, const CutterMotion& motion,
                                           const Ray& ray) {
  std::optional<Removal> best;
  each_removal(cutter, motion, ray, ray.band, [&](const Removal& removal) {
    if (!best || removal.s < best->s) best = removal;
  });
  return best;
}

std::vector<Removal> every_move_within(const Cutter& cutter, const CutterMotion& motion,
                                       const Ray& ray, double reach) {
  std::vector<Removal> found;
  const std::optional<Removal> first = first_of_every_move(cutter, motion, ray);
  if (!first || first->s <= -ray.band) return found;
  each_removal(cutter, motion, ray, std::min(first->s + reach, ray.band),
               [&](const Removal& removal) { found.push_back(removal); });
  return found;
}

}  // namespace abbe::cutting
