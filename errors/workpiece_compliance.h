#pragma once

#include <array>
#include <limits>
#include <string>

#include "errors/compliance.h"

/// Search in a field of nodes; what `compliance.h` needs of it.
namespace abbe::errors {

/// The five nodes nearest to a point, nearest first; of equal distance the one given first.
struct NearestNodes {
  struct Node {
    double squared = std::numeric_limits<double>::infinity();  ///< distance, mm^2
    int number = std::numeric_limits<int>::max();              ///< in the field that was given
    int place = -1;                                            ///< row of the field; -1: none
  };
  std::array<Node, 5> nodes;
};

/// One by one, and by the tree: the same.
NearestNodes nearest_nodes(const WorkpieceField& field, const Eigen::Vector3d& point_w);
NearestNodes nearest_nodes(const IndexedField& index, const Eigen::Vector3d& point_w);

/// The field as a balanced tree: the middle node of a stretch parts it along `split`.
IndexedField indexed(const WorkpieceField& field);

/// Mean of the first four as `local_compliance` weighs them.
Eigen::Matrix3d interpolated_compliance(const WorkpieceField& field, const NearestNodes& nearest);

/// What was expected of a node that is not as it should be; empty if it is.
std::string node_error(const Eigen::Vector3d& point_w, const Eigen::Matrix3d& C);

}  // namespace abbe::errors
