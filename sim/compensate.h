#pragma once

#include <functional>
#include <vector>

#include "sim/loop.h"

namespace abbe::sim {

/// Commands with a correction in them, and what its maker knew that it could not reach.
struct Corrected {
  std::vector<kinematics::AxisState> states;
  double point_left = 0.0;      ///< mm
  double direction_left = 0.0;  ///< rad
  std::size_t not_converged = 0;
};

/// Corrects commands that should bring the tool to T_wt_nominal, both (samples) in the order of
/// time.
using Corrector = std::function<Corrected(const std::vector<kinematics::AxisState>& commanded,
                                          const std::vector<kinematics::Pose>& T_wt_nominal)>;

/// What corrects the program of a case, after all passes from which it learns.
struct Learnt {
  Corrector corrector;
  Corrector at_datum;  ///< acts while the datum is found; none: `corrector`. What a part showed
                       ///< counts from the datum from which it was cut, and moves no datum
  std::optional<errors::GeometricModel> geometric;  ///< what is believed of the geometry alone
  std::vector<std::string> warnings;
};
/// @throws as `compensate`
Learnt learnt(const Job& job, const CaseDescription& compensator, const Progress& progress = {});

/// Commands of the real control for a program that was sampled with `sampled_by`: a tip that is
/// programmed is reached by the control's own kinematics, and the datum that it found shifts all.
/// @param offset_w  mm, that shift
/// @throws BadInput naming the line of a tip that the control's slides do not reach
std::vector<kinematics::AxisState> told(const Job& job, const program::Path& path,
                                        const program::Samples& samples,
                                        const kinematics::Chain& sampled_by,
                                        const Eigen::Vector3d& offset_w);

/// The same with the datum found by a control that nothing compensates.
std::vector<kinematics::AxisState> told(const Job& job, const program::Path& path,
                                        const program::Samples& samples,
                                        const kinematics::Chain& sampled_by);

}  // namespace abbe::sim
