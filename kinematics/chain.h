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
  Fixed,    ///< axes that do not turn with the joint (ISO 230-7): the deviation is applied after
            ///< the motion of a slide, before that of a rotary axis
  Turning,  ///< axes that turn with the joint: the deviation is applied after the motion, as in
            ///< most papers
};

/// Part of the machine that the angles of a location error rotate.
enum class Squareness {
  Frame,   ///< the frame of the axis with all that it carries, or what the structural code requires
           ///< instead (see `location_element`)
  Travel,  ///< only the direction of travel
};

/// Part of the machine that one component of a location error displaces; see `location_element`.
enum class DisplacedPart {
  Frame,    ///< the frame of the joint with all that it carries, about its point, before its motion
  Carried,  ///< only what the joint carries, by the opposite displacement, about its point, after
            ///< its motion
  Axis,     ///< only the direction of travel or the rotary axis
};
using LocationRule = std::array<DisplacedPart, 6>;  ///< for [EX EY EZ EA EB EC]

/// A moving axis, described in the bed frame with all axes at zero.
struct Joint {
  char name = 'X';
  Side side = Side::Tool;
  Motion motion = Motion::Linear;
  Eigen::Vector3d direction_b = Eigen::Vector3d::UnitX();  ///< unit; a positive command moves the
                                                           ///< tool in this direction relative to
                                                           ///< the workpiece
  Eigen::Vector3d point_b = Eigen::Vector3d::Zero();       ///< mm; a point of the rotary axis, or
                                                           ///< the point at which deviations of a
                                                           ///< slide are stated
  double min = -1e9;  ///< mm or rad, lower limit of the commanded travel; `max` is the upper
  double max = 1e9;
  DeviationAxes deviation_axes = DeviationAxes::Fixed;
  Squareness squareness = Squareness::Frame;
};

/// Deviations of one joint: actual minus nominal of the carriage itself, whichever side of the bed
/// it is on.
struct JointDeviation {
  Deviation motion = Deviation::Zero();    ///< error motion, stated at the joint's point after its
                                           ///< motion
  Deviation location = Deviation::Zero();  ///< error of position and direction of the axis; see
                                           ///< `LocationRule`
};

/// Returns the sums of the deviations of each joint.
/// @throws std::invalid_argument if they differ in the number of joints
std::vector<JointDeviation> sum(std::vector<JointDeviation> a, std::span<const JointDeviation> b);

/// A machine as a serial chain of joints from workpiece to tool. Immutable. The same function
/// computes nominal and actual poses; with zero deviations the actual pose has the bits of the
/// nominal one.
class Chain {
 public:
  /// @param joints     in the order of the structural code, workpiece to tool
  /// @param T_bw_home  workpiece in the bed with all axes at zero
  /// @param T_bt_home  tool tip in the bed with all axes at zero; its z axis is the tool axis, from
  ///                   the tip to the spindle
  /// @throws std::invalid_argument if a name occurs twice, a direction is not unit to 1e-12, a
  ///         limit is NaN, limits are reversed, a point or pose is not finite, a home pose is not
  ///         rigid to 1e-12, a workpiece-side joint follows a tool-side one, or there are more
  ///         than max_joints joints
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
  /// @param deviations  one per joint in the order of the structural code; empty: none
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

/// Returns the axes of a chain in order; `to_string` turns them into a structural code.
Topology chain_topology(std::span<const Joint> joints);

/// Returns the nominal displacement of a carriage, in the frame of its parent, from its position at
/// zero; the identity for a spindle nose.
/// @param travel  of the carriage itself, mm or rad
Pose carriage_displacement(const Joint& joint, double travel);

/// Returns the travel of a carriage for a commanded position. The minus sign of axes on the
/// workpiece side (primed in the structural code) occurs only here.
constexpr double carriage_travel(Side side, double command) {
  return side == Side::Workpiece ? -command : command;
}

/// Returns the displacement of every carriage, in the bed frame, from its position with all axes at
/// zero. A body that the carriage carries undergoes the same displacement.
/// @return (joints)
/// @param q, deviations  as for Chain::tool_in_workpiece
std::vector<Pose> carriage_poses(const Chain& chain, const AxisVector& q,
                                 std::span<const JointDeviation> deviations = {});

/// Returns E = T_nominal^-1 T_actual, expressed in the nominal tool frame (Guo et al. 2016,
/// equation 4).
Pose error_transform(const Pose& T_wt_nominal, const Pose& T_wt_actual);

/// Returns true if joint `carrier` carries joint `carried`: both are on the same side of the bed
/// and `carrier` is nearer to it.
bool carries(std::span<const Joint> joints, int carrier, int carried);

/// Returns, for each bed axis, the index of the slide that mainly travels along it; these slides
/// define the frame of the machine. Of two slides along the same axis, the first in the order X Y Z
/// U V W P Q R is chosen. X is the primary axis, Y the secondary, Z the tertiary one.
std::array<std::optional<int>, 3> main_slides(std::span<const Joint> joints);

/// Meaning of one component of the location error of a joint on a given machine.
struct LocationElement {
  DisplacedPart displaces = DisplacedPart::Frame;
  std::optional<int> reference;  ///< slide to which the location refers; empty if there is none for
                                 ///< this component
  std::optional<int> later_slide;  ///< the later slide for which this angle is stated instead;
                                   ///< empty if it is stated for the joint itself
  bool defined = true;  ///< false for an offset of a slide, an angle about its own direction, and
                        ///< an angle without an earlier slide as reference; such a component
                        ///< displaces the frame
};

/// Returns the meaning of a component of the location error of a joint.
/// The location of a rotary axis, or of a slide that is not a main slide, refers to main slides: an
/// angle about a bed axis to the two slides across it, an offset to the slide along it. That of a
/// main slide refers to the other main slide with which it forms the angle.
/// The error displaces the frame of the axis with all that it carries. If the axis carries all of
/// its reference slides, this would move them along and be invisible; then what it carries is
/// displaced by the opposite instead. If it carries only some of them, the error turns only the
/// axis, and so does `Squareness::Travel` in every case.
/// @param component  0..5 of [EX EY EZ EA EB EC]
LocationElement location_element(std::span<const Joint> joints, int joint, int component);

/// Returns the letters of the joints in the order of the structural code, e.g. "CXYZAs".
inline std::string letters(const std::vector<Joint>& joints) {
  std::string text;
  for (const Joint& joint : joints) text += joint.name;
  return text;
}

}  // namespace abbe::kinematics
