#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/report/verdict.h"

namespace abbe::sim {

/// Figures of a case, and their reduction by its compensator.
struct CaseStatistics {
  std::string name;
  cutting::Statistics residual;
  std::optional<cutting::Statistics>
      without_triangle_samples;                ///< of the vertices alone, if the map also has
                                               ///< random points between them
  std::optional<cutting::Statistics> machine;  ///< of the residual minus the error-free map
  std::optional<cutting::Statistics> form;     ///< of the residual through the areal filter
  std::optional<errors::metrology::ArealParameters> texture;  ///< of the residual minus its form
  double form_cutoff = 0.0;                                   ///< mm, cut-off of the areal filter
  std::optional<cutting::InterpolationError> interpolation;
  Spread tip_error;        ///< mm
  Spread direction_error;  ///< rad
  ChordError chord_error;
  std::optional<Verdict::ExtremePoint> highest, lowest, worst;  ///< as in Verdict
  /// Reductions of figures in percent; empty if the uncompensated figure is zero or missing.
  struct Reduction {
    std::optional<double> pv, rms;
  };
  struct TextureReduction {
    std::optional<double> Sa, Sq, Sz;
  };
  // Reductions of a case with a compensator.
  std::optional<Reduction> residual_reduction, machine_reduction, form_reduction;
  std::optional<TextureReduction> texture_reduction;
};

/// Figures of the cutting process of a case.
struct CutStatistics {
  std::size_t steps = 0;
  ProcessTotals totals;
  std::vector<int> crash_lines;  ///< lines of the program
};

/// Figures of one case.
struct Summary {
  std::string scene;
  std::uint64_t seed = 0;
  int moves = 0;
  std::size_t samples = 0;
  program::UnreachedPoints unreached;
  CaseStatistics figures;
  std::optional<Tolerance> tolerance;              ///< of the part, if no region has its own
  std::vector<cutting::AnalyticPatch> recognised;  ///< faces recognised in a mesh
  std::optional<SampledSurface> sampling;          ///< choice of the judged points
  double remaining_point_error =
      0.0;  ///< mm, largest error that the compensator knew it could not correct
  double remaining_direction_error = 0.0;  ///< rad, the same for the direction
  std::optional<Spread> facet_error;       ///< mm, of the design's own mesh; empty if there is none
  DatumDescription::Kind datum = {};
  Alignment alignment = {};
  ViewDescription view;  ///< for the pictures
  /// Displacement that the alignment removed from the map.
  struct RemovedAlignment {
    kinematics::Deviation displacement = kinematics::Deviation::Zero();  ///< mm and rad
    std::vector<std::string> undetermined;  ///< components that could not be determined
  };
  std::optional<RemovedAlignment> removed_alignment;  ///< of a scene with an alignment
  std::vector<cutting::FormNumber> form;
  std::vector<Verdict::Ring> rings;
  struct NodeTemperature {
    std::string node;
    double start_C = 0.0, end_C = 0.0;  ///< when the program starts and ends
  };
  std::optional<std::vector<NodeTemperature>> temperatures;  ///< of a machine with heat
  std::optional<CutStatistics> cut;                          ///< of a scene with [cutting]
  /// Durations of stages; if a name occurs several times, its last entry is valid.
  std::vector<std::pair<std::string, double>> timing_s;
  std::shared_ptr<const StockCheck> stock;  ///< of the verdict
  std::vector<WornTool> wear;               ///< of all tools with wear, at the end of the program
  std::vector<std::string> warnings;
  std::vector<program::Assumption> assumptions;  ///< that the reader of the program made about the
                                                 ///< control
};
/// Returns the figures of a case.
Summary summary(const Job& job, const Verdict& verdict);

/// A case whose plug-in failed.
struct FailedCase {
  std::string name;
  std::string reason;
};

/// All cases of a scene, each compared with the uncompensated case of its variant.
struct Comparison {
  std::string scene;
  std::uint64_t seed = 0;
  Eigen::Index vertices = 0;
  int moves = 0;
  program::UnreachedPoints unreached;
  DatumDescription::Kind datum = {};
  Alignment alignment = {};
  std::optional<Tolerance> tolerance;
  std::vector<CaseStatistics> cases;
  std::vector<FailedCase> failed;
  std::vector<std::string> warnings;  ///< of the scene, its variants and all cases
  std::vector<program::Assumption> assumptions;
};
/// Compares all cases.
Comparison comparison(const Job& job, const std::vector<ComparedCase>& cases,
                      const std::vector<FailedCase>& failed = {});

/// Return `summary.json` of a case and `comparison.json` of all cases. Their keys are stable, so
/// that scripts may rely on them.
nlohmann::ordered_json to_json(const Summary& summary);
nlohmann::ordered_json to_json(const Comparison& comparison);

/// Return the figures of cases and the limits of a tolerance, or null, as in `comparison.json`.
nlohmann::ordered_json to_json(const std::vector<CaseStatistics>& cases);
nlohmann::ordered_json tolerance_um(const std::optional<Tolerance>& tolerance);

/// Return a table of residuals with a line per case.
std::string to_text(const Summary& summary);
std::string to_text(const Comparison& comparison);

}  // namespace abbe::sim
