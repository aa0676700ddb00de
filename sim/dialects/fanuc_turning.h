#pragma once

#include <optional>
#include <span>
#include <vector>

#include "kinematics/chain.h"
#include "sim/dialects/read_options.h"

/// How a Fanuc control turns rotary axes to a direction of the tool.
namespace abbe::sim::dialects::fanuc {

/// The rotary joints in the order in which the control's rule looks at how far they turn: of two in
/// the head or two in the table from the bed outwards, of one in each the table first.
std::vector<int> turning_ranks(const kinematics::Chain& chain);

/// The position that the output judgement conditions take: less travel of the first axis, of the
/// second, then nearer to zero.
/// @param branches  (any, at least one) (size)  @param now  (size)
const kinematics::AxisVector& output_judgement(std::span<const kinematics::AxisVector> branches,
                                               const kinematics::AxisVector& now,
                                               const std::vector<int>& ranks);

/// A block led through the pole that it would pass close by.
struct PolePassage {
  kinematics::AxisVector end;  ///< (size) the rotary axes of the block's end as they are changed
  double angle = 0.0;          ///< rad, by which it would have passed by
  double turned = 0.0;         ///< rad, of its end about the pole
  double off = 0.0;            ///< rad, between the tool at the changed end and the vector
};

/// Tool posture control (FANUC A-79294E, "In the case that the tool posture is near singular
/// posture"): where the plane of the two vectors passes a pole nearer than `near`, the axis that is
/// free at the pole stays as it is and the other one goes on beyond the pole, unless that turns the
/// end about the pole by more than `most_change`. Of an end in the pole nothing is changed.
/// @param from, to  (size) of which the rotary axes count
/// @throws std::invalid_argument unless the chain has two rotary axes at right angles to each
///         other, the tool at right angles to the second
std::optional<PolePassage> through_pole(const kinematics::Chain& chain,
                                        const kinematics::AxisVector& from,
                                        const kinematics::AxisVector& to,
                                        const PoleOptions& limits);

}  // namespace abbe::sim::dialects::fanuc
