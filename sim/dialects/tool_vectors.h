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

/// Returns the chain with unlimited slides, so that their positions cannot limit a direction.
kinematics::Chain with_free_slides(const kinematics::Chain& chain);

/// Kinematics of the tool direction: from rotary positions to a direction and back.
class OrientationKinematics {
 public:
  /// `control` is the chain of the control; empty for a machine that cannot orient the tool.
  explicit OrientationKinematics(const std::optional<kinematics::Chain>& control);

  /// Returns true if the machine has slides X Y Z and one or two rotary axes.
  bool is_possible() const { return !rotary_.empty(); }
  /// Returns the rotary joints in the order in which a control numbers them: those that carry the
  /// tool from the bed on, then those that carry the workpiece from the bed on.
  const std::vector<int>& rotary_joints() const { return rotary_; }

  /// Returns the direction of the tool in the workpiece as a unit vector from the tip to the
  /// spindle. Only the rotary axes of `q` are used.
  Eigen::Vector3d direction_w(const kinematics::AxisVector& q) const;

  /// Returns copies of `near` whose rotary axes give the direction, the nearest solution first. An
  /// axis without influence keeps its position. Returns an empty list if limits or the machine do
  /// not allow the direction. Bound: 1e-12 rad.
  std::vector<kinematics::AxisVector> positions(const Eigen::Vector3d& direction_w,
                                                const kinematics::AxisVector& near) const;

 private:
  std::optional<kinematics::Chain> free_;  ///< the chain with unlimited slides
  std::vector<int> rotary_;
};

/// End of a segment of a line along which the tool direction changes: its position as a fraction of
/// the line, and the rotary axes there.
struct OrientationSegment {
  double fraction = 1.0;
  kinematics::AxisVector q;
};

/// Divides a great circle between two tool directions into equal segments in which the rotary axes
/// move in proportion; their number is a power of two. At the quarters of each segment the
/// direction is within `tolerance` rad of the uniformly traversed great circle. Only the rotary
/// axes of `from` and `to` are used. Returns an empty list if no great circle connects them:
/// opposite directions, positions beyond limits, a pole that 4096 segments do not pass within the
/// tolerance, or an end that the axes reach only in another solution.
std::vector<OrientationSegment> great_circle_segments(const OrientationKinematics& orientation,
                                                      const kinematics::AxisVector& from,
                                                      const kinematics::AxisVector& to,
                                                      double tolerance);

/// Largest deviation of a move from the great circle of its tool vectors, rad.
inline constexpr double great_circle_tolerance = 1e-6;

/// Issues a line at feed with changing tool direction in segments; under inverse time each segment
/// gets its fraction of the time.
void feed_along_segments(program::Canon& canon, const OrientationKinematics& orientation,
                         const std::vector<OrientationSegment>& segments,
                         const program::Straight& move);

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::fanuc {

// Rules by which a Fanuc control positions rotary axes for a tool direction.

/// Returns the rotary joints in the order in which the control compares their travel: of two in the
/// head or two in the table from the bed outwards, of one in each the table first.
std::vector<int> rotary_judgement_order(const kinematics::Chain& chain);

/// Returns the solution chosen by the output judgement conditions: less travel of the first axis,
/// then of the second, then nearer to zero. `branches` must not be empty. `ranks` holds the joints
/// in the judgement order.
const kinematics::AxisVector& output_judgement(std::span<const kinematics::AxisVector> branches,
                                               const kinematics::AxisVector& position,
                                               const std::vector<int>& ranks);

/// A block that is led through a pole because it would otherwise pass it closely.
struct PolePassage {
  kinematics::AxisVector end;  ///< (size) end of the block with changed rotary axes
  double pole_distance = 0.0;  ///< rad, at which the programmed block would have passed the pole
  double end_rotation = 0.0;   ///< rad, rotation of the end about the pole
  double vector_error =
      0.0;  ///< rad, between the tool at the changed end and the programmed vector
};

/// Tool posture control (FANUC A-79294E, "In the case that the tool posture is near singular
/// posture"). If the plane of the two vectors passes a pole closer than `near`, the axis that is
/// free at the pole stays and the other one continues beyond the pole, unless that rotates the end
/// about the pole by more than `max_change`. An end at the pole itself is not changed. Only the
/// rotary axes of `from` and `to` are used. Returns nothing if the block is not changed. Throws
/// std::invalid_argument unless the chain has two rotary axes at right angles to each other and the
/// tool is at right angles to the second.
std::optional<PolePassage> pole_passage(const kinematics::Chain& chain,
                                        const kinematics::AxisVector& from,
                                        const kinematics::AxisVector& to,
                                        const PoleOptions& limits);

}  // namespace abbe::sim::dialects::fanuc

namespace abbe::sim::dialects {

/// Executes lines at feed between two tool vectors by the rule of a control (`ReadOptions::pole`):
/// on great circles, and with Fanuc's rule through a pole that a line would pass closely.
class VectorLines {
 public:
  explicit VectorLines(ProgramRun& run) : run_(run) {}

  PoleRule rule() const { return run_.options().pole.rule; }
  /// Returns true if a rule other than the dialect's own is selected.
  bool is_active() const { return rule() == PoleRule::Fanuc || rule() == PoleRule::Siemens; }

  /// Returns the rotary axes for a tool direction as Fanuc's output judgement selects them, or the
  /// current ones on a machine that cannot orient the tool. `chain` must outlive the object, as in
  /// every other call. Throws BadInput at `cause` if the direction is out of reach.
  kinematics::AxisVector fanuc_rotary_axes(const kinematics::Chain& chain,
                                           const Eigen::Vector3d& direction_w,
                                           const program::Cause& cause);

  /// Issues a line from the current position. Returns false if it was led through a pole and thus
  /// ends with another vector than `move`. Throws BadInput at its cause if the rotary axes cannot
  /// follow the great circle.
  bool straight_feed(const kinematics::Chain& chain, program::Straight move);

  /// Warns of the blocks that were led through a pole.
  void finish();

 private:
  const OrientationKinematics& orientation_kinematics(const kinematics::Chain& chain);
  bool lead_through_pole(const kinematics::Chain& chain, program::Straight& move);

  ProgramRun& run_;
  const kinematics::Chain* chain_ = nullptr;  ///< chain of `orientation_`
  std::optional<OrientationKinematics> orientation_;
  struct PolePassageSummary {
    std::size_t blocks = 0;
    double max_end_rotation = 0.0, max_vector_error = 0.0;  ///< rad
    int line = 0;                                           ///< line of the largest `vector_error`
  } pole_passages_;
};

}  // namespace abbe::sim::dialects
