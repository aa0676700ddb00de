#pragma once

#include "tests/program/machines.h"

/// The lathe of the tests of turning programs.
namespace abbe::sim::dialects::test {

/// w S' b Z X t: the tip on the spindle line with all axes at zero.
inline program::test::Chain lathe(double beyond_tip = 0.0) {
  namespace machines = program::test;
  machines::Pose T_bt = machines::Pose::Identity();
  T_bt.translation().x() = beyond_tip;
  return machines::Chain(
      {machines::joint('S', machines::Side::Workpiece, machines::Motion::Rotary, -machines::ez),
       machines::joint('Z', machines::Side::Tool, machines::Motion::Linear, machines::ez),
       machines::joint('X', machines::Side::Tool, machines::Motion::Linear, machines::ex)},
      machines::Pose::Identity(), T_bt);
}

}  // namespace abbe::sim::dialects::test
