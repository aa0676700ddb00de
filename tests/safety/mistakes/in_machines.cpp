#include "tests/safety/mistakes/mistake.h"

namespace abbe::safety {

std::vector<Mistake> mistakes_in_machines() {
  return {
      {"travel in m",
       "face",
       {{"machine.toml", "travel_mm = [-400, 400]", "travel_mm = [-0.4, 0.4]"}},
       Expected::InputError,
       "expected X between"},
      {"travel turned round",
       "face",
       {{"machine.toml", "travel_mm = [-400, 400]", "travel_mm = [400, -400]"}},
       Expected::InputError,
       "with min below max"},
      {"rapid in m/min",
       "face",
       {{"machine.toml", "rapid_mm_per_min = 15000", "rapid_mm_per_min = 15"}},
       Expected::Warning,
       "machine.rapid_mm_per_min is 15: looks like m/min"},
      {"home outside the travel",
       "face",
       {{"machine.toml", "Z_mm = 390", "Z_mm = 3900"}},
       Expected::InputError,
       "expected Z between"},
      {"nose in m",
       "face",
       {{"machine.toml", "at_mm = [0, 0, 100]\n\n# Where", "at_mm = [0, 0, 0.1]\n\n# Where"}},
       Expected::InputError,
       "a program that comes within"},
      {"axis direction turned round",
       "face",
       {{"machine.toml", "[axis.Z]\n", "[axis.Z]\ndirection = [0, 0, -1]\n"}},
       Expected::InputError,
       "a program that comes within"},
      {"rotary axis travel in radians",
       "dome",
       {{"machine.toml", "travel_deg = [-110, 110]", "travel_deg = [-1.92, 1.92]"}},
       Expected::InputError,
       "an axis would exceed its"},
  };
}

}  // namespace abbe::safety
