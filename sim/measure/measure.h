#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/metrology/readings.h"
#include "sim/cut/cut.h"
#include "sim/readings/readings_file.h"

/// Virtual instruments on the machine of a scene and on a part that was cut.
namespace abbe::sim {

/// Returns an instrument by name: one of the scene, or else a typical one of that kind. Names of
/// the scene come first.
/// @throws BadInput naming the known instruments
InstrumentDescription find_instrument(const Scene& scene, const std::string& name);

/// Returns the readings of an instrument on the machine of a scene, with the nominal tool in place
/// and an empty table: geometric errors, heat at the time of each reading, weight. Before time 0
/// the heat is that of the scene's history; after it the machine continues as in the last phase.
/// Measuring itself warms nothing. Temperatures are those of the scene's sensors. Noise and
/// misalignments are drawn from the seed of the scene and the name of the instrument.
/// @throws BadInput naming the scene if the instrument cannot measure this machine, or a position
///     lies outside an error table
errors::metrology::Readings measured(const Scene& scene, const InstrumentDescription& instrument);

/// Returns the readings of several instruments, with one simulation of the heat for all.
std::vector<errors::metrology::Readings> measured(
    const Scene& scene, const std::vector<InstrumentDescription>& instruments);

/// Returns an instrument that measures the part, by name; none if there is no such instrument of
/// that name.
std::optional<PartInstrumentDescription> find_part_instrument(const Scene& scene,
                                                              const std::string& name);

/// Returns the readings of an instrument on a cut part. A touch probe starts at the end of the
/// program, on the machine that cut the part, with the part still clamped.
/// @throws BadInput naming the scene if the part cannot be measured
PartReadingsFile measured_part(const Job& job, const Cut& cut,
                               const PartInstrumentDescription& instrument);

}  // namespace abbe::sim
