#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "kinematics/chain.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// How the rotary axes of a machine point its tool.
class OrientationKinematics {
 public:
  /// @param control  the control's chain; none: no machine whose tool can be pointed
  explicit OrientationKinematics(const std::optional<kinematics::Chain>& control);

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
struct OrientationSegment {
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
std::vector<OrientationSegment> great_circle_segments(const OrientationKinematics& turning,
                                                      const kinematics::AxisVector& from,
                                                      const kinematics::AxisVector& to,
                                                      double tolerance);

/// rad, by which lines that turn the tool on a great circle may leave it.
inline constexpr double great_circle_tolerance = 1e-6;

/// A line at feed that turns the tool, put out in pieces; under inverse time each has its share.
void feed_along_segments(program::Canon& canon, const OrientationKinematics& turning,
                         const std::vector<OrientationSegment>& pieces,
                         const program::Straight& move);

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::fanuc {

// How a Fanuc control turns rotary axes to a direction of the tool.

/// The rotary joints in the order in which the control's rule looks at how far they turn: of two in
/// the head or two in the table from the bed outwards, of one in each the table first.
std::vector<int> rotary_judgement_order(const kinematics::Chain& chain);

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
/// end about the pole by more than `max_change`. Of an end in the pole nothing is changed.
/// @param from, to  (size) of which the rotary axes count
/// @throws std::invalid_argument unless the chain has two rotary axes at right angles to each
///         other, the tool at right angles to the second
std::optional<PolePassage> pole_passage(const kinematics::Chain& chain,
                                        const kinematics::AxisVector& from,
                                        const kinematics::AxisVector& to,
                                        const PoleOptions& limits);

}  // namespace abbe::sim::dialects::fanuc

namespace abbe::sim::dialects {

/// Lines at feed between two vectors of the tool, put out by the rule of a control
/// (`ReadOptions::pole`): on great circles, and by Fanuc's through a pole that they would pass
/// close by.
class VectorLines {
 public:
  explicit VectorLines(ProgramRun& run) : run_(run) {}

  PoleRule rule() const { return run_.options().pole.rule; }
  /// There is a rule that is not the dialect's own.
  bool on() const { return rule() == PoleRule::Fanuc || rule() == PoleRule::Siemens; }

  /// Rotary axes for a direction of the tool as Fanuc's output judgement takes them; as
  /// they are where the machine has none that points the tool.
  /// @param chain  outlives it, as does that of every other call
  /// @throws BadInput at `cause` where the rotary axes do not reach it
  kinematics::AxisVector fanuc_rotary_axes(const kinematics::Chain& chain,
                                           const Eigen::Vector3d& direction_w,
                                           const program::Cause& cause);

  /// A line from where the tool is.
  /// @return whether it ends with the vector that `move` has; else it was led through a pole
  /// @throws BadInput at its cause where the rotary axes do not follow the great circle
  bool straight_feed(const kinematics::Chain& chain, program::Straight move);

  /// Warns of the blocks that were led through a pole.
  void finish();

 private:
  const OrientationKinematics& turning_of(const kinematics::Chain& chain);
  bool lead_through_pole(const kinematics::Chain& chain, program::Straight& move);

  ProgramRun& run_;
  const kinematics::Chain* chain_ = nullptr;  ///< of `turning_`
  std::optional<OrientationKinematics> turning_;
  struct PolePassageSummary {
    std::size_t blocks = 0;
    double turned = 0.0, off = 0.0;  ///< rad, the largest
    int line = 0;                    ///< of the largest `off`
  } pole_passages_;
};

}  // namespace abbe::sim::dialects
