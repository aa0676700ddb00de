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

/// The camera of pictures, in the part frame.
struct ViewDescription {
  Eigen::Vector3d from =
      Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the camera
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::optional<double> range_um;  ///< colour scale from -range to +range; none: fitted
};

struct Node;

/// A scene as its file describes it: machine, errors, tool, program, part and judgement.
struct Scene {
  // Defined in scene.cpp, so that no other source file compiles copies and moves of a scene.
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
  std::vector<ToolDescription> additional_tools;  ///< if there are any, every tool has a number
  PartDescription part;
  ProgramDescription program;
  ControlDescription control;
  DatumDescription datum;
  Alignment alignment = Alignment::None;
  double chord_tolerance = 5e-7;  ///< mm, of the sampled path of the tool
  double max_step = 1.0;          ///< mm, between two samples of the path
  double band = 2.0;              ///< mm, within which the machined surface is searched for
  ViewDescription view;
  Limits limits;
  BeliefDescription belief;
  CompensationDescription compensation;
  std::string case_name;  ///< the case that `run` cuts without --case; the scene.toml of a result
                          ///< states its own. Empty: uncompensated
  std::vector<CaseDescription> cases;  ///< the cases of `compare`, in order
  std::vector<Variant> variants;
  std::string
      resolved;  ///< TOML text with the section files included and data files (mesh, tables,
                 ///< program) named by absolute path; it gives the same results to the bit
  std::shared_ptr<const Node> tree;            ///< from which the scene was read, with all changes
  std::vector<std::filesystem::path> files;    ///< files that it names; set by read_scene
  std::vector<ProgramReference> programs;      ///< programs that it names; set by read_scene
  std::vector<std::filesystem::path> trusted;  ///< programs that it may run, see sim/scene/trust.h
};

/// Returns all tools of a scene in the order of its file.
std::vector<ToolDescription> all_tools(const Scene& scene);

/// Returns the length from the nose to the tip that the control believes, mm: from the tool table,
/// else from `[control]`, else the nominal length.
double control_tool_length(const Scene& scene, const ToolDescription& tool);

/// Returns warnings for tools whose length or radius in the control's tool table differs from the
/// true one by more than 1 nm, and for tools that are missing in the table.
std::vector<std::string> tool_table_warnings(const Scene& scene);

/// Returns a scene of one tool with the flutes, the material and the compliance of the tool in
/// place of those of its sections.
Scene apply_tool_sections(Scene scene);

/// Returns true if a tool of the scene cuts with a force: the scene has [cutting], and the tool or
/// the scene states a material.
bool has_cutting_force(const Scene& scene);

/// Returns the scene with one of its tools as the only tool.
/// @throws std::out_of_range if the scene has no such tool
Scene select_tool(Scene scene, int number);

}  // namespace abbe::sim
