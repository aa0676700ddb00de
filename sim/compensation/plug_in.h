#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "sim/compensation/control_log.h"

/// Anyone's own compensator: a program that speaks JSON lines, or a C function in a shared library.
/// The protocol is in sim/compensation/README.md.
namespace abbe::sim::compensation {

/// A plug-in that crashed, hung, answered too little, not with numbers, or for another version.
struct PlugInFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What a plug-in is told once, before it is asked.
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

struct PlugInOptions {
  double start_s = 10.0;   ///< deadline of the handshake
  double answer_s = 30.0;  ///< deadline of one batch, and of its end when there is no more to ask
  int batch = 1000;        ///< samples a batch
  double most_mm = 10.0;   ///< an answer beyond is a slip of units and refused
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

/// Asks a plug-in about a whole program: starts it, shakes hands, asks in batches in the order
/// given, ends it. A name that ends in .so is a shared library, anything else is run; a .py file
/// that is not executable or does not begin with #! is run by python3. A shared library runs in a
/// process of its own, so that its crash is not ours. Whatever happens, no process stays behind
/// that did not leave the group it was started in. Linux.
/// @throws PlugInFailure naming the plug-in, the step, what was expected and seen, and its last
///         words on stderr
PlugInAnswer ask(const std::filesystem::path& plug_in, const PlugInTask& task,
                 const PlugInQuestion& question, const PlugInOptions& options = {});

/// First line of a main whose program serves as PlugInOptions::host: does a host's whole work.
/// @return the exit code of a host; nothing in a program started by anybody else
std::optional<int> plug_in_host(int argc, char** argv);

}  // namespace abbe::sim::compensation
