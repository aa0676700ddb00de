#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"
#include "kinematics/chain.h"

/// How instruments see a machine. An instrument never sees an element: it sees where one body of
/// the machine is in another, along a beam, over a bar, or as an angle.
namespace abbe::errors::metrology {

/// Bodies to which parts of an instrument can be fixed.
enum class Body { Bed, Workpiece, Tool };

/// Where the bodies are in the bed at an instant.
struct Bodies {
  kinematics::Pose T_bw = kinematics::Pose::Identity();
  kinematics::Pose T_bt = kinematics::Pose::Identity();
};

/// What a channel reads of a point p_of of one body as it stands at p = T p_of in another.
enum class Quantity {
  Length,        ///< |p - p_in|: ball bar, tracking interferometer
  Displacement,  ///< u (p - p_in): interferometer with retroreflector, straightness, dial, probe
  Mirror,        ///< n (p - p_in) / (n u), n the normal of a flat mirror as it stands: laser vector
  Angle,  ///< u times the rotation vector of the body against its nominal place: angle optics,
          ///< level (in the bed), autocollimator with polygon
};

/// One channel of an instrument.
struct Channel {
  std::string name;  ///< "along X", "about A"
  Quantity quantity = Quantity::Displacement;
  Body of = Body::Tool;       ///< carries the reflector, the ball, the mirror
  Body in = Body::Workpiece;  ///< carries the interferometer, the socket, the sensors
  Eigen::Vector3d point_of = Eigen::Vector3d::Zero();       ///< mm, in the frame of `of`
  Eigen::Vector3d point_in = Eigen::Vector3d::Zero();       ///< mm, in the frame of `in`
  Eigen::Vector3d direction_in = Eigen::Vector3d::UnitX();  ///< u, unit, in the frame of `in`
  Eigen::Vector3d normal_of = Eigen::Vector3d::UnitX();     ///< of a mirror, unit, in that of `of`
  double noise = 0.0;       ///< mm or rad, standard deviation of one reading
  double resolution = 0.0;  ///< mm or rad, readings are multiples of it; 0: not rounded

