#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "kinematics/axes.h"
#include "kinematics/pose.h"

namespace abbe::kinematics {

/// Axes along which the error motion of a joint is stated.
enum class DeviationAxes {
  Fixed,    ///< fixed, they do not turn with the joint (ISO 230-7): applied after a slide, before a
            ///< rotation
  Turning,  ///< turning with the joint: applied after the rotation, the order used in most papers
};

/// Effect of the angles of a location error.
enum class Squareness {
  Frame,   ///< turn the frame as the structural code requires, with all that it carries
           ///< (`location_element`)
  Travel,  ///< turn the direction of travel only
};

/// The part that one component of a location error displaces; see `location_element`.
enum class DisplacedPart {
  Frame,    ///< the joint's frame about its point, before its motion, with all that it carries
  Carried,  ///< the carried parts, about the joint's point after its motion, by the opposite
            ///< displacement
  Axis,     ///< only the direction of travel or the rotation axis
};
using LocationRule = std::array<DisplacedPart, 6>;  ///< of [EX EY EZ EA EB EC]

/// A moving part, described in the bed frame with all axes at zero.
struct Joint {
  char name = 'X';
  Side side = Side::Tool;
  Motion motion = Motion::Linear;
  Eigen::Vector3d direction_b = Eigen::Vector3d::UnitX();  ///< unit; a positive command moves the
                                                           ///< tool in this direction relative to
                                                           ///< the workpiece
  Eigen::Vector3d point_b = Eigen::Vector3d::Zero();       ///< mm; a point of the rotation axis, or
                                                           ///< the point at which deviations of a
                                                           ///< slide are stated
  double min = -1e9;  ///< mm or rad, lower limit of the commanded travel; `max` is the upper
  double max = 1e9;
  DeviationAxes deviation_axes = DeviationAxes::Fixed;
  Squareness squareness = Squareness::Frame;
};

/// Deviations of one joint, actual minus nominal of the carriage itself, on either side of the bed.
struct JointDeviation {
  Deviation motion = Deviation::Zero();    ///< error motion, stated at the joint's point after its
                                           ///< motion
  Deviation location = Deviation::Zero();  ///< error of position and direction of the axis; see
                                           ///< `LocationRule`
};

/// Returns the sum of two sets of deviations, joint by joint.
/// @throws std::invalid_argument if they differ in the number of joints
std::vector<JointDeviation> sum(std::vector<JointDeviation> a, std::span<const JointDeviation> b);

/// A serial machine. Immutable. Nominal and actual machine are computed by the same function; zero
/// deviations give the nominal pose bit for bit.
class Chain {
 public:
  /// @param joints     in the order of the structural code, workpiece to tool
  /// @param T_bw_home  workpiece in the bed with all axes at zero
  /// @param T_bt_home  tool tip in the bed with all axes at zero; its z axis is the tool axis, from
  ///                   the tip to the spindle
  /// @throws std::invalid_argument if a name comes twice, a direction is not unit to 1e-12, a limit
  ///         is NaN or reversed, a point or pose is not finite, a home pose is not rigid to 1e-12,
  ///         a workpiece-side joint follows a tool-side one, or there are more than max_joints
  Chain(std::vector<Joint> joints, const Pose& T_bw_home, const Pose& T_bt_home);

  const std::vector<Joint>& joints() const { return joints_; }
  const Pose& T_bw_home() const { return T_bw_home_; }
  const Pose& T_bt_home() const { return T_bt_home_; }
  int size() const { return int(joints_.size()); }

  /// Returns what each component of the location error of a joint displaces.
  const LocationRule& location_rule(int joint) const { return rules_[std::size_t(joint)]; }

  /// Returns the index of the joint with that letter; empty if there is none.
  std::optional<int> find(char name) const;

  /// Returns the pose T_wt of the tool in the workpiece.
  /// @param q           (size) commanded positions, mm and rad
  /// @param deviations  one per joint in the order of the code, or empty for none
  Pose tool_in_workpiece(const AxisVector& q,
                         std::span<const JointDeviation> deviations = {}) const;

  /// Return the pose of the tool in the bed, T_bt, and of the workpiece in the bed, T_bw.
  Pose tool_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations = {}) const;
  Pose workpiece_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations = {}) const;

 private:
  std::vector<Joint> joints_;
  std::vector<LocationRule> rules_;
  Pose T_bw_home_;
  Pose T_bt_home_;
};

/// Returns the moving parts of a chain in order; `to_string` turns them into a structural code.
Topology chain_topology(std::span<const Joint> joints);

/// Returns the nominal displacement of a joint's carriage in its parent's frame at zero. Identity
/// for a spindle nose.
/// @param travel  of the carriage itself, mm or rad
Pose carriage_displacement(const Joint& joint, double travel);

/// Returns the travel of the carriage for a commanded position; the only minus sign of the primed
/// side.
constexpr double carriage_travel(Side side, double command) {
  return side == Side::Workpiece ? -command : command;
}

/// Returns the displacement of every carriage in the bed, joint by joint, from its position with
/// all axes at zero; applied to a carried body, it places the body.
/// @param q, deviations  as for Chain
std::vector<Pose> carriage_poses(const Chain& chain, const AxisVector& q,
                                 std::span<const JointDeviation> deviations = {});

/// Returns E = T_nominal^-1 T_actual, expressed in the nominal tool frame (Guo et al. 2016,
/// equation 4).
Pose error_transform(const Pose& T_wt_nominal, const Pose& T_wt_actual);

/// Returns true if joint `one` carries joint `other`, i.e. is on the same side of the bed and
/// nearer to it.
bool carries(std::span<const Joint> joints, int one, int other);

/// Returns the slides that define the machine's frame, by the bed axis along which each mainly
/// travels. Of two slides along the same axis the first of X Y Z U V W P Q R is taken. X is
/// primary, Y secondary, Z third.
std::array<std::optional<int>, 3> main_slides(std::span<const Joint> joints);

/// Meaning of one component of a joint's location error on a machine of this structural code.
struct LocationElement {
  DisplacedPart displaces = DisplacedPart::Frame;
  std::optional<int> reference;      ///< slide against which the axis is located; empty if no slide
                                     ///< measures this component
  std::optional<int> stating_slide;  ///< the later slide to which this angle belongs; empty if it
                                     ///< belongs to the joint itself
  bool defined = true;  ///< false for an offset of a slide, an angle about its own direction, and
                        ///< an angle to which no earlier slide is the reference; a component that
                        ///< is not defined displaces the frame
};

/// Returns the meaning of a component of a joint's location error.
/// A rotary axis, or a slide other than the main ones, is located against the main slides that
/// measure the component: an angle about a bed axis against the two slides across it, an offset
/// against the slide along it. A main slide is located against the slide that forms a pair with it.
/// The error displaces the axis frame with all that it carries. If the axis carries all those
/// slides, that would be invisible, and its carried parts are displaced by the opposite instead; if
/// it carries some of them, only the axis is turned. `Squareness::Travel` turns only the axis in
/// every case.
/// @param component  0..5 of [EX EY EZ EA EB EC]
LocationElement location_element(std::span<const Joint> joints, int joint, int component);

/// Returns the letters of the joints in the order of the structural code, e.g. "CXYZAs".
inline std::string letters(const std::vector<Joint>& joints) {
  std::string all;
  for (const Joint& joint : joints) all += joint.name;
  return all;
}

}  // namespace abbe::kinematics
