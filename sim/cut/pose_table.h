#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "sim/cut/pose_list.h"
#include "sim/cut/pose_shares.h"
#include "sim/files/progress.h"

namespace abbe::sim {

/// Derivatives of the nominal pose, as kinematics/jacobian.h states them.
enum class PoseJacobian {
  Axis,      ///< by the positions of the axes: dx_dX ... dc_dX, [tip mm | rotation rad] per mm, rad
  Motion,    ///< by the error motions: dx_dEXX ... dc_dECA
  Location,  ///< by the location errors: dx_dEC0Y ...
};

/// What is computed of every pose beside the place of the tip and its deviation.
struct PoseWishes {
  std::vector<PoseJacobian> jacobians;
  std::vector<std::string> elements;  ///< names of sources, or "all"; see pose_shares.h
};

/// Columns of numbers and how a pose fills them. Immutable.
class PoseTable {
 public:
  /// @throws BadInput for an element that the machine lacks
  PoseTable(const IdleMachine& idle, const PoseWishes& wishes);

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
  const std::vector<Six>& wished() const { return wished_; }

  struct Row {
    Eigen::Vector3d deviation;    ///< mm, workpiece frame
    Eigen::Vector3d direction;    ///< rad
    std::vector<double> numbers;  ///< one a head
  };
  /// @throws std::out_of_range where a table of an element is left
  Row row(const kinematics::AxisState& state) const;

 private:
  void add_share(const std::string& source);
  void add_jacobian(PoseJacobian which);

  const IdleMachine& idle_;
  std::vector<ErrorSource> sources_;
  bool has_shares_;
  std::vector<PoseJacobian> jacobians_;
  std::vector<int> motions_, locations_;  ///< columns of the Jacobians that mean something
  std::vector<std::string> heads_;
  std::vector<Six> wished_;
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

}  // namespace abbe::sim
