#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/test_result.h"
#include "sim/readings/part_readings_file.h"

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

/// Evaluates readings as the standards prescribe: those of a machine (errors/metrology/
/// machine_results.h), of a probed or measured part (part_results.h). Takes files of `measure`,
/// position readings as plain CSV and the position files of laser interferometers
/// (errors/metrology/position_file.h).
/// Judges them first (errors/metrology/reading_diagnostics.h).
/// @throws BadInput, BadScene; BadScene naming what no working instrument reads
Evaluation evaluation_of(const std::filesystem::path& readings);

}  // namespace abbe::sim
