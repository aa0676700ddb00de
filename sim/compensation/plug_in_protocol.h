#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "sim/compensation/time_series.h"

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
  double start_s = 10.0;     ///< deadline of the handshake
  double response_s = 30.0;  ///< deadline of one batch, and of its end when there is no more to ask
  int batch = 1000;          ///< samples a batch
  double max_mm = 10.0;      ///< an answer beyond is a mistake of units and refused
  double max_rad = 0.5;      ///< the same of angles
  /// Program that a shared library is loaded by: one whose main begins with plug_in_host.
  std::filesystem::path host = "/proc/self/exe";
  /// Called again and again while an answer is waited for; what it throws ends the plug-in.
  std::function<void()> waiting = {};
};

/// What the numbers of a plug-in mean.
enum class PlugInOutput {
  Correction,  ///< to be added to the commands
  Deviation,   ///< error of the tool as the plug-in believes it; who asks corrects it
};

struct PlugInResponse {
  std::string name;  ///< as the plug-in calls itself, or empty
  PlugInOutput answers = PlugInOutput::Correction;
  /// (samples x joints) corrections, mm and rad in the order of the structural code, or (samples x
  /// 6) deviations [EX EY EZ EA EB EC], actual minus nominal in the nominal tool frame, mm and rad;
  /// finite, within most_mm and most_rad
  Eigen::MatrixXd rows;
  std::string said;  ///< the last lines that it wrote to stderr
};

/// A compensator in the process of who asks it: a function of batches in the order of time.
struct PlugInFunction {
  PlugInOutput answers = PlugInOutput::Correction;
  /// @return (samples x joints), or (samples x 6), as the rows of an answer
  std::function<Eigen::MatrixXd(const PlugInTask& task, const PlugInBatch& batch)> rows;
};

// The batches in which plug-ins are asked, and what an answer to one must be.

/// How many readings of the control a plug-in is given.
Eigen::Index readings(const PlugInTask& task);

PlugInBatch make_batch(const PlugInTask& task, const PlugInQuestion& question, Samples samples);

/// What an answer must be.
struct Expected {
  long id = 0;
  PlugInOutput answers = PlugInOutput::Correction;
  Eigen::Index samples = 0;
  const PlugInTask& task;
  const PlugInOptions& options;
};

/// Numbers a row.
Eigen::Index columns(PlugInOutput answers, const PlugInTask& task);

/// "X" or "EX"
std::string column_name(const Expected& expected, Eigen::Index column);

/// What a number of an answer would have to be instead; nothing where it may stand.
std::optional<std::string> value_violation(double number, const Expected& expected,
                                           Eigen::Index column);

/// "batch 3 (samples 2001 to 3000)"
std::string batch_label(long id, Samples samples);

// The lines that a plug-in and abbe say to each other; README.md is the protocol.

inline constexpr int protocol_version = 1;

/// Appends a number in the fewest digits that give its bits back; null if it is not finite.
void append_number(std::string& line, double number);

/// What abbe says. Each line ends with its '\n'.
std::string task_line(const PlugInTask& task, Eigen::Index samples, int batch);
std::string end_line();

std::string ask_line(const PlugInBatch& batch, long id);

/// What a plug-in says of itself.
struct Handshake {
  std::string name;
  PlugInOutput answers = PlugInOutput::Correction;
};
/// @throws ChildFault unless the line is that, for this version
Handshake read_handshake(const std::string& line);

/// @return (samples x columns), finite and within the options' bounds
/// @throws ChildFault unless the line is such an answer
Eigen::MatrixXd read_response(const std::string& line, const Expected& expected);

}  // namespace abbe::sim::compensation
