#pragma once

#include "sim/compensation/machine_belief.h"
#include "sim/loop/seen.h"

namespace abbe::sim {

/// What a compensator has learnt when it corrects a program: what the control read while it ran
/// before, and what was measured of the part that it made.
struct Evidence {
  compensation::ControlLog log;
  std::optional<compensation::CurrentLaw> law;         ///< taught by a training part
  std::optional<compensation::LoadCourse> model_load;  ///< of a cut that was computed, not read
  std::optional<compensation::PartCourse> part;
};

/// What the scene gives to believe of the kinds that the case names, by the evidence so far.
/// @throws BadInput naming the scene where it gives nothing of that kind, or what it gives does not
///         fit the machine or its sensors
compensation::MachineBelief machine_belief(const Seen& seen, const CaseDescription& compensator,
                                           const Evidence& evidence);

/// Row of the vertex nearest to a point.
Eigen::Index nearest_vertex(const cutting::Points& vertices, const Eigen::RowVector3d& point);

/// What the program leaves at points of the part on a machine without errors, cusps above all: by
/// the vertex nearest to each, 0 where nothing is cut. @return (points) mm
Eigen::VectorXd left_by_program(const Seen& seen, const cutting::Surface& error_free,
                                const Eigen::MatrixX3d& points_w);

/// What the readings of a part say of the tool, by the instants at which the nominal program
/// shapes the part.
/// @param total  (vertices) mm, deviation by all that was read so far
compensation::PartCourse course_of_part(const Seen& seen, const cutting::Surface& error_free,
                                        const Eigen::VectorXd& total);

/// Whether a case believes in something of that kind.
bool believes(const BeliefDescription& given, CaseDescription::Belief belief,
              CaseDescription::Belief kind);

}  // namespace abbe::sim
