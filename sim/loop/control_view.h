#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "errors/compliance.h"
#include "errors/metrology/part.h"
#include "sim/compensation/machine_belief.h"
#include "sim/cut/commands.h"
#include "sim/program/nc_reader.h"
#include "sim/scene/cases.h"
#include "sim/scene/compensation.h"
#include "sim/scene/machine.h"

/// Knowledge and operations available to a compensator. In this room only compensate.cpp can
/// include the truth; tests/architecture_test.cpp follows every include.
namespace abbe::sim {

/// Nominal tool.
struct NominalTool {
  const std::string& name;
  double length = 0.0;  ///< mm, from the nose s to the tip t
  const std::variant<cutting::Cutter, cutting::Nose>& shape;
};

/// View of a job that its control has: nominal machine and tool, the program, and the beliefs of
/// the scene. It refers to the job, which must outlive it.
struct ControlView {
  const std::filesystem::path& file;  ///< scene file, for messages
  const Machine& machine;
  NominalTool tool;
  const DatumDescription& datum;
  const BeliefDescription& belief;
  const CompensationDescription& compensation;
  std::uint64_t seed = 1;
  double chord_tolerance = 0.0;  ///< mm
  bool is_cut = false;           ///< true: the scene has a blank, so forces can be read
  program::NcOptions control;    ///< state of the control before it reads a program
  program::SampleOptions sampling;
  const program::Path& path;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt_nominal;  ///< (samples) nominal poses of the tool
  const cutting::Design& design_w;
};

/// Function that returns the believed pose of the tool in the workpiece at a sample under a load.
using BelievedPose = std::function<kinematics::Pose(std::size_t sample, const errors::Load&)>;

/// Readings of a part that was cut and measured.
struct MeasuredPart {
  errors::metrology::PartReadings readings;
  double spacing = 0.0;  ///< mm, approximate distance between points
};

/// Readings of a training part, from which a current law is learned.
struct TrainingRun {
  compensation::ControlLog log;
  compensation::CurrentTraining training;
};

/// Operations that a compensator may request from the machine. Operations that run the machine
/// return noisy readings, never the true errors. Only `perfect` knows the truth.
struct MachineAccess {
  /// Measures the datum while a corrector acts (empty: no correction). Returns its shift, mm.
  std::function<Eigen::Vector3d(const Corrector&)> touch_off;
  /// Runs commands in air or through the blank. Returns the signals that the control reads.
  std::function<compensation::ControlLog(const Commands&, bool through_blank)> run;
  /// Cuts a part with commands and measures it with the instrument of the belief `part`.
  std::function<MeasuredPart(const Commands&, int pass)> measure_cut_part;
  /// Cuts and measures the training part of the belief `force`.
  std::function<TrainingRun()> training;
  /// Returns the part as the error-free machine cuts it.
  std::function<cutting::Surface()> error_free;
  /// Returns the load of the cut, simulated on a believed machine.
  std::function<compensation::LoadSeries(const Commands&, const BelievedPose&)> simulate_load;
  /// Returns the corrector of the belief `perfect`: it knows the truth without its random parts.
  std::function<Corrector(const ControlView&, const CaseDescription&)> perfect;
  /// Throws BadInput unless the user has allowed this program to run.
  std::function<void(const std::filesystem::path& program)> check_trusted;
};

}  // namespace abbe::sim
