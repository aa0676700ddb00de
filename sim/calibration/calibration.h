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
  std::filesystem::path file;  ///< file of the readings
  std::string kind;            ///< kind of instrument, or "position file"
  std::vector<errors::metrology::TestResult> results;
  /// Range of one temperature sensor.
  struct Temperatures {
    std::string sensor;
    double min_C = 0.0, max_C = 0.0;
  };
  std::vector<Temperatures> temperatures;  ///< ranges of all sensors
  errors::metrology::MachineTests tests;   ///< evaluated tests of a machine
  std::optional<PartReadingsFile> part;    ///< readings of a part
  std::vector<std::string> warnings;       ///< about doubtful readings
};

/// Evaluates readings of a machine, or of a probed or measured part, by the standards
/// (errors/metrology/test_results.h). Accepts files of `measure`, position readings as plain CSV,
/// and position files of laser interferometers (errors/metrology/position_file.h). The readings are
/// first diagnosed (errors/metrology/reading_diagnostics.h).
/// @throws BadInput, BadScene  for errors in the file; BadScene naming readings that no working
///     instrument can produce
Evaluation evaluate_readings(const std::filesystem::path& readings);

/// Options of an identification.
struct IdentificationOptions {
  /// Excludes elements equivalent to the position of the workpiece on a rotary table, which no
  /// reading determines.
  errors::identification::ModelOptions model = {.placement = false};
  /// A coefficient stays at its start if its uncertainty is three times the variation between
  /// well-made machines.
  errors::identification::EstimateOptions estimate = {.weak_limit = 3.0};
  bool choose_orders = false;  ///< true: orders by cross-validation; false: `model.order`
  errors::identification::OrderOptions orders;
  /// Method of identification.
  enum class Method {
    Chain,         ///< least squares on the exact chain
    StepDiagonal,  ///< the published evaluation of one file of step diagonals
    Composite,     ///< positioning from several starts: gives the cold curve and, in
                   ///< NAME_thermal.txt, its slopes over temperature; these are the two beliefs of
                   ///< a case `composite`
    Thermal,       ///< readings over a day: gives the effect of heat on the elements over
                   ///< temperature, in the text format that `[belief.thermal]` reads
  } method = Method::Chain;
  std::vector<std::string> sensors;  ///< temperatures for the regression of readings from several
                                     ///< starts; thermal method: if empty, sensors are chosen
  int sensor_count = 4;              ///< thermal method: number of sensors to choose
  double margin = 0.1;               ///< thermal and composite methods: fraction of a sensor's
                                     ///< trained range by which it may be exceeded
  std::filesystem::path out;         ///< belief file; NAME.json and NAME.png are written next to it
  Permissions permissions;
};

/// Returns the options of the thermal method.
ThermalIdentification thermal_identification(const IdentificationOptions& options);

/// Files that an identification writes next to each other.
struct BeliefFiles {
  std::filesystem::path belief;                  ///< IdentifyOptions::out
  std::filesystem::path report;                  ///< NAME.json
  std::filesystem::path picture;                 ///< NAME.png
  std::optional<std::filesystem::path> thermal;  ///< NAME_thermal.txt, for the composite method
};
/// Returns the files that an identification with these options writes.
BeliefFiles belief_files(const IdentificationOptions& options);

/// File of readings.
struct ReadingsSource {
  std::filesystem::path file;
  std::string instrument;  ///< name of the instrument
  std::string kind;        ///< kind of the instrument, "laser"
  std::size_t readings = 0;
  std::size_t set_ups = 0;
  double duration_s = 0.0;  ///< duration of the measurement on a real machine
};

/// Result of least squares on the exact chain.
struct ChainFit {
  std::optional<std::map<std::string, int>> orders;  ///< "EXX" -> order, if orders were chosen
  std::size_t unknowns = 0;                          ///< number of coefficients of the model
  double reduced_chi_square = 0.0;
  int degrees_of_freedom = 0;
  double condition = 0.0;  ///< of the scaled design matrix of the determined coefficients
  /// Reading that was left out.
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

/// Result of an identification, before it is written.
struct IdentificationResult {
  BeliefFiles files;
  std::vector<ReadingsSource> sources;
  kinematics::Chain nominal;
  errors::GeometricErrors belief;  ///< determined elements with their covariance; empty for the
                                   ///< thermal method
  compensation::ThermalBelief thermal;  ///< of the composite and thermal methods, otherwise empty
  std::variant<ChainFit, StepDiagonalFit, CompositeFits, ThermalDay> fit;
  std::vector<errors::identification::ConfoundedCoefficient> confounded;
  /// Curves at zero, without any determined coefficient. The coefficients of `confounded` belong to
  /// these curves or to the belief.
  std::vector<errors::Element> undetermined_curves;
  std::vector<std::string> assumptions;  ///< about signs, orders and units of readings that no
                                         ///< other reading checks
  std::vector<std::string> warnings;
};

/// Identifies a machine from files of readings. The result lists the coefficients that no reading
/// determines with those that hide them, the readings left out, and the duration of the
/// measurements. The readings are diagnosed before (errors/metrology/reading_diagnostics.h). The
/// result is diagnosed after: its elements by their size, its chi-square by the band of chance.
/// @param progress  reports the stages "read", "orders" (if orders are chosen) and "fit"
/// @throws BadInput, BadScene; BadInput naming the files if they are of different machines;
///     BadScene naming each channel that no working instrument can produce; std::runtime_error if
///     the fit does not converge
IdentificationResult identified(const std::vector<std::filesystem::path>& files,
                                const IdentificationOptions& options,
                                const Progress& progress = {});

}  // namespace abbe::sim
