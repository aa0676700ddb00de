#pragma once

#include "sim/compensation/machine_belief.h"
#include "sim/loop/control_view.h"

namespace abbe::sim {

/// What a compensator has learnt when it corrects a program: what the control read while it ran
/// before, and what was measured of the part that it made.
struct Evidence {
  compensation::ControlLog log;
  std::optional<compensation::CurrentLaw> law;         ///< taught by a training part
  std::optional<compensation::LoadSeries> model_load;  ///< of a cut that was computed, not read
  std::optional<compensation::DisplacementSeries> part;
};

/// What the scene gives to believe of the kinds that the case names, by the evidence so far.
/// @throws BadInput naming the scene where it gives nothing of that kind, or what it gives does not
///         fit the machine or its sensors
compensation::MachineBelief machine_belief(const ControlView& view,
                                           const CaseDescription& compensator,
                                           const Evidence& evidence);

/// Row of the vertex nearest to a point.
Eigen::Index nearest_vertex(const cutting::Points& vertices, const Eigen::RowVector3d& point);

/// What the program leaves at points of the part on a machine without errors, cusps above all: by
/// the vertex nearest to each, 0 where nothing is cut. @return (points) mm
Eigen::VectorXd program_residuals(const ControlView& view, const cutting::Surface& error_free,
                                  const Eigen::MatrixX3d& points_w);

/// What the readings of a part say of the tool, by the instants at which the nominal program
/// shapes the part.
/// @param total  (vertices) mm, deviation by all that was read so far
compensation::DisplacementSeries part_series(const ControlView& view,
                                             const cutting::Surface& error_free,
                                             const Eigen::VectorXd& total);

/// Whether a case believes in something of that kind.
bool is_belief_enabled(const BeliefDescription& given, CaseDescription::Belief belief,
                       CaseDescription::Belief kind);

// The makers of corrections: a belief with a strategy, somebody's plug-in, a control's tables.

/// Strategy of a case with a belief.
Corrector belief_corrector(const ControlView& view, const CaseDescription& compensator,
                           compensation::Belief belief);

/// A plug-in that the user trusts; where it answers with deviations, the strategy of the case.
/// @throws compensation::PlugInFailure from the corrector
Corrector plug_in_corrector(const ControlView& view, const CaseDescription& compensator,
                            compensation::ControlLog log);

/// Tables made of what a corrector does, as the format of the scene's control can hold them and
/// reads them back.
struct TableCorrector {
  Corrector corrector;
  std::vector<std::string> left_out;  ///< what the format cannot hold, in words
};
/// @param believed  for a volumetric format, which holds deviations and not corrections
/// @throws BadInput naming the scene where tables cannot be made
TableCorrector table_corrector(const ControlView& view, const Corrector& corrector,
                               const std::optional<errors::GeometricModel>& believed);

/// How tables of the scene are laid: over the travel, but of an axis that turns more than once, or
/// has no end, over what the program uses, since no table of so few points holds a hundred turns.
compensation::TableOptions table_options(const ControlView& view);

/// The tables that a corrector amounts to.
/// @throws BadInput naming the scene where they cannot be made
compensation::ParameterTables tables_of(const ControlView& view, const Corrector& corrector);

}  // namespace abbe::sim
