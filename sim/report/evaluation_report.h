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

/// {"file", "kind", "tests": [{"name", "standard", ...}], "temperatures", "pictures"}; the key of a
/// figure is its name and its unit.
nlohmann::ordered_json to_json(const Evaluation& evaluation,
                               const std::vector<std::filesystem::path>& pictures = {});

/// The same as a person reads it: a table a test.
std::string to_text(const Evaluation& evaluation,
                    const std::vector<std::filesystem::path>& pictures = {});

/// A picture of every test: positioning with its means and 2 s band, lines over their targets,
/// circles magnified over the nominal one, drift over time; none where the program was built
/// without VTK.
/// @param from  the file of the readings, named in every picture
/// @return their files @throws OutputFailure
std::vector<std::filesystem::path> write_test_pictures(const ResultFolder& folder,
                                                       const errors::metrology::Tests& tests,
                                                       const std::string& from);

/// `part.png`: how many points of a part have which deviation. @return its file, or none without
/// VTK
std::vector<std::filesystem::path> write_part_picture(const ResultFolder& folder,
                                                      const PartReadingsFile& part,
                                                      const std::string& from);

/// The page of an evaluation: a table for every standard, deviations over position with their bands
/// of 2 s and single runs, circles, drifts, the deviations of a part.
/// @throws BadInput where the readings cannot be read again
FiguresPage evaluate_page(const Evaluation& evaluation);

/// The page of the evaluation.json in a folder, with the pictures that lie there. Charts are not in
/// it, and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen, if it is no evaluation
FiguresPage evaluate_page(const std::filesystem::path& folder);

}  // namespace abbe::sim
