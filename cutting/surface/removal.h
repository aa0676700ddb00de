#pragma once

#include <optional>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"

/// The removal of material along a ray found by testing every move, and the gradient of the
/// residual that follows from the removing pass.
namespace abbe::cutting {

/// The event that removed the material at the start of the machined surface along a ray.
struct Removal {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double t = 0.0;  ///< instant within the whole move, 0 .. 1
  int move = 0;    ///< the move from sample `move` to the next
  int part = 0;    ///< index of the part, if the move is divided
};

/// Returns the number of parts of at most 0.05 rad into which a move is divided if its axis turns
/// by more; otherwise 1.
int parts_of(const CutterMotion& motion, int move);
/// Returns one part of a move.
Move part_of(const CutterMotion& motion, int move, int part);
/// Overload for a move whose number of parts is known.
Move part_of(const CutterMotion& motion, int move, int part, int parts);

/// Returns the first removal along the ray by a convex cutter: the smallest s, of equal ones the
/// earliest move. Tests every move, in time linear in the moves; a SweepTree returns the same
/// without testing all of them.
std::optional<Removal> first_of_every_move(const Cutter& cutter, const CutterMotion& motion,
                                           const Ray& ray);

/// Returns the first removal of every move, or part of a move, that comes within `reach` (mm) of
/// the first of all, in the order of the motion. Empty if there is none, or if the ray starts in
/// removed material. Tests every move.
std::vector<Removal> every_move_within(const Cutter& cutter, const CutterMotion& motion,
                                       const Ray& ray, double reach);

/// First-order model of the residual around each vertex of a design, for the pass that cut it: at a
/// point of the design that is displaced by the vector `d` (mm) the residual is residual - gradient
/// . d.
struct PassGradients {
  Points gradient;  ///< (n x 3) with gradient . normal = 1; NaN if the vertex is not cut or the
                    ///< gradient is undefined because the tool stands there on a sharp rim
  Eigen::VectorXd travel;  ///< (n) mm, path length of the tool over the work until the cut: two
                           ///< vertices whose travels differ by far more than their distance were
                           ///< cut by two passes; NaN unless cut
};

/// Returns the gradients of a surface that `milled_surface` computed. Where the tool stands still,
/// the skin of the tool itself is used.
/// @param before  mm, path length of the tool before the motion begins
/// @throws std::invalid_argument if sizes differ
PassGradients milled_gradients(const Design& design_w, const Surface& surface, const Cutter& cutter,
                               const CutterMotion& motion, double before = 0.0);

/// Returns (samples) the path length of the tip until each sample, mm.
Eigen::VectorXd way_of(const CutterMotion& motion, double before = 0.0);

/// Returns the gradients of a surface that `turned_surface` computed; the travel is that of the
/// vertex about the spindle line. Waves of the nose are neglected in the gradient, which causes an
/// error of amplitude times order / radius. On a sharp corner of an insert the normal from the
/// corner to the contact is used.
PassGradients turned_gradients(const Design& design_w, const Surface& surface, const Nose& nose,
                               const NoseMotion& motion);

}  // namespace abbe::cutting
