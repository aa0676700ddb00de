#pragma once

#include <cstdint>
#include <vector>

#include "cutting/stock/engagement.h"
#include "cutting/stock/stock.h"

/// The skin of a machined part as a mesh, with the points on the skin from which it was made.
namespace abbe::cutting {

/// The machined part as a mesh with the points from which it was made. A vertex of the mesh is the
/// mean of the points of its cell and lies up to a spacing off the skin at sharp edges; the points
/// lie on the skin, where it was cut to the accuracy of `remove` (1e-9 mm along their line if the
/// axis does not turn).
struct StockSkin {
  StockMesh mesh;
  Points places_w;                 ///< (m x 3) mm, ends of runs of material
  std::vector<std::int32_t> line;  ///< (m) program line of each, as in DexelRun
  std::vector<int> first;          ///< (vertices + 1) start of the points of a vertex in `place`
  std::vector<int> place;          ///< rows of `places_w`, vertex after vertex
  double spacing = 0.0;            ///< mm, between dexels or nodes of a profile
  /// The directions in which the skin was sampled.
  enum class Lattice : std::uint8_t {
    ThreeDirections,  ///< along x, y and z
    OneDirection,     ///< along z alone
    Profile,         ///< along z, the axis, and across it
  };
  Lattice lattice = Lattice::ThreeDirections;
  Eigen::Isometry3d T_wk = Eigen::Isometry3d::Identity();  ///< pose of the lattice; a node is at 0
};

/// Returns the mesh of `stock_mesh` with its points. In a stock of one direction only ends along
/// that direction are points: vertices on walls along it have none, nor have those where the
/// directions contradict each other.
StockSkin stock_skin(const Stock& stock);

/// Returns a turned part with a ring of vertices at every node, thinned to about 2000 rings plus
/// those where the profile bends; each vertex is its own point.
/// @param around  vertices on a circle, >= 3
StockSkin stock_skin(const TurnedStock& stock, int around = 180);

/// Returns a turned part as a closed mesh: its profile, thinned to where it bends by more than 1 um
/// or where skin and cut meet, revolved about the spindle line. `line` as in TurnedStock.
/// @param around  vertices on a circle, >= 3
StockMesh stock_mesh(const TurnedStock& stock, int around = 180);

}  // namespace abbe::cutting
