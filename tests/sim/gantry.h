#pragma once

#include <gtest/gtest.h>

#include "sim/scene/scene_sections.h"

namespace abbe::sim {

/// A gantry with a turntable, from a text of few keys.
inline MachineDescription gantry() {
  Faults faults;
  const MachineDescription machine = read_machine(parse_toml(R"(code = "w C' b X Y Z A s t"
axis.C = { point_mm = [0, 0, 0] }
axis.X = {}
axis.Y = {}
axis.Z = {}
axis.A = { point_mm = [0, 0, 200] }
nose = { at_mm = [0, 0, 50] }
)",
                                                             "machine.toml"),
                                                  faults);
  EXPECT_TRUE(faults.empty());
  return machine;
}

}  // namespace abbe::sim
