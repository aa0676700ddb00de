#pragma once

#include <string>

#include "sim/report/result_map.h"

/// A map as meshes that other programs open.
namespace abbe::sim {

/// Binary PLY of the design: a vertex has x, y, z in mm (float64), its normal (float32: a step of
/// 6e-8), `quality` = residual in um (float32: a step of 1.2e-7 of its size at most; NaN where not
/// cut) and `status` (uchar); faces follow. Comments have the facts.
std::string to_ply(const ResultMap& map);

/// Binary STL of the machined surface, mm: cut vertices moved along their normals by the residual,
/// the others where the design has them. Coordinates are float32, a step of 1.2e-7 of their size at
/// most: of 15 nm at 128 to 256 mm. Where vertices are split along an edge, the surface is open
/// there by as much as their residuals differ.
std::string to_stl(const ResultMap& map);

/// Binary STL of any triangles, mm, after 80 bytes that begin with "abbe", its version and `what`.
std::string to_stl(const cutting::Points& vertices, const cutting::Triangles& triangles,
                   const std::string& what);

}  // namespace abbe::sim
