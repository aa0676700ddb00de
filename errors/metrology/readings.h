#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/observable.h"
#include "kinematics/axis.h"
#include "kinematics/chain.h"

namespace abbe::errors::metrology {

/// One reading to be taken: which channel, and where the machine is commanded to be, when, and from
/// which side it came.
struct Look {
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
  std::vector<Look> looks;
  double duration_s = 0.0;  ///< on a real machine, setting up included
};

/// What was read. Carries the nominal machine and no truth.
struct Readings {
  Plan plan;
  kinematics::Chain nominal;
  Eigen::VectorXd value;             ///< (looks) mm or rad; empty for temperatures alone
  std::vector<std::string> sensors;  ///< (k) temperature sensors that were logged
  Eigen::MatrixXd T_C;               ///< (looks x k)
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

/// s since the first reading of its set-up, for every look. (looks)
Eigen::VectorXd since_set_up(const Plan& plan);

}  // namespace abbe::errors::metrology
