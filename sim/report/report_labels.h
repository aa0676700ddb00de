#pragma once

#include <span>
#include <string_view>

namespace abbe::sim {

/// A word or sentence of a report, in both languages.
struct ReportLabel {
  std::string_view key;  ///< as the page and its script name it
  std::string_view en, zh;
};

/// Every label of a report.
std::span<const ReportLabel> report_labels();

}  // namespace abbe::sim
