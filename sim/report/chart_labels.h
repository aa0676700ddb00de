#pragma once

#include <span>

#include "sim/report/report_labels.h"

namespace abbe::sim {

/// Every label of a page of tables and charts besides those of report_labels(); no key stands in
/// both.
std::span<const ReportLabel> chart_labels();

}  // namespace abbe::sim
