#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// Description of abbe in one line and in a paragraph, and the meaning of its exit codes, for
/// `--help`, the manual pages and `abbe help`.
inline constexpr const char* about_line = "virtual five-axis machine tool that is wrong on purpose";
inline constexpr const char* about_text =
    "It cuts a part on a machine with errors and shows, in micrometres on the design surface, "
    "what they\ndid, with and without a compensator.";
inline constexpr const char* exit_codes_text =
    "0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
    "4 numerical, 5 output, 6 plug-in, 130 interrupted.";

/// An option of abbe itself, not of a command: `abbe --cases SCENE`.
struct GlobalOption {
  std::string name;      ///< "--cases"
  std::string argument;  ///< "SCENE"; "[PREFIX]" is optional
  std::string help;
  std::vector<std::string> words;  ///< possible values of the argument; empty: any
  /// Called with an empty argument if it is omitted.
  std::function<Exit(const std::string& argument)> answer;
  bool hidden = false;  ///< not listed by `--help`
};

/// Returns all such options: manual pages, completion scripts, and the lists that completion reads.
/// @param commands  that they describe; must outlive the options
std::vector<GlobalOption> global_options(const std::vector<Command>& commands);

// Completion scripts of shells. They call `abbe --cases` and `abbe --keys` for the names of cases
// and keys.

struct GlobalOption;

std::string bash_completion(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options);
std::string zsh_completion(const std::vector<Command>& commands,
                           const std::vector<GlobalOption>& global_options);
std::string fish_completion(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options);

/// Returns the manual page abbe(1) in roff, which refers to the page of every command.
std::string manual(const std::vector<Command>& commands);

/// Returns the manual page of one command, such as abbe-run(1), in roff.
std::string manual(const Command& command);

}  // namespace abbe::sim
