#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "cutting/alignment.h"
#include "cutting/force.h"
#include "cutting/primitive.h"
#include "cutting/tool.h"
#include "errors/compliance.h"
#include "errors/geometric.h"
#include "errors/identification/thermal_study.h"
#include "errors/metrology/instrument.h"
#include "errors/metrology/part.h"
#include "errors/thermal.h"
#include "errors/thermal_elements.h"
#include "errors/vibration.h"
#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/compensation/channels.h"
#include "sim/compensation/control_files.h"
#include "sim/compensation/correct.h"
#include "sim/compensation/force_belief.h"
#include "sim/compensation/parameter_tables.h"
#include "sim/compensation/thermal_belief.h"
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
  std::optional<int> number;  ///< T of a program that calls it
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
  struct Ring {                         ///< where the radius of a part of revolution is told
    std::string name;
    double along = 0.0;  ///< mm, z of the part frame
    double width = 0.0;  ///< mm, > 0
  };
  std::vector<Ring> rings;
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

/// A stretch of time before the program, as the machine spent it.
struct ThermalPhase {
  double duration = 0.0;              ///< s
  double spindle_speed = 0.0;         ///< rad/s
  kinematics::AxisVector axis_speed;  ///< (joints) mean |v| of reciprocating axes, mm/s or rad/s
  bool powered = true;
  bool coolant = false;
};

/// Heat: the network, what it does to the elements, what came before the program. Time 0 is the
/// start of the program; the history ends there.
struct ThermalDescription {
  static constexpr double least_T_C = -273.15, most_T_C = 5000.0;  ///< of anything in it, ever
  errors::ThermalNetwork network;
  errors::ThermalErrors errors;
  std::vector<errors::TemperatureSensor> sensors;
  std::vector<ThermalPhase> history;  ///< in order, the last one ends at time 0
  Eigen::VectorXd room_time_s;        ///< (n >= 1) the room is linear between, held outside
  Eigen::VectorXd room_T_C;           ///< (n)
  double coolant_T_C = 20.0;
  bool powered = true;    ///< while the program runs
  bool coolant = false;   ///< the same
  double interval = 1.0;  ///< s, in the program heat flows are linear over stretches of this length
  double scale = 1.0;     ///< of all that heat does to elements and workpiece
  struct Plot {
    errors::ElementName element;
    Eigen::VectorXd time_s;                      ///< (n) instants whose curves are drawn
    std::optional<std::array<double, 2>> range;  ///< mm or rad; else the travel
  };
  std::vector<Plot> plots;
};

/// An instrument of the scene, and when it is used.
struct InstrumentDescription {
  errors::metrology::Instrument instrument;
  std::vector<double> starts_s;  ///< (n >= 1) everything is read once from each; time 0 is the
                                 ///< start of the program
};

/// What measures the finished part: a touch probe on the machine that cut it, or a coordinate
/// measuring machine of its own.
struct PartInstrumentDescription {
  std::string name;
  std::string case_name;  ///< of which case the part is; empty: uncompensated
  std::variant<errors::metrology::CoordinateMachine, errors::metrology::TouchProbe> how;
  double spacing = 5.0;  ///< mm, about, between points
};

/// Which temperature sensors are worth having, and what a model of them is good for.
struct SensorChoiceDescription {
  std::string instrument = "drift";  ///< reads the drift, over the scene's own history for
                                     ///< training, over those of its variants for testing
  errors::identification::ThermalStudyOptions study;
  /// Another way to choose, graded beside.
  struct Way {
    std::string name;
    errors::identification::SensorChoiceOptions choice;
    std::vector<std::string> drifts;  ///< "Z": displacements to choose for; empty: all
  };
  std::vector<Way> beside;
};

/// The blank, what is cut with which forces, and how finely that is followed.
struct CuttingDescription {
  struct OffsetBlank {       ///< of a milled design, raised along its normals
    double allowance = 0.0;  ///< mm
    double floor = 0.0;      ///< mm, z of the part frame below
  };
  struct TurnedBlank {  ///< radius over the spindle line, from the part's origin
    Eigen::Matrix<double, Eigen::Dynamic, 2> profile;  ///< (n x 2) mm: along, radius
  };
  using Blank =
      std::variant<cutting::BoxBlank, cutting::CylinderBlank, OffsetBlank, MeshFile, TurnedBlank>;
  Blank blank;           ///< in the part's frame
  double spacing = 0.5;  ///< mm of dexels; of a turned blank along the line
  bool three_directions = true;
  std::size_t max_bytes = std::size_t(2) << 30;
  std::optional<cutting::CuttingCoefficients> material;  ///< none: stock alone, no forces
  cutting::Flutes flutes;
  double step = 0.5;         ///< mm of tip travel between two looks at the engagement (milling)
  double tolerance = 1e-6;   ///< mm, to which deflection and force agree
  int most_iterations = 30;  ///< of one step
};

