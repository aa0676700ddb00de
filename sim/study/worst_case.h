#pragma once

#include "sim/study/box.h"
#include "sim/study/response_function.h"

namespace abbe::sim::study {

/// A corner of the box of all inputs.
struct Corner {
  Eigen::VectorXd inputs;  ///< (inputs) each at an end
  double response = 0.0;   ///< there, mm, by the influence map
  double bound = 0.0;      ///< mm, none of the box is worse; infinite where the scene aligns
};

/// The worst corner that is found for a response (largest; of InTolerance least). The map is nearly
/// linear in the inputs, so what grows with a norm of it is convex and worst at a corner. Of at
/// most 12 inputs all corners are tried; of more the search climbs from those that sums of
/// magnitudes name for pairs of vertices, and from random ones, so it may stop below the worst,
/// which `bound` limits. Of 13 and 14 inputs it finds 99.9 % of it or more (worst_case_test.cpp).
Corner worst_corner(const Study& study, const ReadyArm& ready, const InfluenceMap& influence,
                    Response response);

/// The same of maps that nobody aligns.
/// @param function  the response by those maps
Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function);

}  // namespace abbe::sim::study
