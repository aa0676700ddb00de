#pragma once

#include <cstdint>

#include "sim/scene/axis_words.h"
#include "sim/scene/fields.h"
#include "sim/scene/placement.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"

/// The sections of a scene, each from its table. Faults are collected; what is returned is whole
/// only if there were none.
namespace abbe::sim {

MachineDescription read_machine(const Node& table, Faults& faults);
Node::Table written_machine(const MachineDescription& machine);
std::vector<Key> machine_keys();

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

/// One tool, or several of which each has its number.
/// @param section  a table or a list of them @return one at least
std::vector<ToolDescription> read_tools(const Node& section, Faults& faults);
Node::Table written_tool(const ToolDescription& tool);
std::vector<Key> tool_keys();

/// `file` and `unit` of a mesh.
/// @param file  name of the key, with what else may stand in its place
Fields<MeshFile> mesh_file_fields(const KeyName& file);

PartDescription read_part(const Node& table, Faults& faults);
Node::Table written_part(const PartDescription& part);
std::vector<Key> part_keys();

/// @param joints  of the machine, for the words of work offsets
ProgramDescription read_program(const Node& table, const std::vector<kinematics::Joint>& joints,
                                Faults& faults);
/// Refuses offsets of axes that a machine has not; those that their control refuses where they are
/// called and missing are taken out and noted instead. @param joints  none: nothing is looked at
void check_axes(dialects::ControlTable& offsets, const std::vector<kinematics::Joint>& joints,
                Faults& faults);
Node::Table written_program(const ProgramDescription& program,
                            const std::vector<kinematics::Joint>& joints);
std::vector<Key> program_keys();

/// A body and its place in what carries it.
Fields<BodyDescription> body_fields();
/// The profile of a body of revolution: `radii_mm`, `heights_mm`. @param from  where heights count
Fields<Eigen::MatrixX2d> profile_fields(const char* from);
/// `[collision]`
const Fields<CollisionDescription>& collision_fields();

/// `[control]`: what the control believes where it differs.
/// @param joints  of the machine as it is designed
ControlDescription read_control(const Node& table, const std::vector<kinematics::Joint>& joints,
                                Faults& faults);
Node::Table written_control(const ControlDescription& control);
std::vector<Key> control_keys();

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
Node::Table written_compliance(const errors::ComplianceErrors& errors,
                               const MachineDescription& machine);
std::vector<Key> compliance_keys();

/// `[material]`: cutting coefficients with their source.
cutting::CuttingCoefficients read_material(const Node& table, Faults& faults);
Node::Table written_material(const cutting::CuttingCoefficients& material);
std::vector<Key> material_keys();

/// `[cutting]`: blank, flutes, how finely the cut is followed; the material is a section apart.
CuttingDescription read_cutting(const Node& table, const ToolDescription& tool, Faults& faults);
Node::Table written_cutting(const CuttingDescription& cutting, const ToolDescription& tool);
std::vector<Key> cutting_keys();

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
std::vector<Node::Table> written_instruments(const Instruments& instruments,
                                             const MachineDescription& machine);
std::vector<Key> instrument_keys();

/// `[belief]`: what compensators are given to believe.
BeliefDescription read_belief(const Node& table, const MachineDescription& machine, Faults& faults);
Node::Table written_belief(const BeliefDescription& belief, const MachineDescription& machine);
std::vector<Key> belief_keys();

/// Refuses a case whose belief the scene does not give, or cannot have from its sensors.
void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader);

/// `[compensation]`: strategies and channels with their limits.
CompensationDescription read_compensation(const Node& table,
                                          const std::vector<kinematics::Joint>& joints,
                                          Faults& faults);
Node::Table written_compensation(const CompensationDescription& compensation,
                                 const std::vector<kinematics::Joint>& joints);
std::vector<Key> compensation_keys();

/// `[signals]`: what the control reads, and how often it is written.
const Fields<SignalsDescription>& signals_fields();

/// `[[vibration]]`
errors::Vibration read_vibration(const Node& table, const MachineDescription& machine,
                                 Faults& faults);
Node::Table written_vibration(const errors::Vibration& vibration);
std::vector<Key> vibration_keys();

/// `[setup]`, whose value starts from zero, and `[datum]`
const Fields<kinematics::Deviation>& setup_fields();
const Fields<DatumDescription>& datum_fields();

/// `[sampling]`, `[search]`, `[view]`, `[limits]`
const Fields<Scene>& sampling_fields();
const Fields<Scene>& search_fields();
const Fields<ViewDescription>& view_fields();
const Fields<Limits>& limits_fields();

/// `[compare]` and `[[variant]]`
const Fields<std::vector<CaseDescription>>& compare_fields();
std::vector<Variant> read_variants(TableReader& scene);
Node::Table written_variant(const Variant& variant);
std::vector<Key> variant_keys();

/// `[sensor_choice]`: how many sensors, by which likeness and screening, for which model.
SensorChoiceDescription read_sensor_choice(const Node& table, Faults& faults);
Node::Table written_sensor_choice(const SensorChoiceDescription& choice);
std::vector<Key> sensor_choice_keys();

}  // namespace abbe::sim
