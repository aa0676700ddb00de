#pragma once

#include "sim/scene/fields.h"
#include "sim/scene/machine.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/test.h"

namespace abbe::sim {

/// A gantry with a turntable, from a text of few keys.
inline MachineDescription gantry() {
  InputErrors input_errors;
  const MachineDescription machine = read_machine(parse_toml(R"(code = "w C' b X Y Z A s t"
axis.C = { point_mm = [0, 0, 0] }
axis.X = {}
axis.Y = {}
axis.Z = {}
axis.A = { point_mm = [0, 0, 200] }
nose = { at_mm = [0, 0, 50] }
)",
                                                             "machine.toml"),
                                                  input_errors);
  EXPECT_TRUE(input_errors.empty());
  return machine;
}

}  // namespace abbe::sim
