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
  Fixed,    ///< do not turn with the joint (ISO 230-7): after a slide, before a rotation
  Turning,  ///< turn with the joint: after the rotation, the order of the papers
};

/// What the angles of a location error turn.
enum class Squareness {
  Frame,   ///< frames as the structural code asks for it, with all that they carry (`location.h`)
  Travel,  ///< the direction of travel only
};

/// What one component of a location error displaces, by the structural code (`location.h`).
enum class DisplacedPart {
  Frame,    ///< the joint's frame about its point, before its motion, with all that it carries
  Carried,  ///< what it carries, about its point as carried, after its motion, by the opposite
  Axis,     ///< the direction of travel or the rotation axis alone
};
using LocationRule = std::array<DisplacedPart, 6>;  ///< of [EX EY EZ EA EB EC]

/// One moving part, described in the bed frame with all axes at zero.
struct Joint {
  char name = 'X';
  Side side = Side::Tool;
  Motion motion = Motion::Linear;
  Eigen::Vector3d direction_b = Eigen::Vector3d::UnitX();  ///< unit; positive command moves the
                                                           ///< tool this way in the workpiece
  Eigen::Vector3d point_b = Eigen::Vector3d::Zero();       ///< mm; on the rotation line, or where
                                                           ///< deviations of a slide are stated
  double min = -1e9;  ///< mm or rad, limits of travel as commanded
  double max = 1e9;
  DeviationAxes deviation_axes = DeviationAxes::Fixed;
  Squareness squareness = Squareness::Frame;
};

/// What is wrong with one joint: actual minus nominal of the carriage itself, on either side.
struct JointDeviation {
  Deviation motion = Deviation::Zero();    ///< error motion, at the joint's point as carried
  Deviation location = Deviation::Zero();  ///< where its axis lies and points, `LocationRule`
};

/// Two sources of deviations, added joint by joint. @throws std::invalid_argument if one has other
/// joints than the other
std::vector<JointDeviation> sum(std::vector<JointDeviation> a, std::span<const JointDeviation> b);

/// Serial machine. Immutable once made. The nominal and the actual machine are this one function;
/// zero deviations give the nominal bit for bit.
class Chain {
 public:
  /// @param joints     in the order of the structural code, workpiece to tool
  /// @param T_bw_home  workpiece in the bed with all axes at zero
  /// @param T_bt_home  tool tip in the bed with all axes at zero; its z axis is the tool axis, from
  ///                   the tip to the spindle
  /// @throws std::invalid_argument if a name comes twice, a direction is not unit to 1e-12, a
  ///         limit is NaN or reversed, a point or pose is not finite, a home pose is not rigid to
  ///         1e-12, a workpiece-side joint follows a tool-side one, or there are more than
  ///         max_joints
  Chain(std::vector<Joint> joints, const Pose& T_bw_home, const Pose& T_bt_home);

  const std::vector<Joint>& joints() const { return joints_; }
  const Pose& T_bw_home() const { return T_bw_home_; }
  const Pose& T_bt_home() const { return T_bt_home_; }
  int size() const { return int(joints_.size()); }

  /// What the location error of a joint displaces, component by component.
  const LocationRule& location_rule(int joint) const { return rules_[std::size_t(joint)]; }

  /// Index of the joint of that letter in the structural code, if it has one.
  std::optional<int> find(char name) const;

  /// Pose T_wt of the tool in the workpiece.
  /// @param q           (size) commanded positions, mm and rad
  /// @param deviations  one per joint in the order of the code, or empty for none
  Pose tool_in_workpiece(const AxisVector& q,
                         std::span<const JointDeviation> deviations = {}) const;

  /// Pose of the tool in the bed, T_bt, and of the workpiece in the bed, T_bw.
  Pose tool_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations = {}) const;
  Pose workpiece_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations = {}) const;

 private:
  std::vector<Joint> joints_;
  std::vector<LocationRule> rules_;
  Pose T_bw_home_;
  Pose T_bt_home_;
};

/// The order of a chain's moving parts, of which `to_string` makes its structural code.
Topology chain_topology(std::span<const Joint> joints);

/// Nominal displacement of the joint's own carriage, in its parent's frame at zero, by `travel` (mm
/// or rad of the carriage itself). Identity for a spindle nose.
Pose carriage_displacement(const Joint& joint, double travel);

/// Travel of the carriage itself for a commanded position: the one minus sign of the primed side.
constexpr double carriage_travel(Side side, double command) {
  return side == Side::Workpiece ? -command : command;
}

/// Where every carriage is in the bed, joint by joint: what it carries is placed by this from where
/// it is with the axes at zero.
/// @param q, deviations  as of Chain
std::vector<Pose> carriage_poses(const Chain& chain, const AxisVector& q,
                                 std::span<const JointDeviation> deviations = {});

/// E = T_nominal^-1 T_actual, expressed in the nominal tool frame (Guo et al. 2016, equation 4).
Pose error_transform(const Pose& T_wt_nominal, const Pose& T_wt_actual);

/// Whether joint `one` carries joint `other`: on the same side of the bed and nearer to it.
bool carries(std::span<const Joint> joints, int one, int other);

/// The slides that make the machine's frame, by the bed axis along which each mainly travels. Of
/// two along one axis it is the first of X Y Z U V W P Q R. X is primary, Y secondary, Z third.
std::array<std::optional<int>, 3> main_slides(std::span<const Joint> joints);

/// What one component of a joint's location error is on a machine of this structural code.
struct LocationElement {
  DisplacedPart displaces = DisplacedPart::Frame;
  std::optional<int> reference;      ///< slide against which the axis is located, if one sees it
  std::optional<int> stating_slide;  ///< set where the angle is already that of this later slide
  bool defined = true;  ///< a slide has no place, no angle about its own direction, and
                        ///< none where no earlier slide sees it; what is not defined
                        ///< displaces the frame
};

/// A rotary axis and a slide beyond the main ones are located against the main slides that see it:
/// of a turn about a bed axis the two that travel across it, of an offset the one along it. A main
/// slide is located against the one that makes a pair with it. The frame of the axis is displaced
/// with all that it carries; where it carries all those slides, that would show nowhere, and what
/// it carries is displaced by the opposite instead; where it carries some of them, the axis alone
/// is turned. `Squareness::Travel` turns the axis alone in any case.
/// @param component  0..5 of [EX EY EZ EA EB EC]
LocationElement location_element(std::span<const Joint> joints, int joint, int component);

/// "CXYZAs", a letter a joint in the order of the structural code.
inline std::string letters(const std::vector<Joint>& joints) {
  std::string all;
  for (const Joint& joint : joints) all += joint.name;
  return all;
}

}  // namespace abbe::kinematics
