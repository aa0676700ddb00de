#pragma once

#include <cstddef>
#include <string>

#include "sim/compensation/plug_in_batch.h"

/// The lines that a plug-in and abbe say to each other; README.md is the protocol.
namespace abbe::sim::compensation {

inline constexpr int protocol_version = 1;

/// Appends a number in the fewest digits that give its bits back; null if it is not finite.
void append_number(std::string& line, double number);

/// What abbe says. Each line ends with its '\n'.
std::string task_line(const PlugInTask& task, Eigen::Index samples, int batch);
std::string end_line();

std::string ask_line(const PlugInBatch& batch, long id);

/// What a plug-in says of itself.
struct Ready {
  std::string name;
  Answers answers = Answers::Correction;
};
/// @throws ChildFault unless the line is that, for this version
Ready read_ready(const std::string& line);

/// @return (samples x columns), finite and within the options' bounds
/// @throws ChildFault unless the line is such an answer
Eigen::MatrixXd read_answer(const std::string& line, const Expected& expected);

}  // namespace abbe::sim::compensation
