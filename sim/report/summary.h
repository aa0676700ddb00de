#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/report/verdict.h"

namespace abbe::sim {

/// What a case left on the part, and how far a compensator brought it down.
struct CaseStatistics {
  std::string name;
  cutting::Statistics residual;
  std::optional<cutting::Statistics> at_vertices;   ///< of the vertices alone, where places at
                                                    ///< random between them are in the others
  std::optional<cutting::Statistics> machine;       ///< of it minus the error-free map
  std::optional<cutting::Statistics> form;          ///< of it through the areal filter
  std::optional<errors::metrology::Areal> texture;  ///< of what the filter leaves out
  double form_cutoff = 0.0;                         ///< mm, of that filter
  std::optional<cutting::InterpolationError> interpolation;
  Spread tip_error;        ///< mm
  Spread direction_error;  ///< rad
  ChordError chord_error;
  std::optional<Verdict::Place> highest, lowest, worst;  ///< as of a verdict
  /// Percent by which a figure fell; none where there is nothing to fall from.
  struct Reduction {
    std::optional<double> pv, rms;
  };
  struct TextureReduction {
    std::optional<double> Sa, Sq, Sz;
  };
  std::optional<Reduction> residual_reduction, machine_reduction;  ///< of a compensator's case
  std::optional<Reduction> form_reduction;                         ///< the same
  std::optional<TextureReduction> texture_reduction;               ///< the same
};

/// The cut of a case in figures.
struct CutStatistics {
  std::size_t steps = 0;
  ProcessTotals totals;
  std::vector<int> crash_lines;  ///< of the program
};

/// One case in figures.
struct Summary {
  std::string scene;
  std::uint64_t seed = 0;
  int moves = 0;
  std::size_t samples = 0;
  program::Unreached unreached;
  CaseStatistics figures;
  std::optional<Tolerance> tolerance;              ///< of the part, where no region has another
  std::vector<cutting::AnalyticPatch> recognised;  ///< faces of a mesh
  std::optional<SampledSurface> sampling;          ///< how the judged places were chosen
  double point_left = 0.0;            ///< mm, most that the compensator knew it could not restore
  double direction_left = 0.0;        ///< rad, the same of the direction
  std::optional<Spread> facet_error;  ///< mm, of the design's own mesh; none where there is none
  DatumDescription::Kind datum = {};
  Alignment alignment = {};
  ViewDescription view;  ///< of the pictures
  /// What the alignment took out of the map.
  struct RemovedAlignment {
    kinematics::Deviation displacement = kinematics::Deviation::Zero();  ///< mm and rad
    std::vector<std::string> undetermined;  ///< components that were left out
  };
  std::optional<RemovedAlignment> taken_out;  ///< of a scene with an alignment
  std::vector<cutting::FormNumber> form;
  std::vector<Verdict::Ring> rings;
  struct NodeTemperature {
    std::string node;
    double start_C = 0.0, end_C = 0.0;  ///< when the program starts and ends
  };
  std::optional<std::vector<NodeTemperature>> temperatures;  ///< of a machine with heat
  std::optional<CutStatistics> cut;                          ///< of a scene with [cutting]
  std::vector<std::pair<std::string, double>> timing_s;      ///< stages; the last of a name counts
  std::shared_ptr<const StockCheck> stock;                   ///< of the verdict
  std::vector<WornTool> wear;  ///< of the tools that are assumed to wear, at the end
  std::vector<std::string> warnings;
  std::vector<program::Assumption> assumptions;  ///< about the control, of the program's reader
};
Summary summary(const Job& job, const Verdict& verdict);

/// A case whose plug-in failed.
struct FailedCase {
  std::string name;
  std::string reason;
};

/// Every case against the uncompensated one of its variant.
struct Comparison {
  std::string scene;
  std::uint64_t seed = 0;
  Eigen::Index vertices = 0;
  int moves = 0;
  program::Unreached unreached;
  DatumDescription::Kind datum = {};
  Alignment alignment = {};
  std::optional<Tolerance> tolerance;
  std::vector<CaseStatistics> cases;
  std::vector<FailedCase> failed;
  std::vector<std::string> warnings;  ///< of the scene, its variants and all cases
  std::vector<program::Assumption> assumptions;
};
Comparison comparison(const Job& job, const std::vector<Compared>& cases,
                      const std::vector<FailedCase>& failed = {});

/// `summary.json` of a case and `comparison.json` of all; the keys are a promise to scripts.
nlohmann::ordered_json to_json(const Summary& summary);
nlohmann::ordered_json to_json(const Comparison& comparison);

/// A table of residuals, a line a case.
std::string to_text(const Summary& summary);
std::string to_text(const Comparison& comparison);

}  // namespace abbe::sim
