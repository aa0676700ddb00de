#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace abbe::sim::study {

enum class Sampling {
  Random,  ///< pseudo-random: independent points
  Sobol,   ///< Sobol's sequence with one random digital shift: fills the cube evenly
};

/// Points of the open unit cube, any of them by its number: the same for any order, thread or
/// machine.
struct Sequence {
  Sampling sampling = Sampling::Random;
  int dimensions = 1;      ///< 1 .. 3600
  std::uint64_t seed = 1;  ///< of the random points, and of the shift
};

/// Points number `first` to `first + count - 1`, bit for bit the same in whatever stretches they
/// are asked for. Each is an odd multiple of 2^-53, so strictly within 0 .. 1.
/// Random: SplitMix64's stream (Steele, Lea, Flood 2014) of a state that seed and number of the
/// point make, one draw a dimension. Sobol: Boost's engine with the directions of Joe and Kuo 2008,
/// every coordinate's bits xored with a random word of its own, which keeps the sequence's balance
/// exactly; the point at the origin, shifted like the others, is number 0, as leaving it out would
/// spoil that balance (Owen 2022). Sobol points 0 .. 2^k - 1 have one coordinate in every 2^-k of
/// each axis.
/// Time: Random 1 to 2 ns a number. Sobol the same and, at every call wherever it begins, some
/// 0.5 us a dimension: ask for dozens of points together.
/// @return (dimensions x count)
/// @throws std::invalid_argument for dimensions out of range, or more points than 2^52
Eigen::MatrixXd points(const Sequence& sequence, std::uint64_t first, Eigen::Index count);

}  // namespace abbe::sim::study
