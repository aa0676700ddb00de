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

/// Tables of tool poses with their errors, sources and Jacobians, and maps of the errors over the
/// work space.
namespace abbe::sim {

/// Derivatives of the nominal pose, defined in kinematics/inverse_kinematics.h.
enum class PoseJacobian {
  Axis,      ///< by axis positions: dx_dX ... dc_dX, [tip mm | rotation rad] per mm or rad
  Motion,    ///< by error motions: dx_dEXX ... dc_dECA
  Location,  ///< by location errors: dx_dEC0Y ...
};

/// Quantities to be computed for every pose in addition to the tip and its deviation.
struct PoseRequest {
  std::vector<PoseJacobian> jacobians;
  std::vector<std::string> elements;  ///< names of error sources, or "all"; see idle_machine.h
};

/// The columns of a table of poses, and the computation of a row. Immutable.
class PoseTable {
 public:
  /// Throws BadInput if the machine lacks a requested element.
  PoseTable(const IdleMachine& idle, const PoseRequest& request);

  const IdleMachine& idle() const { return idle_; }

  /// Returns the column names: tip_x_mm ..., deviation_x_um ..., deviation_um, direction_x_urad
  /// ..., direction_urad; for a source EXX_x_um ..., EXX_x_urad ...; the remainder that the
  /// requested sources leave, rest_x_um ...; then the Jacobians.
  const std::vector<std::string>& column_names() const { return heads_; }
  static constexpr std::size_t fixed_column_count =
      11;  ///< number of columns before the requested ones

  /// The six columns of a requested quantity.
  struct ColumnGroup {
    std::string name;         ///< of the source, of the remainder, or of the variable
    bool derivative = false;  ///< true: derivative by the variable; false: um and urad
  };
  /// Returns the requested quantities, in the order of their columns.
  const std::vector<ColumnGroup>& requested_columns() const { return requested_columns_; }

  /// A row of the table: the deviation, and the numbers of all columns.
  struct Row {
    Eigen::Vector3d deviation;    ///< mm, workpiece frame
    Eigen::Vector3d direction;    ///< rad
    std::vector<double> numbers;  ///< one for each column
  };
  /// Returns the row of an axis state.
  /// @throws std::out_of_range if a position lies outside an error table that does not extrapolate
  Row row(const kinematics::AxisState& state) const;

 private:
  void add_contribution(const std::string& source);
  void add_jacobian(PoseJacobian jacobian);

  const IdleMachine& idle_;
  std::vector<ErrorSource> sources_;
  bool has_contributions_;
  std::vector<PoseJacobian> jacobians_;
  std::vector<int> motions_, locations_;  ///< columns of the Jacobians whose element exists
  std::vector<std::string> heads_;
  std::vector<ColumnGroup> requested_columns_;
};

/// Statistics of the deviations over many poses.
struct PoseStatistics {
  std::size_t poses = 0;
  double max_um = 0.0, p95_um = 0.0, rms_um = 0.0;  ///< of the length of the deviation of the tip
  std::size_t worst = 0;  ///< number of the first pose with the largest deviation, from 0
  double direction_max_urad = 0.0;
  std::size_t direction_worst = 0;
};
/// Returns the statistics of deviations.
/// @param deviation_um, direction_urad  (poses) lengths of the deviations
PoseStatistics pose_statistics(const Eigen::VectorXd& deviation_um,
                               const Eigen::VectorXd& direction_urad);

/// Formats of a table of poses.
enum class TableFormat { Csv, Json };

/// Computes all poses and passes their lines to `sink` in order, a bounded number at a time: CSV
/// with a header, or the objects of a JSON list, separated by commas. The bytes are the same for
/// any number of threads, and every number reads back to the same bits.
/// @throws BadInput at the first pose outside an error table that does not extrapolate
/// @throws Interrupted if the user stops the program
PoseStatistics write_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::function<void(std::string_view)>& sink,
                           ProgressLine* progress = nullptr);

