#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// What is asked of abbe itself and not of a command: `abbe --cases SCENE`.
struct Question {
  std::string name;      ///< "--cases"
  std::string argument;  ///< "SCENE"; "[PREFIX]" may be left out
  std::string help;
  std::vector<std::string> words;  ///< that the argument may be; empty: any
  std::function<Exit(const std::string& argument)> answer;  ///< empty where it is left out
  bool hidden = false;                                      ///< from `--help`
};

/// Every question: the pages of the manual, completions, and the lists that completions read.
/// @param commands  of which they speak; must outlive the answers
std::vector<Question> questions(const std::vector<Command>& commands);

}  // namespace abbe::sim
