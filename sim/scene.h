#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "cutting/alignment.h"
#include "cutting/primitive.h"
#include "cutting/tool.h"
#include "errors/geometric.h"
#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/compensation/correct.h"
#include "sim/program/generate.h"
#include "sim/program/nc.h"

/// Everything together: description (TOML) -> compiled machine, part, path -> loop -> report.
namespace abbe::sim {

/// A machine as its file describes it; every length mm, every angle rad, in the bed frame at zero.
struct MachineDescription {
  std::string name;
  std::vector<kinematics::Joint> joints;                 ///< in the order of the structural code
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece, axes at zero
  kinematics::Pose T_bs =
      kinematics::Pose::Identity();     ///< spindle nose or tool post; z = tool axis
  kinematics::AxisVector home;          ///< (joints) where the axes stand when a program begins
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s
  double rapid_turn = 1.0;              ///< rad/s
};

/// A tool, what the control believes of it, and what it really is.
struct ToolDescription {
  std::string name;
  std::variant<cutting::Cutter, cutting::Nose> nominal;
  std::variant<cutting::Cutter, cutting::Nose> actual;  ///< same alternative as nominal
  double length = 0.0;                                  ///< mm from the nose s to the tip t
  double actual_length = 0.0;                           ///< mm
  double centring_offset = 0.0;  ///< mm, turning: the tip stands this much along t's x really
  double centring_height = 0.0;  ///< mm, turning: and this much along t's y
};

/// A design surface from a file.
struct MeshFile {
  std::filesystem::path file;
  double unit = 1.0;      ///< mm per unit of the file
  bool any_size = false;  ///< its size is meant: no doubt is cast on the unit
  bool open = false;      ///< a surface with a rim is meant
};

struct PartDescription {
  std::string name;
  std::variant<cutting::Primitive, MeshFile> shape;
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece
  int vertices = 20000;                                  ///< wanted; not for mesh files
  std::optional<double>
      judged_radius_max;  ///< mm from the part's z axis; vertices beyond are left out
  std::optional<double> judged_radius_min;
  std::optional<double>
      judged_normal_z;  ///< mesh files: vertices whose normal's z is less are left out
  std::optional<double> judged_margin;  ///< mesh files: mm from the rim that are left out
  double tolerance = 0.0;               ///< mm, +- ; 0: none given
};

/// A program: a file, or a generator that writes one.
struct ProgramDescription {
  struct File {
    std::filesystem::path file;  ///< .ngc .nc .tap are NC, .csv .pvt are PVT
  };
  std::variant<File, program::Raster, program::Flank, program::Spiral> source;
  std::map<int, double> tool_length;  ///< mm by H number; H of the tool in use is there already
  std::array<kinematics::AxisVector, 6> work_offset{};
};

/// What the control believes, where it differs from the nominal machine.
struct ControlDescription {
  std::vector<kinematics::Joint> joints;  ///< as it believes (points, directions)
  std::optional<double> tool_length;      ///< mm
};

struct DatumDescription {
  enum class Kind { None, Ideal, TouchOff } kind = Kind::None;
  struct Touch {
    Eigen::Vector3d point_w;      ///< mm
    Eigen::Vector3d direction_w;  ///< unit, along which the probe touches
  };
  std::vector<Touch> touches;                         ///< touch_off
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();  ///< ideal: where the tip is set exactly
  double time_s = 0.0;
};

using Alignment = cutting::Alignment;

/// A picture's view: where the camera stands, in the part frame.
struct ViewDescription {
  Eigen::Vector3d from =
      Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the camera
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::optional<double> range_um;  ///< colour scale is -range .. +range; else fitted
};

struct Limits {
  std::optional<double> pv_um, rms_um, max_abs_um;  ///< exceeded: exit 1
};

/// A compensator as the three choices of a case name.
struct CaseDescription {
  std::string name;  ///< "perfect-iterated-ideal"
  compensation::Strategy strategy = compensation::Strategy::Iterated;
  enum class Channel { Ideal, Program } channel = Channel::Ideal;
};

struct CompensationDescription {
  double rotary_bound = 0.1 * 0.017453292519943295;       ///< rad, default 0.1 deg
  double word_resolution = 1e-4;                          ///< mm, of a rewritten NC program
  double angle_resolution = 1e-4 * 0.017453292519943295;  ///< rad, the same for rotary words
};

/// A value of the scene changed by path: {"errors.scale", "2.0"}; the value is TOML text.
using Override = std::pair<std::string, std::string>;

struct Variant {
  std::string name;
  std::vector<Override> set;
};

/// A scene as read: description only, nothing compiled.
struct Scene {
  std::filesystem::path file;
  std::string title;
  std::uint64_t seed = 1;
  MachineDescription machine;
  errors::GeometricErrors geometric;
  double error_scale = 1.0;
  kinematics::Deviation setup = kinematics::Deviation::Zero();  ///< clamping of the part, at w
  ToolDescription tool;
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
  CompensationDescription compensation;
  std::string case_name;  ///< what `run` cuts if not told: the case that a finished result
                          ///< names in its scene.toml; empty: uncompensated
  std::vector<CaseDescription> cases;  ///< compensators that compare runs, in order
  std::vector<Variant> variants;
  std::string
      resolved;  ///< TOML text with every file it names read in; rerunning it gives the same
                 ///< bits. Data files (mesh, tables, program) are named by absolute path
};

/// Reads a scene strictly: unknown keys are refused with the nearest known one, types and units are
/// checked, and all faults are found before any is told.
/// @param overrides  applied to the text before it is checked; a path that names nothing known is
/// refused
/// @throws BadScene with every fault
Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides = {});

/// All faults of a scene at once; `what()` has one "file:line:column: expected ..., seen ..." a
/// line.
struct BadScene : std::runtime_error {
  explicit BadScene(std::vector<BadInput> faults);
  std::vector<BadInput> faults;
};

/// Reads a case name "perfect-iterated-ideal".
/// @throws std::invalid_argument naming the token and what it could be
CaseDescription parse_case(const std::string& name);

}  // namespace abbe::sim
