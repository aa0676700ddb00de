#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "sim/compensation/control_log.h"

/// What a plug-in is asked and what it answers; plug_in.h asks it.
namespace abbe::sim::compensation {

/// A plug-in that crashed, hung, answered too little, not with numbers, or for another version.
struct PlugInFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What a plug-in is given once, before it is asked.
struct PlugInTask {
  std::string structure;  ///< "w C' b X Y Z A s t"
  std::vector<kinematics::Joint> joints;
  std::string tool;          ///< its name
  double tool_length = 0.0;  ///< mm
  ControlLog log;            ///< what the control could read; may be empty
};

/// What it is asked, one row a sample in the order of time.
struct PlugInQuestion {
  const std::vector<kinematics::AxisState>& commands;
  const std::vector<kinematics::Pose>& T_wt;  ///< where the tool should be
};

/// Samples first ... first + count - 1 of a question, counted from 0.
struct Samples {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// Some samples of a question, as abbe_batch of abbe_compensator.h has them.
struct PlugInBatch {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd time_s;       ///< (samples)
  Rows q;                       ///< (samples x joints) commands, mm and rad
  Rows direction;               ///< (samples x joints) +1 up, -1 down, 0 has not moved yet
  Eigen::VectorXd spindle_rpm;  ///< (samples)
  Rows T_wt;      ///< (samples x 12) first three rows of where the tool should be in the workpiece
  Rows readings;  ///< (samples x readings) last read before the sample; NaN where there was none
};

struct PlugInOptions {
  double start_s = 10.0;   ///< deadline of the handshake
  double answer_s = 30.0;  ///< deadline of one batch, and of its end when there is no more to ask
  int batch = 1000;        ///< samples a batch
  double most_mm = 10.0;   ///< an answer beyond is a mistake of units and refused
  double most_rad = 0.5;   ///< the same of angles
  /// Program that a shared library is loaded by: one whose main begins with plug_in_host.
  std::filesystem::path host = "/proc/self/exe";
  /// Called again and again while an answer is waited for; what it throws ends the plug-in.
  std::function<void()> waiting = {};
};

/// What the numbers of a plug-in mean.
enum class Answers {
  Correction,  ///< to be added to the commands
  Deviation,   ///< error of the tool as the plug-in believes it; who asks corrects it
};

struct PlugInAnswer {
  std::string name;  ///< as the plug-in calls itself, or empty
  Answers answers = Answers::Correction;
  /// (samples x joints) corrections, mm and rad in the order of the structural code, or (samples x
  /// 6) deviations [EX EY EZ EA EB EC], actual minus nominal in the nominal tool frame, mm and rad;
  /// finite, within most_mm and most_rad
  Eigen::MatrixXd rows;
  std::string said;  ///< the last lines that it wrote to stderr
};

/// A compensator in the process of who asks it: a function of batches in the order of time.
struct PlugInFunction {
  Answers answers = Answers::Correction;
  /// @return (samples x joints), or (samples x 6), as the rows of an answer
  std::function<Eigen::MatrixXd(const PlugInTask& task, const PlugInBatch& batch)> rows;
};

}  // namespace abbe::sim::compensation
