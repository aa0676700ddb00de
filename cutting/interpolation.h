#pragma once

#include <cstdint>
#include <functional>

#include "cutting/nearest.h"
#include "cutting/surface.h"

namespace abbe::cutting {

/// The map sampled within every triangle whose corners are cut, at its `place_within`.
Surface with_places_within(Surface surface, const Design& design, Surface::Within within,
                           const OnSurface& on_surface,
                           const std::function<Surface(const Design&)>& cut);

/// How well linear interpolation between the vertices of a design meets its residual, found at
/// places of their own: random in area over the triangles whose three vertices are judged and cut.
struct InterpolationError {
  double resolution = 0.0;  ///< mm, as asked
  int places = 0;           ///< that are cut
  double worst = 0.0;       ///< mm
  double rms = 0.0;         ///< mm
  double mean = 0.0;        ///< mm, signed: straight lines fill hollows between crests
  double unresolved = 0.0;  ///< share of the places at which it exceeds the resolution
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, the worst
};
struct ProbeOptions {
  int places = 2000;
  std::uint64_t seed = 1;
  double resolution = 5e-5;  ///< mm
};
InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const OnSurface& on_surface,
                                       const std::function<Surface(const Design&)>& cut,
                                       const ProbeOptions& options = {});

}  // namespace abbe::cutting
