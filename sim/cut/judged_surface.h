#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "sim/cut/job.h"
#include "sim/program/path.h"

/// The vertices at which a part is judged, and warnings about uncut and gouged vertices.
namespace abbe::sim {

/// Returns some of the given vertices.
using VertexFilter = std::function<std::vector<Eigen::Index>(std::vector<Eigen::Index> vertices)>;

/// Returns the warnings about uncut vertices ("1348 of 1483 judged vertices (90.9 %) are uncut
/// ..."), gouges beyond the band with depth and line, and vertices cut by rapids, in this order.
/// @param not_fed_before  returns the vertices that no feed before their cut has reached as deep: a
///     rapid that runs where the tool has fed, such as the retract from a hole, cuts nothing
std::vector<std::string> surface_warnings(const cutting::Surface& surface,
                                          const program::Path& path, double band,
                                          const VertexFilter& not_fed_before);

/// The vertices at which the program cuts into the design, within the band, by more than the errors
/// of the machine explain.
struct ProgramGouge {
  int vertices = 0;
  double deepest = 0.0;          ///< mm, positive into the design
  int line = 0;                  ///< program line of the deepest
  std::vector<Eigen::Index> at;  ///< numbers of the vertices
};
/// Returns the gouge of the program.
/// @param explained  largest deviation of the actual tool from its commanded surface, mm
ProgramGouge program_gouge(const cutting::Surface& surface, double explained);

/// Returns the number of vertices of a gouge that the flank has cut.
int flank_gouge_count(const ProgramGouge& gouge, const cutting::Surface& surface,
                      const cutting::Design& design_w, const cutting::Cutter& cutter,
                      const cutting::CutterMotion& motion);

/// Returns a sentence about the area that is not judged, with the reasons.
std::string exclusion_text(const SampledSurface& sampled);

/// Fraction of the area that may miss the resolution; above it a map is too coarse.
inline constexpr double max_unresolved_fraction = 0.02;

/// Returns the surface of the part between its vertices, workpiece frame: the declared surface, or
/// that of a mesh.
cutting::SurfaceInterpolator surface_interpolator(const Job& job);

/// Returns the range of the residual, mm, without a hundredth of the area at either end, so that a
/// corner into which no tool fits does not set the scale.
double trimmed_range(const cutting::Surface& surface, const cutting::Design& design);

/// Returns the job with its part sampled as the scene requests. The error-free cut decides on the
/// vertices, which all cases share. Unless the scene judges everything, only the area that this cut
/// reaches is judged.
Job sampled(Job job, const Progress& progress = {});

}  // namespace abbe::sim
