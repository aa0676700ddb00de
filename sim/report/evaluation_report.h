#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "errors/metrology/machine_tests.h"
#include "sim/calibration/calibration.h"
#include "sim/files/output.h"
#include "sim/readings/readings_file.h"
#include "sim/report/figures_page.h"

namespace abbe::sim {

/// Returns {"file", "kind", "tests": [{"name", "standard", ...}], "temperatures", "pictures"}; the
/// key of a figure is its name with its unit.
nlohmann::ordered_json to_json(const Evaluation& evaluation,
                               const std::vector<std::filesystem::path>& pictures = {});

/// Returns the evaluation as text, one table for each test.
std::string to_text(const Evaluation& evaluation,
                    const std::vector<std::filesystem::path>& pictures = {});

/// Writes pictures of all tests: positioning as means with their 2 s bands, line tests over the
/// target position, circles with magnified deviations from the nominal circle, drift over time.
/// Writes nothing if the program was built without VTK.
/// @param from  file of the readings, named in every picture
/// @return the files written
/// @throws OutputFailure
std::vector<std::filesystem::path> write_test_pictures(const ResultFolder& folder,
                                                       const errors::metrology::MachineTests& tests,
                                                       const std::string& from);

/// Writes `part.png`, the histogram of the deviations of a part's points. Returns the file; nothing
/// if the program was built without VTK.
std::vector<std::filesystem::path> write_part_picture(const ResultFolder& folder,
                                                      const PartReadingsFile& part,
                                                      const std::string& from);

/// Returns the page of an evaluation without files for download: a table for each standard,
/// deviations over position with 2 s bands and single runs, circles, drifts, and the deviations of
/// a part.
FiguresPage evaluation_page(const Evaluation& evaluation);

}  // namespace abbe::sim
