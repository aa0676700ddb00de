#pragma once

#include <cstddef>
#include <optional>

#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_turning.h"

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
  kinematics::AxisVector fanuc_axes(const kinematics::Chain& chain,
                                    const Eigen::Vector3d& direction_w,
                                    const program::Cause& cause);

  /// A line from where the tool is.
  /// @return whether it ends with the vector that `move` has; else it was led through a pole
  /// @throws BadInput at its cause where the rotary axes do not follow the great circle
  bool straight_feed(const kinematics::Chain& chain, program::Straight move);

  /// Warns of the blocks that were led through a pole.
  void finish();

 private:
  const RotaryTurning& turning_of(const kinematics::Chain& chain);
  bool led_through(const kinematics::Chain& chain, program::Straight& move);

  ProgramRun& run_;
  const kinematics::Chain* chain_ = nullptr;  ///< of `turning_`
  std::optional<RotaryTurning> turning_;
  struct Led {
    std::size_t blocks = 0;
    double turned = 0.0, off = 0.0;  ///< rad, the largest
    int line = 0;                    ///< of the largest `off`
  } led_;
};

}  // namespace abbe::sim::dialects
