#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "errors/identification/estimate.h"
#include "errors/identification/model.h"
#include "errors/identification/step_diagonal.h"
#include "errors/metrology/machine_tests.h"
#include "errors/metrology/test_results.h"
#include "sim/calibration/thermal_identification.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/readings/readings_file.h"

namespace abbe::sim {

/// Readings and what the standards make of them.
struct Evaluation {
  std::filesystem::path file;  ///< of the readings
  std::string kind;            ///< of the instrument, or "position file"
  std::vector<errors::metrology::TestResult> results;
  struct Temperatures {
    std::string sensor;
    double min_C = 0.0, max_C = 0.0;
  };
  std::vector<Temperatures> temperatures;  ///< of every sensor while it was read
  errors::metrology::Tests tests;          ///< of a machine: what was evaluated
  std::optional<PartReadingsFile> part;    ///< of a part, the same
  std::vector<std::string> warnings;       ///< what makes the readings doubtful
};

/// Evaluates readings as the standards prescribe: those of a machine, of a
/// probed or measured part (errors/metrology/test_results.h). Takes files of `measure`,
/// position readings as plain CSV and the position files of laser interferometers
/// (errors/metrology/position_file.h).
/// Judges them first (errors/metrology/reading_diagnostics.h).
/// @throws BadInput, BadScene; BadScene naming what no working instrument reads
Evaluation evaluate_readings(const std::filesystem::path& readings);

struct IdentifyOptions {
  /// Without what only places the workpiece on a rotary table: no reading determines that.
  errors::identification::ModelOptions model = {.placement = false};
  /// What the readings know three times worse than machines of good making differ stays at its
  /// start.
  errors::identification::EstimateOptions estimate = {.weak_limit = 3.0};
  bool choose_orders = false;  ///< by cross-validation instead of `model.order`
  errors::identification::OrderOptions orders;
  enum class Method {
    Chain,         ///< least squares on the exact chain
    StepDiagonal,  ///< the published evaluation of one file of step diagonals
    Composite,     ///< a positioning from several starts: cold curve, and in NAME_thermal.txt the
                   ///< slopes on temperatures, the two beliefs that a case `composite` takes
    Thermal,       ///< a day: what heat adds to the elements, on temperatures; a belief of its own
                   ///< text format, as `[belief.thermal]` reads it
  } method = Method::Chain;
  std::vector<std::string> sensors;  ///< temperatures on which what was measured from several
                                     ///< starts is regressed; thermal: none, to have some chosen
  int sensor_count = 4;              ///< thermal: how many are chosen
  double margin =
      0.1;  ///< thermal, composite: part of its trained range by which a sensor may leave it
  std::filesystem::path out;  ///< belief file; beside it NAME.json and NAME.png
  Permissions permissions;
};

/// The options of a day.
ThermalIdentification thermal_identification(const IdentifyOptions& options);

/// What an identification writes, side by side.
struct BeliefFiles {
  std::filesystem::path belief;                  ///< as asked for
  std::filesystem::path report;                  ///< NAME.json
  std::filesystem::path picture;                 ///< NAME.png
  std::optional<std::filesystem::path> thermal;  ///< NAME_thermal.txt of a composite
};
BeliefFiles belief_files(const IdentifyOptions& options);

/// One file of readings.
struct ReadingsSource {
  std::filesystem::path file;
  std::string instrument;  ///< its name
  std::string kind;        ///< "laser"
  std::size_t readings = 0;
  std::size_t set_ups = 0;
  double duration_s = 0.0;  ///< on a real machine
};

/// Least squares on the exact chain.
struct ChainFit {
  std::optional<std::map<std::string, int>> orders;  ///< "EXX" -> order, where they were chosen
  std::size_t unknowns = 0;                          ///< numbers of the model
  double reduced_chi_square = 0.0;
  int degrees_of_freedom = 0;
  double condition = 0.0;  ///< of the scaled design matrix over what was found
  /// A reading that was left out.
  struct Outlier {
    std::filesystem::path file;
    std::size_t row = 0;       ///< of the readings in it, from 1
    double residual_sd = 0.0;  ///< in standard deviations
  };
  std::vector<Outlier> outliers;
  std::vector<errors::identification::CurveReadings> curves;
  std::vector<Eigen::VectorXd> residual_sd;  ///< (files)(readings) reading minus model, in standard
                                             ///< deviations, outliers as well
};

/// The published evaluation of step diagonals.
struct StepDiagonalFit {
  double reduced_chi_square = 0.0;
  std::vector<std::string> sensors;
  std::optional<errors::identification::StepDiagonalTrend> trend;  ///< where sensors were named
};

/// A positioning from several starts.
struct CompositeFits {
  std::vector<std::string> sensors;
  std::vector<CompositeAxis> axes;
};

/// What was identified, before anything of it is written.
struct Identified {
  BeliefFiles files;
  std::vector<ReadingsSource> sources;
  kinematics::Chain nominal;
  errors::GeometricErrors belief;       ///< what was found, with its covariance; empty of a day
  compensation::ThermalBelief thermal;  ///< of a composite and of a day, else empty
  std::variant<ChainFit, StepDiagonalFit, CompositeFits, ThermalDay> fit;
  std::vector<errors::identification::Confounded> confounded;
  /// Curves at zero of which no number was found; numbers of `confounded` stand in them or in the
  /// belief.
  std::vector<errors::Element> unidentified;
  std::vector<std::string> assumptions;  ///< what no reading checks: signs, orders of readings
  std::vector<std::string> warnings;
};

/// Identifies a machine from files of readings alone. Says which numbers no reading determines,
/// what hides them, what was left out, and how long the measurements would take.
/// @param progress  shows the stages "read", "orders" where they are chosen, and "fit"
/// Judges the readings first (errors/metrology/reading_diagnostics.h) and the result afterwards:
/// its elements by their size, its chi-square by the band of chance.
/// @throws BadInput, BadScene; BadInput naming the files if they are of different machines;
/// BadScene
///         naming each channel that no working instrument reads; std::runtime_error if the fit does
///         not converge
Identified identified(const std::vector<std::filesystem::path>& files,
                      const IdentifyOptions& options, const Progress& progress = {});

}  // namespace abbe::sim
