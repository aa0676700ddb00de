#pragma once

#include <vector>

/// Depths of drilling cycles.
namespace abbe::sim::dialects::siemens {

/// Positions along a hole, mm.
struct HoleLevels {
  double retract = 0.0, reference = 0.0, start = 0.0, bottom = 0.0;
};

/// How CYCLE83 goes down, mm.
struct PeckWords {
  double first = 0.0;  ///< from the reference plane, > 0, at most the whole
  double degression =
      0.0;             ///< by which each peck is shorter; below zero the factor of each; 0: none
  double least = 0.0;  ///< shortest peck where degression is a factor
};

/// Depths below the reference plane at the end of each peck, the last one `total`: a peck is
/// shorter than the one before by the degression as long as that leaves more than the degression,
/// then as long as it; what is left once it is at most twice that is halved. Empty for more than
/// 1e5 pecks.
std::vector<double> peck_depths(double total, const PeckWords& words);

/// How far above the last depth a drill that has cleared its chips goes on with the feed: 0.6 mm,
/// beyond 30 mm of depth a fiftieth of it, at most 7 mm.
double ahead_of_peck(double total);

/// Pitch of a metric coarse thread M3 to M48 of the first choice (ISO 261), mm; 0 for others.
double coarse_pitch(double size);

}  // namespace abbe::sim::dialects::siemens
