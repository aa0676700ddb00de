#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

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

/// Writes the compensated program of a scene, of the dialect of the original, and cuts nothing that
/// the belief does not ask for. @return `file`, `case`, `blocks` {`before`, `after`}, `bytes`,
/// `correction_um` and `correction_urad` {`rms`, `max`}, `path_tolerance_um`, `words` {`mm`, `deg`;
/// null in PVT}, `left_um`, `left_urad`, `warnings`
/// @throws BadScene, BadInput (a case through another channel, a scene without one), OutputFailure
nlohmann::ordered_json rewrite(const std::filesystem::path& scene,
                               const RewriteCommandOptions& options);

/// The same in words.
std::string rewrite_text(const nlohmann::ordered_json& report);

/// `abbe rewrite`.
Command rewrite_command(Common& common);

}  // namespace abbe::sim
