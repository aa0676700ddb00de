#pragma once

#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"

/// The removal of material along a ray, the parts into which a turning move is divided, and the
/// gradient of the residual for the pass that made the surface.
namespace abbe::cutting {

/// The event that made the machined surface on a ray.
struct Removal {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double t = 0.0;  ///< instant within the whole move, 0 .. 1
  int move = 0;    ///< the move from sample `move` to the next
  int part = 0;    ///< index of the part, if the move is divided
};

/// Returns the number of parts into which a move is divided so that its axis turns by at most 0.05
/// rad in each.
int move_part_count(const CutterMotion& motion, int move);
/// Returns one part of a move.
Move move_part(const CutterMotion& motion, int move, int part);
/// Overload for a move whose number of parts is known.
Move move_part(const CutterMotion& motion, int move, int part, int parts);

/// First-order model of the residual around each vertex of a design, for the pass that cut it: at
/// the vertex displaced by `d` (mm) the residual is residual - gradient . d.
struct PassGradients {
  Points gradient;  ///< (n x 3) with gradient . normal = 1; NaN if the vertex is not cut or the
                    ///< gradient is undefined because the tool stands there on a sharp rim
  Eigen::VectorXd travel;  ///< (n) mm, path length of the tool over the work until the cut: two
                           ///< vertices whose travels differ by far more than their distance were
                           ///< cut by two passes; NaN unless cut
};

/// Returns the gradients of a surface computed by `milled_surface`. Where the tool stands still,
/// they are those of the surface of the tool itself.
/// @param initial_length  mm, path length of the tool before the motion begins
/// @throws std::invalid_argument if sizes differ
PassGradients milled_gradients(const Design& design_w, const Surface& surface, const Cutter& cutter,
                               const CutterMotion& motion, double initial_length = 0.0);

/// Returns the path length of the tip until each sample, (n) mm.
/// @param initial_length  mm, path length before the first sample
Eigen::VectorXd path_lengths(const CutterMotion& motion, double initial_length = 0.0);

/// Returns the gradients of a surface computed by `turned_surface`; the travel is that of the
/// vertex about the spindle line. The gradient neglects the waves of the nose, which causes an
/// error of amplitude times order / radius. On a sharp corner of an insert it uses the normal from
/// the corner to the contact.
PassGradients turned_gradients(const Design& design_w, const Surface& surface, const Nose& nose,
                               const NoseMotion& motion);

}  // namespace abbe::cutting
