#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/surface/tool.h"

/// The machined surface at the vertices of a design, milled or turned, with its gouges; and the
/// competing passes, which predict how the surface changes with a displacement of the tool.
namespace abbe::cutting {

/// Actual motion of a milling cutter in the workpiece, as poses at instants. Between two poses the
/// tip moves on a line and the axis on a great circle, both in proportion to time.
struct CutterMotion {
  Points tip;              ///< (n x 3) mm
  Points axis;             ///< (n x 3) unit, from the tip to the spindle
  Eigen::VectorXd time_s;  ///< (n) not decreasing; between equal instants the tool jumps, and the
                           ///< jump cuts
  std::vector<int> line;   ///< (n) program line of the move that ENDS at this sample
};

/// Actual motion of a turning tool relative to the spindle that carries the workpiece. The slow
/// pose is the tool's pose in the workpiece without the spindle's rotation: the pose in the
/// workpiece is rotation(spindle angle about the spindle line) * slow pose. Between samples the
/// origin of the slow pose moves on a line, its orientation turns at constant rate, and the spindle
/// angle grows in proportion to time.
struct NoseMotion {
  std::vector<Eigen::Isometry3d> T_without_spindle;              ///< (n) slow poses
  Eigen::VectorXd spindle;                                       ///< (n) rad, unwrapped
  Eigen::VectorXd time_s;                                        ///< (n) strictly increasing
  std::vector<int> line;                                         ///< (n) as in CutterMotion
  Eigen::Vector3d spindle_point = Eigen::Vector3d::Zero();       ///< mm, workpiece frame
  Eigen::Vector3d spindle_direction = Eigen::Vector3d::UnitX();  ///< unit, workpiece frame
};

class WallThickness;

/// Status of the surface at a vertex.
enum class VertexStatus : std::uint8_t {
  Cut = 0,
  Uncut = 1,    ///< nothing was removed along the normal, neither within the band nor below it
  Outside = 2,  ///< outside the judged region
  Gouged = 3,   ///< removed deeper than the band
};

/// Depth, in multiples of the band, down to which a gouge is searched.
inline constexpr double gouge_bands = 10.0;

struct SurfaceOptions {
  double band = 2.0;                     ///< mm, the ray is searched from -band (inside) to +band
  std::function<void(double)> progress;  ///< called from time to time with the finished fraction,
                                         ///< from any thread
  std::shared_ptr<const WallThickness> body = {};  ///< the part behind the design; if null, the
                                                   ///< design itself
};

/// Material removed below the band at a gouged vertex.
struct Gouge {
  int vertex = 0;
  double depth = 0.0;  ///< mm below the design, along the normal, of the deepest point removed
  bool continues_deeper =
      false;  ///< true if the search ended at `depth` while the material was still removed
};

/// The machined surface relative to the design: the position at which the part ends along every
/// outward normal.
struct Surface {
  /// Positions of additional samples of a map within its triangles.
  enum class InteriorSample : std::uint8_t {
    None,
    Middle,  ///< the middle of a triangle, for a map that its vertices resolve
    Random,  ///< a random point of each triangle, so that waves finer than the triangles do not
             ///< alias
  };
  Eigen::VectorXd residual;  ///< (n) mm; + material left, - gouged; NaN where not cut
  Eigen::VectorXd
      cut_time_s;  ///< (n) instant at which the surface was cut; NaN unless cut or gouged
  std::vector<int> cut_line;         ///< (n) program line that cut it; 0 unless cut or gouged
  std::vector<VertexStatus> status;  ///< (n)
  std::vector<Gouge> gouges = {};    ///< of the vertices with status Gouged, in the order of the
                                     ///< vertices
  InteriorSample interior_sample = InteriorSample::None;
  Eigen::VectorXd within = {};  ///< (m) mm, residual at the sample within each triangle; NaN where
                                ///< it or a corner is not cut; empty if `interior_sample` is None
};

/// Returns the surface left by a milling cutter: on each normal the first point, from inside the
/// part outwards, that any move removes.
/// The result is the minimum over all moves, and the earliest of equal ones, so it does not depend
/// on the number of threads or the order of the vertices.
/// A vertex is Gouged if its ray is removed at -band or, if nothing is removed within the band,
/// anywhere below it down to `gouge_bands` bands.
/// Exception: removal below an intact skin is not counted here if its deepest point is at least 10
/// % closer to another point of the part; it is then a gouge at that point.
///
/// A ray extends at most half way through the part, i.e. to half the distance from the vertex to
/// the triangle through which the ray leaves; if that point is nearer than -band, the ray starts
/// there.
///
/// Bound: the residual is within 1e-7 mm (0.1 nm) of the sweep of the motion as given, for parts of
/// up to 1 m.
///
/// A move that rotates the tool axis is searched in parts of at most 0.05 rad. Within one part,
/// separate contacts with the same ray that are shallower than (R + flank length) 0.05^2 / 2 may be
/// missed, except for one.
///
/// Memory is linear: about 75 bytes per move and convex part of the cutter, and 40 per vertex in
/// addition to arguments and result.
///
/// If `design_w.judged` is empty, all vertices are judged. A motion of a single sample is a pose
/// that cuts.
/// @throws std::invalid_argument if an array has the wrong size, a number is not finite, a
///         direction is not unit to 1e-9, time goes back, or the axis turns by half a turn between
///         two samples
Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options = {});

