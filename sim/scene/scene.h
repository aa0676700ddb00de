#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/compliance.h"
#include "errors/geometric.h"
#include "errors/vibration.h"
#include "kinematics/bad_input.h"
#include "sim/scene/cases.h"
#include "sim/scene/compensation.h"
#include "sim/scene/cutting.h"
#include "sim/scene/document.h"
#include "sim/scene/instruments.h"
#include "sim/scene/machine.h"
#include "sim/scene/part.h"
#include "sim/scene/program.h"
#include "sim/scene/thermal.h"
#include "sim/scene/tool.h"

namespace abbe::sim {

/// A picture's view: where the camera stands, in the part frame.
struct ViewDescription {
  Eigen::Vector3d from =
      Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the camera
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::optional<double> range_um;  ///< colour scale is -range .. +range; else fitted
};

// Everything together: description (TOML) -> compiled machine, part, path -> loop -> report.

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

/// Every tool of a scene, in the order in which it describes them.
std::vector<ToolDescription> tools_of(const Scene& scene);

/// Length from the nose to the tip as the control has it, mm: of its tool table, else of its own
/// section, else that of the scene.
double believed_length(const Scene& scene, const ToolDescription& tool);

/// Where the control's tool table and the true tools of the scene part by more than 1 nm, with
/// figures, and tools that it has not.
std::vector<std::string> tool_table_warnings(const Scene& scene);

/// The scene with the tool of that number as its only one.
/// @throws std::out_of_range if it describes none
Scene with_tool(Scene scene, int number);

}  // namespace abbe::sim
