#include "tests/safety/mistakes/mistake.h"

namespace abbe::safety {

std::vector<Mistake> mistakes_in_instruments() {
  return {
      warning("laser noise in mm", "dome", {{"scene.toml", "noise_um = 0.1", "noise_um = 0.0001"}},
              "instrument.noise_um is 0.0001: looks like mm", Command::Measure),
      warning("laser noise in nm", "dome", {{"scene.toml", "noise_um = 0.1", "noise_um = 1000"}},
              "instrument.noise_um is 1000: looks like nm", Command::Measure),
      input_error("laser axis that is not there", "dome",
                  {{"scene.toml", "axes = [\"X\"]", "axes = [\"B\"]"}}, "an axis of the machine",
                  Command::Measure),
      warning("laser speed in m/min", "dome",
              {{"scene.toml", "targets = 5\nruns = 3\nspeed_mm_per_min = 1000",
                "targets = 5\nruns = 3\nspeed_mm_per_min = 1"}},
              "instrument.speed_mm_per_min is 1: looks like m/min", Command::Measure),
      warning("drift interval in ms", "dome",
              {{"scene.toml", "interval_s = 60\nduration_h = 1",
                "interval_s = 60000\nduration_h = 100"}},
              "instrument.interval_s is 60000: looks like ms", Command::Measure),
      reported(input_error(
          "drift duration in seconds", "dome",
          {{"scene.toml", "interval_s = 60\nduration_h = 1", "interval_s = 60\nduration_h = 3600"}},
          "at most 100000 intervals", Command::Measure)),
      input_error(
          "drift duration shorter than its interval", "dome",
          {{"scene.toml", "interval_s = 60\nduration_h = 1", "interval_s = 60\nduration_h = 0.01"}},
          "for at least two readings", Command::Measure),
      warning("encoder in nm", "dome",
              {{"scene.toml", "encoder_resolution_um = 0.1", "encoder_resolution_um = 1000"}},
              "signals.encoder_resolution_um is 1000: looks like nm"),
      warning("signals interval in ms", "dome",
              {{"scene.toml", "interval_s = 1\nenc", "interval_s = 10000\nenc"}},
              "signals.interval_s is 10000: looks like ms"),
  };
}

}  // namespace abbe::safety
