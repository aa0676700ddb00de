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
/// Returns the box of the inputs: the ends of bounded distributions, and for unbounded ones the
/// values with the same probability beyond them as `coverage` standard deviations of a normal
/// distribution. Correlations are ignored.
Box input_box(const Study& study, double coverage);

/// Returns an upper bound of a response over a box, mm, from the maps without alignment. The bounds
/// of all passes add the magnitudes of their slopes, and have the curvature of the largest shift.
///   pv: maximum over pairs of vertices, in which the common effect of an input cancels; exact for
///       linear maps with one pass per vertex if 1e9 products suffice for the pairs, else larger
///   rms, std: norm of base and slopes, with the magnitudes of products of slopes
///   max_abs, p95_abs: that of the farthest vertex; mean: the mean over all vertices
/// For InTolerance it is 0, the worst possible value; for form and texture it is infinite.
/// @param attained  a value attained in the box: pairs that cannot exceed it are skipped
double response_bound(const InfluenceMap& influence, const Box& box, Response response,
                      double attained);

/// A corner of the box of all inputs.
struct Corner {
  Eigen::VectorXd inputs;  ///< (inputs) each at an end of its range
  double response = 0.0;   ///< mm, at this corner, by the influence map
  double bound = 0.0;      ///< mm, upper bound over the box; infinite if the scene has an alignment
};

/// Returns the worst corner that is found for a response: the largest one, for InTolerance the
/// smallest. The map is nearly linear in the inputs, so a response that grows with a norm of the
/// map is convex and has its maximum at a corner. With at most 12 inputs all corners are evaluated.
/// With more a local search starts from corners that maximise the distance of pairs of vertices or
/// a norm, and from random corners. It may stop below the maximum, of which `bound` is an upper
/// bound. For 13 and 14 inputs it finds at least 99.9 % of the maximum (worst_case_test.cpp).
Corner worst_corner(const Study& study, const PreparedConfiguration& ready,
                    const InfluenceMap& influence, Response response);

/// Returns the worst corner for maps without alignment.
/// @param function  response by these maps
Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function);

}  // namespace abbe::sim::study
