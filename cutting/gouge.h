#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <vector>

#include "cutting/cutter_entry.h"
#include "cutting/surface.h"
#include "cutting/thickness.h"

/// The vertices whose ray starts in removed material or meets none, looked at a second time.
namespace abbe::cutting {

/// What removes a ray first, coming from inside the part; s is -band of the ray if it starts in
/// removed material.
struct FirstCut {
  double s = 0.0;  ///< mm along the normal
  double time_s = 0.0;
  int line = 0;
};
using FirstCutAlong = std::function<std::optional<FirstCut>(const Ray&)>;  ///< from any thread
/// Of so many rays at once, each made on request.
using FirstCutsAlong = std::function<std::vector<std::optional<FirstCut>>(
    std::size_t count, const std::function<Ray(std::size_t)>& ray)>;

/// The stretch of a normal that a ray covers, its middle `shift` mm from the vertex.
struct ShiftedRay {
  Ray ray;
  double shift = 0.0;
};

/// Rays that start half way through the part, for vertices where that is nearer than -band.
/// The design outlives them; asked from any thread.
class ThinRays {
 public:
  ThinRays(const Design& design, double band) : design_(design), band_(band) {}

  /// None where the part is not so thin.
  std::optional<ShiftedRay> of(Eigen::Index vertex) const;

 private:
  const Design& design_;
  double band_;
  mutable std::once_flag once_;
  mutable std::optional<Thickness> thickness_;
};

/// The map with its gouges: every vertex that it calls Gouged (its ray starts in removed material)
/// or Uncut is followed inwards as milled_surface says, and called Gouged, Uncut or, where the part
/// is thinner than two bands, Cut.
Surface with_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                    const FirstCutAlong& first_cut);
/// The same where the first cuts of all rays are found together. @param first_cuts  asked once, if
/// there is a ray
Surface with_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                    const FirstCutsAlong& first_cuts);

}  // namespace abbe::cutting
