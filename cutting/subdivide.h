#pragma once

#include "cutting/nearest.h"

namespace abbe::cutting {

struct SubdivideOptions {
  double spacing = 0.1;             ///< mm, no judged edge is longer
  Eigen::Index points = 1'000'000;  ///< vertices at most, unless more are given
};

/// The design with its judged edges halved, longest first, until none is longer than the spacing or
/// there are as many vertices as may be.
/// @throws std::invalid_argument if the spacing is not positive
Design subdivided(const Design& design, const OnSurface& on_surface,
                  const SubdivideOptions& options = {});

}  // namespace abbe::cutting
