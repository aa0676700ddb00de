#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "cutting/mesh.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

enum class VertexStatus : std::uint8_t {
  Cut = 0,
  Uncut = 1,    ///< nothing was removed within the band along the normal
  Outside = 2,  ///< not in the judged region
};

struct SurfaceOptions {
  double band = 2.0;  ///< mm, the ray is searched from -band (inside) to +band
  std::function<void(double)> progress;  ///< called now and then with the finished fraction, any thread
};

/// The machined surface told on the design: where the part ends along every outward normal.
struct Surface {
  Eigen::VectorXd residual;          ///< (n) mm; + material left, - gouged; NaN where not cut
  Eigen::VectorXd cut_time_s;        ///< (n) instant that made the surface there; NaN where not cut
  std::vector<int> cut_line;         ///< (n) program line that made it; 0 where not cut
  std::vector<VertexStatus> status;  ///< (n)
};

/// Surface left by a milling cutter: along each normal the first point, coming from inside the part,
/// that any move removes.
/// The result is the minimum over all moves, so it does not depend on the number of threads. A ray
/// whose start at -band is already removed has its surface beyond the band: Uncut.
/// @throws std::invalid_argument if an array has the wrong size or a number is not finite
Surface milled_surface(const Design& design_w, const Cutter& cutter, const CutterMotion& motion,
                       const SurfaceOptions& options = {});

/// Surface left by a turning tool, the helix of the cut resolved: for every revolution the instant at
/// which the rake plane passes the ray is solved exactly.
Surface turned_surface(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                       const SurfaceOptions& options = {});

}  // namespace abbe::cutting
