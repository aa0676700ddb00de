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

namespace abbe::sim {

/// Commands with a correction in them, and what its maker knew that it could not reach.
struct CorrectedCommands {
  std::vector<kinematics::AxisState> states;
  double point_left = 0.0;      ///< mm
  double direction_left = 0.0;  ///< rad
  std::size_t not_converged = 0;
};

/// Corrects commands that should bring the tool to T_wt_nominal, both (samples) in the order of
/// time.
using Corrector =
    std::function<CorrectedCommands(const std::vector<kinematics::AxisState>& commanded,
                                    const std::vector<kinematics::Pose>& T_wt_nominal)>;

/// Where the tool is in the part, T_wt, on whatever machine it is asked of.
using ToolAt = std::function<kinematics::Pose(const kinematics::AxisState&)>;

/// Shift of the work zero that the control makes after it found the datum on the wrong machine: the
/// tip is commanded to `point + offset`. Rotary axes stand at zero. `ideal` brings the tip to its
/// point exactly; `touch_off` sees one component a touch and leaves the directions that it never
/// touched.
/// @param tool_at    of that machine
/// @param corrector  acts while the datum is found; without one nothing does
/// @return mm, workpiece frame
Eigen::Vector3d datum_offset(const DatumDescription& datum, const Machine& machine,
                             const ToolAt& tool_at, const Corrector& corrector = {});

/// The shift that a compensator expects to be found by a control without it: what its corrections
/// take away at the datum, to the second order in them.
/// @return mm, workpiece frame
Eigen::Vector3d expected_offset(const DatumDescription& datum, const Machine& machine,
                                const Corrector& corrector);

/// Slide positions of a shift of the tip in the workpiece, rotary axes at zero; directions without
/// a slide are left. @return (joints)
kinematics::AxisVector slide_offset(const kinematics::Chain& chain,
                                    const Eigen::Vector3d& offset_w);

/// What a piezo does to the tool beside the axes.
struct PiezoMotion {
  compensation::Piezo piezo;
  Eigen::VectorXd stroke;  ///< (samples) mm along its direction
};

/// What the axes are commanded, compensated or not.
struct Commands {
  program::Samples samples;
  std::optional<program::Path>
      path;  ///< from which the samples come, where it is not the job's own
  std::vector<kinematics::Pose>
      T_wt_nominal;  ///< (samples) empty where the times are the job's own
  std::vector<kinematics::AxisVector>
      correction;  ///< (samples) that a channel of the axes adds; else empty
  std::optional<PiezoMotion> piezo;
  double point_left = 0.0;      ///< mm, most that a compensator knew it could not restore
  double direction_left = 0.0;  ///< rad, the same of the direction
  std::size_t not_converged = 0;
  std::string rewritten_program;
  std::vector<std::string> warnings;
  std::vector<Commands> stretches = {};  ///< of a job with stretches: one for each; of the whole
                                         ///< then hold the states alone of the samples, what is
                                         ///< left, and warnings
};

/// The commands of a job from those of its parts, one for each.
Commands joined(std::vector<Commands> parts);

/// The commands of a part of a job. @param part  its number among `parts_of`
const Commands& of_part(const Commands& commands, std::size_t part);

/// Commands of a control for a program that was sampled with `sampled_by`: a tip that is programmed
/// is reached by the control's own kinematics, and the datum that it found shifts all.
/// @param offset_w  mm, that shift
/// @throws BadInput naming the line of a tip that the control's slides do not reach
std::vector<kinematics::AxisState> commanded(const kinematics::Chain& control,
                                             const program::Path& path,
                                             const program::Samples& samples,
                                             const kinematics::Chain& sampled_by,
                                             const Eigen::Vector3d& offset_w);

/// The commands of a program that was sampled on the nominal machine, without a compensator.
/// @param offset_w  mm, shift of the datum that the control found
/// @throws as `commanded`
Commands uncompensated_commands(const Machine& machine, const program::Path& path,
                                const program::Samples& samples, const Eigen::Vector3d& offset_w);

}  // namespace abbe::sim
