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

/// Facts that a file of a map states about itself, so that it can be read alone.
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
  Eigen::VectorXd within_um;   ///< (m) the same at the sampled point of every triangle
  Eigen::VectorXd form_um;     ///< (n) the residual through the areal filter; NaN where not cut
  Eigen::VectorXd texture_um;  ///< (n) residual minus form
  cutting::ToleranceBands tolerance_um = {};  ///< for each vertex, if regions have their own
  std::vector<std::uint8_t> status;           ///< (n) as cutting::VertexStatus
  Eigen::VectorXd cut_time_s;                 ///< (n) NaN where nothing was removed
  std::vector<int> cut_line;                  ///< (n) 0 where nothing was removed
};
/// Returns the map of a judged case.
ResultMap result_map(const Job& job, const Verdict& verdict);

/// Returns units, sign, scene, case, seed, version and the settings of the statistics; the keys are
/// stable for scripts.
nlohmann::ordered_json to_json(const MapFacts& facts);

/// Returns the same as names and texts of one line each, for files that hold text only.
std::vector<std::pair<std::string, std::string>> fact_texts(const MapFacts& facts);

/// A file in a zip archive.
struct ZipEntry {
  std::string name;  ///< ASCII
  std::string bytes;
};

/// Header of deflated bytes: zlib's header and checksum, which a browser's DecompressionStream
/// ("deflate") expects, or none, as in a zip archive.
enum class DeflateHeader { None, Zlib };

/// Returns the bytes compressed by deflate.
/// @throws std::length_error for 4 GiB or more
std::string deflate_bytes(const std::string& bytes, DeflateHeader head);

/// Returns a zip archive of the entries, compressed by deflate and dated 1980-01-01: the same
/// entries give the same bytes.
/// @throws std::length_error for an entry or an archive of 4 GiB or more
/// Source: PKWARE's APPNOTE.TXT, 4.3.
std::string zip_archive(const std::vector<ZipEntry>& entries);

// Maps as meshes for other programs.

/// Returns a binary PLY file of the design: each vertex has x, y, z in mm (float64), its normal
/// (float32: a step of 6e-8), `quality` = residual in um (float32: a step of 1.2e-7 of its
/// size at most; NaN where not cut) and `status` (uchar); faces follow. Comments hold the facts.
std::string to_ply(const ResultMap& map);

/// Returns a binary STL file of the machined surface, mm: cut vertices moved along their normals by
/// the residual, the others at their position on the design. Coordinates are float32, a step of
/// 1.2e-7 of their size at most: 15 nm at 128 to 256 mm. Where vertices are split along an edge,
/// the surface is open there by the difference of their residuals.
std::string to_stl(const ResultMap& map);

/// Returns a binary STL file of any triangles, mm, after 80 bytes that begin with "abbe", its
/// version and `what`.
std::string to_stl(const cutting::Points& vertices, const cutting::Triangles& triangles,
                   const std::string& what);

// Maps as tables for scripts.

/// Returns one line per vertex below a head of names with their units: x_mm, y_mm, z_mm, nx, ny,
/// nz, residual_um, form_um, texture_um, status, cut_time_s, cut_line, area_mm2. Numbers have the
/// fewest digits that read back to the same bits, or are nan; the facts stand first in lines that
/// begin with #.
std::string to_csv(const ResultMap& map);

/// Returns an archive for NumPy: `vertices`, `normals` (n x 3, float64, mm), `triangles` (m x 3,
/// int32), `area_mm2`, `residual_um`, `form_um`, `texture_um`, `cut_time_s` (n, float64), `status`
/// (n, uint8), `cut_line` (n, int32), and `meta`, the facts as JSON text. Compressed; the same map
/// gives the same bytes.
std::string to_npz(const ResultMap& map);

/// Returns an archive for NumPy: `time_s` (n, float64), `line` (n, int32), `q` (n x axes, float64,
/// mm and rad, as commanded), `nominal_tip`, `nominal_direction`, `actual_tip`, `actual_direction`
/// (n x 3, float64, mm), `axes`, their letters in the order of the columns, and `meta` as for a
/// map.
/// @param track  in the part frame
std::string to_npz(const ToolTrack& track, const std::string& axes, const MapFacts& facts);

}  // namespace abbe::sim
