#pragma once

#include <functional>

#include "sim/study/influence.h"

namespace abbe::sim::study {

/// A response of an arm as a function of its inputs. Both may be called from any thread.
struct ResponseFunction {
  /// (p x cases) inputs -> (cases) mm or percent
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& x)> values;
  /// (p x cases) inputs -> (p x cases) per unit of the input; at a kink that of one side
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& x)> gradients;
};

/// By influence maps. Gradients are those of the maps in closed form where the scene aligns nothing
/// and the response is not counted, else differences over a hundredth of the spreads. Keeps
/// references: the arguments must outlive it.
ResponseFunction response_function(const Study& study, const ReadyArm& ready,
                                   const InfluenceMap& influence, Response response);

/// Gradients of a response of maps that are not aligned: of the pass that makes the surface at each
/// vertex, weighted as the response weighs the vertex.
/// @param x  (p x cases)  @return (p x cases); zero where nothing is cut
/// @throws std::invalid_argument for a response that is counted
Eigen::MatrixXd gradients(const InfluenceMap& influence, Response response,
                          const Eigen::MatrixXd& x);

}  // namespace abbe::sim::study
