#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace abbe::sim {

/// What the program says to the shell.
enum class Exit {
  Ok = 0,
  LimitExceeded = 1,
  Usage = 2,
  Input = 3,
  Numerical = 4,
  Output = 5,
  PlugIn = 6,
  Interrupted = 130
};

/// A value of an option that the command cannot take. what(): "--set: expected ..."
struct BadUsage : std::invalid_argument {
  BadUsage(const std::string& option, const std::string& reason)
      : std::invalid_argument(option + ": " + reason) {}
};

/// Returns the exit code of a program, or the one that its exception stands for, which is printed.
/// Standard output that was lost counts as an exception.
Exit exit_code(const std::function<Exit()>& program);

}  // namespace abbe::sim
