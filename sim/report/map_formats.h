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

/// Metadata in every file of a map: a file must be understood without the others.
struct MapFacts {
  std::string scene, case_name;
  std::uint64_t seed = 0;
  double form_cutoff = 0.0;  ///< mm
  std::optional<Tolerance> tolerance;
};

/// The map of a case as it is saved, in the part frame.
struct ResultMap {
  MapFacts facts;
  cutting::Design design;       ///< mm
  Eigen::VectorXd residual_um;  ///< (n) + material left, - gouged; NaN where not cut
  cutting::Surface::InteriorSample interior_sample = cutting::Surface::InteriorSample::None;
  Eigen::VectorXd within_um;   ///< (m) the residual at the sampled point of every triangle
  Eigen::VectorXd form_um;     ///< (n) the residual through the areal filter; NaN where not cut
  Eigen::VectorXd texture_um;  ///< (n) residual minus form
  cutting::ToleranceBands tolerance_um = {};  ///< of each vertex; empty if no region has its own
  std::vector<std::uint8_t> status;           ///< (n) as cutting::VertexStatus
  Eigen::VectorXd cut_time_s;                 ///< (n) NaN where nothing was removed
  std::vector<int> cut_line;                  ///< (n) 0 where nothing was removed
};
/// Returns the map of a judged case.
ResultMap result_map(const Job& job, const Verdict& verdict);

/// Returns units, sign, scene, case, seed, version and the settings of the statistics. The keys are
/// stable, so that scripts may rely on them.
nlohmann::ordered_json to_json(const MapFacts& facts);

/// Returns these keys with their values as text of one line, for files that hold only text.
std::vector<std::pair<std::string, std::string>> fact_texts(const MapFacts& facts);

/// A file in a zip archive.
struct ZipEntry {
  std::string name;  ///< ASCII
  std::string bytes;
};

/// Framing of deflated bytes: zlib's header and checksum, which a browser's DecompressionStream
/// ("deflate") expects, or none, as in a zip archive.
enum class DeflateHeader { None, Zlib };

/// Returns the bytes compressed by deflate.
/// @throws std::length_error for 4 GiB or more
std::string deflate_bytes(const std::string& bytes, DeflateHeader header);

/// Returns a zip archive of the entries, compressed by deflate. Entries are dated 1980-01-01, so
/// that the same entries give the same bytes.
/// @throws std::length_error for an entry or an archive of 4 GiB or more
/// Source: PKWARE's APPNOTE.TXT, 4.3.
std::string zip_archive(const std::vector<ZipEntry>& entries);

// Maps as meshes for other programs.

/// Returns a binary PLY file of the design: each vertex has x, y, z in mm (float64), its normal
/// (float32, resolution 6e-8), `quality` = residual in um (float32, relative resolution 1.2e-7; NaN
/// where not cut) and `status` (uchar); faces follow. Comments hold the facts.
std::string to_ply(const ResultMap& map);

/// Returns a binary STL file of the machined surface, mm. Cut vertices are displaced along their
/// normals by the residual, the others stay on the design. Coordinates are float32 with a relative
/// resolution of 1.2e-7: 15 nm at 128 to 256 mm. If vertices are split along an edge, the surface
/// has a gap there of the difference of their residuals.
std::string to_stl(const ResultMap& map);

/// Returns a binary STL file of any triangles, mm. Its header of 80 bytes begins with "abbe", the
/// version and `description`.
std::string to_stl(const cutting::Points& vertices, const cutting::Triangles& triangles,
                   const std::string& description);

// Maps as tables for scripts.

/// Returns a table with a row per vertex and the columns x_mm, y_mm, z_mm, nx, ny, nz, residual_um,
/// form_um, texture_um, status, cut_time_s, cut_line, area_mm2. Numbers are nan or have the fewest
/// digits that read back to the same bits. The facts precede the table in lines that begin with #.
std::string to_csv(const ResultMap& map);

/// Returns an archive for NumPy: `vertices`, `normals` (n x 3, float64, mm), `triangles` (m x 3,
/// int32), `area_mm2`, `residual_um`, `form_um`, `texture_um`, `cut_time_s` (n, float64), `status`
/// (n, uint8), `cut_line` (n, int32), and `meta`, the facts as JSON text. It is compressed; the
/// same map gives the same bytes.
std::string to_npz(const ResultMap& map);

/// Returns an archive for NumPy: `time_s` (n, float64), `line` (n, int32), `q` (n x axes, float64,
/// mm and rad, as commanded), `nominal_tip`, `nominal_direction`, `actual_tip`, `actual_direction`
/// (n x 3, float64, mm), `axes` (the letters of the axes in the order of the columns), and `meta`,
/// as for a map.
/// @param track  in the part frame
std::string to_npz(const ToolTrack& track, const std::string& axes, const MapFacts& facts);

}  // namespace abbe::sim
