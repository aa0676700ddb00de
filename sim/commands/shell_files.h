#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// Description of abbe in one line and in a paragraph, and the meaning of its exit codes, for
/// `--help` and `abbe help`.
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
};

/// Returns all such options.
std::vector<GlobalOption> global_options();

/// A text that can stand in place of the word under the cursor.
struct Candidate {
  std::string text;         ///< ends in "=" if a value must follow
  std::string description;  ///< empty if there is none
};

/// Completions of a word of a command line.
struct Completions {
  std::vector<Candidate> candidates;
  bool has_files = false;   ///< names of files complete the word as well
  std::string file_prefix;  ///< part of the word in front of the name of a file: "--out="
};

/// Returns the completions of a word: commands, options, their values, names of cases, and keys.
/// @param words    of the line, without the name of the program
/// @param current  index of the word; at most the number of words, which stands for an empty one
Completions completions(const std::vector<Command>& commands, std::span<const std::string> words,
                        std::size_t current);

/// Runs `abbe __complete CURRENT WORD ...`, which the scripts of `--completion` call: prints one
/// candidate per line, with a tab before its description, and `:files PREFIX` if files complete the
/// word. CURRENT counts the name of the program as word 0.
Exit print_completions(const std::vector<Command>& commands,
                       std::span<const std::string> arguments);

}  // namespace abbe::sim
