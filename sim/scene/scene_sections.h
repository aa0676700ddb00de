#pragma once

#include <cstdint>

#include "sim/scene/fields.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"

/// The sections of a scene, each from its table. Faults are collected; what is returned is whole
/// only if there were none.
namespace abbe::sim {

MachineDescription read_machine(const Node& table, Faults& faults);

/// Positions of the axes from words such as Z_mm and A_deg; those left out stand at zero. @return
/// (joints)
kinematics::AxisVector read_axis_words(TableReader& reader,
                                       const std::vector<kinematics::Joint>& joints);

/// Rotation by `turn_deg`, a rotation vector in degrees; the identity where it is left out. Turns
/// by multiples of 90 degrees about one axis are exact.
Eigen::Matrix3d read_turn(TableReader& reader);

/// Place of a thing in its parent from `at_mm` and `turn_deg`.
kinematics::Pose read_placement(TableReader& reader);

/// Whether a name may be that of a file or folder: letters, digits, blanks, _ - .
bool names_a_folder(const std::string& name);

struct ErrorsSection {
  errors::GeometricErrors geometric;
  double scale = 1.0;
};
/// @param section  one table or a list of them; several add up
/// @param machine  for the units of its axes and to bind each element to it, so that an element
/// that
///                 means nothing is refused where it stands
/// @param seed     of the scene, from which repeatability without a seed of its own takes one
ErrorsSection read_errors(const Node& section, const MachineDescription& machine,
                          std::uint64_t seed, Faults& faults);
/// One table; what came from files stands in it.
Node::Table written_errors(const ErrorsSection& section, const MachineDescription& machine);
std::vector<Key> errors_keys();

ToolDescription read_tool(const Node& table, Faults& faults);

/// `file` and `unit` of a mesh.
MeshFile read_mesh_file(TableReader& reader);

PartDescription read_part(const Node& table, Faults& faults);

/// @param joints  of the machine, for the words of work offsets
ProgramDescription read_program(const Node& table, const std::vector<kinematics::Joint>& joints,
                                Faults& faults);

ControlDescription read_control(const Node& table, const std::vector<kinematics::Joint>& joints,
                                Faults& faults);

/// `[thermal]`: network, thermal elements, sensors, history, room.
ThermalDescription read_thermal(const Node& table, const MachineDescription& machine,
                                std::uint64_t seed, Faults& faults);
/// @param seed  of the scene, for the sensors without one of their own
Node::Table written_thermal(const ThermalDescription& thermal, const MachineDescription& machine,
                            std::uint64_t seed);
std::vector<Key> thermal_keys();

/// `[compliance]`: joints, tool, fixture, workpiece, masses.
errors::ComplianceErrors read_compliance(const Node& table, const MachineDescription& machine,
                                         Faults& faults);

/// `[material]`: cutting coefficients with their source.
cutting::CuttingCoefficients read_material(const Node& table, Faults& faults);

/// `[cutting]`: blank, flutes, how finely the cut is followed; the material is a section apart.
CuttingDescription read_cutting(const Node& table, const ToolDescription& tool, Faults& faults);

/// What `[[instrument]]` tables say, sorted into those that measure the machine and those that
/// measure the part. A kind that is left to itself is a typical one.
struct Instruments {
  std::vector<InstrumentDescription> of_machine;
  std::vector<PartInstrumentDescription> of_part;
};
/// @param machine  on which every plan is tried, so that one that cannot be is refused where it
/// stands
Instruments read_instruments(const std::vector<const Node*>& tables,
                             const MachineDescription& machine, Faults& faults);

/// `[belief]`: what compensators are given to believe.
BeliefDescription read_belief(const Node& table, const MachineDescription& machine, Faults& faults);

/// Refuses a case whose belief the scene does not give, or cannot have from its sensors.
void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader);

/// `[compensation]`: strategies and channels with their limits.
CompensationDescription read_compensation(const Node& table,
                                          const std::vector<kinematics::Joint>& joints,
                                          Faults& faults);

/// `[signals]`: what the control reads, and how often it is written.
const Fields<SignalsDescription>& signals_fields();

/// `[sensor_choice]`: how many sensors, by which likeness and screening, for which model.
SensorChoiceDescription read_sensor_choice(const Node& table, Faults& faults);

}  // namespace abbe::sim
