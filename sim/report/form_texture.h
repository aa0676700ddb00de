#pragma once

#include <optional>

#include <Eigen/Core>

#include "cutting/residual.h"
#include "errors/metrology/areal.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// A map parted by the areal filter of the part's cut-off.
struct FormAndTexture {
  Eigen::VectorXd filtered;                         ///< (n) mm, NaN where not cut
  cutting::Statistics form;                         ///< of that
  std::optional<errors::metrology::Areal> texture;  ///< of the map minus it, about its mean; none
                                                    ///< where nothing is cut, or the places at
                                                    ///< random are too few to carry the form
};

/// @param surface    a map on the job's design, aligned
/// @param tolerance  of each vertex; no rows where there is none
FormAndTexture form_and_texture(const Job& job, const cutting::Surface& surface,
                                const cutting::ToleranceBands& tolerance);

}  // namespace abbe::sim
