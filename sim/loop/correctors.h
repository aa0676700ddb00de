#pragma once

#include "sim/compensation/machine_belief.h"
#include "sim/loop/control_view.h"

/// Correctors: a belief with a strategy, a plug-in, or tables of a control, and the beliefs learned
/// from evidence.
namespace abbe::sim {

/// Evidence of a compensator before it corrects a program: readings of the control in earlier runs,
/// and measurements of the part.
struct Evidence {
  compensation::ControlLog log;
  std::optional<compensation::CurrentLaw> law;         ///< learned from a training part
  std::optional<compensation::LoadSeries> model_load;  ///< of a simulated cut
  /// Displacement of the tool that the measured part shows.
  std::optional<compensation::DisplacementSeries> part;
};

/// Returns the belief of the scene in the kinds that the case names, with the evidence so far.
/// @throws BadInput naming the scene if it has no belief of that kind, or if it does not fit the
///     machine or its sensors
compensation::MachineBelief machine_belief(const ControlView& view,
                                           const CaseDescription& compensator,
                                           const Evidence& evidence);

/// Returns the number of the vertex nearest to a point.
Eigen::Index nearest_vertex(const cutting::Points& vertices, const Eigen::RowVector3d& point);

/// Returns the residual that the program leaves at points of the part on a machine without errors,
/// mainly cusps; taken at the nearest vertex, 0 where nothing is cut.
/// @return (points) mm
Eigen::VectorXd program_residuals(const ControlView& view, const cutting::Surface& error_free,
                                  const Eigen::MatrixX3d& points_w);

/// Returns the displacement of the tool that the readings of a part show, at the times when the
/// nominal program shapes the part.
/// @param total  (vertices) mm, deviation from all readings so far
compensation::DisplacementSeries part_series(const ControlView& view,
                                             const cutting::Surface& error_free,
                                             const Eigen::VectorXd& total);

/// Returns true if a case uses a belief of a kind.
bool is_belief_enabled(const BeliefDescription& given, CaseDescription::Belief belief,
                       CaseDescription::Belief kind);

// The correctors

/// Returns the corrector of a belief with the strategy of the case.
Corrector belief_corrector(const ControlView& view, const CaseDescription& compensator,
                           compensation::Belief belief);

/// Returns the corrector of a plug-in that the user trusts. If it answers with deviations, the
/// strategy of the case converts them.
/// @throws compensation::PlugInFailure from the corrector
Corrector plug_in_corrector(const ControlView& view, const CaseDescription& compensator,
                            compensation::ControlLog log);

/// A corrector made into tables, as the format of the scene's control holds them and reads them
/// back.
struct TableCorrector {
  Corrector corrector;
  std::vector<std::string> left_out;  ///< what the format cannot hold
};
/// Returns the tables of a corrector.
/// @param believed  for a volumetric format, which holds deviations instead of corrections
/// @throws BadInput naming the scene if tables cannot be made
TableCorrector table_corrector(const ControlView& view, const Corrector& corrector,
                               const std::optional<errors::GeometricModel>& believed);

/// Returns the layout of the scene's tables: over the travel; for an axis that turns more than
/// once, or has no limits, over the range of the program, since a table has too few points for a
/// hundred turns.
compensation::TableOptions table_options(const ControlView& view);

/// Returns the correction of a corrector as tables over the axes.
/// @throws BadInput naming the scene if they cannot be made
compensation::ParameterTables tables_of(const ControlView& view, const Corrector& corrector);

}  // namespace abbe::sim
