#pragma once

#include <Eigen/Core>

#include "sim/study/influence.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Bounds of the inputs.
struct Box {
  Eigen::VectorXd low;   ///< (inputs)
  Eigen::VectorXd high;  ///< (inputs)
};
/// Returns the box of the inputs: the ends of bounded distributions; else the values beyond which
/// the probability is that of a normal distribution beyond `coverage` standard deviations.
/// Correlations are ignored.
Box box_of(const Study& study, double coverage);

/// Returns an upper bound of a response over a box, mm, from the maps without alignment: every
/// pass's slopes at their magnitudes, its curvature at the largest shift.
///   pv: over pairs of vertices, inputs that lift both counted once; exact for linear maps with
///       one pass a vertex, as long as 1e9 products suffice for the pairs, less tight beyond
///   rms, std: norm of base and slopes, products of slopes at their magnitudes
///   max_abs, p95_abs: the farthest vertex; mean: the mean of all
/// InTolerance: 0, the worst possible value. Form and texture: infinite.
/// @param found  a value attained in the box: pairs that cannot exceed it are skipped
double response_bound(const InfluenceMap& influence, const Box& box, Response response,
                      double found);

/// A corner of the box of all inputs.
struct Corner {
  Eigen::VectorXd inputs;  ///< (inputs) each at an end of its range
  double response = 0.0;   ///< response there, mm, by the influence map
  double bound = 0.0;      ///< mm, upper bound over the box; infinite where the scene aligns
};

/// Returns the worst corner found for a response (the largest; for InTolerance the smallest). The
/// map is nearly linear in the inputs, so a response that grows with a norm of it is convex and
/// worst at a corner. With at most 12 inputs all corners are evaluated; with more the search climbs
/// from corners that maximise the distance of pairs of vertices or a norm, and from random ones, so
/// it may stop below the worst, which `bound` limits. For 13 and 14 inputs it finds 99.9 % of it or
/// more (worst_case_test.cpp).
Corner worst_corner(const Study& study, const PreparedConfiguration& ready,
                    const InfluenceMap& influence, Response response);

/// Returns the worst corner of maps that are not aligned.
/// @param function  the response by those maps
Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function);

}  // namespace abbe::sim::study
