#pragma once

#include <string>

#include "sim/report/result_map.h"

/// A map as tables for scripts.
namespace abbe::sim {

/// A line a vertex under a head of names with their units: x_mm, y_mm, z_mm, nx, ny, nz,
/// residual_um, form_um, texture_um, status, cut_time_s, cut_line, area_mm2. Numbers have the
/// fewest digits that read back to the same bits, or are nan; the facts stand before in lines that
/// begin with #.
std::string to_csv(const ResultMap& map);

/// NumPy's archive: `vertices`, `normals` (n x 3, float64, mm), `triangles` (m x 3, int32),
/// `area_mm2`, `residual_um`, `form_um`, `texture_um`, `cut_time_s` (n, float64), `status` (n,
/// uint8), `cut_line` (n, int32), and `meta`, the facts as a text of JSON. Compressed; the same map
/// gives the same bytes.
std::string to_npz(const ResultMap& map);

/// NumPy's archive: `time_s` (n, float64), `line` (n, int32), `q` (n x axes, float64, mm and rad,
/// as commanded), `nominal_tip`, `nominal_direction`, `actual_tip`, `actual_direction` (n x 3,
/// float64, mm), `axes`, their letters in the order of the columns, and `meta` as of a map.
/// @param track  in the part frame
std::string to_npz(const ToolTrack& track, const std::string& axes, const MapFacts& facts);

}  // namespace abbe::sim
