#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "sim/cut/job.h"
#include "sim/program/path.h"

namespace abbe::sim {

/// From this share of the judged vertices on, what is left uncut is warned of.
inline constexpr double uncut_warning = 0.01;

/// "1348 of 1483 judged vertices (90.9 %) are uncut ..."; gouges beyond the band with depth and
/// line; a surface that rapids make. @return in that order, those that hold
std::vector<std::string> surface_warnings(const cutting::Surface& surface,
                                          const program::Path& path, double band);

/// How far below the design a program has taken the tool within the band, where the errors of the
/// machine do not explain it.
struct ProgramGouge {
  int vertices = 0;
  double deepest = 0.0;          ///< mm
  int line = 0;                  ///< program line of the deepest
  std::vector<Eigen::Index> at;  ///< those vertices
};
/// @param explained  mm, by which the tool was off its commanded place at most, and larger
ProgramGouge program_gouge(const cutting::Surface& surface, double explained);

/// Of the vertices of a gouge, those that the cylindrical flank has made.
int flank_gouge_count(const ProgramGouge& gouge, const cutting::Surface& surface,
                      const cutting::Design& design_w, const cutting::Cutter& cutter,
                      const cutting::CutterMotion& motion);

// What of the judged surface a program means to cut (part.judged = "cut").

enum class ExclusionReason : std::uint8_t { NotExcluded, Unreached, Corner, LeadOut };

/// Takes out of a map, and of what the job judges, where the error-free cut does not reach, where
/// the corner of no tool of the job fits into the design, and where the sweep runs out beside
/// these. Nothing where the scene judges all, nor if all would be left out, which is refused
/// where it is cut.
/// @param before  what was said of the first vertices before others were added; empty: nothing
/// @return        (vertices) the reason; of those that the scene does not judge: meant
std::vector<ExclusionReason> exclude_unintended(Job& job, cutting::Surface& nominal,
                                                std::vector<ExclusionReason> before);

struct JudgedAreas {
  double judged = 0.0;  ///< mm^2
  ExcludedArea excluded_area;
};
JudgedAreas judged_areas(const Job& job, const cutting::Surface& nominal,
                         const std::vector<ExclusionReason>& why);

std::string exclusion_text(const SampledSurface& sampled);

/// Of the surface: where more of it misses the resolution, a map is too coarse.
inline constexpr double max_unresolved_fraction = 0.02;

/// The surface of the part between its vertices, workpiece frame: the declared one, or the facets
/// of a mesh.
cutting::SurfaceInterpolator on_surface(const Job& job);

/// The range of a map without the hundredth of its area at either end, so that a corner that no
/// tool enters says nothing of the rest; mm.
double trimmed_range(const cutting::Surface& surface, const cutting::Design& design);

/// The job with its part sampled as the scene asks, for the error-free cut, which every case then
/// shares; and, unless the scene judges all, only what that cut reaches judged.
Job sampled(Job job, const Progress& progress = {});

}  // namespace abbe::sim
