#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "cutting/mesh.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

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
  Within looked_within = Within::None;
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

}  // namespace abbe::cutting