/// Returns a function that computes milled_surface for any number of designs with a sweep that is
/// prepared once. The motion must outlive the function.
/// @throws as milled_surface, both here and when the function is called
std::function<Surface(const Design& design_w)> prepare_milled_surface(
    const Cutter& cutter, const CutterMotion& motion, const SurfaceOptions& options = {});

/// Returns the surface left by a turning tool. The helix of the cut is resolved: for every
/// revolution the instant at which the rake plane passes the ray is computed exactly.
Surface turned_surface(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                       const SurfaceOptions& options = {});
/// Returns a function that computes turned_surface for any number of designs with a sweep that is
/// prepared once.
std::function<Surface(const Design& design_w)> prepare_turned_surface(
    const Nose& nose, const NoseMotion& motion, const SurfaceOptions& options = {});

/// A pass of the tool that cuts, or nearly cuts, the surface at a vertex, and how its distance
/// along the normal changes with a small displacement of the tool. For a displacement d (mm,
/// workpiece frame) of the tool at the contact, which is vertex + distance normal, the distance
/// becomes
///   distance + gradient . d + curvature / 2 (across . d)^2.
/// The error in mm is bounded by the sum of the following terms, with D = |d|, h the stencil, R the
/// radius of the pass's cross-section, and p its slope over the surface (at most (D + pitch / 2) /
/// R where it cuts):
///   p D (D^2 + h^2) / 2R^2 + D^2 (D^2 + h^2) / 8R^3  terms beyond the second order
///   + D^2 / 2L  L: radius of the pass along the feed; in turning that of the work divided by
///               (p + the radial component of the normal)
///   + theta D / 2  theta (rad): turn of the path from one move to the next
///   + 1e-7 + 2e-6 D + 4e-4 D^2  rounding where the axis turns, else 1e-7 + 1e-7 D + 2e-5 D^2
///
/// Examples. Ball R 5 mm, pitch 0.4 mm: on a plane 0.1 nm for a displacement of 50 um; on a dome of
/// R 100 mm with moves of 0.1 mm 38 nm for 50 um (25 nm of it from theta) and 5 nm for 10 um. Nose
/// R 0.249 mm, facing at 20 um feed: 165 nm for 50 um, 1.3 nm for 10 um.
///
/// No bound holds within max(D, h) of an edge of the pass (its ends, a sharp rim of the cutter),
/// where only the flatter side of the pass is modelled, without curvature. Where the tool stands or
/// reverses, the curvature in the other direction, D^2 / 2R, is neglected.
struct CompetingPass {
  int vertex = 0;
  double distance = 0.0;                               ///< mm along the vertex normal
  int move = 0;                                        ///< the move from sample `move` to the next
  double t = 0.0;                                      ///< instant within the move, 0 .. 1
  Eigen::Vector3d contact = Eigen::Vector3d::Zero();   ///< mm
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< with gradient . normal = 1
  Eigen::Vector3d across = Eigen::Vector3d::Zero();  ///< unit, in the tangent plane, normal to the
                                                     ///< feed; the direction of largest curvature
                                                     ///< if the tool stands
  double curvature = 0.0;                            ///< 1/mm along `across`
};

struct CompetingPassOptions {
  double reach = 0.05;  ///< mm, passes this much farther than the nearest are included
  int max_passes = 6;   ///< maximum number of passes per vertex, nearest first; suffices for
                        ///< displacements up to (max_passes - 1) / 2 pitches
  double difference_step = 0.01;  ///< mm, step of the differences that give gradient and curvature
  double band = 2.0;              ///< mm, as for the surface
  std::function<void(double)> progress = {};  ///< called with the finished fraction, from any
                                              ///< thread
};

/// Returns the competing passes of every judged vertex that is cut, in the order of the vertices.
/// The passes of a vertex are sorted by distance, equal ones by time; the distance of the first is
/// the residual of milled_surface to 1e-7 mm. A pass is a run of consecutive moves with a single
/// minimum of the distance; two runs without a crest of at least 1e-6 mm between them count as one
/// pass. The result does not depend on the number of threads.
/// @throws std::invalid_argument as milled_surface, or if an option is not finite, `reach` is
///         negative, `max_passes` below 1 or `difference_step` not positive, or if the cutter is
///         hollow
std::vector<CompetingPass> milled_competing_passes(const Design& design_w, const Cutter& cutter,
                                                   const CutterMotion& motion,
                                                   const CompetingPassOptions& options = {});

/// Returns the competing passes of a turning tool. A pass is one revolution; of cuts less than half
/// a revolution apart only the nearest counts. `across` lies in the rake plane, in the direction of
/// the meridian. The displacement is that of the tool in the workpiece at the instant of the cut: a
/// displacement that is constant in the machine turns in the workpiece with the spindle angle. No
/// bound holds nearer to the spindle line than |d| or the stencil.
/// @throws std::invalid_argument as turned_surface, or as milled_competing_passes for an option
std::vector<CompetingPass> turned_competing_passes(const Design& design_w, const Nose& nose,
                                                   const NoseMotion& motion,
                                                   const CompetingPassOptions& options = {});

}  // namespace abbe::cutting
