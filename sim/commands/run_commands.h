#pragma once

#include <filesystem>

#include "sim/commands/command.h"
#include "sim/commands/scene_runs.h"

/// The commands `abbe run`, `abbe compare` and `abbe study`.
namespace abbe::sim {

/// Returns the option --compensator of `run` and `compare`.
Option compensator_option(std::vector<std::filesystem::path>& files);

/// Returns the option --save of both commands.
Option save_option(std::vector<std::string>& formats);

/// Returns the option --report of both commands.
Option report_option(bool& report);
/// Returns the option --language of both commands.
Option language_option(std::string& language);

/// Requests a report that quotes the command line to reproduce it.
/// @param command  such as "run" or "compare --compensator x.py"
void request_report(RunOptions& options, const CommonOptions& common, const std::string& command,
                    const std::string& language);

/// Returns the options of `run` and `compare`.
/// @param compensators  files of plug-ins
/// @param formats       of maps; empty: the default formats
/// @throws BadUsage for a plug-in that does not exist or whose name cannot be a folder name
RunOptions run_options(const CommonOptions& common,
                       const std::vector<std::filesystem::path>& compensators,
                       const std::vector<std::string>& formats);

/// Prints exceeded limits and failures on stderr. Returns the exit code.
Exit print_limits_and_failures(const std::vector<std::string>& exceeded_limits,
                               const std::vector<std::string>& failed);

/// Prints the figures of a cut or of a comparison, exceeded limits and failures. Returns the exit
/// code.
Exit print_outcome(const CommonOptions& common, const RunOptions& options, const Outcome& outcome);

/// Returns the command `abbe run`, which cuts one case of a scene.
Command run_command(CommonOptions& common);

/// Returns the command `abbe compare`, which cuts a scene with the error-free machine, with the
/// uncompensated one and with every compensator.
Command compare_command(CommonOptions& common);

/// Returns the command `abbe study`, which cuts with thousands of variations of a machine.
/// @param argc, argv  of the program, as started by mpirun
Command study_command(CommonOptions& common, int& argc, char**& argv);

}  // namespace abbe::sim
