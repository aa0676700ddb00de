#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "cutting/map/residual.h"
#include "cutting/part/mesh.h"
#include "cutting/stock/stock.h"
#include "cutting/surface/surface.h"
#include "render/vtk_writer.h"

/// Residuals on the vertices of a design, and their files for ParaView. No display is needed.
namespace abbe::render {

/// The residual in micrometres on the vertices of a design.
struct Field {
  cutting::Design design;            ///< mm; a field read from a file has no facet error
  Eigen::VectorXd deviation_um;      ///< (n) + material left, - gouged; NaN where not cut
  std::vector<std::uint8_t> status;  ///< (n) 0 cut, 1 uncut, 2 outside the judged region, 3 gouged
                                     ///< deeper than the band
  Eigen::VectorXd cut_time_s;        ///< (n) NaN where not cut or gouged
  std::vector<int> cut_line;         ///< (n) program line; 0 where not cut or gouged
  cutting::Surface::InteriorSample interior_sample = cutting::Surface::InteriorSample::None;
  Eigen::VectorXd within_um = {};  ///< (m) deviation at the sample point of each triangle, NaN
                                   ///< where not cut; empty without sample points
  Eigen::VectorXd form_um = {};    ///< (n) deviation after the areal filter, NaN where not cut;
                                   ///< empty if it was not filtered
  cutting::ToleranceBands tolerance_um = {};  ///< (n) limits of each vertex; no rows if all
                                              ///< vertices have the same
};

/// Returns the field of a machined surface.
/// @throws std::invalid_argument if the sizes do not match
Field make_field(const cutting::Design& design, const cutting::Surface& surface);

/// Returns the statistics of a field, mm.
/// @throws std::invalid_argument if the sizes do not match
cutting::Statistics statistics(const Field& field, const cutting::ToleranceBands& tolerance = {});

/// Returns the areas, mm^2, that vertices and sample points of triangles represent in `statistics`.
/// @throws std::invalid_argument if the sizes do not match
cutting::Weights weights(const Field& field);

/// Writes `residual.vtp`: VTK XML PolyData, little endian, appended bytes, compressed by zlib; the
/// design mesh in mm (float64) with point data `deviation_um` (float64, NaN unless cut), `status`
/// (uint8), `cut_time_s` (float64), `cut_line` (int32), `area_mm2` (float64) and, if the field has
/// them, `form_um` (float64), `texture_um` (float32), `Normals` (float32, three), `lower_um` and
/// `upper_um` (float64) and, for triangles, `middle_um` or `random_um` (float64). Facts become
/// field data of the file. The same field gives the same bytes.
/// @throws std::invalid_argument if the sizes do not match
/// @throws std::system_error with the path if the file cannot be written
void write_residual(const std::filesystem::path& path, const Field& field, const Facts& facts = {});
void write_residual(const std::filesystem::path& path, const cutting::Design& design,
                    const cutting::Surface& surface);

/// The comparison of a machined body with its design, at the vertices of the body's mesh.
struct StockField {
  cutting::StockMesh mesh;
  Eigen::VectorXd deviation_um;  ///< (n) + material left, - gouged; NaN where not compared
  Eigen::VectorXd largest_um;    ///< (n) largest deviation in the cell of the vertex; NaN where
                                 ///< not compared
  std::vector<std::uint8_t> compared;  ///< (n) cutting::SkinStatus
  std::vector<int> finding;   ///< (n) number of the rest material or gouge at the vertex; 0: none
  std::vector<int> undercut;  ///< (n) number of the undercut at the vertex; 0: none
  std::vector<std::uint8_t> kind;  ///< (n) 0 no finding, 1 rest material, 2 gouge, 3 undercut only
};

/// Writes `stock.vtp` in the same layout: the machined body with point data `deviation_um`,
/// `largest_um` (float64), `compared` (uint8: 0 yes, 1 farther than the band, 2 no design there, 3
/// not resolved), `finding`, `undercut` (int32), `kind`, `status` (uint8: 0 cut, 1 skin of the
/// blank, 2 cut by a crash) and `cut_line` (int32).
/// @throws std::invalid_argument if the sizes do not match
/// @throws std::system_error with the path if the file cannot be written
void write_stock(const std::filesystem::path& path, const StockField& stock,
                 const Facts& facts = {});

/// Reads a file of `write_residual`, compressed or not, with identical bits. Vertex areas are
/// computed from the triangles, normals are normalised again, texture and field data are ignored.
/// The memory used is at most a few times the size of the file, whatever sizes the file states.
/// @throws BadInput if the file is missing, truncated or of another layout, if an array is missing
///         or has another type or length, if a vertex is not finite, an index out of range, a
///         status beyond 3, or a normal not of length 1, or if a deviation is not finite at status
///         0 or finite at status 1 or 3
Field read_residual(const std::filesystem::path& path);

}  // namespace abbe::render
