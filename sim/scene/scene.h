#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "errors/compliance.h"
#include "errors/geometric.h"
#include "errors/vibration.h"
#include "kinematics/bad_input.h"
#include "sim/scene/case_description.h"
#include "sim/scene/compensation_description.h"
#include "sim/scene/cutting_description.h"
#include "sim/scene/instrument_description.h"
#include "sim/scene/machine_description.h"
#include "sim/scene/override.h"
#include "sim/scene/part_description.h"
#include "sim/scene/program_description.h"
#include "sim/scene/signals_description.h"
#include "sim/scene/thermal_description.h"
#include "sim/scene/tool_description.h"
#include "sim/scene/view_description.h"

/// Everything together: description (TOML) -> compiled machine, part, path -> loop -> report.
namespace abbe::sim {

struct Node;

/// A scene as read: description only, nothing compiled.
struct Scene {
  // compiled once, not in every source that copies or moves one
  Scene();
  Scene(const Scene&);
  Scene(Scene&&) noexcept;
  Scene& operator=(const Scene&);
  Scene& operator=(Scene&&) noexcept;
  ~Scene();

  std::filesystem::path file;
  std::string title;
  std::uint64_t seed = 1;
  MachineDescription machine;
  errors::GeometricErrors geometric;
  double error_scale = 1.0;
  std::optional<ThermalDescription> thermal;
  std::optional<errors::ComplianceErrors> compliance;
  std::vector<errors::Vibration> vibrations;
  std::optional<CuttingDescription> cutting;
  std::vector<BodyDescription> fixtures;  ///< what clamps the part, in the workpiece frame
  CollisionDescription collision;
  SignalsDescription signals;
  std::vector<InstrumentDescription> instruments;
  std::vector<PartInstrumentDescription> part_instruments;
  std::optional<SensorChoiceDescription> sensor_choice;
  kinematics::Deviation setup = kinematics::Deviation::Zero();  ///< clamping of the part, at w
  ToolDescription tool;
  std::vector<ToolDescription> more_tools;  ///< of several; then each has a number of its own
  PartDescription part;
  ProgramDescription program;
  ControlDescription control;
  DatumDescription datum;
  Alignment alignment = Alignment::None;
  double chord_tolerance = 5e-7;  ///< mm
  double max_step = 1.0;          ///< mm
  double band = 2.0;              ///< mm
  ViewDescription view;
  Limits limits;
  BeliefDescription belief;
  CompensationDescription compensation;
  std::string case_name;  ///< what `run` cuts without --case: the case that a finished result
                          ///< names in its scene.toml; empty: uncompensated
  std::vector<CaseDescription> cases;  ///< compensators that compare runs, in order
  std::vector<Variant> variants;
  std::string
      resolved;  ///< TOML text with every file it names read in; rerunning it gives the same
                 ///< bits. Data files (mesh, tables, program) are named by absolute path
  std::shared_ptr<const Node> tree;            ///< of which it was read, with every change made
  std::vector<std::filesystem::path> files;    ///< that it was read from or names; of read_scene
  std::vector<NamedProgram> programs;          ///< that it would run; of read_scene
  std::vector<std::filesystem::path> trusted;  ///< programs that it may run: sim/scene/trust.h
};

}  // namespace abbe::sim
