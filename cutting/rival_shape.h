#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/rivals.h"

namespace abbe::cutting {

/// Where the surface of one pass is asked about a vertex.
struct PassProbe {
  Eigen::Vector3d normal;               ///< unit, of the vertex
  double distance = 0.0;                ///< mm, of the pass along it
  std::optional<Eigen::Vector3d> feed;  ///< way of the tool at the contact, any length; nothing, or
                                        ///< along the normal: the pass stands
  double step = 0.01;                   ///< mm, of the differences
};

/// Distance (mm) of the pass along the normal from the vertex displaced by a vector of its tangent
/// plane; nothing where the pass is missed.
using PassDistance = std::function<std::optional<double>(const Eigen::Vector3d& displacement)>;

/// A pass to second order, as `Rival` describes it.
struct PassShape {
  Eigen::Vector3d gradient;
  Eigen::Vector3d across;
  double curvature = 0.0;
};

/// Shape from central differences: four rays, six where the pass stands. Where one of two rays
/// misses, or the pass has an edge between them (a slope that changes by over 0.5), the slope is
/// that of the flatter side and the curvature 0; where both miss, the slope is 0 too.
PassShape pass_shape(const PassProbe& probe, const PassDistance& distance);

/// All in one, each marked with its vertex.
std::vector<Rival> in_order_of_vertices(const std::vector<std::vector<Rival>>& of_vertex);

}  // namespace abbe::cutting
