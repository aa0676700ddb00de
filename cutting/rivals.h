#pragma once

#include <functional>
#include <vector>

#include "cutting/mesh.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

/// A pass of the tool that makes, or nearly makes, the surface at a vertex, and how its distance
/// along the normal follows a small displacement of the tool. With d the displacement (mm,
/// workpiece frame) that the pass's tool has at the contact, vertex + distance normal, it comes to
///   distance + gradient . d + curvature / 2 (across . d)^2.
/// Bound in mm, with D = |d|, h the stencil, R the radius of the pass's cross-section, p its slope
/// over the surface (at most (D + pitch / 2) / R where it cuts):
///   p D (D^2 + h^2) / 2R^2 + D^2 (D^2 + h^2) / 8R^3  what the second order leaves out
///   + D^2 / 2L  L: radius of the pass along the feed; turning: that of the work over (p + the
///               radial part of the normal)
///   + theta D / 2  theta (rad): by which the path turns from one move to the next
///   + 1e-7 + 2e-6 D + 4e-4 D^2  rounding where the axis turns, else 1e-7 + 1e-7 D + 2e-5 D^2
/// Ball R 5 at pitch 0.4: 0.1 nm on a plane and 38 nm on a dome of 100 with moves of 0.1 mm (25 of
/// them from theta) for 50 um, 5 nm for 10 um; nose R 0.249 on a face at 20 um feed: 165 nm for 50
/// um, 1.3 nm for 10 um.
/// No bound within max(D, h) of an edge of the pass (its ends, a sharp rim of the cutter): there
/// the pass is given by its flatter side, without curvature. Where the tool stands or turns back,
/// its curvature in the other direction, D^2 / 2R, is left out.
struct Rival {
  int vertex = 0;
  double distance = 0.0;                               ///< mm along the vertex normal
  int move = 0;                                        ///< the move from sample `move` to the next
  double t = 0.0;                                      ///< instant within it, 0 .. 1
  Eigen::Vector3d contact = Eigen::Vector3d::Zero();   ///< mm
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< gradient . normal is 1
  Eigen::Vector3d across = Eigen::Vector3d::Zero();    ///< unit, in the tangent plane, across the
                                                       ///< feed; where it curves most if the tool
                                                       ///< stands
  double curvature = 0.0;                              ///< 1/mm along `across`
};

struct RivalOptions {
  double reach = 0.05;  ///< mm, passes whose distance is within so much of the first one's
  int most = 6;  ///< of one vertex, nearest first; the nearest stay enough up to a displacement of
                 ///< (most - 1) / 2 pitches
  double stencil = 0.01;  ///< mm, step of the differences that give gradient and curvature
  double band = 2.0;      ///< mm, as of the surface
  std::function<void(double)> progress = {};  ///< finished fraction, from any thread
};

/// Rivals of every judged vertex that is cut, in the order of the vertices, the nearest first, of
/// equal ones the earliest: the first one's distance is the residual of milled_surface to 1e-7 mm.
/// A pass is a run of consecutive moves with one least distance in it; two that no crest of 1e-6 mm
/// parts are one. Does not depend on the number of threads.
/// @throws std::invalid_argument as milled_surface, or if an option is not finite, `reach` is
///         negative, `most` below 1 or `stencil` not positive
std::vector<Rival> milled_rivals(const Design& design_w, const Cutter& cutter,
                                 const CutterMotion& motion, const RivalOptions& options = {});

/// The same of a turning tool, a pass being one revolution (of cuts less than half of one apart
/// the nearest counts). `across` lies in the rake plane: the meridian's direction. The displacement
/// is that of the tool at the instant, in the workpiece: one that stands in the machine turns with
/// the spindle angle there. Nearer to the spindle line than |d| or the stencil there is no bound.
/// @throws std::invalid_argument as turned_surface, or as milled_rivals for an option
std::vector<Rival> turned_rivals(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                                 const RivalOptions& options = {});

}  // namespace abbe::cutting
