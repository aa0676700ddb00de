#pragma once

#include <array>
#include <limits>
#include <string>

#include "errors/compliance.h"

/// Nearest-node search in a compliance field, for `compliance.h`.
namespace abbe::errors {

/// The five nodes nearest to a point, nearest first; at equal distance the one of lower index.
struct NearestNodes {
  struct Node {
    double squared_distance = std::numeric_limits<double>::infinity();  ///< squared distance, mm^2
    int index = std::numeric_limits<int>::max();  ///< index in the original field
    int row = -1;                                 ///< row of the field; -1: none
  };
  std::array<Node, 5> nodes;
};

/// Return the nodes nearest to a point, by exhaustive search and with the tree; the results are the
/// same.
NearestNodes nearest_nodes(const WorkpieceField& field, const Eigen::Vector3d& point_w);
NearestNodes nearest_nodes(const IndexedField& tree, const Eigen::Vector3d& point_w);

/// Returns the field as a balanced tree: the middle node of a range splits it along `split`.
IndexedField build_tree(const WorkpieceField& field);

/// Returns the weighted mean of the four nearest nodes, with the weights of `local_compliance`.
Eigen::Matrix3d interpolated_compliance(const WorkpieceField& field, const NearestNodes& nearest);

/// Returns the violated expectation of an invalid node, for a message; empty if the node is valid.
std::string node_error(const Eigen::Vector3d& point_w, const Eigen::Matrix3d& C);

}  // namespace abbe::errors
