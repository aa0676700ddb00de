#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// What abbe is, on one line and in a paragraph, and what its exit codes mean: for `--help`, for
/// the pages of the manual and for `abbe help`.
inline constexpr const char* about_line = "virtual five-axis machine tool that is wrong on purpose";
inline constexpr const char* about_text =
    "It cuts a part on a machine with errors and shows, in micrometres on the design surface, "
    "what they\ndid, with and without a compensator.";
inline constexpr const char* exit_codes_text =
    "0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
    "4 numerical, 5 output, 6 plug-in, 130 interrupted.";

/// What is asked of abbe itself and not of a command: `abbe --cases SCENE`.
struct GlobalOption {
  std::string name;      ///< "--cases"
  std::string argument;  ///< "SCENE"; "[PREFIX]" may be left out
  std::string help;
  std::vector<std::string> words;  ///< that the argument may be; empty: any
  std::function<Exit(const std::string& argument)> answer;  ///< empty where it is left out
  bool hidden = false;                                      ///< from `--help`
};

/// Every question: the pages of the manual, completions, and the lists that completions read.
/// @param commands  of which they speak; must outlive the answers
std::vector<GlobalOption> global_options(const std::vector<Command>& commands);

// Scripts by which shells complete a command line of abbe. They ask `abbe --cases` and
// `abbe --keys` for the names of cases and keys.

struct GlobalOption;

std::string bash_completion(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options);
std::string zsh_completion(const std::vector<Command>& commands,
                           const std::vector<GlobalOption>& global_options);
std::string fish_completion(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options);

/// The page abbe(1) of the manual, in roff; it names the page of every command.
std::string manual(const std::vector<Command>& commands);

/// The page of one command, abbe-run(1), in roff.
std::string manual(const Command& command);

}  // namespace abbe::sim
