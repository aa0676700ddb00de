#pragma once

#include <optional>
#include <string>

#include "sim/cut/sweep.h"

namespace abbe::sim {

/// How much of the judged area the error-free machine comes to.
struct ReachableArea {
  double share = 0.0;  ///< 0 .. 1, that it cuts or gouges
  double cut = 0.0;    ///< the same, that it cuts within the band
  int tried = 0;       ///< judged vertices
};
ReachableArea reachable_area(const cutting::Design& design_w, const Job& job);

/// The design with at most some 2000 of its vertices judged, for a look at where it is cut.
cutting::Design thinned(cutting::Design design);

/// A change of the scene with which its program cuts its part, tried out.
struct PlacementSuggestion {
  std::string words;    ///< "with G54 Z = -80 it fits best: ...", or "... it touches"
  ReachableArea reach;  ///< of the thinned design, with that change
};

/// Where a program that does not fit the part would have to stand: where the median of the
/// magnitudes of the error-free residuals of the thinned design is least. It is sought from where
/// the program stands and from where it first touches; in directions that the residuals do not
/// determine the middle of the feed comes over the middle of the part if more is cut then. The
/// program of a turned part is moved along the spindle and outwards. A part of which half stays
/// further away than the band is brought to where the sweep of the feed first touches a judged
/// vertex. Said as
/// work offsets that the program uses, to 1 um, where the program read with them cuts the part
/// within the travel of the axes; else as part.at_mm. Where neither does and the axes turn between
/// feeds, the same for the feed in each of its first directions alone; none where that does not
/// either, nor for a job in windows.
std::optional<PlacementSuggestion> placement_suggestion(const Job& job);

}  // namespace abbe::sim
