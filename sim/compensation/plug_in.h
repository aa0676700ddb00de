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

/// The data and messages exchanged with a plug-in.
namespace abbe::sim::compensation {

/// Thrown if a plug-in crashes, hangs, returns too few or invalid numbers, or has the wrong
/// version.
struct PlugInFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The data given to a plug-in once, before the first batch.
struct PlugInTask {
  std::string structure;  ///< "w C' b X Y Z A s t"
  std::vector<kinematics::Joint> joints;
  std::string tool;          ///< name of the tool
  double tool_length = 0.0;  ///< mm
  ControlLog log;            ///< signals that the control recorded; may be empty
};

/// The samples to be corrected, in time order.
struct PlugInRequest {
  const std::vector<kinematics::AxisState>& commands;
  const std::vector<kinematics::Pose>& T_wt;  ///< nominal poses of the tool
};

/// A range of the samples to be corrected: first ... first + count - 1, counted from 0.
struct Samples {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// A batch of samples, with the layout of abbe_batch in abbe_compensator.h.
struct PlugInBatch {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd time_s;       ///< (samples)
  Rows q;                       ///< (samples x joints) commands, mm and rad
  Rows direction;               ///< (samples x joints) +1 up, -1 down, 0 not moved yet
  Eigen::VectorXd spindle_rpm;  ///< (samples)
  Rows T_wt;      ///< (samples x 12) first three rows of the nominal pose in the workpiece
  Rows readings;  ///< (samples x readings) last reading before the sample; NaN if there is none
};

/// Time limits, batch size and limits on the response of a plug-in.
struct PlugInOptions {
  double start_s = 10.0;     ///< deadline of the handshake
  double response_s = 30.0;  ///< deadline of one batch, and of the end after the last one
  int batch_size = 1000;     ///< samples in a batch
  double max_mm = 10.0;      ///< larger values are rejected as a probable unit mistake
  double max_rad = 0.5;      ///< limit on angles, rad
  /// Program that loads a shared library: its main must begin with plug_in_host.
  std::filesystem::path host = "/proc/self/exe";
  /// Called repeatedly while waiting for a response; if it throws, the plug-in is ended.
  std::function<void()> on_wait = {};
};

/// Meaning of the numbers that a plug-in returns.
enum class PlugInOutput {
  Correction,  ///< to be added to the commands
  Deviation,   ///< estimated error of the tool; abbe computes the correction
};

/// The response of a plug-in to a whole program.
struct PlugInResponse {
  std::string name;  ///< stated by the plug-in; may be empty
  PlugInOutput output = PlugInOutput::Correction;
  /// (samples x joints) corrections, mm and rad in the order of the structural code, or (samples x
  /// 6) deviations [EX EY EZ EA EB EC], actual minus nominal in the nominal tool frame, mm and rad;
  /// finite, within `max_mm` and `max_rad`
  Eigen::MatrixXd rows;
  std::string stderr_text;  ///< the last lines written to stderr
};

/// A compensator in this process: a function that is called with the batches in time order.
struct PlugInFunction {
  PlugInOutput output = PlugInOutput::Correction;
  /// Returns (samples x joints) or (samples x 6) numbers, see `PlugInResponse::rows`.
  std::function<Eigen::MatrixXd(const PlugInTask& task, const PlugInBatch& batch)> rows;
};

// Batches, and the requirements on the response to a batch.

/// Returns the number of readings of the control that a plug-in receives.
Eigen::Index reading_count(const PlugInTask& task);

/// Returns the batch of a range of samples.
PlugInBatch make_batch(const PlugInTask& task, const PlugInRequest& question, Samples samples);

/// The requirements on the response to a batch.
struct ResponseRequirements {
  long id = 0;
  PlugInOutput output = PlugInOutput::Correction;
  Eigen::Index samples = 0;
  const PlugInTask& task;
  const PlugInOptions& options;
};

/// Returns the number of columns of a response.
Eigen::Index column_count(PlugInOutput output, const PlugInTask& task);

/// Returns the name of a column of a response, such as "X" or "EX".
std::string column_name(const ResponseRequirements& expected, Eigen::Index column);

/// Returns the requirement that a number of a response violates; empty if the number is acceptable.
std::optional<std::string> violated_requirement(double number, const ResponseRequirements& expected,
                                                Eigen::Index column);

/// Returns a text such as "batch 3 (samples 2001 to 3000)".
std::string batch_label(long id, Samples samples);

// The lines of the protocol, which README.md describes.

/// Version of the protocol, exchanged in the handshake.
inline constexpr int protocol_version = 1;

/// Appends a number with the fewest digits that read back as the same bits; null if it is not
/// finite.
void append_number(std::string& line, double number);

/// Returns the message with the task. Messages end with '\n'.
std::string task_line(const PlugInTask& task, Eigen::Index samples, int batch_size);
/// Returns the message that ends the exchange.
std::string end_line();
/// Returns the message that sends a batch.
std::string request_line(const PlugInBatch& batch, long id);

/// The reply of a plug-in to the task.
struct Handshake {
  std::string name;
  PlugInOutput output = PlugInOutput::Correction;
};
/// Parses the handshake of a plug-in. Throws ChildProcessError unless it states `protocol_version`.
Handshake read_handshake(const std::string& line);

/// Parses the response to a batch.
/// @return (samples x columns), finite and within the bounds of the options
/// @throws ChildProcessError unless the line is a valid response
Eigen::MatrixXd read_response(const std::string& line, const ResponseRequirements& expected);

// A plug-in is a user's compensator: either a program that exchanges JSON lines, or a C function in
// a shared library. sim/compensation/README.md describes the protocol.

/// Runs a plug-in over a whole program: starts it, exchanges the handshake, sends the batches in
/// the given order, and ends it. A file whose name ends in .so is a shared library; any other file
/// is run as a program; a .py file that is not executable or does not begin with #! is run by
/// python3. A shared library runs in a separate process, so that its crash does not end abbe. No
/// child process is left running, except one that has left its process group. Linux only.
/// @throws PlugInFailure naming the plug-in, the step, the expected and the seen text, and its last
///     lines on stderr
PlugInResponse ask(const std::filesystem::path& plug_in, const PlugInTask& task,
                   const PlugInRequest& question, const PlugInOptions& options = {});

/// Calls a function of this process in the same batches, with the same requirements on its
/// responses.
/// @param name  name of the function in messages
/// @throws PlugInFailure naming the function, the batch, the expected and the seen text; passes on
///     exceptions of the function
PlugInResponse ask(const std::string& name, const PlugInFunction& function, const PlugInTask& task,
                   const PlugInRequest& question, const PlugInOptions& options = {});

/// Serves as a plug-in host. Must be the first call in the main of a program that is used as
/// `PlugInOptions::host`.
/// @return the exit code of a host; empty if the program was not started as a host
std::optional<int> plug_in_host(int argc, char** argv);

}  // namespace abbe::sim::compensation
