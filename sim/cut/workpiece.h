#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cutting/map/residual.h"
#include "kinematics/chain.h"

/// The interface for programs that use abbe as a library: a scene file in, residual maps out.
namespace abbe::sim {

/// A scene prepared for cutting: machine, errors, program, and the design at whose vertices the
/// part is judged. Immutable.
struct Job;

/// Prepares a scene as `abbe run` does.
/// @param overrides  values by their paths, as of `--set`: {"part.vertices", "2000"}
/// @throws std::runtime_error with all input errors of the scene, one a line
std::shared_ptr<const Job> prepare_scene(
    const std::filesystem::path& scene,
    const std::vector<std::pair<std::string, std::string>>& overrides = {});

/// Returns the design at whose vertices the part is judged, workpiece frame.
const cutting::Design& judged_design(const Job& job);

/// Returns the machine as its control assumes it to be. Its joints are the columns of commands.
const kinematics::Chain& control_chain(const Job& job);

/// The machined surface of a part, with the residual at every vertex of the design, and the
/// warnings of the scene and the cut.
struct Workpiece {
  cutting::Surface surface;
  std::vector<std::string> warnings;
};

/// Changes the commands of one tool, (samples) in order of time, before they reach the machine.
/// Their number must stay the same.
using CommandFilter =
    std::function<std::vector<kinematics::AxisState>(std::vector<kinematics::AxisState> commands)>;

/// Cuts the part on the machine with errors, without a compensator of the scene.
/// @param filter  changes the commands; empty: as the control commands them
/// @throws std::runtime_error if a commanded axis leaves its travel or the range of an error table
/// @throws std::invalid_argument if the filter changes the number of commands
Workpiece cut_workpiece(const Job& job, const CommandFilter& filter = {});

}  // namespace abbe::sim
