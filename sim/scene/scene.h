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

/// A view of a picture, given by the camera position in the part frame.
struct ViewDescription {
  Eigen::Vector3d from =
      Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the camera
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::optional<double> range_um;  ///< colour scale from -range to +range; none: fitted
};

// The complete sequence: description (TOML), compiled machine, part and path, simulation, report.

struct Node;

/// A scene as read, a description without compiled parts.
struct Scene {
  // defined in one source file, which spares every other the compilation of copies and moves
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
  std::vector<BodyDescription> fixtures;  ///< clamping of the part, in the workpiece frame
  CollisionDescription collision;
  SignalsDescription signals;
  std::vector<InstrumentDescription> instruments;
  std::vector<PartInstrumentDescription> part_instruments;
  std::optional<SensorChoiceDescription> sensor_choice;
  kinematics::Deviation setup = kinematics::Deviation::Zero();  ///< clamping deviation of the part,
                                                                ///< at w
  ToolDescription tool;
  std::vector<ToolDescription>
      additional_tools;  ///< further tools; then every tool has its own number
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
  std::string case_name;  ///< the case that `run` cuts without --case, as stated in the scene.toml
                          ///< of a finished result; empty: uncompensated
  std::vector<CaseDescription> cases;  ///< compensators for comparison runs, in order
  std::vector<Variant> variants;
  std::string
      resolved;  ///< TOML text with the section files included; running it again gives identical
                 ///< bits. Data files (mesh, tables, program) are named by absolute path
  std::shared_ptr<const Node> tree;            ///< the tree from which the scene was read, with all
                                               ///< changes
  std::vector<std::filesystem::path> files;    ///< files read or named; set by read_scene
  std::vector<NamedProgram> programs;          ///< programs that it would run; set by read_scene
  std::vector<std::filesystem::path> trusted;  ///< programs that it may run: sim/scene/trust.h
};

/// Returns all tools of a scene in the order of their description.
std::vector<ToolDescription> all_tools(const Scene& scene);

/// Returns the length from the nose to the tip as the control knows it, mm: from its tool table,
/// else from its own section, else from the scene.
double control_tool_length(const Scene& scene, const ToolDescription& tool);

/// Returns warnings with figures for tools whose entries in the control's table differ from the
/// true ones by more than 1 nm, and for tools missing there.
std::vector<std::string> tool_table_warnings(const Scene& scene);

/// Returns the scene with the tool of that number as its only tool.
/// @throws std::out_of_range if the scene has no such tool
Scene with_tool(Scene scene, int number);

}  // namespace abbe::sim
