#include "tests/safety/mistakes/mistake.h"

namespace abbe::safety {

std::vector<Mistake> mistakes_in_machines() {
  return {
      input_error("travel in m", "face",
                  {{"machine.toml", "travel_mm = [-400, 400]", "travel_mm = [-0.4, 0.4]"}},
                  "expected X between"),
      input_error("travel turned round", "face",
                  {{"machine.toml", "travel_mm = [-400, 400]", "travel_mm = [400, -400]"}},
                  "with min below max"),
      warning("rapid in m/min", "face",
              {{"machine.toml", "rapid_mm_per_min = 15000", "rapid_mm_per_min = 15"}},
              "machine.rapid_mm_per_min is 15: looks like m/min"),
      input_error("home outside the travel", "face",
                  {{"machine.toml", "Z_mm = 390", "Z_mm = 3900"}}, "expected Z between"),
      input_error(
          "nose in m", "face",
          {{"machine.toml", "at_mm = [0, 0, 100]\n\n# Where", "at_mm = [0, 0, 0.1]\n\n# Where"}},
          "a program that comes within"),
      input_error("axis direction turned round", "face",
                  {{"machine.toml", "[axis.Z]\n", "[axis.Z]\ndirection = [0, 0, -1]\n"}},
                  "a program that comes within"),
      input_error("rotary axis travel in radians", "dome",
                  {{"machine.toml", "travel_deg = [-110, 110]", "travel_deg = [-1.92, 1.92]"}},
                  "an axis would exceed its"),
  };
}

}  // namespace abbe::safety
