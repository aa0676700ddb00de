#pragma once

#include <optional>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"

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

/// How the residual goes on around the vertices of a design, by the pass that cut each: at a place
/// of the design `d` mm away it is residual - gradient . d to first order.
struct PassGradients {
  Points gradient;         ///< (n x 3) gradient . normal is 1; NaN unless cut, or not defined: the
                           ///< tool stands there on a sharp rim
  Eigen::VectorXd travel;  ///< (n) mm, way of the tool over the work until the cut: two vertices
                           ///< whose travels differ by far more than their distance were cut by two
                           ///< passes; NaN unless cut
};

/// Of a surface that `milled_surface` found. Where the tool stands its own skin serves.
/// @param before  mm, way of the tool until the motion begins
/// @throws std::invalid_argument if sizes differ
PassGradients milled_gradients(const Design& design_w, const Surface& surface, const Cutter& cutter,
                               const CutterMotion& motion, double before = 0.0);

/// (samples) mm, way of the tip until each.
Eigen::VectorXd way_of(const CutterMotion& motion, double before = 0.0);

/// The same of `turned_surface`, its travel that of the vertex about the spindle line. Waves of the
/// nose are left out of the gradient: amplitude times order / radius of it. On a sharp corner of an
/// insert it is that of the normal from the corner to the contact.
PassGradients turned_gradients(const Design& design_w, const Surface& surface, const Nose& nose,
                               const NoseMotion& motion);

}  // namespace abbe::cutting
