#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/removal.h"

/// Removal along a ray by every move tried on its own, in time linear in the moves: what a
/// SweepTree returns without trying all of them.
namespace abbe::cutting {

template <class Visitor>
void visit_removals(const Cutter& cutter, const CutterMotion& motion, const Ray& ray, double max_s,
                    const Visitor& visit) {
  const int moves = std::max(1, int(motion.tip.rows()) - 1);
  for (int move = 0; move < moves; ++move) {
    const int parts = move_part_count(motion, move);
    for (int part = 0; part < parts; ++part)
      if (const auto entry = first_entry(cutter, move_part(motion, move, part, parts), ray, max_s))
        visit(Removal{entry->s, entry->t, move, part});
  }
}

/// The first removal: the smallest s, of equal ones the earliest move.
inline std::optional<Removal> first_removal_of_every_move(const Cutter& cutter,
                                                          const CutterMotion& motion,
                                                          const Ray& ray) {
  std::optional<Removal> first;
  visit_removals(cutter, motion, ray, ray.band, [&](const Removal& removal) {
    if (!first || removal.s < first->s) first = removal;
  });
  return first;
}

/// In the order of the motion, the first removal by every move or part of a move whose s is within
/// `reach` (mm) of the first removal. Empty if nothing is removed or if the ray starts in removed
/// material.
inline std::vector<Removal> removals_of_every_move(const Cutter& cutter, const CutterMotion& motion,
                                                   const Ray& ray, double reach) {
  std::vector<Removal> removals;
  const std::optional<Removal> first = first_removal_of_every_move(cutter, motion, ray);
  if (!first || first->s <= -ray.band) return removals;
  visit_removals(cutter, motion, ray, std::min(first->s + reach, ray.band),
                 [&](const Removal& removal) { removals.push_back(removal); });
  return removals;
}

}  // namespace abbe::cutting
