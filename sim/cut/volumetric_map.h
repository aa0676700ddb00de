#pragma once

#include <array>
#include <string>
#include <vector>

#include "cutting/mesh.h"
#include "sim/cut/pose_list.h"
#include "sim/cut/pose_table.h"

namespace abbe::sim {

/// One to three axes that run through the work space while the others stand.
struct PoseGrid {
  struct Run {
    int joint = 0;
    double from = 0.0, to = 0.0;  ///< mm or degrees
    int count = 2;
  };
  std::vector<Run> runs;             ///< in the order of the structural code
  std::array<int, 3> size{1, 1, 1};  ///< points along each; the first runs fastest
  PoseList poses;                    ///< every axis that can be positioned has a column
};

inline constexpr std::size_t most_grid_poses = 200'000;

/// Reads "X=0:400:9 Y=::5 Z=10 A=30" (mm, degrees): from, to and count, each of which may be left
/// out, or a place. Slides that are not named run over their travel, turns stand at home; a count
/// left out is 11 of three runs, 21 of two, 101 of one.
/// @throws BadInput with the column: an axis that the machine lacks or that comes twice, a number
///         that is none or beyond the travel, an end left out of an axis without limits, from not
///         below to, a count below 2, no run or more than three, more than most_grid_poses
PoseGrid pose_grid(const IdleMachine& idle, const std::string& text);

/// What is wrong with a machine all over its work space, workpiece frame.
struct VolumetricMap {
  PoseGrid grid;
  cutting::Points nominal;    ///< (n x 3) mm, tip
  cutting::Points deviation;  ///< (n x 3) mm, of the tip
  cutting::Points direction;  ///< (n x 3) rad, of the tool axis
  cutting::Points rotation;   ///< (n x 3) rad, rotation vector of the tool
};
/// The same bits for any number of threads.
/// @throws BadInput naming the first pose where the table of an element is left
VolumetricMap volumetric_map(const IdleMachine& idle, PoseGrid grid);

struct VolumetricSummary {
  PoseStatistics all;
  Eigen::Vector3d mean_um = Eigen::Vector3d::Zero();
  /// Volumetric error of ISO 230-1: how far the deviations in X, Y, Z range, and the rotations
  /// about them. A constant deviation, which an offset of the work zero takes away, is not in it.
  Eigen::Vector3d range_um = Eigen::Vector3d::Zero();
  Eigen::Vector3d range_urad = Eigen::Vector3d::Zero();
  /// The two poses whose deviations differ most, and by how much.
  std::array<std::size_t, 2> worst_pair{};
  double worst_pair_um = 0.0;
};
VolumetricSummary summary(const VolumetricMap& map);

/// The two rows that lie farthest apart, the first such pair. (n x 3), n >= 1
struct FarthestPair {
  std::size_t a = 0, b = 0;
  double distance = 0.0;
};
FarthestPair farthest_pair(const cutting::Points& points);

}  // namespace abbe::sim
