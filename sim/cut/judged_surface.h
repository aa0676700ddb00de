#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "sim/cut/job.h"
#include "sim/program/path.h"

/// Selection of the vertices at which a part is judged, and warnings about uncut, gouged and coarse
/// maps.
namespace abbe::sim {

/// Fraction of uncut judged vertices from which a warning is given.
inline constexpr double uncut_warning = 0.01;

/// Returns those of these warnings that hold, in this order: "1348 of 1483 judged vertices (90.9 %)
/// are uncut ..."; gouges beyond the band with depth and line; a surface cut by rapids.
std::vector<std::string> surface_warnings(const cutting::Surface& surface,
                                          const program::Path& path, double band);

/// Vertices where the program cuts into the design within the band by more than the errors of the
/// machine explain.
struct ProgramGouge {
  int vertices = 0;
  double deepest = 0.0;          ///< mm, positive into the design
  int line = 0;                  ///< program line of the deepest
  std::vector<Eigen::Index> at;  ///< the vertices
};
/// Returns the gouge of the program.
/// @param explained  largest deviation of the actual tool from its commanded surface, mm
ProgramGouge program_gouge(const cutting::Surface& surface, double explained);

/// Returns the number of vertices of a gouge that the cylindrical flank has cut.
int flank_gouge_count(const ProgramGouge& gouge, const cutting::Surface& surface,
                      const cutting::Design& design_w, const cutting::Cutter& cutter,
                      const cutting::CutterMotion& motion);

// Reason why a vertex of the judged surface is not intended to be cut (part.judged = "cut").

enum class ExclusionReason : std::uint8_t { NotExcluded, Unreached, Corner, LeadOut };

/// Excludes vertices from a map and from what the job judges: where the error-free cut does not
/// reach, where the corner of no tool of the job fits into the design, and at the lead-out beside
/// these. Does nothing if the scene judges everything, or if no vertex would be left; the cut then
/// reports that as an error.
/// @param before  earlier result for the first vertices, before others were added; empty: none
/// @return        (vertices) the reason; NotExcluded where the scene does not judge
std::vector<ExclusionReason> exclude_unintended(Job& job, cutting::Surface& nominal,
                                                std::vector<ExclusionReason> before);

/// Judged area and excluded area of a part.
struct JudgedAreas {
  double judged = 0.0;  ///< mm^2
  ExcludedArea excluded_area;
};
JudgedAreas judged_areas(const Job& job, const cutting::Surface& nominal,
                         const std::vector<ExclusionReason>& why);

/// Returns a sentence on the area that is not judged, with the reasons.
std::string exclusion_text(const SampledSurface& sampled);

/// Fraction of the area that may miss the resolution; above it a map is too coarse.
inline constexpr double max_unresolved_fraction = 0.02;

/// Returns the surface of the part between its vertices, workpiece frame: the declared surface, or
/// that of a mesh.
cutting::SurfaceInterpolator on_surface(const Job& job);

/// Returns the range of the residual without the outer hundredth of the area at either end, mm, so
/// that a corner that no tool enters does not set the scale.
double trimmed_range(const cutting::Surface& surface, const cutting::Design& design);

/// Returns the job with its part sampled as the scene asks. The samples are chosen on the
/// error-free cut and shared by every case; unless the scene judges everything, only the area that
/// this cut reaches is judged.
Job sampled(Job job, const Progress& progress = {});

}  // namespace abbe::sim
