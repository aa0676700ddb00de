#pragma once

#include <cstdint>
#include <vector>

#include "cutting/stock/engagement.h"
#include "cutting/stock/stock.h"

/// The skin of a machined part as a mesh, with the skin points that define it.
namespace abbe::cutting {

/// The machined part as a mesh with the skin points that define it. A vertex of the mesh is the
/// mean of the points of its cell and lies up to a spacing off the skin at sharp edges. The points
/// lie on the skin to the accuracy of `remove` (1e-9 mm along their line if the axis does not
/// turn).
struct StockSkin {
  StockMesh mesh;
  Points points_w;                 ///< (m x 3) mm, ends of runs of material
  std::vector<std::int32_t> line;  ///< (m) program line of each point, as in DexelRun
  std::vector<int> first;  ///< (vertices + 1) start of the points of a vertex in `point_indices`
  std::vector<int> point_indices;  ///< rows of `points_w`, vertex after vertex
  double spacing = 0.0;            ///< mm, between dexels or nodes of a profile
  /// The directions in which the skin was sampled.
  enum class Lattice : std::uint8_t {
    ThreeDirections,  ///< along x, y and z
    OneDirection,     ///< along z only
    Profile,          ///< along z, the axis, and across it
  };
  Lattice lattice = Lattice::ThreeDirections;
  Eigen::Isometry3d T_wk = Eigen::Isometry3d::Identity();  ///< pose of the lattice; a node is at 0
};

/// Returns the mesh of `stock_mesh` with its skin points. In a stock of one direction the points
/// are the ends of runs along that direction, so vertices on walls along it have none; neither have
/// vertices where the directions contradict each other.
StockSkin stock_skin(const Stock& stock);

/// Returns the skin of a turned part with a ring of vertices at every node, thinned to about 2000
/// rings plus those where the profile bends. Every vertex is its own skin point.
/// @param vertices_per_ring  >= 3
StockSkin stock_skin(const TurnedStock& stock, int vertices_per_ring = 180);

/// Returns a turned part as a closed mesh: its profile revolved about the spindle line. The profile
/// is thinned to the nodes where it bends by more than 1 um or where skin and cut meet. `line` as
/// in TurnedStock.
/// @param vertices_per_ring  >= 3
StockMesh stock_mesh(const TurnedStock& stock, int vertices_per_ring = 180);

}  // namespace abbe::cutting
