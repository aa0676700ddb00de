#pragma once

#include <string>
#include <vector>

#include "cutting/surface.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"
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
int by_flank(const ProgramGouge& gouge, const cutting::Surface& surface,
             const cutting::Design& design_w, const cutting::Cutter& cutter,
             const cutting::CutterMotion& motion);

}  // namespace abbe::sim
