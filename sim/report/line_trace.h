#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "cutting/mesh.h"
#include "cutting/residual.h"

namespace abbe::sim {

/// Lines across a part, in its frame.
enum class TracedLine {
  X,       ///< along x through the middle of the part
  Y,       ///< along y through the middle of the part
  Radius,  ///< from the z axis outwards along +x
};
/// "x", "y" or "radius". @throws std::invalid_argument for anything else
TracedLine traced_line(const std::string& word);

/// A map as it is read, residuals in any unit.
struct TracedMap {
  const cutting::Design& design;    ///< mm
  const Eigen::VectorXd& residual;  ///< (n) NaN where not cut
  cutting::Surface::Within looked_within = cutting::Surface::Within::None;
  const Eigen::VectorXd& within;  ///< (m) at that place of every triangle; empty without
};

/// The longest stretch of a plane's section through a map where it is cut, as a line from triangle
/// to triangle: residuals between vertices are linear.
struct LineTrace {
  Eigen::VectorXd s;         ///< (k >= 2) mm, the way along the surface
  cutting::Points points;    ///< (k x 3) mm
  Eigen::VectorXd along;     ///< (k) mm, x, y or radius
  Eigen::VectorXd residual;  ///< (k)
  double left_out = 0.0;     ///< mm, of other stretches of the same section
  int stretches = 1;
  double mean_spacing = 0.0,
         widest_spacing = 0.0;  ///< mm, of places where it goes from triangle to
                                ///< triangle, those that coincide counted once
  /// What its triangles have at the places within them, less what is linear between their corners.
  struct Between {
    int places = 0;
    double rms = 0.0, worst = 0.0;  ///< unit of the residuals
  };
  std::optional<Between> between;  ///< where the map has any
};

/// Places that coincide to 1e-9 mm are one. Where a section closes on itself it begins where it is
/// lowest along the line.
/// @return none where nothing on the line is cut
/// @throws std::invalid_argument if sizes differ
std::optional<LineTrace> line_trace(const TracedMap& map, TracedLine line);

}  // namespace abbe::sim
