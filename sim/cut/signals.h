#pragma once

#include <functional>
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

/// Returns true if a run has signals: with heat, stock, compliance or a channel.
/// @param has_channel  true if a channel corrects the run
bool has_signals(const Scene& scene, bool has_channel);

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

/// The state of the machine in a row of the signals.
struct SignalRow {
  kinematics::AxisState state;
  int line = 0;
  errors::Load load;
  kinematics::Pose T_wt_target;
  std::size_t sample = 0;
};

/// Picks the samples of a program nearest to the whole multiples of an interval, at most 20 000.
/// The program may come in windows.
class SignalSamples {
 public:
  SignalSamples(double interval_s, double start_s, double end_s);

  /// Calls `use` with the number of each sample that is picked.
  /// @param is_continued  true if the first sample is the last of the window before
  /// @param continues     true if further samples follow
  void pick(const std::vector<kinematics::AxisState>& states, bool is_continued, bool continues,
            const std::function<void(std::size_t sample)>& use);

 private:
  double interval_s_, start_s_;
  std::size_t multiple_ = 0;
  bool is_picked_ = false;  // the nearest sample so far
  bool is_complete_ = false;
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

/// Returns the same table of the rows of a program, to which the rows of the history are added.
/// @param start  state at the start of the program, for the history
Signals signals(const Scene& scene, const Machine& machine, const Truth& truth,
                const SignalRow& start, std::vector<SignalRow> rows, const Process& process,
                std::span<const kinematics::AxisVector> correction = {},
                std::span<const double> stroke = {});

/// Appends the rows of the second table to the first. A column that only one of them has is zero
/// for the other.
Signals joined(Signals first, const Signals& second);

/// Returns CSV text: a header, then a line for each row, with numbers of 9 digits.
std::string to_csv(const Signals& signals);

}  // namespace abbe::sim
