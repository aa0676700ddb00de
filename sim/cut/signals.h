#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/cut/process.h"
#include "sim/machine/truth.h"
#include "sim/program/sample.h"

/// The signals of a run: the state of the machine and the readings of the control over time.
namespace abbe::sim {

/// A table of the state of the machine and of the readings of the control over time.
struct Signals {
  std::vector<std::string> columns;  ///< (m) names with units, "X_mm", "T_nut_C"
  Eigen::MatrixXd rows;              ///< (n x m)
};

/// The data of a run for its signals.
struct SignalInputs {
  const program::Samples& samples;                   ///< as commanded
  const std::vector<kinematics::Pose>& T_wt_target;  ///< (samples)
  const Process& process;
  const std::vector<errors::Load>& loads;  ///< (samples) or empty
  /// (samples) corrections that a channel adds to the commands; empty without one
  std::span<const kinematics::AxisVector> correction = {};
  std::span<const double> stroke = {};  ///< (samples) mm, of a piezo; empty without one
};

/// Returns rows at the samples nearest to the whole multiples of the scene's interval, at most 20
/// 000. If the scene requests it, at most 20 000 rows of the thermal history precede them, with the
/// axes as at the start of the program and line 0. The columns:
/// - `time_s`, `line`, commands `X_mm` ..., encoders `X_encoder_mm` ..., `spindle_rpm`;
/// - corrections of a channel, `X_correction_um` ... `A_correction_urad`, of every axis but a
///   workpiece spindle, in the history as at the start of the program, and `piezo_um`, the stroke
///   of a piezo;
/// - temperatures `T_NODE_C` and the readings of the sensors, `SENSOR_C`;
/// - force on the tool in frame t `FX_N` ..., `torque_Nm`, `power_W`, `removed_mm3` since the row
///   before, edge in material `engaged_mm` and largest chip thickness `chip_mm`; `current_A` and
///   `FX_dynamometer_N` ... if the scene has those sensors;
/// - every deviation `EXX_um` ... `EC0Y_urad`, of the tool `tool_EX_um` and the part `part_EX_um`
///   under force, and of the tip in the workpiece without the stroke of a piezo, `tip_EX_um` ...
///   `tip_EC_urad` (of a turned part: turned back by the spindle).
/// Columns of deviations with only zeros are left out. The same seed gives the same readings. Empty
/// without heat, force, compliance and channel.
Signals signals(const Scene& scene, const Machine& machine, const Truth& truth,
                const SignalInputs& inputs);

/// Appends the rows of the second table to the first. A column that only one of them has is zero
/// for the other.
Signals joined(Signals first, const Signals& second);

/// Returns CSV text: a header, then a line for each row, with numbers of 9 digits.
std::string to_csv(const Signals& signals);

}  // namespace abbe::sim
