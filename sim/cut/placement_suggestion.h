#pragma once

#include <optional>
#include <string>

#include "sim/cut/sweep.h"

/// Suggestion of a work offset or part position with which a program fits its part.
namespace abbe::sim {

/// The fraction of the judged area that the tool of the error-free machine reaches.
struct ReachableArea {
  double reached_fraction = 0.0;  ///< fraction, 0 .. 1, cut or gouged
  double cut = 0.0;               ///< fraction, 0 .. 1, cut within the band
  int vertex_count = 0;           ///< number of judged vertices
};
/// Returns the area of a design that the program of a job reaches on the error-free machine.
ReachableArea reachable_area(const cutting::Design& design_w, const Job& job);

/// Returns the design with about `max_judged` judged vertices at most, for a quick test of its
/// placement. Each of 2000 represents 0.05 % of the area.
cutting::Design thin_out(cutting::Design design, std::ptrdiff_t max_judged = 2000);

/// A change of the scene with which its program cuts its part.
struct PlacementSuggestion {
  std::string words;    ///< text such as "with G54 Z = -80 it fits best: ...", or "... it touches"
  ReachableArea reach;  ///< of the thinned design after the change
};

/// Returns the change with which a program fits its part best: the median of the magnitudes of the
/// error-free residuals of the thinned design is smallest. The search starts from the present
/// position and from the first contact. In directions that the residuals do not determine, the
/// middle of the feed is moved to the middle of the part if that cuts more. The program of a turned
/// part is moved along the spindle and radially. If half of the part remains farther away than the
/// band, the feed is moved to its first contact with a judged vertex. The result consists of work
/// offsets of the program, to 1 um, if the program read with them cuts the part within the travel
/// of the axes; otherwise of part.at_mm. If neither helps and the rotary axes turn between feeds,
/// only the feed in each of its first three orientations is moved. Returns none if that fails too,
/// and for a job in windows.
std::optional<PlacementSuggestion> placement_suggestion(const Job& job);

}  // namespace abbe::sim