  bool is_angle() const { return quantity == Quantity::Angle; }
};

/// What is not known of a set-up: its true values are drawn when it is set up, and are unknowns of
/// every identification that uses it. Zero in all of them is the set-up as it was meant.
struct Misalignment {
  Eigen::VectorXd zero;  ///< (channels) mm or rad, added to the readings; empty: zeros
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< rad, turns every direction_in together
  Eigen::Vector3d point_of = Eigen::Vector3d::Zero();  ///< mm, the same for all channels
  Eigen::Vector3d point_in = Eigen::Vector3d::Zero();  ///< mm, the same for all channels
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< rad, turns the mirror in its body
  /// mm, of the ball against the spindle's line: adds its vector turned by the spindle's angle
  /// about z of the tool to point_of
  Eigen::Vector2d eccentricity = Eigen::Vector2d::Zero();
  double scale = 0.0;  ///< relative: wavelength, bar length
  double drift = 0.0;  ///< mm/s or rad/s since the set-up's first reading
};

/// One setting up: channels that stand until the next.
struct SetUp {
  std::string name;  ///< "X positioning"
  std::vector<Channel> channels;
  bool zero_unknown = true;  ///< readings count from an arbitrary zero, one for each channel
  /// Standard deviations of what is drawn; 0: known exactly, not drawn and not fitted.
  double rotation_sigma = 0.0;      ///< rad, each of three
  double point_of_sigma = 0.0;      ///< mm, each of three
  double point_in_sigma = 0.0;      ///< mm, each of three
  double normal_sigma = 0.0;        ///< rad, each of the two that matter
  double eccentricity_sigma = 0.0;  ///< mm, each of two
  double scale_sigma = 0.0;         ///< relative
  double drift_sigma = 0.0;         ///< mm/s or rad/s
  double set_up_s = 0.0;            ///< time that a person needs for it
};

/// What a channel reads, without noise.
/// @param nominal        where the bodies should be; only an angle asks for it
/// @param spindle_angle  rad, of the nose; only an eccentric ball asks for it
/// @param since_s        s since the set-up's first reading
/// Bound: 2 ulp of the sum of the distances of both bodies from the bed's origin and of both points
/// from theirs (1e-12 mm where these are 500 mm each), of a mirror that over n u; 1e-15 rad of an
/// angle below 3 mrad.
double reading(const SetUp& set_up, int channel, const Misalignment& misalignment,
               const Bodies& actual, const Bodies& nominal, double spindle_angle = 0.0,
               double since_s = 0.0);

/// Change of that reading, first order at a perfect set-up, per unit of a small motion of each body
/// about the bed's origin: [translation | rotation vector] in the bed frame.
struct ReadingGradient {
  kinematics::Deviation workpiece = kinematics::Deviation::Zero();
  kinematics::Deviation tool = kinematics::Deviation::Zero();
};
ReadingGradient gradient(const Channel& channel, const Bodies& nominal);

/// Unknowns of a set-up that its sigmas leave to be found, in the order zero (channels), rotation,
/// point_of, point_in, normal, eccentricity, scale, drift.
struct SetUpUnknown {
  std::string name;    ///< "zero of along X", "rotation about B"
  double sigma = 0.0;  ///< of what is known beforehand; infinite for a zero
};
std::vector<SetUpUnknown> unknowns(const SetUp& set_up);
/// The misalignment whose unknowns have these values, and the values of a misalignment.
Misalignment misalignment(const SetUp& set_up, const Eigen::VectorXd& values);
Eigen::VectorXd values(const SetUp& set_up, const Misalignment& misalignment);

/// Two unit vectors square to a normal and to each other.
Eigen::Matrix<double, 3, 2> across(const Eigen::Vector3d& normal);

/// Change of a reading per unit of each unknown of its set-up, at a perfect one. (unknowns)
Eigen::VectorXd unknowns_gradient(const SetUp& set_up, int channel, const Bodies& nominal,
                                  double spindle_angle = 0.0, double since_s = 0.0);

/// One reading to be taken: which channel, and where the machine is commanded to be, when, and from
/// which side it came.
struct Measurement {
  int set_up = 0;
  int channel = 0;  ///< -1 in a set-up without channels: temperatures are logged
  int run = 0;
  int target = 0;  ///< number of the place in its run, the same for both ways of approach
  kinematics::AxisState state;
};

/// What an operator would do: set-ups and the readings of each, in the order of time.
struct Plan {
  std::string instrument;  ///< its name, for reports
  std::string kind;        ///< its kind, "laser"
  std::vector<SetUp> set_ups;
  std::vector<Measurement> measurements;
  double duration_s = 0.0;  ///< on a real machine, setting up included
};

/// What was read. Carries the nominal machine and no truth.
struct Readings {
  Plan plan;
  kinematics::Chain nominal;
  Eigen::VectorXd value;             ///< (measurements) mm or rad; empty for temperatures alone
  std::vector<std::string> sensors;  ///< (k) temperature sensors that were logged
  Eigen::MatrixXd T_C;               ///< (measurements x k)
};

/// The machine as an instrument meets it: where its bodies really are at a state.
using MachineUnderTest = std::function<Bodies(const kinematics::AxisState&)>;

/// Sets up and reads: misalignments, noise and rounding are drawn from the seed, the same numbers
/// on every machine. A counter with an unknown zero is set, when it is first read, to what it would
/// show on the nominal machine; its zero is then minus what was wrong there. Sensors are left
/// empty.
/// @throws std::invalid_argument if the plan does not fit the chain (a set-up or channel out of
///         range, a state of another size)
Readings measure(const Plan& plan, const kinematics::Chain& nominal,
                 const MachineUnderTest& machine, std::uint64_t seed);

/// Where the bodies should be.
Bodies nominal_bodies(const kinematics::Chain& nominal, const kinematics::AxisVector& q);

/// Standard deviation of one reading: noise and rounding. mm or rad
double standard_deviation(const Channel& channel);

/// A reading as it is shown in steps of a resolution; 0 shows it all.
double rounded(double value, double resolution);

/// The angle that an eccentric ball turns by at a state: that of the nose `s`, else 0.
double spindle_angle(const kinematics::Chain& nominal, const kinematics::AxisState& state);

/// s since the first reading of its set-up, for every measurement. (measurements)
Eigen::VectorXd time_since_set_up(const Plan& plan);

}  // namespace abbe::errors::metrology
