#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cutting/part/mesh.h"
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
  cutting::Surface::Within sampled_within = cutting::Surface::Within::None;
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

struct ZipEntry {
  std::string name;  ///< ASCII
  std::string bytes;
};

/// Whether zlib's own head and sum stand around deflated bytes, as a browser's DecompressionStream
/// ("deflate") wants, or none, as in a zip archive.
enum class DeflateHeader { None, Zlib };

/// @throws std::length_error for 4 GiB or more
std::string deflate_bytes(const std::string& bytes, DeflateHeader head);

/// A zip archive of these, compressed by deflate, dated 1980-01-01: the same entries give the same
/// bytes.
/// @throws std::length_error for an entry or an archive of 4 GiB or more
/// Source: PKWARE's APPNOTE.TXT, 4.3.
std::string zip_archive(const std::vector<ZipEntry>& entries);

// A map as meshes that other programs open.

/// Binary PLY of the design: a vertex has x, y, z in mm (float64), its normal (float32: a step of
/// 6e-8), `quality_range` = residual in um (float32: a step of 1.2e-7 of its size at most; NaN
/// where not cut) and `status` (uchar); faces follow. Comments have the facts.
std::string to_ply(const ResultMap& map);

/// Binary STL of the machined surface, mm: cut vertices moved along their normals by the residual,
/// the others where the design has them. Coordinates are float32, a step of 1.2e-7 of their size at
/// most: of 15 nm at 128 to 256 mm. Where vertices are split along an edge, the surface is open
/// there by as much as their residuals differ.
std::string to_stl(const ResultMap& map);

/// Binary STL of any triangles, mm, after 80 bytes that begin with "abbe", its version and `what`.
std::string to_stl(const cutting::Points& vertices, const cutting::Triangles& triangles,
                   const std::string& what);

// A map as tables for scripts.

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
