#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cutting/stock/part_findings.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// Comparison of the machined body of a case with the design in the workpiece frame. The scene's
/// alignment displaces the design.
struct StockCheck {
  cutting::StockSkin skin;
  cutting::PartDeviation part;
  cutting::Findings findings;
  cutting::FindingOptions limits;
  double band = 0.0;       ///< mm, limit to which larger deviations are clipped
  bool is_closed = false;  ///< the design is a closed surface
  bool is_turned = false;  ///< turned stock: its profile has no undercuts, none are searched
  bool has_design = true;  ///< false: nothing can be compared
  std::vector<std::string> omitted_effects;  ///< effects that the map contains and the body does
                                             ///< not, a sentence each
  double seconds = 0.0;                      ///< computing time
};

/// Returns the comparison; null if no stock was tracked.
std::shared_ptr<const StockCheck> stock_check(const Job& job, const Verdict& verdict);

/// Returns "rest material", "gouge" or "undercut".
const char* name_of(cutting::FindingKind kind);

/// Returns a volume in mm^3, as a whole number from 1000 mm^3 on.
std::string volume_text(double mm3);

/// Returns "1 place" or, for example, "4 places".
std::string place_count_text(std::size_t count);

/// Returns depth, position and program line, such as "0.41 mm at (12.1, -4.0, 80.2), line 120".
std::string finding_text(const cutting::Finding& finding);

/// Returns the findings as text: the totals and the three largest findings of each kind, then the
/// omitted effects.
std::string to_text(const StockCheck& check);

/// Returns `stock` of `summary.json`. The keys are stable, so that scripts may rely on them.
nlohmann::ordered_json to_json(const StockCheck& check);

/// Returns a warning if the part is gouged, and one if nothing could be compared.
std::vector<std::string> warnings_of(const StockCheck& check);

/// Returns a binary STL file of the machined body, mm, workpiece frame. Coordinates are float32
/// with a relative resolution of 1.2e-7.
std::string to_stl(const StockCheck& check, const Job& job, const Verdict& verdict);

}  // namespace abbe::sim
