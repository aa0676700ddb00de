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

/// Evaluation of readings by the standards, and identification of a machine from readings.
namespace abbe::sim {

/// Readings and their evaluation by the standards.
struct Evaluation {
  std::filesystem::path file;  ///< of the readings
  std::string kind;            ///< of the instrument, or "position file"
  std::vector<errors::metrology::TestResult> results;
  struct Temperatures {
    std::string sensor;
    double min_C = 0.0, max_C = 0.0;
  };
  std::vector<Temperatures> temperatures;  ///< of every sensor during the readings
  errors::metrology::Tests tests;          ///< of a machine: the evaluated tests
  std::optional<PartReadingsFile> part;    ///< of a part: its readings
  std::vector<std::string> warnings;       ///< about doubtful readings
};

/// Evaluates readings by the standards: those of a machine, or of a probed or measured part
/// (errors/metrology/test_results.h). Accepts files of `measure`, position readings as plain CSV,
/// and the position files of laser interferometers (errors/metrology/position_file.h). The readings
/// are diagnosed first (errors/metrology/reading_diagnostics.h).
/// @throws BadInput, BadScene  for errors in the file; BadScene naming readings that no working
///     instrument gives
Evaluation evaluate_readings(const std::filesystem::path& readings);

/// Options of an identification.
struct IdentifyOptions {
  /// Without elements that only place the workpiece on a rotary table, which no reading determines.
  errors::identification::ModelOptions model = {.placement = false};
  /// A number that the readings determine three times worse than well-made machines vary stays at
  /// its start.
  errors::identification::EstimateOptions estimate = {.weak_limit = 3.0};
  bool choose_orders = false;  ///< by cross-validation, instead of `model.order`
  errors::identification::OrderOptions orders;
  enum class Method {
    Chain,         ///< least squares on the exact chain
    StepDiagonal,  ///< the published evaluation of one file of step diagonals
    Composite,     ///< positioning from several starts: the cold curve, and the slopes over
                   ///< temperature in NAME_thermal.txt; the two beliefs of a case `composite`
    Thermal,       ///< readings over a day: the effect of heat on the elements over temperature; a
                   ///< belief with a text format of its own, as `[belief.thermal]` reads it
  } method = Method::Chain;
  std::vector<std::string> sensors;  ///< temperatures for the regression of readings from several
                                     ///< starts; thermal: empty to have some chosen
  int sensor_count = 4;              ///< thermal: number of sensors to choose
  double margin =
      0.1;  ///< thermal, composite: fraction of its trained range by which a sensor may leave it
  std::filesystem::path out;  ///< belief file; NAME.json and NAME.png are written next to it
  Permissions permissions;
};

/// Returns the options of the thermal method.
ThermalIdentification thermal_identification(const IdentifyOptions& options);

/// The files that an identification writes next to each other.
struct BeliefFiles {
  std::filesystem::path belief;                  ///< as requested
  std::filesystem::path report;                  ///< NAME.json
  std::filesystem::path picture;                 ///< NAME.png
  std::optional<std::filesystem::path> thermal;  ///< NAME_thermal.txt, for the composite method
};
/// Returns the files that an identification with these options writes.
BeliefFiles belief_files(const IdentifyOptions& options);

/// A file of readings.
struct ReadingsSource {
  std::filesystem::path file;
  std::string instrument;  ///< its name
  std::string kind;        ///< "laser"
  std::size_t readings = 0;
  std::size_t set_ups = 0;
  double duration_s = 0.0;  ///< duration of the measurement on a real machine
};

/// Result of least squares on the exact chain.
struct ChainFit {
  std::optional<std::map<std::string, int>> orders;  ///< "EXX" -> order, if they were chosen
  std::size_t unknowns = 0;                          ///< number of coefficients of the model
  double reduced_chi_square = 0.0;
  int degrees_of_freedom = 0;
  double condition = 0.0;  ///< of the scaled design matrix, over the determined coefficients
  /// A reading that was left out.
  struct Outlier {
    std::filesystem::path file;
    std::size_t row = 0;       ///< number of the reading in the file, from 1
    double residual_sd = 0.0;  ///< in standard deviations
  };
  std::vector<Outlier> outliers;
  std::vector<errors::identification::CurveReadings> curves;
  std::vector<Eigen::VectorXd> residual_sd;  ///< (files)(readings) reading minus model in standard
                                             ///< deviations, including outliers
};

/// Result of the published evaluation of step diagonals.
struct StepDiagonalFit {
  double reduced_chi_square = 0.0;
  std::vector<std::string> sensors;
  std::optional<errors::identification::StepDiagonalTrend> trend;  ///< if sensors were named
};

/// Result of positioning from several starts.
struct CompositeFits {
  std::vector<std::string> sensors;
  std::vector<CompositeAxis> axes;
};

/// The result of an identification, before it is written.
struct Identified {
  BeliefFiles files;
  std::vector<ReadingsSource> sources;
  kinematics::Chain nominal;
  errors::GeometricErrors belief;  ///< determined elements with their covariance; empty for the
                                   ///< thermal method
  compensation::ThermalBelief thermal;  ///< of the composite and thermal methods, otherwise empty
  std::variant<ChainFit, StepDiagonalFit, CompositeFits, ThermalDay> fit;
  std::vector<errors::identification::Confounded> confounded;
  /// Curves at zero of which no number was determined; the numbers of `confounded` are in them or
  /// in the belief.
  std::vector<errors::Element> unidentified;
  std::vector<std::string> assumptions;  ///< signs and orders of readings that no other reading
                                         ///< checks
  std::vector<std::string> warnings;
};

/// Identifies a machine from files of readings alone. The result names the numbers that no reading
/// determines and what hides them, the readings left out, and the time that the measurements would
/// take. The readings are diagnosed first (errors/metrology/reading_diagnostics.h), and the result
/// afterwards: its elements by their size, its chi-square by the band of chance.
/// @param progress  reports the stages "read", "orders" if they are chosen, and "fit"
/// @throws BadInput, BadScene; BadInput naming the files if they are of different machines;
///     BadScene naming each channel that no working instrument reads; std::runtime_error if the fit
///     does not converge
Identified identified(const std::vector<std::filesystem::path>& files,
                      const IdentifyOptions& options, const Progress& progress = {});

}  // namespace abbe::sim
