#pragma once

#include "sim/study/box.h"
#include "sim/study/response_function.h"

namespace abbe::sim::study {

/// Corners from which a search for the worst may begin: at which some pair of vertices is farthest
/// apart, some vertex highest or lowest; for rms and std the best of many that cannot be improved
/// in one input, by the linear map alone. (p x count)
Eigen::MatrixXd promising_corners(const InfluenceMap& influence, const Box& box, Response response);

}  // namespace abbe::sim::study
