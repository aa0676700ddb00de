#pragma once

#include <optional>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// How the rotary axes of a machine point its tool.
class RotaryTurning {
 public:
  /// @param control  the control's chain; none: no machine whose tool can be pointed
  explicit RotaryTurning(const std::optional<kinematics::Chain>& control);

  /// There are slides X Y Z and one or two rotary axes.
  bool possible() const { return !rotary_.empty(); }
  /// Joints in the order in which a control numbers them: those that carry the tool from the bed
  /// on, then those that carry the workpiece from the bed on.
  const std::vector<int>& rotary() const { return rotary_; }

  /// Direction of the tool in the workpiece, unit, from the tip to the spindle.
  /// @param q  (size) of which the rotary axes count
  Eigen::Vector3d direction_w(const kinematics::AxisVector& q) const;

  /// `near` with rotary axes that give the direction, the nearest of the positions first; an axis
  /// that is free stays; empty where limits or the machine do not allow it. Bound: 1e-12 rad.
  std::vector<kinematics::AxisVector> positions(const Eigen::Vector3d& direction_w,
                                                const kinematics::AxisVector& near) const;

 private:
  std::optional<kinematics::Chain> free_;  ///< the chain with slides that have no limits
  std::vector<int> rotary_;
};

/// A piece of a line on which the tool turns: its end as fraction of the line, rotary axes there.
struct TurningPiece {
  double fraction = 1.0;
  kinematics::AxisVector q;
};

/// A great circle between two directions of the tool as pieces in which the rotary axes move in
/// proportion. At the quarters of each piece the direction is within `tolerance` rad of the great
/// circle, uniformly turned; the pieces are equal, their number a power of two.
/// @param from, to  (size) of which the rotary axes count
/// @return empty where no great circle leads from one to the other: opposite directions, positions
///         beyond limits, a pole that 4096 pieces do not pass within the tolerance, or an end that
///         the axes reach in another way only
std::vector<TurningPiece> great_circle_pieces(const RotaryTurning& turning,
                                              const kinematics::AxisVector& from,
                                              const kinematics::AxisVector& to, double tolerance);

/// rad, by which lines that turn the tool on a great circle may leave it.
inline constexpr double great_circle_within = 1e-6;

/// A line at feed that turns the tool, put out in pieces; under inverse time each has its share.
void feed_in_pieces(program::Canon& canon, const RotaryTurning& turning,
                    const std::vector<TurningPiece>& pieces, const program::Straight& move);

}  // namespace abbe::sim::dialects
