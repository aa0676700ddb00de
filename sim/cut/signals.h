#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/cut/process.h"
#include "sim/machine/truth.h"
#include "sim/program/sample.h"

namespace abbe::sim {

/// A time line of what happened and of what the control could read of it.
struct Signals {
  std::vector<std::string> columns;  ///< (m) with their units, "X_mm", "T_nut_C"
  Eigen::MatrixXd rows;              ///< (n x m)
};

/// What is recorded of.
struct SignalInputs {
  const program::Samples& samples;                   ///< as commanded
  const std::vector<kinematics::Pose>& T_wt_wanted;  ///< (samples)
  const Process& process;
  const std::vector<errors::Load>& loads;  ///< (samples) or empty
  /// (samples) what a channel adds to the commands; else empty
  std::span<const kinematics::AxisVector> correction = {};
  std::span<const double> stroke = {};  ///< (samples) mm, of a piezo; else empty
};

/// Rows at the samples nearest to every whole multiple of the scene's interval, at most 20 000;
/// before them, where the scene asks for it, rows of the thermal history with the axes as the
/// program finds them, line 0, at most 20 000 more:
/// - `time_s`, `line`, commands `X_mm` … , encoders `X_encoder_mm` …, `spindle_rpm`;
/// - what a channel added to the commands, `X_correction_um` … `A_correction_urad` of every axis
/// but a
///   workpiece spindle, in the history as the program begins, and `piezo_um`, the stroke of a
///   piezo;
/// - temperatures `T_NODE_C` and what the sensors say, `SENSOR_C`;
/// - force on the tool in frame t `FX_N` … , `torque_Nm`, `power_W`, `removed_mm3` since the row
///   before, edge in material `engaged_mm` and largest chip thickness `chip_mm`,
///   `current_A` and `FX_dynamometer_N` … where the scene has those sensors;
/// - every deviation `EXX_um` … `EC0Y_urad`, of the tool `tool_EX_um` and the part `part_EX_um`
/// under
///   force, and of the tip in the workpiece, a piezo's stroke left out, `tip_EX_um` … `tip_EC_urad`
///   (of a turned part: turned back by the spindle).
/// Columns of deviations that are zero throughout are left out. Readings repeat for the same seed.
/// Empty without heat, force, compliance and channel.
Signals signals(const Scene& scene, const Machine& machine, const Truth& truth,
                const SignalInputs& recorded);

/// Rows after rows; a column that only one of them has is zero in the other.
Signals joined(Signals first, const Signals& second);

/// CSV text, a head and one row a line, numbers with 9 digits.
std::string to_csv(const Signals& signals);

}  // namespace abbe::sim
