#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "cutting/part/mesh.h"
#include "sim/report/page_data.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// The map of a case on the mesh of its page.
struct CaseMap {
  std::string name;
  Eigen::VectorXd residual_um;   ///< (n) NaN where not cut
  Eigen::VectorXd form_um;       ///< (n) the same; empty where it is not known
  Eigen::VectorXd cut_time_s;    ///< (n) NaN where nothing was removed
  std::vector<int> cut_line;     ///< (n) 0 where nothing was removed
  nlohmann::ordered_json shown;  ///< what stands beside it, by the name of a layer
};

/// Stretches of a program of one line each, one after the other.
struct LineIntervals {
  std::vector<int> line, begin_ms;
};

/// What a page shows of the part, in the part frame.
struct PartMaps {
  cutting::Points vertices;  ///< mm
  cutting::Triangles triangles;
  std::vector<CaseMap> cases;
  std::vector<int> region;  ///< (n) of every vertex, from 1, 0 where none holds it; or empty
  nlohmann::ordered_json regions = nlohmann::ordered_json::array();  ///< names and figures
  LineIntervals stretches;            ///< of which instants are predicted; empty where not known
  std::vector<std::string> left_out;  ///< what a page does not show, by name
};

/// Adds the map of a case, of which the first gives the mesh; one of a part with other vertices is
/// left out.
/// @return whether it is among the maps
bool add_case(PartMaps& maps, const cutting::Design& design, CaseMap one);

/// What stands beside the layers of a map, from its figures as summary.json has them.
nlohmann::ordered_json displayed_figures(const nlohmann::ordered_json& figures);

/// What of a map no page can hold; none where it holds all.
std::optional<std::string> packing_limit(const CaseMap& one);

/// Packs the mesh of the part and the map of every case: residual and form in steps of 2 nm or
/// finer, positions to 1/65534 of the largest extent, instants of cutting to 0.02 s, lines of the
/// program and regions as they are. Form is packed where every case has it.
/// @throws std::invalid_argument if something is too large to pack
void add_maps(PageData& data, const PartMaps& maps);

/// Packs the bodies of the machine and of every tool, the motion along the program of the first
/// case's job, axes to 10 um and 0.01 degrees, spindles to a degree, and the tools called.
/// @return what is left out
std::vector<std::string> add_machine(PageData& data, const Job& job);

/// Packs what a case did along its program: where its track was kept, the deviation of the tool in
/// the part frame to within a fiftieth of the largest of the case or 50 nm; its signals from the
/// beginning of the program on and the clearance of every block to within 1/500 of what they span.
/// @param number  of the case in the index of the page
void add_case_time_series(PageData& data, const Compared& one, std::size_t number);

/// What a page of maps shows (render/report/viewer.js).
struct MapsPage {
  std::string title;
  std::string language = "en";  ///< "en" or "zh", in which it opens
  PageData data;
  nlohmann::ordered_json cases;  ///< figures, as comparison.json has them
  std::string pictures;          ///< a section for browsers that turn no map, and for paper
  std::string words;             ///< below the figures
};

/// What a page holds of its maps.
/// @param tolerance_um  lower and upper, or null
/// @throws std::invalid_argument as `add_maps`
PageData maps_data(const PartMaps& maps, const nlohmann::ordered_json& tolerance_um);

/// One page that needs nothing besides itself.
std::string page_html(const MapsPage& page);

}  // namespace abbe::sim
