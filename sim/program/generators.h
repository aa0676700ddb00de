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

/// The design as a generator sees it: the surface point above (x, y) of the part frame, if any.
using ContactField = std::function<std::optional<cutting::Contact>(double x, double y)>;

/// Finishing in parallel passes. A pass lies in a plane y = const of the part frame; the passes are
/// spaced by `step_over` of arc length on the design along its section x = 0 (so on a dome they lie
/// at equal steps of latitude), the points of a pass by `step` of arc length along it.
struct Raster {
  double step_over = 0.3;       ///< mm
  double step = 0.3;            ///< mm
  double lead = 0.0;            ///< rad, tool axis leans forward in the feed plane
  double tilt = 0.0;            ///< rad, tool axis leans across, about the feed direction
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double speed_rpm = 10000.0;   ///< of the spindle
  double clearance = 5.0;       ///< mm, retract along the tool axis between passes
  bool zigzag = true;           ///< false: all passes in one direction
  double overrun = 0.0;         ///< mm the passes run beyond a declared analytic surface
  NcFormat format;
};

/// Flank milling of a cone frustum: the flank of a cutter along its generators, once around.
struct Flank {
  double step = 0.5;            ///< mm of arc at the base between points
  double feed = 1000.0 / 60.0;  ///< mm/s
  double speed_rpm = 10000.0;   ///< of the spindle
  double clearance = 5.0;       ///< mm
  double tip_below = 1.0;       ///< mm the tip reaches below the base, along the generator
  NcFormat format;
};

/// Facing by a spiral: the spindle turns at constant speed, the nose follows the design from
/// outside the rim to the axis with a constant feed per revolution, the nose radius compensated.
struct Spiral {
  double spindle_speed = 150.0 / 60.0 * 6.283185307179586;  ///< rad/s
  double feed_per_revolution = 0.02;                        ///< mm
  double start_beyond_rim = 0.02;  ///< mm of radius outside the rim where the cut begins
  double end_radius = 0.0;         ///< mm; 0 ends with one revolution at r = 0
  double interval = 0.1;           ///< s between rows of a PVT file
  bool write_nc = false;           ///< false: PVT
  NcFormat format;
};

/// What a generator needs to know besides its own options.
struct GeneratorContext {
  kinematics::Chain control;                             ///< as the control believes it
  kinematics::Pose T_wm = kinematics::Pose::Identity();  ///< part frame in the workpiece
  Eigen::Vector2d lower, upper;                          ///< mm, x y of the part frame to cover
  int h_number = 1;                                      ///< tool length word
};

/// What a generator had to leave out, as the machine does not reach it.
struct Unreached {
  int passes = 0;         ///< of which nothing is cut
  int broken_passes = 0;  ///< of which some is cut
  int all_passes = 0;     ///< wanted
  int points = 0;         ///< left out, of all passes
  int all_points = 0;     ///< wanted
  int first_pass = 0;     ///< that is not whole, counted from 1; 0: all are
  kinematics::Reach why = kinematics::Reach::Reached;  ///< of its first point that is not reached
  Eigen::Vector3d tip_w = Eigen::Vector3d::Zero();     ///< mm, that point
};

/// A generated program, and what of it the machine cannot do.
struct MillingProgram {
  std::string text;
  Unreached unreached;
};

/// Five-axis NC text (G43.4, tip coordinates) for any cutter; three-axis G1 where the machine has
/// no rotary axes. Points that the machine does not reach end the pass, and are counted.
/// @throws std::invalid_argument if nothing of the design lies in the range or no pose is reachable
MillingProgram generate_raster(const Raster& raster, const ContactField& design,
                               const cutting::Cutter& cutter, const GeneratorContext& context);

std::string generate_flank(const Flank& flank, const cutting::Cone& cone,
                           const cutting::Cutter& cutter, const GeneratorContext& context);

/// PVT or NC text for a turning machine: the part's z axis lies along the spindle, the design is
/// seen in its half plane r >= 0.
std::string generate_spiral(const Spiral& spiral, const cutting::Primitive& design,
                            const cutting::Nose& nose, const GeneratorContext& context);

/// Where a milling cutter is put.
struct Posture {
  Eigen::Vector3d tip_w;
  Eigen::Vector3d direction_w;  ///< unit, from the tip to the spindle
  Eigen::Vector3d retreat_w;    ///< unit, the way out of the cut
};
using Pass = std::vector<Posture>;

struct MillingTextOptions {
  std::string title;
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double clearance = 5.0;       ///< mm
  double speed_rpm = 10000.0;   ///< of the spindle
  double cutter_radius = 5.0;   ///< mm, how much a turning tool may dip below its tip
  double neighbour = 0.0;  ///< mm, passes this near are linked at clearance, others above the part
  bool whole = false;  ///< a posture out of reach is refused; else it ends its pass, and is counted
  NcFormat format;
};

/// The machine reaches no point of what is to be cut.
struct NoReachablePose : std::invalid_argument {
  explicit NoReachablePose(const Unreached& all)
      : std::invalid_argument("no pose that the machine can reach"), unreached(all) {}
  Unreached unreached;
};

/// NC text of passes: G43.4 where the machine has rotary axes, positions of the slides where not.
/// @throws NothingReached; std::invalid_argument if the machine lacks X, Y or Z
MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GeneratorContext& context);

/// True if the machine can turn the tool against the workpiece.
bool has_rotary_axes(const kinematics::Chain& chain);

/// Every joint as the reader of programs wants it.
std::vector<ControlledAxis> controlled_axes(const kinematics::Chain& chain);

}  // namespace abbe::sim::program
