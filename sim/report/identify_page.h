#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "sim/calibration/identify.h"
#include "sim/report/figures_page.h"

namespace abbe::sim {

/// The page of an identification: its numbers with their uncertainties, the curve of every element
/// with its band of 95 % and the readings behind it, residuals, what is confounded. The files that
/// it was written to must be there.
/// @throws BadInput where the belief cannot be read
FiguresPage identify_page(const Identified& identified);

/// The page of its report NAME.json. Curves and residuals are not in it, and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen, if it is no report of an
///         identification
FiguresPage identify_page(const std::filesystem::path& report);

}  // namespace abbe::sim
