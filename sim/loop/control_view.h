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

/// What a compensator may know. Nothing in this room but compensate.cpp can include
/// what the machine really is: tests/architecture_test.cpp follows every include.
namespace abbe::sim {

/// The tool as it was ordered.
struct NominalTool {
  const std::string& name;
  double length = 0.0;  ///< mm from the nose s to the tip t
  const std::variant<cutting::Cutter, cutting::Nose>& shape;
};

/// A job as the control and the shop floor see it: machine and tool as ordered, the program, what
/// the scene gives to believe. It refers to the job, which must outlive it.
struct ControlView {
  const std::filesystem::path& file;  ///< of the scene, for refusals
  const Machine& machine;
  NominalTool tool;
  const DatumDescription& datum;
  const BeliefDescription& belief;
  const CompensationDescription& compensation;
  std::uint64_t seed = 1;
  double chord_tolerance = 0.0;  ///< mm
  bool is_cut = false;           ///< the scene has a blank, so that there is force to read
  program::NcOptions control;    ///< what the control knows before it reads a program
  program::SampleOptions sampling;
  const program::Path& path;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt_nominal;  ///< (samples) where the tool should be
  const cutting::Design& design_w;
};

/// Where a machine is believed to bring the tool at a sample when the cut loads it so.
using BelievedPose = std::function<kinematics::Pose(std::size_t sample, const errors::Load&)>;

/// A part that was cut and measured.
struct MeasuredPart {
  errors::metrology::PartReadings readings;
  double spacing = 0.0;  ///< mm, about, between points
};

/// A part from which a current is learnt.
struct TrainingRun {
  compensation::ControlLog log;
  compensation::CurrentTraining training;
};

/// What a compensator can have done. Of the real machine only readings come back, with their noise.
struct MachineAccess {
  /// Shift of the datum that the control finds, mm, while a corrector acts (none: while nothing
  /// does).
  std::function<Eigen::Vector3d(const Corrector&)> touch_off;
  /// Runs commands, in air or through the blank, and reads what the control reads.
  std::function<compensation::ControlLog(const Commands&, bool through_blank)> run;
  /// Cuts a part with commands and measures it with the instrument of the belief `part`.
  std::function<MeasuredPart(const Commands&, int pass)> measured_part;
  /// Cuts and measures the training part of the belief `force`.
  std::function<TrainingRun()> training;
  /// The part as the error-free machine cuts it.
  std::function<cutting::Surface()> error_free;
  /// The load of the cut computed on a machine as it is believed to be.
  std::function<compensation::LoadSeries(const Commands&, const BelievedPose&)> computed_load;
  /// Corrects by the truth without its random parts: the one belief that knows the machine.
  std::function<Corrector(const ControlView&, const CaseDescription&)> perfect;
  /// @throws BadInput unless the user lets this program run
  std::function<void(const std::filesystem::path& program)> check_trusted;
};

}  // namespace abbe::sim
