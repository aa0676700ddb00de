#pragma once

#include <Eigen/Core>

#include "sim/study/influence.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Values that inputs are between.
struct Box {
  Eigen::VectorXd low;   ///< (inputs)
  Eigen::VectorXd high;  ///< (inputs)
};
/// Ends of the distributions where they have any; else the values beyond which there is as little
/// as beyond `coverage` standard deviations of a normal distribution. Correlations do not matter to
/// it.
Box box_of(const Study& study, double coverage);

/// What of a response no machine in a box exceeds, mm, by the maps without alignment: every rival's
/// slopes at their magnitudes, its curvature at the largest shift.
///   pv: over pairs of vertices, the inputs that lift both taken once; exact for linear maps with
///       one rival a vertex, as far as 1e9 products reach to look at pairs, beyond them less tight
///   rms, std: norm of base and slopes, products of slopes at their magnitudes
///   max_abs, p95_abs: the farthest vertex; mean: the mean of all
/// InTolerance: 0, of which none is worse.
/// @param found  a value in the box: pairs that cannot exceed it are not looked at
double response_bound(const InfluenceMap& influence, const Box& box, Response response,
                      double found);

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
Corner worst_corner(const Study& study, const PreparedConfiguration& ready,
                    const InfluenceMap& influence, Response response);

/// The same of maps that nobody aligns.
/// @param function  the response by those maps
Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function);

}  // namespace abbe::sim::study
