#pragma once

#include "cutting/mesh.h"
#include "cutting/surface.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

/// How the residual goes on around the vertices of a design, by the pass that cut each: at a place
/// of the design `d` mm away it is residual - gradient . d to first order.
struct Contacts {
  Points gradient;         ///< (n x 3) gradient . normal is 1; NaN unless cut, or not defined: the
                           ///< tool stands there on a sharp rim
  Eigen::VectorXd travel;  ///< (n) mm, way of the tool over the work until the cut: two vertices
                           ///< whose travels differ by far more than their distance were cut by two
                           ///< passes; NaN unless cut
};

/// Of a surface that `milled_surface` found. Where the tool stands its own skin serves.
/// @param before  mm, way of the tool until the motion begins
/// @throws std::invalid_argument if sizes differ
Contacts milled_contacts(const Design& design_w, const Surface& surface, const Cutter& cutter,
                         const CutterMotion& motion, double before = 0.0);

/// (samples) mm, way of the tip until each.
Eigen::VectorXd way_of(const CutterMotion& motion, double before = 0.0);

/// The same of `turned_surface`, its travel that of the vertex about the spindle line. Waves of the
/// nose are left out of the gradient: amplitude times order / radius of it. On a sharp corner of an
/// insert it is that of the normal from the corner to the contact.
Contacts turned_contacts(const Design& design_w, const Surface& surface, const Nose& nose,
                         const NoseMotion& motion);

}  // namespace abbe::cutting
