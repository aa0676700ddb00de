#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cutting/stock/part_findings.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// Comparison of the machined body of a case with the design, both in the workpiece frame; the
/// design is at the pose of the scene's alignment.
struct StockCheck {
  cutting::StockSkin skin;
  cutting::PartDeviation part;
  cutting::Findings findings;
  cutting::FindingOptions limits;
  double band = 0.0;                  ///< mm, larger deviations are clipped
  bool is_closed = false;             ///< the design is a closed surface
  bool is_turned = false;             ///< undercuts are not searched: a turned profile has none
  bool has_design = true;             ///< false: there is nothing to compare with
  std::vector<std::string> left_out;  ///< effects that the map contains and the body does not, one
                                      ///< sentence each
  double seconds = 0.0;               ///< computing time
};

/// Returns the comparison; null if no stock was tracked.
std::shared_ptr<const StockCheck> stock_check(const Job& job, const Verdict& verdict);

/// Returns "rest material", "gouge" or "undercut".
const char* name_of(cutting::FindingKind kind);

/// Returns a volume, mm^3, with all digits if it is large.
std::string volume_text(double mm3);

/// Returns "1 place", "4 places".
std::string location_count_text(std::size_t count);

/// Returns "0.41 mm at (12.1, -4.0, 80.2), line 120".
std::string place_text(const cutting::Finding& finding);

/// Returns one line for each kind with its three largest findings, then the omissions.
std::string to_text(const StockCheck& check);

/// Returns `stock` of `summary.json`; the keys are stable for scripts.
nlohmann::ordered_json to_json(const StockCheck& check);

/// Returns warnings that the part is gouged, or that the design cannot be compared.
std::vector<std::string> warnings_of(const StockCheck& check);

/// Returns a binary STL file of the machined body, mm, workpiece frame. Coordinates are float32, a
/// step of 1.2e-7 of their size at most.
std::string to_stl(const StockCheck& check, const Job& job, const Verdict& verdict);

}  // namespace abbe::sim
