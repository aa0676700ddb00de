#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "sim/compensation/machine_belief.h"
#include "sim/loop/control_view.h"

/// Correctors by a belief with a strategy, by a plug-in, or by tables of a control; beliefs learned
/// from evidence.
namespace abbe::sim {

/// Evidence available to a compensator before it corrects a program: readings of the control in
/// earlier runs, and measurements of the part.
struct Evidence {
  compensation::ControlLog log;
  std::optional<compensation::CurrentLaw> law;         ///< learned from a training part
  std::optional<compensation::LoadSeries> model_load;  ///< of a simulated cut
  /// Displacement of the tool derived from the measured part.
  std::optional<compensation::DisplacementSeries> part;
};

/// Returns the beliefs of the scene of the kinds that the case uses, with the evidence so far.
/// @throws BadInput naming the scene if it has no belief of a kind, or if a belief does not fit the
///     machine or its sensors
compensation::MachineBelief machine_belief(const ControlView& view,
                                           const CaseDescription& compensator,
                                           const Evidence& evidence);

/// Returns the index of the vertex nearest to a point.
Eigen::Index nearest_vertex(const cutting::Points& vertices, const Eigen::RowVector3d& point);

/// Returns the residual, mainly cusps, that the program leaves at points of the part on a machine
/// without errors. It is that of the nearest vertex, 0 for a vertex that is not cut.
/// @return (points) mm
Eigen::VectorXd program_residuals(const ControlView& view, const cutting::Surface& error_free,
                                  const Eigen::MatrixX3d& points_w);

/// Returns the displacement of the tool derived from the deviations of a part, at the times at
/// which the nominal program shapes the part.
/// @param total  (vertices) mm, deviation from all readings so far
compensation::DisplacementSeries part_series(const ControlView& view,
                                             const cutting::Surface& error_free,
                                             const Eigen::VectorXd& total);

/// Returns true if a case uses a belief of a kind.
bool is_belief_enabled(const BeliefDescription& beliefs, CaseDescription::Belief belief,
                       CaseDescription::Belief kind);

/// Returns the corrector of a belief with the strategy of the case.
Corrector belief_corrector(const ControlView& view, const CaseDescription& compensator,
                           compensation::Belief belief);

/// Returns the corrector of a plug-in that the user trusts. Deviations returned by the plug-in are
/// converted into corrections by the strategy of the case.
/// @throws compensation::PlugInFailure from the corrector
Corrector plug_in_corrector(const ControlView& view, const CaseDescription& compensator,
                            compensation::ControlLog log);

/// Tables of a control, after they were written and read back in the format of the scene's control.
struct ControlTables {
  /// Corrections of the axes, or of a volumetric format the deviations from which the control
  /// corrects the position.
  std::variant<compensation::ParameterTables, errors::GeometricErrors> values;
  std::vector<std::string> omissions;  ///< corrections that the format cannot represent
};
/// Converts a corrector into tables.
/// @param view  of the tool whose tip the tables correct, with the program of all tools
/// @param believed  errors for a volumetric format
/// @throws BadInput naming the scene if tables cannot be made
ControlTables control_tables(const ControlView& view, const Corrector& corrector,
                             const std::optional<errors::GeometricModel>& believed);

/// Returns the corrector by tables while a tool runs, the one for which they were made or another.
Corrector table_corrector(const ControlView& view, const ControlTables& tables);

/// Returns the layout of the scene's tables. They extend over the travel. For an axis of more than
/// one turn or without limits they extend over the range of the program, since a table has too few
/// points for a hundred turns.
compensation::TableOptions table_options(const ControlView& view);

/// Returns the correction of a corrector as tables over the axes.
/// @throws BadInput naming the scene if the correction cannot be tabulated
compensation::ParameterTables correction_tables(const ControlView& view,
                                                const Corrector& corrector);

}  // namespace abbe::sim
