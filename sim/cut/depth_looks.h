#pragma once

#include <cstddef>
#include <functional>
#include <vector>

/// When the depth of a contact is looked at, which takes too long for every moment.
namespace abbe::sim {

/// Of a motion in steps, so many moments of each may be looked at: what is thinner than a step is
/// deep only between its ends.
inline constexpr std::size_t looks_of_step = 8;

/// Contacts of which the depth is looked at.
inline constexpr std::size_t most_measured_contacts = 50;

/// Where a contact is deepest, of the moments at which it was looked at.
struct DeepestLook {
  double depth = 0.0;  ///< mm
  std::size_t at = 0;  ///< moment
  std::size_t looks = 0;
};

/// Looks at moments spread over [first, end), at up to as many ends of blocks, where motion turns
/// back, and between those beside the deepest.
/// @param block_ends  moments
/// @param depth_at    mm, of a moment
DeepestLook deepest_look(std::size_t first, std::size_t end,
                         const std::vector<std::size_t>& block_ends,
                         const std::function<double(std::size_t)>& depth_at);

}  // namespace abbe::sim
