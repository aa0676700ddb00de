#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"
#include "kinematics/chain.h"

/// Measurement model. An instrument does not measure an error element. It measures the pose of one
/// body of the machine in another: along a beam, over a bar, or as an angle.
namespace abbe::errors::metrology {

/// Bodies to which parts of an instrument can be fixed.
enum class Body { Bed, Workpiece, Tool };

/// Poses of workpiece and tool in the bed.
struct BodyPoses {
  kinematics::Pose T_bw = kinematics::Pose::Identity();
  kinematics::Pose T_bt = kinematics::Pose::Identity();
};

/// Quantity that a channel reads. A point p_of of one body has the position p = T p_of in another.
enum class Quantity {
  Length,        ///< |p - p_in|: ball bar, tracking interferometer
  Displacement,  ///< u (p - p_in): interferometer with retroreflector, straightness optics, dial,
                 ///< probe
  Mirror,        ///< n (p - p_in) / (n u), n the current normal of a flat mirror: laser vector
  Angle,         ///< u times the rotation vector of the body from its nominal pose: angle optics,
                 ///< level (in the bed), autocollimator with polygon
};

/// Channel of an instrument.
struct Channel {
  std::string name;  ///< "along X", "about A"
  Quantity quantity = Quantity::Displacement;
  Body of = Body::Tool;       ///< carries the reflector, the ball, the mirror
  Body in = Body::Workpiece;  ///< carries the interferometer, the socket, the sensors
  Eigen::Vector3d point_of = Eigen::Vector3d::Zero();       ///< mm, in the frame of `of`
  Eigen::Vector3d point_in = Eigen::Vector3d::Zero();       ///< mm, in the frame of `in`
  Eigen::Vector3d direction_in = Eigen::Vector3d::UnitX();  ///< u, unit, in the frame of `in`
  Eigen::Vector3d normal_of = Eigen::Vector3d::UnitX();     ///< unit normal of a mirror, in the
                                                            ///< frame of `of`
  double noise = 0.0;       ///< mm or rad, standard deviation of one reading
  double resolution = 0.0;  ///< mm or rad, readings are multiples of it; 0: not rounded

