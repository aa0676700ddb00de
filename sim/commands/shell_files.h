#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sim/commands/command.h"

/// Shell completion of abbe's command line, its global options, and the texts that completion
/// shares with `--help`.
namespace abbe::sim {

/// Description of abbe in one line and in a paragraph, and the meaning of its exit codes, for
/// `--help` and `abbe help`.
inline constexpr const char* about_line = "virtual five-axis machine tool that is wrong on purpose";
inline constexpr const char* about_text =
    "It cuts a part on a machine with errors and shows their effect, in micrometres on the "
    "design\nsurface, with and without a compensator.";
inline constexpr const char* exit_codes_text =
    "0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
    "4 numerical, 5 output, 6 plug-in, 130 interrupted.";

/// An option of abbe itself, not of a command: `abbe --cases SCENE`.
struct GlobalOption {
  std::string name;      ///< "--cases"
  std::string argument;  ///< "SCENE"; "[PREFIX]" is optional
  std::string help;
  std::vector<std::string> choices;  ///< possible values of the argument; empty if any is allowed
  /// Called with an empty argument if it is omitted.
  std::function<Exit(const std::string& argument)> run;
};

/// Returns all global options.
std::vector<GlobalOption> global_options();

/// A possible replacement for the word at the cursor.
struct Candidate {
  std::string text;         ///< ends in "=" if a value must follow
  std::string description;  ///< empty if there is none
};

/// Completions of a word of a command line.
struct Completions {
  std::vector<Candidate> candidates;
  bool completes_files = false;  ///< the shell also offers file names
  std::string file_prefix;       ///< part of the word before the file name: "--out="
};

/// Returns the completions of a word: commands, options, their values, names of cases, and keys.
/// @param words    words of the line, without the name of the program
/// @param current  index of the word to complete; `words.size()` for a new, empty word
Completions completions(const std::vector<Command>& commands, std::span<const std::string> words,
                        std::size_t current);

/// Runs `abbe __complete CURRENT WORD ...`, which the scripts of `--completion` call: prints one
/// candidate per line, with a tab before its description, and `:files PREFIX` if the shell also
/// offers file names. CURRENT counts the name of the program as word 0.
Exit print_completions(const std::vector<Command>& commands,
                       std::span<const std::string> arguments);

}  // namespace abbe::sim
