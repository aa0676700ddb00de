#pragma once

#include <optional>
#include <vector>

#include "cutting/cutter_entry.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

/// What removed the material at the start of the machined surface along a ray.
struct Removal {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double t = 0.0;  ///< instant within the move, 0 .. 1
  int move = 0;    ///< the move from sample `move` to the next
  int part = 0;    ///< of the move, if it counts as several
};

/// The parts of at most 0.05 rad as which a move counts if its axis turns by more.
int parts_of(const CutterMotion& motion, int move);
Move part_of(const CutterMotion& motion, int move, int part);
/// The same of a move whose number of parts is known.
Move part_of(const CutterMotion& motion, int move, int part, int parts);

/// First removal along the ray by a convex cutter: smallest s, of equal ones the earliest move.
/// Every move is tried on its own, which takes a time linear in the moves: what a SweepTree
/// answers, without its bounds.
std::optional<Removal> first_of_every_move(const Cutter& cutter, const CutterMotion& motion,
                                           const Ray& ray);

/// First removal of every move, or part of one, that comes within `reach` (mm) of the first of all,
/// in the order of the motion. Empty if there is none, or if the ray starts in removed material.
/// Every move is tried, as above.
std::vector<Removal> every_move_within(const Cutter& cutter, const CutterMotion& motion,
                                       const Ray& ray, double reach);

}  // namespace abbe::cutting
