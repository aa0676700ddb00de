#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"
#include "kinematics/chain.h"
#include "sim/compensation/channels.h"
#include "sim/machine/machine.h"
#include "sim/program/path.h"
#include "sim/program/sample.h"
#include "sim/scene/machine.h"

/// Commands of the axes: the datum shift of the control, and the positions that it commands, with
/// or without corrections.
namespace abbe::sim {

/// Corrected commands, and the errors that the corrector knows it could not remove.
struct CorrectedCommands {
  std::vector<kinematics::AxisState> states;
  double remaining_point_error = 0.0;      ///< largest position error left, mm
  double remaining_direction_error = 0.0;  ///< largest direction error left, rad
  std::size_t not_converged = 0;           ///< number of corrections that did not converge
};

/// Corrects commands so that the tool reaches T_wt_nominal. Both are (samples), in order of time.
using Corrector =
    std::function<CorrectedCommands(const std::vector<kinematics::AxisState>& commanded,
                                    const std::vector<kinematics::Pose>& T_wt_nominal)>;

/// Returns the pose of the tool in the workpiece, T_wt, at an axis state on a given machine.
using ToolAt = std::function<kinematics::Pose(const kinematics::AxisState&)>;

/// Returns the shift of the work zero after the control has measured the datum on the machine with
/// errors, rotary axes at zero: the tip is then commanded to `point + offset`. `ideal` brings the
/// tip to its point exactly. `touch_off` measures one component in each touch, and the shift is
/// zero in directions that no touch measures.
/// @param tool_at    of the machine with errors
/// @param corrector  corrects the commands while the datum is measured; none by default
/// @return mm, workpiece frame
Eigen::Vector3d datum_offset(const DatumDescription& datum, const Machine& machine,
                             const ToolAt& tool_at, const Corrector& corrector = {});

/// Returns the shift that a compensator expects an uncompensated control to measure: the effect of
/// its corrections at the datum, exact to the second order of them.
/// @return mm, workpiece frame
Eigen::Vector3d expected_offset(const DatumDescription& datum, const Machine& machine,
                                const Corrector& corrector);

/// Returns the derivatives of the tip by the positions of the slides, in the workpiece frame.
/// @return (3 x joints) zero for other joints
Eigen::MatrixXd slide_jacobian(const kinematics::Chain& chain, const kinematics::AxisVector& q);

/// Returns the slide positions that shift the tip by `offset_w` in the workpiece, rotary axes at
/// zero. Directions without a slide are ignored.
/// @return (joints)
kinematics::AxisVector slide_offset(const kinematics::Chain& chain,
                                    const Eigen::Vector3d& offset_w);

/// Motion that a piezo adds to the tool, independent of the axes.
struct PiezoMotion {
  compensation::Piezo piezo;
  Eigen::VectorXd stroke;  ///< (samples) mm along the direction of the piezo
};

/// Commanded axis positions of a job, with or without compensation.
struct Commands {
  program::Samples samples;
  std::optional<program::Path> path;  ///< program of the samples, if it is not the job's own
  std::vector<kinematics::Pose> T_wt_nominal;  ///< (samples) empty if the times are the job's own
  std::vector<kinematics::AxisVector>
      correction;  ///< (samples) added by a channel of the axes; empty without one
  std::optional<PiezoMotion> piezo;
  double remaining_point_error = 0.0;  ///< largest position error known to the compensator that it
                                       ///< could not remove, mm
  double remaining_direction_error = 0.0;  ///< the same for the direction, rad
  std::size_t not_converged = 0;
  std::string rewritten_program;
  std::vector<std::string> warnings;
  /// Commands of the segments of a job with several tools. The outer object then has only the
  /// states of the samples, the remaining errors, and the warnings.
  std::vector<Commands> segments = {};
};

/// Joins the commands of the segments of a job into those of the job.
Commands joined(std::vector<Commands> segments);

/// Returns the commands of a part of a job.
/// @param part  its number in `job_segments`
const Commands& part_commands(const Commands& commands, std::size_t part);

/// Returns the commands of a control for a program that was sampled with the chain `sampled_by`.
/// The control reaches a programmed tip by its own kinematics, and shifts every position by the
/// datum that it measured.
/// @param offset_w  shift of the datum, mm
/// @throws BadInput with the program line if the slides of the control do not reach a tip
std::vector<kinematics::AxisState> commanded(const kinematics::Chain& control,
                                             const program::Path& path,
                                             const program::Samples& samples,
                                             const kinematics::Chain& sampled_by,
                                             const Eigen::Vector3d& offset_w);

/// Returns the commands of a program sampled on the nominal machine, without a compensator.
/// @param offset_w  shift of the datum that the control measured, mm
/// @throws BadInput as `commanded`
Commands uncompensated_commands(const Machine& machine, const program::Path& path,
                                const program::Samples& samples, const Eigen::Vector3d& offset_w);

}  // namespace abbe::sim
