#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "sim/cut/idle_machine.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Derivatives of the nominal pose, as kinematics/jacobian.h states them.
enum class PoseJacobian {
  Axis,      ///< by the positions of the axes: dx_dX ... dc_dX, [tip mm | rotation rad] per mm, rad
  Motion,    ///< by the error motions: dx_dEXX ... dc_dECA
  Location,  ///< by the location errors: dx_dEC0Y ...
};

/// What is computed of every pose beside the place of the tip and its deviation.
struct PoseRequest {
  std::vector<PoseJacobian> jacobians;
  std::vector<std::string> elements;  ///< names of sources, or "all"; see idle_machine.h
};

/// Columns of numbers and how a pose fills them. Immutable.
class PoseTable {
 public:
  /// @throws BadInput for an element that the machine lacks
  PoseTable(const IdleMachine& idle, const PoseRequest& wishes);

  const IdleMachine& idle() const { return idle_; }

  /// tip_x_mm ..., deviation_x_um ..., deviation_um, direction_x_urad ..., direction_urad; of a
  /// source EXX_x_um ..., EXX_x_urad ..., and what the chosen ones leave of the whole, rest_x_um
  /// ...; then the Jacobians.
  const std::vector<std::string>& heads() const { return heads_; }
  static constexpr std::size_t always = 11;  ///< heads before those that are wished

  /// What is wished, each with six of the heads.
  struct Six {
    std::string name;         ///< of the source, of what is left, or of what is varied
    bool derivative = false;  ///< by what is varied; else um and urad
  };
  const std::vector<Six>& requested_columns() const { return requested_columns_; }

  struct Row {
    Eigen::Vector3d deviation;    ///< mm, workpiece frame
    Eigen::Vector3d direction;    ///< rad
    std::vector<double> numbers;  ///< one a head
  };
  /// @throws std::out_of_range where a table of an element is left
  Row row(const kinematics::AxisState& state) const;

 private:
  void add_contribution(const std::string& source);
  void add_jacobian(PoseJacobian which);

  const IdleMachine& idle_;
  std::vector<ErrorSource> sources_;
  bool has_contributions_;
  std::vector<PoseJacobian> jacobians_;
  std::vector<int> motions_, locations_;  ///< columns of the Jacobians that mean something
  std::vector<std::string> heads_;
  std::vector<Six> requested_columns_;
};

/// How large deviations are over many poses.
struct PoseStatistics {
  std::size_t poses = 0;
  double max_um = 0.0, p95_um = 0.0, rms_um = 0.0;  ///< of the distance of the tip
  std::size_t worst = 0;                            ///< pose of the largest, from 0, the first
  double direction_max_urad = 0.0;
  std::size_t direction_worst = 0;
};
/// @param deviation_um, direction_urad  (poses) lengths
PoseStatistics pose_statistics(const Eigen::VectorXd& deviation_um,
                               const Eigen::VectorXd& direction_urad);

enum class TableFormat { Csv, Json };

/// Computes all poses and hands their lines to `sink` in order, a bounded number at a time: of CSV
/// with its head, of JSON the objects of a list, parted by commas. The same bytes for any number of
/// threads; every number with the digits that read back the same bits.
/// @throws BadInput at the first pose where the table of an element is left
/// @throws Interrupted
PoseStatistics write_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::function<void(std::string_view)>& sink,
                           ProgressLine* progress = nullptr);

/// Where the tool is and should be at one pose.
struct PoseResult {
  TipPose pose;
  std::vector<PoseTable::Six> requested_columns;  ///< what is computed beside it
  std::vector<std::string> heads;                 ///< (6 x wished) as in a table of poses
  std::vector<double> numbers;                    ///< (heads)
  std::vector<std::string> warnings;
};

enum class Within { Travel, Anything };

/// Numbers for axes as words have them, "X=100 A=30" (mm, degrees); zero for axes not named.
/// @param option  that refusals name
/// @throws BadInput for an axis that the machine lacks, a number that is none, an axis twice, and
///         one beyond the travel where that is asked for
kinematics::AxisVector positions_in(const std::string& words, const kinematics::Chain& chain,
                                    const std::string& option, Within within);

/// The pose with the axes at "X=100 A=30" (mm, degrees; axes not named stand at zero, moving
/// nowhere).
/// @throws BadInput for an axis that the machine lacks, a number that is none or beyond the travel,
///         an axis twice, an element that the machine lacks
PoseResult pose_at(const Scene& scene, const std::string& at, const PoseRequest& wishes = {});

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

inline constexpr std::size_t max_grid_poses = 200'000;

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
