#pragma once

#include <optional>
#include <string>

#include "sim/cut/sweep.h"

/// Suggestion of a work offset or part position with which a program fits its part.
namespace abbe::sim {

/// The judged area that the tool of the error-free machine reaches.
struct ReachableArea {
  double reached_fraction = 0.0;  ///< fraction, 0 .. 1, cut or gouged
  double cut = 0.0;               ///< fraction, 0 .. 1, cut within the band
  int vertex_count = 0;           ///< number of judged vertices
};
/// Returns the area of a design that the program of a job reaches on the error-free machine.
ReachableArea reachable_area(const cutting::Design& design_w, const Job& job);

/// Returns the design with at most some 2000 of its vertices judged, for a quick test of where it
/// is cut.
cutting::Design thin_out(cutting::Design design);

/// A change of the scene, tried out, with which its program cuts its part.
struct PlacementSuggestion {
  std::string words;    ///< "with G54 Z = -80 it fits best: ...", or "... it touches"
  ReachableArea reach;  ///< of the thinned design after the change
};

/// Returns where a program that does not fit the part should stand: where the median of the
/// magnitudes of the error-free residuals of the thinned design is smallest. The search starts at
/// the present position and at the first contact. In directions that the residuals do not
/// determine, the middle of the feed is moved over the middle of the part if that cuts more. The
/// program of a turned part is moved along the spindle and radially. A part of which half stays
/// farther away than the band is brought to where the sweep of the feed first touches a judged
/// vertex.
/// The result is given as work offsets that the program uses, to 1 um, if the program read with
/// them cuts the part within the travel of the axes; otherwise as part.at_mm. If neither helps and
/// the axes turn between feeds, the same is tried for the feed in each of its first three
/// directions alone. Returns none if that fails too, and for a job in windows.
std::optional<PlacementSuggestion> placement_suggestion(const Job& job);

}  // namespace abbe::sim
