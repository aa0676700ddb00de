#pragma once

#include "sim/commands/calibration_commands.h"
#include "sim/readings/readings_file.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

/// Machines that are there to be measured: scenes that cut next to nothing.
namespace abbe::sim {

/// Text of a scene of a gantry, or of any machine under a ball end mill, with a part of a few
/// vertices.
/// @param sections  TOML after the keys that stand before any section
inline std::string measured_scene(const std::string& sections,
                                  const std::string& machine = "gantry_cxyza") {
  return fmt::format(
      "title = \"measured\"\nmachine = \"{0}machines/{1}.toml\"\ntool = \"{0}tools/ball_r5.toml\"\n"
      "[part]\nsurface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\nat_mm = [0, 0, 80]\n"
      "vertices = 100\n[program]\ngenerator = \"raster\"\nstep_over_mm = 1\nstep_mm = 1\n{2}",
      packaged("").string(), machine, sections);
}

inline Scene scene_of(const std::string& text, const std::vector<Override>& changes = {}) {
  const SceneFolder folder;
  return read_scene(folder.write("measured.toml", text), changes);
}

/// An instrument that reads what is there: no noise, no rounding, laid without a fault.
inline InstrumentDescription faultless(InstrumentDescription description) {
  errors::metrology::Instrument& i = description.instrument;
  i.noise = i.noise_rad = i.resolution = i.resolution_rad = 0.0;
  i.rotation_sigma = i.position_sigma = i.scale_sigma = i.drift_sigma = 0.0;
  return description;
}
inline InstrumentDescription faultless(const Scene& scene, const std::string& name) {
  return faultless(find_instrument(scene, name));
}

/// Readings minus what the nominal machine would show. (measurements)
inline VectorXd beyond_nominal(const errors::metrology::Readings& readings) {
  VectorXd result = readings.value;
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const auto& measurement = readings.plan.measurements[i];
    const auto bodies = errors::metrology::nominal_bodies(readings.nominal, measurement.state.q);
    result[Index(i)] -= errors::metrology::reading(
        readings.plan.set_ups[std::size_t(measurement.set_up)], measurement.channel, {}, bodies,
        bodies, errors::metrology::spindle_angle(readings.nominal, measurement.state));
  }
  return result;
}

/// What measuring a scene refuses, empty if it does not.
inline std::string refusal_of_measuring(const Scene& scene, const std::string& instrument) {
  return thrown_text<BadInput>([&] { measure_machine(scene, find_instrument(scene, instrument)); });
}

/// Machine's part of the map of a case, um RMS.
inline double machine_um(const Job& job, const std::optional<CaseDescription>& compensator = {}) {
  const Verdict error_free = judge(job, cut_error_free(job), nullptr);
  return judge(job, cut(job, compensator), &error_free).machine_contribution->rms.value() /
         units::um;
}

inline double rms(const VectorXd& v) { return std::sqrt(v.squaredNorm() / double(v.size())); }

}  // namespace abbe::sim
