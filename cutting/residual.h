#pragma once

#include <optional>

#include "cutting/mesh.h"
#include "cutting/surface.h"

namespace abbe::cutting {

/// What a residual map comes to. Vertices that are uncut, gouged beyond the band or outside the
/// judged region are left out of every number and counted; only the share in tolerance counts
/// gouged ones, as out of it. A number for which no vertex is left (or no area, for the weighted
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
  std::optional<double> in_tolerance_percent;  ///< of the cut and gouged vertices, each counting
                                               ///< one; empty if no tolerance was given
  int vertices = 0;
  int cut_vertices = 0;
  int uncut_vertices = 0;    ///< judged, but nothing was removed
  int outside_vertices = 0;  ///< not judged
  int gouged_vertices = 0;   ///< judged, and removed deeper than the band
  std::optional<Gouge> deepest;  ///< of those, of equal ones the first
};

/// @param tolerance  mm, half width: |residual| <= tolerance is within
/// @throws std::invalid_argument if sizes differ, or a vertex called cut has no finite residual
Statistics statistics(const Surface& surface, const Design& design,
                      std::optional<double> tolerance = std::nullopt);

/// What a vertex is in a difference of two maps: outside if it is outside in either, else gouged,
/// else uncut, else cut.
VertexStatus worse(VertexStatus a, VertexStatus b);

/// First map minus second, vertex by vertex, where both are cut; else its status is the worse of
/// the two. Instants, lines and gouges are those of the first, gouges of the second where only that
/// has one.
/// @throws std::invalid_argument if sizes differ
Surface minus(const Surface& a, const Surface& b);

}  // namespace abbe::cutting
