#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/surface/tool.h"

namespace abbe::cutting {

/// Actual motion of a milling cutter in the workpiece: poses at instants; between two of them the
/// tip moves on a line and the axis on a great circle, both in proportion to time.
struct CutterMotion {
  Points tip;              ///< (n x 3) mm
  Points axis;             ///< (n x 3) unit, from the tip to the spindle
  Eigen::VectorXd time_s;  ///< (n) not decreasing; equal instants are a jump, and it cuts
  std::vector<int> line;   ///< (n) program line of the move that ENDS at this sample
};

/// Actual motion of a turning tool seen from the spindle that carries the workpiece. The slow pose
/// is the tool in the workpiece turned back by the spindle angle; between samples its origin moves
/// on a line, its rotation turns at constant rate, the spindle angle grows in proportion to time.
/// The tool in the workpiece is turn(spindle angle about the spindle line) * slow pose.
struct NoseMotion {
  std::vector<Eigen::Isometry3d> T_slow;                         ///< (n)
  Eigen::VectorXd spindle;                                       ///< (n) rad, unwrapped
  Eigen::VectorXd time_s;                                        ///< (n) strictly increasing
  std::vector<int> line;                                         ///< (n) as above
  Eigen::Vector3d spindle_point = Eigen::Vector3d::Zero();       ///< mm, workpiece frame
  Eigen::Vector3d spindle_direction = Eigen::Vector3d::UnitX();  ///< unit, workpiece frame
};

class Thickness;

enum class VertexStatus : std::uint8_t {
  Cut = 0,
  Uncut = 1,    ///< nothing was removed along the normal, neither within the band nor below it
  Outside = 2,  ///< not in the judged region
  Gouged = 3,   ///< removed deeper than the band
};

/// A gouge is followed inwards to so many bands.
inline constexpr double gouge_bands = 10.0;

struct SurfaceOptions {
  double band = 2.0;                     ///< mm, the ray is searched from -band (inside) to +band
  std::function<void(double)> progress;  ///< called now and then with the finished fraction, from
                                         ///< any thread
  std::shared_ptr<const Thickness> body = {};  ///< the part behind the design; without one the
                                               ///< design itself
};

/// What was removed below the band at a vertex that is Gouged.
struct Gouge {
  int vertex = 0;
  double depth = 0.0;   ///< mm below the design, along the normal: the deepest place removed
  bool deeper = false;  ///< that is as far as was searched, and removed there too
};

/// The machined surface against the design: where the part ends along every outward normal.
struct Surface {
  /// Where a map was sampled within its triangles, besides its vertices.
  enum class Within : std::uint8_t {
    None,
    Middle,  ///< for a map that its vertices resolve
    Random,  ///< at a place of their own: waves finer than the triangles average out
  };
  Eigen::VectorXd residual;    ///< (n) mm; + material left, - gouged; NaN where not cut
  Eigen::VectorXd cut_time_s;  ///< (n) instant that made the surface there; NaN unless cut, gouged
  std::vector<int> cut_line;   ///< (n) program line that made it; 0 unless cut or gouged
  std::vector<VertexStatus> status;  ///< (n)
  std::vector<Gouge> gouges = {};    ///< those of status Gouged, in the order of the vertices
  Within sampled_within = Within::None;
  Eigen::VectorXd within = {};  ///< (m) mm, residual at that place of each triangle; NaN where it
                                ///< or a corner is not cut; empty without
};

/// Surface left by a milling cutter: along each normal the first point, coming from inside the
/// part, that any move removes.
/// The result is the minimum over all moves, of equal ones the earliest, so it does not depend on
/// the number of threads or the order of the vertices.
/// A ray that is removed at -band or, if nothing is within the band, anywhere below it down to
/// `gouge_bands` bands is Gouged, unless the deepest place that is removed below an intact skin
/// lies nearer to another place of the part by a tenth: it is that one's gouge. No ray goes further
/// than half way through the part, from a vertex to the triangle that it leaves through: where that
/// is nearer than -band, it starts there.
///
/// Bound: residual within 1e-7 mm (0.1 nm) of the sweep of the motion as given, parts of 1 m
/// included.
///
/// A move whose axis turns is searched in parts of at most 0.05 rad; only one of several touches by
/// the same part, apart from each other and no deeper than (R + flank length) 0.05^2 / 2, can be
/// missed.
///
/// Memory is linear: about 75 bytes a move and part of a hollow cutter, and 40 a vertex besides the
/// arrays given and returned. A single sample is a pose that cuts. An empty `judged` judges all
/// vertices.
/// @throws std::invalid_argument if an array has the wrong size, a number is not finite, a
///         direction is not unit to 1e-9, time goes back, or the axis turns by half a turn between
///         two samples
Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options = {});

/// The same for one design after another, the sweep prepared once. The motion outlives it.
/// @throws as milled_surface, when it is made and when it is asked
std::function<Surface(const Design& design_w)> milled_search(const Cutter& cutter,
                                                             const CutterMotion& motion,
                                                             const SurfaceOptions& options = {});

/// Surface left by a turning tool, the helix of the cut resolved: for every revolution the instant
/// at which the rake plane passes the ray is solved exactly.
Surface turned_surface(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                       const SurfaceOptions& options = {});
std::function<Surface(const Design& design_w)> turned_search(const Nose& nose,
                                                             const NoseMotion& motion,
                                                             const SurfaceOptions& options = {});

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
struct CompetingPass {
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

struct CompetingPassOptions {
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
std::vector<CompetingPass> milled_competing_passes(const Design& design_w, const Cutter& cutter,
                                                   const CutterMotion& motion,
                                                   const CompetingPassOptions& options = {});

/// The same of a turning tool, a pass being one revolution (of cuts less than half of one apart
/// the nearest counts). `across` lies in the rake plane: the meridian's direction. The displacement
/// is that of the tool at the instant, in the workpiece: one that stands in the machine turns with
/// the spindle angle there. Nearer to the spindle line than |d| or the stencil there is no bound.
/// @throws std::invalid_argument as turned_surface, or as milled_rivals for an option
std::vector<CompetingPass> turned_competing_passes(const Design& design_w, const Nose& nose,
                                                   const NoseMotion& motion,
                                                   const CompetingPassOptions& options = {});

}  // namespace abbe::cutting