/// Nominal and actual pose of the tool at one position.
struct PoseResult {
  TipPose pose;
  std::vector<PoseTable::ColumnGroup> requested_columns;  ///< quantities in addition to the pose
  std::vector<std::string> column_names;  ///< (6 x requested) as in a table of poses
  std::vector<double> numbers;            ///< (heads)
  std::vector<std::string> warnings;
};

/// Limits of accepted axis positions.
enum class Within { Travel, Anything };

/// Reads axis positions such as "X=100 A=30" (mm, degrees). Axes that are not named are at zero.
/// @param option  name in messages
/// @throws BadInput if the machine lacks an axis, a number is not valid, an axis occurs twice, or a
///     position is beyond the travel where `within` forbids that
kinematics::AxisVector parse_positions(const std::string& text, const kinematics::Chain& chain,
                                       const std::string& option, Within within);

/// Returns the pose at positions such as "X=100 A=30" (mm, degrees), all axes at rest. Axes that
/// are not named are at zero.
/// @throws BadInput if the machine lacks an axis or an element, a number is not valid or beyond the
///     travel, or an axis occurs twice
PoseResult pose_at(const Scene& scene, const std::string& positions,
                   const PoseRequest& request = {});

/// A grid of poses over the ranges of one to three axes, the others at fixed positions.
struct PoseGrid {
  /// The range of an axis.
  struct Run {
    int joint = 0;
    double from = 0.0, to = 0.0;  ///< mm or degrees
    int count = 2;
  };
  std::vector<Run> runs;             ///< in the order of the structural code
  std::array<int, 3> size{1, 1, 1};  ///< number of points along each run; the first varies fastest
  PoseList poses;                    ///< with a column for every positioned axis
};

/// Limit on the poses of a grid.
inline constexpr std::size_t max_grid_poses = 200'000;

/// Reads a grid such as "X=0:400:9 Y=::5 Z=10 A=30" (mm, degrees): a fixed position, or from, to
/// and count, each of which may be omitted. Slides that are not named run over their travel, rotary
/// axes are at home. The default count is 11 for three ranges, 21 for two, 101 for one.
/// @throws BadInput with the column: an axis that the machine lacks or that occurs twice, a number
///     that is not valid or beyond the travel, a missing end of an axis without limits, from not
///     below to, a count below 2, no run or more than three, or more than `max_grid_poses`
PoseGrid pose_grid(const IdleMachine& idle, const std::string& text);

/// Errors of a machine over its work space, in the workpiece frame.
struct VolumetricMap {
  PoseGrid grid;
  cutting::Points nominal;    ///< (n x 3) mm, tip
  cutting::Points deviation;  ///< (n x 3) mm, of the tip
  cutting::Points direction;  ///< (n x 3) rad, of the tool axis
  cutting::Points rotation;   ///< (n x 3) rad, rotation vector of the tool
};
/// Computes the map; the bits are the same for any number of threads.
/// @throws BadInput naming the first pose outside an error table that does not extrapolate
VolumetricMap volumetric_map(const IdleMachine& idle, PoseGrid grid);

/// Figures of a volumetric map.
struct VolumetricSummary {
  PoseStatistics all;
  Eigen::Vector3d mean_um = Eigen::Vector3d::Zero();
  /// Volumetric error of ISO 230-1: range of the deviations in X, Y and Z, and of the rotations
  /// about them. A constant deviation does not count, since an offset of the work zero removes it.
  Eigen::Vector3d range_um = Eigen::Vector3d::Zero();
  Eigen::Vector3d range_urad = Eigen::Vector3d::Zero();
  /// The two poses whose deviations differ most, and the difference.
  std::array<std::size_t, 2> worst_pair{};
  double worst_pair_um = 0.0;
};
/// Returns the figures of a map.
VolumetricSummary summary(const VolumetricMap& map);

/// The first pair of points with the largest distance.
struct FarthestPair {
  std::size_t a = 0, b = 0;
  double distance = 0.0;
};
/// Returns the farthest pair of points.
/// @param points  (n x 3), n >= 1
FarthestPair farthest_pair(const cutting::Points& points);

}  // namespace abbe::sim
