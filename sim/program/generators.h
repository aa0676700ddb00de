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

namespace abbe::sim::program {

inline constexpr double max_points = 2e7;  ///< of a generated program

/// The design as a generator queries it: the surface point above (x, y) of the part frame, if any.
using ContactField = std::function<std::optional<cutting::Contact>(double x, double y)>;

/// Options of finishing in parallel passes. A pass lies in a plane y = const of the part frame.
/// Passes are spaced by `step_over` of arc length along the section x = 0 of the design (on a dome
/// at equal steps of latitude), the points of a pass by `step` of arc length along it.
struct Raster {
  double step_over = 0.3;       ///< mm
  double step = 0.3;            ///< mm
  double lead = 0.0;            ///< rad, lean of the tool axis forward in the feed plane
  double tilt = 0.0;            ///< rad, lean of the tool axis sideways, about the feed direction
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double speed_rpm = 10000.0;   ///< of the spindle
  double clearance = 5.0;       ///< mm, retraction along the tool axis between passes
  bool zigzag = true;           ///< false: all passes run in one direction
  double overrun = 0.0;         ///< mm by which the passes overrun a declared analytic surface
  NcFormat format;
};

/// Options of flank milling of a cone frustum: the flank of the cutter runs along the generators,
/// once around.
struct Flank {
  double step = 0.5;            ///< mm of arc at the base between points
  double feed = 1000.0 / 60.0;  ///< mm/s
  double speed_rpm = 10000.0;   ///< of the spindle
  double clearance = 5.0;       ///< mm
  double tip_below = 1.0;       ///< mm by which the tip reaches below the base, along the generator
  NcFormat format;
};

/// Options of facing by a spiral: the spindle turns at constant speed, and the nose follows the
/// design from outside the rim to the axis at a constant feed per revolution, with nose radius
/// compensation.
struct Spiral {
  double spindle_speed = 150.0 / 60.0 * 6.283185307179586;  ///< rad/s
  double feed_per_revolution = 0.02;                        ///< mm
  double start_beyond_rim = 0.02;  ///< mm of radius outside the rim at which the cut begins
  double end_radius = 0.0;         ///< mm; 0 ends with one revolution at r = 0
  double interval = 0.1;           ///< s, between rows of a PVT file
  bool write_nc = false;           ///< false: write PVT
  NcFormat format;
};

/// Machine and range that a generator needs besides its own options.
struct GeneratorContext {
  kinematics::Chain control;                             ///< the control's own model
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece
  Eigen::Vector2d lower, upper;                          ///< mm, range of x y in the part frame
  int h_number = 1;                                      ///< H number of the tool length
};

/// Parts of a tool path that a generator left out because the machine cannot reach them.
struct Unreached {
  int passes = 0;         ///< passes of which nothing is cut
  int broken_passes = 0;  ///< passes of which a part is cut
  int all_passes = 0;     ///< planned passes
  int points = 0;         ///< omitted points of all passes
  int all_points = 0;     ///< planned points of all passes
  int first_pass = 0;     ///< first incomplete pass, counted from 1; 0: all are complete
  kinematics::Reach why = kinematics::Reach::Reached;  ///< reason at its first unreachable point
  Eigen::Vector3d tip_w = Eigen::Vector3d::Zero();     ///< mm, that point
};

/// A generated program and the parts the machine cannot reach.
struct MillingProgram {
  std::string text;
  Unreached unreached;
};

/// Returns five-axis NC text (G43.4, tip coordinates) for any cutter, or three-axis G1 on a machine
/// without rotary axes. Points that the machine cannot reach end their pass and are counted. Throws
/// std::invalid_argument if nothing of the design lies in the range or no pose is reachable.
MillingProgram generate_raster(const Raster& raster, const ContactField& design,
                               const cutting::Cutter& cutter, const GeneratorContext& context);

/// Returns five-axis NC text of flank milling. Throws std::invalid_argument if a pose is out of
/// reach from every start and in both directions.
std::string generate_flank(const Flank& flank, const cutting::Cone& cone,
                           const cutting::Cutter& cutter, const GeneratorContext& context);

/// Returns PVT or NC text for a turning machine. The z axis of the part lies along the spindle; the
/// design is its profile in the half plane r >= 0.
std::string generate_spiral(const Spiral& spiral, const cutting::Primitive& design,
                            const cutting::Nose& nose, const GeneratorContext& context);

/// Position of a milling cutter.
struct Posture {
  Eigen::Vector3d tip_w;
  Eigen::Vector3d direction_w;  ///< unit, from the tip towards the spindle
  Eigen::Vector3d retreat_w;    ///< unit, retraction out of the cut
};
using Pass = std::vector<Posture>;

/// Options of NC text for milling passes.
struct MillingTextOptions {
  std::string title;
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double clearance = 5.0;       ///< mm
  double speed_rpm = 10000.0;   ///< of the spindle
  double cutter_radius = 5.0;   ///< mm, bounds how far a tilting tool reaches below its tip
  /// mm; passes closer than this are linked at clearance, others above the part
  double neighbour = 0.0;
  /// True: an unreachable posture is an error; false: it ends its pass and is counted.
  bool whole = false;
  NcFormat format;
};

/// Thrown if the machine reaches no point of the passes.
struct NoReachablePose : std::invalid_argument {
  explicit NoReachablePose(const Unreached& all)
      : std::invalid_argument("no pose that the machine can reach"), unreached(all) {}
  Unreached unreached;
};

/// Returns NC text of passes: G43.4 on a machine with rotary axes, slide positions otherwise.
/// Throws NoReachablePose, and std::invalid_argument if the machine lacks X, Y or Z.
MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GeneratorContext& context);

/// Returns true if the machine has a rotary axis other than the spindle S.
bool has_rotary_axes(const kinematics::Chain& chain);

/// Returns all joints in the form that program readers take.
std::vector<ControlledAxis> controlled_axes(const kinematics::Chain& chain);

}  // namespace abbe::sim::program
