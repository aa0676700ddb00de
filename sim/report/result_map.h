#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cutting/mesh.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// What a file of a map says of itself, so that it can be read alone.
struct MapFacts {
  std::string scene, case_name;
  std::uint64_t seed = 0;
  double form_cutoff = 0.0;  ///< mm
  std::optional<Tolerance> tolerance;
};

/// The map of a case as its files hold it, in the part frame.
struct ResultMap {
  MapFacts facts;
  cutting::Design design;       ///< mm
  Eigen::VectorXd residual_um;  ///< (n) + material left, - gouged; NaN where not cut
  cutting::Surface::Within looked_within = cutting::Surface::Within::None;
  Eigen::VectorXd within_um;                  ///< (m) the same at that place of every triangle
  Eigen::VectorXd form_um;                    ///< (n) through the areal filter; NaN where not cut
  Eigen::VectorXd texture_um;                 ///< (n) the residual minus it
  cutting::ToleranceBands tolerance_um = {};  ///< of each vertex where regions have their own
  std::vector<std::uint8_t> status;           ///< (n) as cutting::VertexStatus
  Eigen::VectorXd cut_time_s;                 ///< (n) NaN where nothing was removed
  std::vector<int> cut_line;                  ///< (n) 0 where nothing was removed
};
ResultMap result_map(const Job& job, const Verdict& verdict);

/// Units, sign, scene, case, seed, version and what the statistics depend on; the keys are a
/// promise to scripts.
nlohmann::ordered_json to_json(const MapFacts& facts);

/// The same as names and texts of one line each, for files that have nothing but text.
std::vector<std::pair<std::string, std::string>> fact_texts(const MapFacts& facts);

}  // namespace abbe::sim
