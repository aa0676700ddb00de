#pragma once

#include <algorithm>
#include <vector>

#include "sim/study/box.h"
#include "sim/study/response_function.h"

namespace abbe::sim::study {

struct HeightRange {
  double low = 0.0;
  double high = 0.0;
};

/// The passes of influence maps over a box of inputs, a slope that is common to all taken away.
struct Passes {
  const InfluenceMap& influence;
  Eigen::VectorXd half;           ///< (p) half widths of the box
  Eigen::VectorXd middle;         ///< (m) mm, linear part at its middle, less the error-free map
  Eigen::VectorXd magnitude;      ///< (m) mm, most by which the linear part differs from that
  std::vector<HeightRange> lift;  ///< (m) mm, of the curvature
  std::vector<Eigen::Index> cut;  ///< vertices that have a pass

  Eigen::Index begin(Eigen::Index v) const { return influence.first[std::size_t(v)]; }
  Eigen::Index end(Eigen::Index v) const { return influence.first[std::size_t(v) + 1]; }
};
/// @param common  (p) taken away
Passes passes_over(const InfluenceMap& influence, const Box& box, const Eigen::VectorXd& common);

/// (p) zeros, and the middle of the slopes of each input: a shift of all vertices alike does not
/// matter to PV.
Eigen::VectorXd no_slope(const InfluenceMap& influence);
Eigen::VectorXd common_slope(const InfluenceMap& influence);

/// Where each vertex can be in the box, mm; zero where it is not cut. (n)
std::vector<HeightRange> heights(const Passes& passes);

/// Most by which a vertex can stand above another, mm: below any pass of the first, and above the
/// least of the other's.
double apart(const Passes& passes, Eigen::Index upper, Eigen::Index lower);

/// Heights as the pass of the base run has them, and what other passes and curvature may add.
struct LinearHeights {
  Eigen::VectorXd weight;  ///< (c) share of the area of each cut vertex
  Eigen::VectorXd base;    ///< (c) mm, at the middle of the box
  Eigen::MatrixXd slope;   ///< (p x c)
  Eigen::VectorXd added;   ///< (c) mm, most of it
  Eigen::VectorXd slack;   ///< (c) mm, its largest magnitude
};
/// @param passes  nothing taken away
LinearHeights linear_heights(const Passes& passes);
/// Less their mean by area.
LinearHeights about_mean(LinearHeights heights);

/// Cut vertices by a key, greatest first, of equal ones the first.
template <typename Key>
std::vector<Eigen::Index> ordered(const Passes& passes, const Key& key) {
  std::vector<Eigen::Index> vertices = passes.cut;
  std::stable_sort(vertices.begin(), vertices.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return key(a) > key(b); });
  return vertices;
}

}  // namespace abbe::sim::study
