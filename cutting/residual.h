#pragma once

#include <optional>

#include "cutting/mesh.h"
#include "cutting/surface.h"

namespace abbe::cutting {

/// What a residual map comes to. Vertices that are uncut or outside the judged region are left out
/// of every number and counted. A number for which no vertex is left (or no area, for the weighted
/// ones) is empty. Sums are compensated and run in the order of the vertices, so they give the same
/// bits always; the rounding of a sum is below 4e-16 of the sum of magnitudes.
struct Statistics {
  std::optional<double> pv;       ///< mm, max - min
  std::optional<double> rms;      ///< mm, weighted by the area of the vertices
  std::optional<double> mean;     ///< mm, weighted by area
  std::optional<double> std_dev;  ///< mm, about the mean, weighted by area
  std::optional<double> min;      ///< mm
  std::optional<double> max;      ///< mm
  std::optional<double> p95_abs;  ///< mm, 95 % of the cut vertices (each counting one) have at most
                                  ///< this magnitude; linear between ranks
  std::optional<double> in_tolerance_percent;  ///< of the cut vertices, each counting one; empty if
                                               ///< no tolerance was given
  int vertices = 0;
  int cut_vertices = 0;
  int uncut_vertices = 0;    ///< judged, but nothing was removed within the band
  int outside_vertices = 0;  ///< not judged
};

/// @param tolerance  mm, half width: |residual| <= tolerance is within
/// @throws std::invalid_argument if sizes differ, or a vertex called cut has no finite residual
Statistics statistics(const Surface& surface, const Design& design,
                      std::optional<double> tolerance = std::nullopt);

/// First map minus second, vertex by vertex, where both are cut; a vertex that is outside in either
/// is outside, one that is uncut in either is uncut. Instants and lines are those of the first.
/// @throws std::invalid_argument if sizes differ
Surface minus(const Surface& a, const Surface& b);

}  // namespace abbe::cutting
