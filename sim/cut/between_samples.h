#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/cut/job.h"

namespace abbe::sim {

/// How far the errors of a machine bend what the cut takes as straight: the tool moves from sample
/// to sample along lines, and samples are as dense as the commanded path asks for.
struct BetweenSamples {
  std::size_t looked_at = 0;  ///< intervals of feeds
  std::size_t beyond = 0;     ///< of them, bent by more than the tolerance
  double tolerance = 0.0;     ///< mm: 2 nm, or that of the chord where it is more
  double rms = 0.0;           ///< mm
  double max = 0.0;           ///< mm
  double step = 0.0;          ///< mm of tip travel of the interval with the largest
  int line = 0;               ///< program line of it
};

/// Intervals of a whole program that are looked at.
inline constexpr std::size_t usual_looks = 1000;

/// Looks midway between samples and at 0.38 of the way, at one interval of feed in each of at most
/// `most` stretches that hold as many intervals each: how far the errors of position and time
/// there, at the tip and as far above it as the tool cuts, are off the line between those at both
/// samples. Loads are left out, and intervals over which an axis reverses. What bends the path in a
/// few intervals of very many may be missed.
BetweenSamples between_samples(const Job& job, const Commands& commands,
                               std::size_t most = usual_looks);

/// Of both.
BetweenSamples joined(const BetweenSamples& a, const BetweenSamples& b);

/// Bends beyond 50 nm, the tolerance and a hundredth of what the machine is off at the samples; the
/// step to begin with.
/// @param off  mm, RMS of the tip
std::vector<std::string> between_samples_warnings(const BetweenSamples& found, double off);

}  // namespace abbe::sim
