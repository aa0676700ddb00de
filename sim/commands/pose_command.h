#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "sim/cut/pose_table.h"
#include "sim/files/permissions.h"
#include "sim/scene/scene.h"

namespace CLI {
class App;
}

namespace abbe::sim {

/// What `abbe pose` is asked for: one of `at`, `at_file` and `grid`.
struct PoseCommand {
  std::string at;                   ///< one pose, "X=100 A=30"
  std::filesystem::path at_file;    ///< many, CSV
  std::optional<std::string> grid;  ///< the work space, "X=0:400:9 Y=::5"; may be empty
  PoseWishes wishes;
  std::filesystem::path out;  ///< of many: a file, else standard output; of the work space: a
                              ///< folder, else out/SCENE/volumetric
  bool json = false;
  Permissions permissions;
};

/// Its words on the command line, but for those that it shares with other commands.
void add_pose_options(CLI::App& app, PoseCommand& command);

/// Computes and prints; warnings go to standard error, and into JSON where that is what is written.
/// @throws BadScene, BadInput, OutputFailure, Interrupted
void pose_command(const Scene& scene, const PoseCommand& command);

}  // namespace abbe::sim
