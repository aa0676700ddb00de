#pragma once

#include <filesystem>

#include "sim/calibration/evaluate.h"
#include "sim/report/figures_page.h"

namespace abbe::sim {

/// The page of an evaluation: a table for every standard, deviations over position with their bands
/// of 2 s and single runs, circles, drifts, the deviations of a part.
/// @throws BadInput where the readings cannot be read again
FiguresPage evaluate_page(const Evaluation& evaluation);

/// The page of the evaluation.json in a folder, with the pictures that lie there. Charts are not in
/// it, and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen, if it is no evaluation
FiguresPage evaluate_page(const std::filesystem::path& folder);

}  // namespace abbe::sim
