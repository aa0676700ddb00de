#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/metrology/readings.h"
#include "sim/cut/cut.h"
#include "sim/readings/readings_file.h"

/// Virtual instruments on the machine of a scene and on a part that was cut.
namespace abbe::sim {

/// Returns an instrument by name: the one of the scene with that name, or else a typical instrument
/// if the name is a kind of instrument.
/// @throws BadInput with the list of known instruments
InstrumentDescription find_instrument(const Scene& scene, const std::string& name);

/// Returns the readings of an instrument on the machine of a scene, with the nominal tool and an
/// empty table. They contain the geometric errors, the thermal errors at the time of each reading,
/// and the effect of weight. Until time 0 the machine follows the thermal history of the scene;
/// then it continues as in the last phase. Measuring itself generates no heat. Temperatures are
/// those of the scene's sensors. Noise and misalignments are drawn from the seed of the scene and
/// the name of the instrument.
/// @throws BadInput naming the scene if the instrument cannot measure this machine, or a position
///     lies outside an error table
errors::metrology::Readings measure_machine(const Scene& scene,
                                            const InstrumentDescription& instrument);

/// Returns the readings of several instruments, with a single simulation of the heat.
std::vector<errors::metrology::Readings> measure_machine(
    const Scene& scene, const std::vector<InstrumentDescription>& instruments);

/// Returns an instrument for parts by name: the one of the scene with that name, or else a typical
/// one if the name is a kind; empty if there is none.
std::optional<PartInstrumentDescription> find_part_instrument(const Scene& scene,
                                                              const std::string& name);

/// Returns the readings of an instrument on a cut part. A touch probe starts at the end of the
/// program, on the machine that cut the part, with the part still clamped.
/// @throws BadInput naming the scene if the part cannot be measured
PartReadingsFile measure_cut_part(const Job& job, const Cut& cut,
                                  const PartInstrumentDescription& instrument);

}  // namespace abbe::sim
