#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/metrology/readings.h"
#include "sim/cut/cut.h"
#include "sim/readings/readings_file.h"

namespace abbe::sim {

/// Instruments that `measure` knows by a name: those of the scene, then every kind as it is usually
/// bought. A scene's own name goes before a kind's.
/// @throws BadInput naming the known ones
InstrumentDescription find_instrument(const Scene& scene, const std::string& name);

/// What an instrument reads on the machine of a scene, with the nominal tool in place and the
/// table empty: geometric errors, heat at the time of each reading, weight. Before time 0 the heat
/// is that of the scene's history, after it the machine goes on as in the last phase; measuring
/// itself warms nothing. Temperatures are those of the scene's sensors. Noise and misalignments are
/// drawn from the scene's seed and the instrument's name.
/// @throws BadInput naming the scene if the instrument cannot measure this machine, or a table of
/// the errors is left
errors::metrology::Readings measured(const Scene& scene, const InstrumentDescription& instrument);

/// The same of several, the heat run once for all of them.
std::vector<errors::metrology::Readings> measured(
    const Scene& scene, const std::vector<InstrumentDescription>& instruments);

/// The same of an instrument that measures the part; none if the name is of no such instrument.
std::optional<PartInstrumentDescription> find_part_instrument(const Scene& scene,
                                                              const std::string& name);

/// What an instrument reads of a part that was cut. A touch probe starts when the program has
/// ended, on the machine that cut the part, the part clamped as it was.
/// @throws BadInput naming the scene if it cannot
PartReadingsFile measured_part(const Job& job, const Cut& cut,
                               const PartInstrumentDescription& instrument);

}  // namespace abbe::sim
