#pragma once

#include <filesystem>

#include "sim/commands/command.h"
#include "sim/commands/scene_runs.h"

namespace abbe::sim {

/// --compensator of `run` and `compare`.
Option compensator_option(std::vector<std::filesystem::path>& files);

/// --save of both.
Option save_option(std::vector<std::string>& formats);

/// --report of both, and --language of it.
Option report_option(bool& report);
Option language_option(std::string& language);

/// Asks for a report besides, with the line that makes it again.
/// @param command  "run", "compare --compensator x.py"
void request_report(RunOptions& options, const CommonOptions& common, const std::string& command,
                    const std::string& language);

/// What the options of `run` and `compare` ask for.
/// @param compensators  files of plug-ins
/// @param formats       of maps; empty: as usual
/// @throws BadUsage for one that is not there or whose name no folder can have
RunOptions run_options(const CommonOptions& common,
                       const std::vector<std::filesystem::path>& compensators,
                       const std::vector<std::string>& formats);

/// Prints the figures of a cut or of a comparison, and what exceeds a limit or failed.
Exit print_outcome(const CommonOptions& common, const RunOptions& options, const Outcome& outcome);

/// `abbe run`: cuts one case of a scene.
Command run_command(CommonOptions& common);

/// `abbe compare`: cuts error-free, uncompensated and every compensator of a scene.
Command compare_command(CommonOptions& common);

/// `abbe study`: thousands of machines. @param argc, argv  what mpirun gave the program
Command study_command(CommonOptions& common, int& argc, char**& argv);

}  // namespace abbe::sim
