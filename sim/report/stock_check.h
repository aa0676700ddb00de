#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cutting/stock/part_findings.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// The machined body of a case held against the design, both in the workpiece frame; the design is
/// where the alignment of the scene puts it.
struct StockCheck {
  cutting::StockSkin skin;
  cutting::PartDeviation part;
  cutting::Findings findings;
  cutting::FindingOptions limits;
  double band = 0.0;                  ///< mm, further off is cut off there
  bool is_closed = false;             ///< the design
  bool is_turned = false;             ///< undercuts are not looked for: a profile has none
  bool has_design = true;             ///< else there is nothing to compare with
  std::vector<std::string> left_out;  ///< effects that the map shows and the body does not, a
                                      ///< sentence each
  double seconds = 0.0;               ///< that it took
};

/// Null where no stock was followed.
std::shared_ptr<const StockCheck> stock_check(const Job& job, const Verdict& verdict);

/// "rest material", "gouge", "undercut".
const char* name_of(cutting::FindingKind kind);

/// mm^3, all digits of what is large.
std::string volume_text(double mm3);

/// "1 place", "4 places"
std::string location_count_text(std::size_t count);

/// "0.41 mm at (12.1, -4.0, 80.2), line 120"
std::string place_text(const cutting::Finding& finding);

/// A line a kind and the three largest of it, then what was not compared.
std::string to_text(const StockCheck& check);

/// `stock` in `summary.json`; the keys are a promise to scripts.
nlohmann::ordered_json to_json(const StockCheck& check);

/// That the part is gouged, that the design cannot be compared.
std::vector<std::string> warnings_of(const StockCheck& check);

/// Binary STL of the machined body, mm, workpiece frame. Coordinates are float32, a step of 1.2e-7
/// of their size at most.
std::string to_stl(const StockCheck& check, const Job& job, const Verdict& verdict);

}  // namespace abbe::sim
