#pragma once

#include <cstddef>
#include <string>

#include "sim/compensation/plug_in_task.h"

/// The lines that a plug-in and abbe say to each other; README.md is the protocol.
namespace abbe::sim::compensation {

inline constexpr int protocol_version = 1;

/// Appends a number in the fewest digits that give its bits back; null if it is not finite.
void append_number(std::string& line, double number);

/// What abbe says. Each line ends with its '\n'.
std::string task_line(const PlugInTask& task, Eigen::Index samples, int batch);
std::string end_line();

/// Samples first ... first + count - 1 of a question, counted from 0.
struct Samples {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};
std::string ask_line(const PlugInTask& task, const PlugInQuestion& question, Samples samples,
                     long id);

/// What a plug-in says of itself.
struct Ready {
  std::string name;
  Answers answers = Answers::Correction;
};
/// @throws ChildFault unless the line is that, for this version
Ready read_ready(const std::string& line);

/// What an answer must be.
struct Expected {
  long id = 0;
  Answers answers = Answers::Correction;
  Eigen::Index samples = 0;
  const PlugInTask& task;
  const PlugInOptions& options;
};
Eigen::Index columns(Answers answers, const PlugInTask& task);

/// @return (samples x columns), finite and within the options' bounds
/// @throws ChildFault unless the line is such an answer
Eigen::MatrixXd read_answer(const std::string& line, const Expected& expected);

}  // namespace abbe::sim::compensation
