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
  Eigen::VectorXd residual_um;     ///< (n) NaN where not cut
  Eigen::VectorXd form_um;         ///< (n) the same; empty if it is not known
  Eigen::VectorXd cut_time_s;      ///< (n) NaN where nothing was removed
  std::vector<int> cut_line;       ///< (n) 0 where nothing was removed
  nlohmann::ordered_json figures;  ///< figures beside the map, by the name of a layer
};

/// Consecutive time intervals of a program, each with the line that runs in it.
struct LineIntervals {
  std::vector<int> line, begin_ms;
};

/// Maps of a part for a page, in the part frame.
struct PartMaps {
  cutting::Points vertices;  ///< mm
  cutting::Triangles triangles;
  std::vector<CaseMap> cases;
  std::vector<int> region;  ///< (n) number of the region of every vertex, from 1; 0 outside all
                            ///< regions; empty if the part has no regions
  nlohmann::ordered_json regions = nlohmann::ordered_json::array();  ///< names and figures
  LineIntervals line_intervals;        ///< predictors of the cutting times; empty if not known
  std::vector<std::string> omissions;  ///< messages on what the page leaves out
};

/// Adds the map of a case. The first case defines the mesh; a case on another mesh is left out and
/// noted as an omission.
/// @return true if the case was added
bool add_case(PartMaps& maps, const cutting::Design& design, CaseMap case_map);

/// Returns the texts beside the layers of a map, taken from its figures in summary.json.
nlohmann::ordered_json displayed_figures(const nlohmann::ordered_json& figures);

/// Returns the quantity of a map that is too large to pack, such as "a deviation"; empty if all
/// fit.
std::optional<std::string> packing_limit(const CaseMap& case_map);

/// Packs the mesh of the part and the map of every case. Steps are at most 2 nm for residual and
/// form, 1/65534 of the largest extent for positions, and 0.02 s for cutting times; program lines
/// and regions are exact. Form is packed if every case has it.
/// @throws std::invalid_argument if a value is too large to pack
void add_maps(PageData& data, const PartMaps& maps);

/// Packs the bodies of the machine and of every tool, the motion along the program of the first
/// case's job (axes to 10 um and 0.01 degrees, spindles to 1 degree), and the tool changes.
/// @return messages on what is left out
std::vector<std::string> add_machine(PageData& data, const Job& job);

/// Packs the time series of a case along its program: the deviation of the tool in the part frame,
/// if its track was kept, to within 1/50 of its largest value or 50 nm; the signals from the start
/// of the program and the clearance of every block to within 1/500 of their range.
/// @param number  of the case in the index of the page
void add_case_time_series(PageData& data, const ComparedCase& compared, std::size_t number);

/// Contents of a page of maps (render/report/viewer.js).
struct MapsPage {
  std::string title;
  std::string language = "en";  ///< language in which it opens, "en" or "zh"
  PageData data;
  nlohmann::ordered_json cases;  ///< figures as in comparison.json
  std::string pictures;          ///< section for printing and for browsers without WebGL
  std::string details;           ///< text below the figures
};

/// Packs the maps of a page.
/// @param tolerance_um  lower and upper limit, or null
/// @throws std::invalid_argument as `add_maps`
PageData maps_data(const PartMaps& maps, const nlohmann::ordered_json& tolerance_um);

/// Returns one self-contained page.
std::string page_html(const MapsPage& page);

}  // namespace abbe::sim
