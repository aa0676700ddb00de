#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/files/permissions.h"
#include "sim/loop/compensate.h"

namespace abbe::sim {

struct RewriteCommandOptions {
  std::vector<Override> overrides;
  std::string case_name;  ///< belief-strategy-program, or a plug-in's file whose channel is
                          ///< program; empty: the first such case of the scene
  std::filesystem::path
      out;  ///< file; empty: `rewritten` in out/SCENE, its ending as the program's
  Permissions permissions;
};

/// What the words of a rewritten program change: where it would bring the tip and the tool axis of
/// a machine without errors, less where they should be.
struct WordChange {
  Spread tip;        ///< mm
  Spread direction;  ///< rad
};
WordChange word_change(const Job& job, const Commands& commands);

/// What was written.
struct Rewritten {
  std::filesystem::path file;
  std::string case_name;
  std::size_t blocks_before = 0, blocks_after = 0, bytes = 0;
  WordChange correction;
  double path_tolerance = 0.0;  ///< mm
  struct Words {
    double mm = 0.0, deg = 0.0;
  };
  std::optional<Words> words;   ///< resolution of the words; none in PVT
  double point_left = 0.0;      ///< mm, what the corrections leave
  double direction_left = 0.0;  ///< rad
  std::vector<std::string> warnings;
};

/// Writes the compensated program of a scene, of the dialect of the original, and cuts nothing that
/// the belief does not ask for.
/// @throws BadScene, BadInput (a case through another channel, a scene without one), OutputFailure
Rewritten rewrite(const std::filesystem::path& scene, const RewriteCommandOptions& options);

/// `abbe rewrite`.
Command rewrite_command(Common& common);

}  // namespace abbe::sim
