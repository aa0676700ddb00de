#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
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

/// A vertex whose ray starts in removed material or meets none, and how far inwards it is followed.
struct SecondLook {
  int vertex = 0;
  bool buried = false;  ///< it starts in removed material
  bool thin = false;  ///< the part is thinner there than two bands: the outer band is searched too
  double deepest = 0.0;  ///< mm below the design
};

/// The part behind a design, as far as the options do not give it.
std::shared_ptr<const Thickness> body_of(const Design& design, const SurfaceOptions& options);

/// Every vertex that is called Gouged or Uncut and has more of the part to look at, in their order.
std::vector<SecondLook> second_looks(const Surface& surface, const Design& design,
                                     const Thickness& body, double band);

/// Along what a vertex is followed.
ShiftedRay ray_of(const SecondLook& look, const Design& design, double band);

/// The map once those vertices are called Gouged, Uncut or, where the part is thin, Cut.
/// @param cuts  (looks) first cuts along their rays
Surface judged_again(Surface surface, const Design& design, const Thickness& body, double band,
                     std::span<const SecondLook> looks,
                     std::span<const std::optional<FirstCut>> cuts);

/// The map with its gouges: every vertex that it calls Gouged (its ray starts in removed material)
/// or Uncut is followed inwards as milled_surface says, and called Gouged, Uncut or, where the part
/// is thinner than two bands, Cut.
Surface with_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                    const FirstCutAlong& first_cut);

}  // namespace abbe::cutting
