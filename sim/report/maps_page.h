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
  Eigen::VectorXd form_um;       ///< (n) the same; empty if it is not known
  Eigen::VectorXd cut_time_s;    ///< (n) NaN where nothing was removed
  std::vector<int> cut_line;     ///< (n) 0 where nothing was removed
  nlohmann::ordered_json shown;  ///< figures shown beside the map, by the name of a layer
};

/// Consecutive time intervals of a program, of one line each.
struct LineIntervals {
  std::vector<int> line, begin_ms;
};

/// Maps of a part for a page, in the part frame.
struct PartMaps {
  cutting::Points vertices;  ///< mm
  cutting::Triangles triangles;
  std::vector<CaseMap> cases;
  std::vector<int> region;  ///< (n) number of the region of every vertex, from 1; 0 outside all
                            ///< regions; or empty
  nlohmann::ordered_json regions = nlohmann::ordered_json::array();  ///< names and figures
  LineIntervals stretches;  ///< intervals from which the times of cutting are predicted; empty if
                            ///< not known
  std::vector<std::string> left_out;  ///< omissions of the page, by name
};

/// Adds the map of a case. The first case defines the mesh; a case with other vertices is left out.
/// @return true if the case was added
bool add_case(PartMaps& maps, const cutting::Design& design, CaseMap one);

/// Returns the figures shown beside the layers of a map, from its figures in summary.json.
nlohmann::ordered_json displayed_figures(const nlohmann::ordered_json& figures);

/// Returns the quantity of a map that no page can hold, such as "a deviation"; empty if all fit.
std::optional<std::string> packing_limit(const CaseMap& one);

/// Packs the mesh of the part and the map of every case: residual and form in steps of 2 nm or
/// finer, positions to 1/65534 of the largest extent, times of cutting to 0.02 s, lines of the
/// program and regions exactly. Form is packed if every case has it.
/// @throws std::invalid_argument if something is too large to pack
void add_maps(PageData& data, const PartMaps& maps);

/// Packs the bodies of the machine and of every tool, the motion along the program of the first
/// case's job, axes to 10 um and 0.01 degrees, spindles to a degree, and the tool changes.
/// @return omissions
std::vector<std::string> add_machine(PageData& data, const Job& job);

/// Packs the time series of a case along its program: if its track was kept, the deviation of the
/// tool in the part frame to within a fiftieth of its largest value or 50 nm; its signals from the
/// start of the program and the clearance of every block to within 1/500 of their range.
/// @param number  of the case in the index of the page
void add_case_time_series(PageData& data, const Compared& one, std::size_t number);

/// Contents of a page of maps (render/report/viewer.js).
struct MapsPage {
  std::string title;
  std::string language = "en";  ///< "en" or "zh", in which it opens
  PageData data;
  nlohmann::ordered_json cases;  ///< figures as in comparison.json
  std::string pictures;          ///< a section for browsers that cannot turn maps, and for print
  std::string words;             ///< text below the figures
};

/// Returns the packed maps of a page.
/// @param tolerance_um  lower and upper, or null
/// @throws std::invalid_argument as `add_maps`
PageData maps_data(const PartMaps& maps, const nlohmann::ordered_json& tolerance_um);

/// Returns one self-contained page.
std::string page_html(const MapsPage& page);

}  // namespace abbe::sim