/// What a control can read, and how well.
struct SignalsDescription {
  double interval = 0.0;  ///< s between rows of signals.csv; 0: as fine as 20 000 rows allow
  double history_interval = 0.0;    ///< s between rows of the thermal history; 0: it is not told
  double encoder_resolution = 0.0;  ///< mm; 0: not rounded
  double encoder_resolution_rad = 0.0;
  double encoder_noise = 0.0;  ///< mm, standard deviation
  double encoder_noise_rad = 0.0;
  struct Current {
    double torque_per_current = 1e3;  ///< N mm/A
    double idle_torque = 0.0;         ///< N mm, of bearings at any speed
    double viscous_torque = 0.0;      ///< N mm s/rad
    double noise_A = 0.0;             ///< standard deviation
    double bandwidth = 0.0;           ///< Hz, first order; 0: none
  };
  std::optional<Current> current;
  struct Dynamometer {
    double noise = 0.0;       ///< N
    double resolution = 0.0;  ///< N
    double bandwidth = 0.0;   ///< Hz, first order; 0: none
  };
  std::optional<Dynamometer> dynamometer;
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

/// A compensator as the three choices of a case name, or one of the user's own.
struct CaseDescription {
  std::string name;  ///< "perfect-iterated-ideal", "mine.py"
  enum class Belief {
    Perfect,     ///< the truth without its random parts
    Identified,  ///< geometric errors, from readings
    Thermal,     ///< what heat adds, from temperatures
    Composite,   ///< both (Yang 2012)
    Force,       ///< what the cut bends, from current, dynamometer or a model of the force
    Part,        ///< what was measured of a part that was cut before
    Fused,       ///< all that the scene gives to believe, with one correction (Guo 2016)
  } belief = Belief::Perfect;
  compensation::Strategy strategy = compensation::Strategy::Iterated;
  enum class Channel {
    Ideal,
    Program,
    Pulses,
    Open,
    Origin,
    Table,
    Piezo
  } channel = Channel::Ideal;
  std::filesystem::path plug_in;  ///< then belief and strategy are its own
};

/// What a compensator is given to believe, by the tokens of a case.
struct BeliefDescription {
  std::optional<errors::GeometricErrors> identified;
  std::optional<compensation::ThermalBelief> thermal;
  struct Force {
    enum class From { Current, Dynamometer, Model } from = From::Model;
    errors::ComplianceErrors compliance;  ///< as it is believed; not from current
    std::filesystem::path training;       ///< from current: scene of the part from which is learnt
    std::string instrument;               ///< that measures that part
    double smoothing_s = 0.0;             ///< of current or dynamometer
    int passes = 2;                       ///< runs from which is learnt, each corrected by the last
  };
  std::optional<Force> force;
  struct Part {
    std::string instrument;  ///< of the scene, that measures the part
    int passes = 1;          ///< parts that are cut and measured before the one that counts
  };
  std::optional<Part> part;
  double scale = 1.0;  ///< of what identified and thermal say; 0: one that believes in nothing
};

/// Channels, strategies and their limits.
struct CompensationDescription {
  double rotary_bound = 0.1 * 0.017453292519943295;       ///< rad, default 0.1 deg
  double word_resolution = 1e-4;                          ///< mm, of a rewritten NC program
  double angle_resolution = 1e-4 * 0.017453292519943295;  ///< rad, the same for rotary words
  double path_tolerance = 0.0;  ///< mm, between the corrected path and that of the rewritten
                                ///< blocks; 0: a word's resolution, of PVT 1 nm
  compensation::PositionLoop loop;
  struct Pulses {
    double count = 1e-3;                             ///< mm
    double count_rad = 1e-3 * 0.017453292519943295;  ///< rad
    double cycle_s = 1e-3;
    double pulse_s = 2e-6;
  } pulses;
  compensation::OpenControl open;
  compensation::OriginShift origin;
  struct Table {
    compensation::TableOptions options;
    std::optional<compensation::ControlFormat> format;  ///< through a file of that control
    std::optional<kinematics::AxisVector> reference;    ///< (joints) where the other axes stand;
                                                        ///< none: the middle of the program
  } table;
  compensation::Piezo piezo;
  CaseDescription plug_in;  ///< strategy and channel of plug-ins
};

struct Node;
struct Place;

/// A value of the scene changed by path: {"errors.scale", "2.0"}.
struct Override {
  std::string path;
  std::string value;                        ///< TOML text
  std::shared_ptr<const Place> place = {};  ///< in a file; null: the user typed it

  /// The same change, wherever it stands.
  friend bool operator==(const Override& a, const Override& b) {
    return a.path == b.path && a.value == b.value;
  }
};

/// A program that a scene or study would have run: a compensator of somebody's own.
struct NamedProgram {
  std::filesystem::path program;  ///< absolute
  std::filesystem::path file;     ///< that names it
  int line = 0;
  int column = 0;
  bool typed = false;  ///< by the user, on the command line
};

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
  std::optional<ThermalDescription> thermal;
  std::optional<errors::ComplianceErrors> compliance;
  std::vector<errors::Vibration> vibrations;
  std::optional<CuttingDescription> cutting;
  SignalsDescription signals;
  std::vector<InstrumentDescription> instruments;
  std::vector<PartInstrumentDescription> part_instruments;
  std::optional<SensorChoiceDescription> sensor_choice;
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
  BeliefDescription belief;
  CompensationDescription compensation;
  std::string case_name;  ///< what `run` cuts if not told: the case that a finished result
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
