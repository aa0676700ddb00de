#pragma once

#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutting/part/primitive.h"
#include "cutting/surface/tool.h"
#include "kinematics/chain.h"
#include "kinematics/inverse_kinematics.h"
#include "sim/program/program_writers.h"

/// Generators of programs: raster finishing, flank milling, and face turning along a spiral.
namespace abbe::sim::program {

inline constexpr double max_points = 2e7;  ///< points of a generated program

/// Returns the surface point of the design above (x, y) of the part frame; nothing if there is
/// none.
using ContactField = std::function<std::optional<cutting::Contact>(double x, double y)>;

/// Options of finishing in parallel passes, each in a plane y = const of the part frame.
/// `step_over` is the arc length between passes along the section x = 0 of the design (equal steps
/// of latitude on a dome); `step` is the arc length between points of a pass.
struct Raster {
  double step_over = 0.3;       ///< mm
  double step = 0.3;            ///< mm
  double lead = 0.0;            ///< rad, lead angle: lean of the tool axis forwards along the feed
  double tilt = 0.0;            ///< rad, tilt angle: lean sideways, about the feed direction
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double speed_rpm = 10000.0;   ///< of the spindle
  double clearance = 5.0;       ///< mm, retraction along the tool axis between passes
  bool zigzag = true;           ///< false: all passes run in the same direction
  double overrun = 0.0;         ///< mm by which passes extend beyond the rim of a primitive
  NcFormat format;
};

/// Options of flank milling of a cone frustum: the flank of the cutter lies along the generatrix
/// while the cutter goes around once.
struct Flank {
  double step = 0.5;            ///< mm of arc along the base, between points
  double feed = 1000.0 / 60.0;  ///< mm/s
  double speed_rpm = 10000.0;   ///< of the spindle
  double clearance = 5.0;       ///< mm
  double tip_below = 1.0;       ///< mm of generatrix by which the tip reaches below the base
  NcFormat format;
};

/// Options of face turning along a spiral: the spindle turns at constant speed while the tool nose
/// follows the design from outside its rim to the axis at a constant feed per revolution. The path
/// compensates the nose radius.
struct Spiral {
  double spindle_speed = 150.0 / 60.0 * 6.283185307179586;  ///< rad/s
  double feed_per_revolution = 0.02;                        ///< mm
  double start_beyond_rim = 0.02;  ///< mm, radial distance outside the rim where the cut begins
  double end_radius = 0.0;         ///< mm; 0: the path ends with one revolution at r = 0
  double interval = 0.1;           ///< s, between rows of a PVT file
  bool write_nc = false;           ///< false: write PVT
  NcFormat format;
};

/// Input common to all generators: the machine and the range to cut.
struct GeneratorContext {
  kinematics::Chain control;                             ///< the machine as the control models it
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece
  Eigen::Vector2d lower, upper;                          ///< mm, bounds of (x, y) in the part frame
  int h_number = 1;                                      ///< H number that selects the tool length
};

/// The passes and points of a tool path that a generator omitted because the machine cannot reach
/// them.
struct UnreachedPoints {
  int passes = 0;         ///< passes omitted completely
  int broken_passes = 0;  ///< passes of which some points are omitted
  int all_passes = 0;     ///< planned passes
  int points = 0;         ///< omitted points of all passes
  int all_points = 0;     ///< planned points of all passes
  int first_pass = 0;     ///< first incomplete pass, from 1; 0: all are complete
  kinematics::Reachability why =
      kinematics::Reachability::Reached;            ///< reason at the first omitted point
  Eigen::Vector3d tip_w = Eigen::Vector3d::Zero();  ///< mm, tip at that point
};

/// A generated program, and the points that it omits because the machine cannot reach them.
struct MillingProgram {
  std::string text;
  UnreachedPoints unreached;
};

/// Returns the program of a raster for any cutter: five-axis NC text with tip coordinates (G43.4),
/// or three-axis G1 on a machine without rotary axes. A point that the machine cannot reach ends
/// its pass and is counted. Throws std::invalid_argument if no part of the design lies in the range
/// or no pose is reachable.
MillingProgram generate_raster(const Raster& raster, const ContactField& design,
                               const cutting::Cutter& cutter, const GeneratorContext& context);

/// Returns five-axis NC text of flank milling. Starting point and direction are chosen such that
/// the machine reaches every pose; throws std::invalid_argument if no choice allows that.
std::string generate_flank(const Flank& flank, const cutting::Cone& cone,
                           const cutting::Cutter& cutter, const GeneratorContext& context);

/// Returns PVT or NC text of a spiral for a turning machine. The z axis of the part is the spindle
/// axis, and the profile of the design lies in the half plane r >= 0.
std::string generate_spiral(const Spiral& spiral, const cutting::Primitive& design,
                            const cutting::Nose& nose, const GeneratorContext& context);

/// Position and orientation of a milling cutter.
struct CutterPose {
  Eigen::Vector3d tip_w;
  Eigen::Vector3d direction_w;  ///< unit, from the tip towards the spindle
  Eigen::Vector3d retract_w;    ///< unit, direction in which the cutter retracts
};
using Pass = std::vector<CutterPose>;

/// Options of NC text for milling passes.
struct MillingTextOptions {
  std::string title;
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double clearance = 5.0;       ///< mm
  double speed_rpm = 10000.0;   ///< of the spindle
  double cutter_radius = 5.0;   ///< mm, bounds how far a tilted cutter reaches below its tip
  /// mm; the link to a pass that is closer than this stays at clearance; other links go above the
  /// part
  double max_link_distance = 0.0;
  /// True: an unreachable pose is an error; false: it ends its pass and is counted.
  bool must_reach_all = false;
  NcFormat format;
};

/// Thrown if the machine cannot reach any point of the passes.
struct NoReachablePose : std::invalid_argument {
  explicit NoReachablePose(const UnreachedPoints& all)
      : std::invalid_argument("no pose that the machine can reach"), unreached(all) {}
  UnreachedPoints unreached;
};

/// Returns NC text of passes: tip coordinates (G43.4) on a machine with rotary axes, slide
/// positions otherwise. Throws NoReachablePose, and std::invalid_argument if the machine lacks X, Y
/// or Z.
MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GeneratorContext& context);

/// Returns true if the machine has a rotary axis besides the spindle S.
bool has_rotary_axes(const kinematics::Chain& chain);

}  // namespace abbe::sim::program
