#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "errors/metrology/readings.h"
#include "sim/part_readings_file.h"
#include "sim/permissions.h"
#include "sim/scene.h"
#include "sim/truth.h"

namespace abbe::sim {

/// Instruments that `measure` knows by a name: those of the scene, then every kind as it is usually
/// bought. A scene's own name goes before a kind's.
/// @throws BadInput naming the known ones
InstrumentDescription instrument_of(const Scene& scene, const std::string& name);

/// What an instrument reads on the machine of a scene, with the nominal tool in place and the
/// table empty: geometric errors, heat at the time of each reading, weight. Before time 0 the heat
/// is that of the scene's history, after it the machine goes on as in the last phase; measuring
/// itself warms nothing. Temperatures are those of the scene's sensors. Noise and misalignments are
/// drawn from the scene's seed and the instrument's name.
/// @throws BadInput naming the scene if the instrument cannot measure this machine, or a table of
/// the errors is left
errors::metrology::Readings measured(const Scene& scene, const InstrumentDescription& instrument);

/// The same of an instrument that measures the part; none if the name is of no such instrument.
std::optional<PartInstrumentDescription> part_instrument_of(const Scene& scene,
                                                            const std::string& name);

/// Cuts the part of a scene in the case that the instrument names and measures it. A touch probe
/// starts when the program has ended, on the machine that cut the part, the part clamped as it was.
/// @throws BadInput naming the scene if it cannot
PartReadingsFile measured_part(const Scene& scene, const PartInstrumentDescription& instrument);

struct Job;
struct Cut;
/// The same of a part that was cut already.
PartReadingsFile measured_part(const Job& job, const Cut& cut,
                               const PartInstrumentDescription& instrument);

struct MeasureOptions {
  std::vector<Override> overrides;
  std::vector<std::string> instruments;  ///< names; empty: every one of the scene
  std::filesystem::path folder;          ///< NAME.csv of each goes there
  Permissions permissions;
};

/// One file that was written.
struct Measured {
  std::filesystem::path file;
  std::size_t readings = 0;
  std::size_t set_ups = 0;
  double duration_s = 0.0;  ///< that it would take on a real machine
  std::vector<std::string> warnings = {};  ///< of the cut of a part that was measured
};

/// Measures and writes the readings.
/// @throws BadScene, BadInput, OutputFailure; BadInput where an instrument would read nothing
std::vector<Measured> measure(const std::filesystem::path& scene, const MeasureOptions& options);

}  // namespace abbe::sim