  bool is_angle() const { return quantity == Quantity::Angle; }
};

/// Unknowns of a set-up. Their true values are drawn at the set-up; identifications estimate them.
/// All are zero in a perfect set-up.
struct Misalignment {
  Eigen::VectorXd zero;  ///< (channels) mm or rad, added to the readings; empty: zeros
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< rad, common rotation of every
                                                       ///< direction_in
  Eigen::Vector3d point_of = Eigen::Vector3d::Zero();  ///< mm, common to all channels
  Eigen::Vector3d point_in = Eigen::Vector3d::Zero();  ///< mm, common to all channels
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< rad, rotation of the mirror in its body
  /// mm, from the spindle axis to the ball; rotated by the spindle angle about z of the tool, it is
  /// added to point_of
  Eigen::Vector2d eccentricity = Eigen::Vector2d::Zero();
  double scale = 0.0;  ///< relative: wavelength, bar length
  double drift = 0.0;  ///< mm/s or rad/s since the set-up's first reading
};

/// Set-up: channels that stay in place together.
struct SetUp {
  std::string name;  ///< "X positioning"
  std::vector<Channel> channels;
  bool is_zero_unknown = true;  ///< readings count from an arbitrary zero, one for each channel
  /// Standard deviations of the unknowns; 0: known exactly, neither drawn nor estimated.
  double rotation_sigma = 0.0;      ///< rad, each of three
  double point_of_sigma = 0.0;      ///< mm, each of three
  double point_in_sigma = 0.0;      ///< mm, each of three
  double normal_sigma = 0.0;        ///< rad, each of two
  double eccentricity_sigma = 0.0;  ///< mm, each of two
  double scale_sigma = 0.0;         ///< relative
  double drift_sigma = 0.0;         ///< mm/s or rad/s
  double set_up_s = 0.0;            ///< s, time that an operator needs for it
};

/// Returns the value of a channel, without noise.
/// @param nominal        nominal poses of the bodies, used for angles only
/// @param spindle_angle  rad, of the nose, used for an eccentric ball only
/// @param since_s        s since the set-up's first reading
/// Bound: 2 ulp of the sum of the distances of both bodies from the bed's origin and of both points
/// from the origins of their bodies (1e-12 mm if each is 500 mm), for a mirror divided by n u;
/// 1e-15 rad for an angle below 3 mrad.
double reading(const SetUp& set_up, int channel, const Misalignment& misalignment,
               const BodyPoses& actual, const BodyPoses& nominal, double spindle_angle = 0.0,
               double since_s = 0.0);

/// Gradient of a reading in a perfect set-up: its first-order change per unit of a small motion
/// [translation | rotation vector] of each body about the bed's origin, in the bed frame.
struct ReadingGradient {
  kinematics::Deviation workpiece = kinematics::Deviation::Zero();
  kinematics::Deviation tool = kinematics::Deviation::Zero();
};
ReadingGradient gradient(const Channel& channel, const BodyPoses& nominal);

/// Unknown of a set-up.
struct SetUpUnknown {
  std::string name;    ///< "zero of along X", "rotation about B"
  double sigma = 0.0;  ///< prior standard deviation; infinite for a zero
};
/// Returns the unknowns with a sigma above 0, in the order zero (channels), rotation, point_of,
/// point_in, normal, eccentricity, scale, drift.
std::vector<SetUpUnknown> unknowns(const SetUp& set_up);
/// Return the misalignment at given values of the unknowns, and the values of a misalignment.
Misalignment misalignment(const SetUp& set_up, const Eigen::VectorXd& values);
Eigen::VectorXd values(const SetUp& set_up, const Misalignment& misalignment);

/// Returns two unit vectors perpendicular to a normal and to each other.
Eigen::Matrix<double, 3, 2> perpendicular_basis(const Eigen::Vector3d& normal);

/// Returns the change of a reading per unit of each unknown of its set-up (unknowns), for a perfect
/// set-up.
Eigen::VectorXd unknowns_gradient(const SetUp& set_up, int channel, const BodyPoses& nominal,
                                  double spindle_angle = 0.0, double since_s = 0.0);

/// Reading of a plan: its channel, and the commanded state with direction of approach.
struct Measurement {
  int set_up = 0;
  int channel = 0;  ///< -1 in a set-up without channels: temperatures are logged
  int run = 0;
  int target = 0;  ///< index of the position in its run, the same for both directions of approach
  kinematics::AxisState state;
};

/// Measuring plan: set-ups and their readings, in the order of time.
struct Plan {
  std::string instrument;  ///< name of the instrument, for reports
  std::string kind;        ///< kind of the instrument, "laser"
  std::vector<SetUp> set_ups;
  std::vector<Measurement> measurements;
  double duration_s = 0.0;  ///< s on a real machine, with set-up times
};

/// Readings of a plan, with the nominal machine. They contain no truth.
struct Readings {
  Plan plan;
  kinematics::Chain nominal;
  Eigen::VectorXd value;             ///< (measurements) mm or rad; empty for temperatures alone
  std::vector<std::string> sensors;  ///< (k) logged temperature sensors
  Eigen::MatrixXd T_C;               ///< (measurements x k)
};

/// Machine under test: returns the actual poses of the bodies at a state.
using MachineUnderTest = std::function<BodyPoses(const kinematics::AxisState&)>;

/// Simulates set-ups and readings. Misalignments and noise are drawn from the seed, the same on
/// every computer. A counter with an unknown zero is set at its first reading to the value of the
/// nominal machine, so its zero is minus the error there. Temperature sensors are left empty.
/// @throws std::invalid_argument if the plan does not fit the chain (a set-up or channel out of
///         range, a state of another size)
Readings measure(const Plan& plan, const kinematics::Chain& nominal,
                 const MachineUnderTest& machine, std::uint64_t seed);

/// Returns the nominal poses of the bodies.
BodyPoses nominal_bodies(const kinematics::Chain& nominal, const kinematics::AxisVector& q);

/// Returns the standard deviation of one reading by noise and rounding, mm or rad.
double standard_deviation(const Channel& channel);

/// Returns a reading rounded to a resolution; 0: unchanged.
double round_to_resolution(double value, double resolution);

/// Returns the rotation of an eccentric ball at a state: the angle of the nose `s`, 0 without a
/// nose.
double spindle_angle(const kinematics::Chain& nominal, const kinematics::AxisState& state);

/// Returns for every measurement the time since the first reading of its set-up, s (measurements).
Eigen::VectorXd time_since_set_up(const Plan& plan);

}  // namespace abbe::errors::metrology
