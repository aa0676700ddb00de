#pragma once

#include <optional>
#include <string>

#include "sim/compensation/plug_in_task.h"

/// The batches in which plug-ins are asked, and what an answer to one must be.
namespace abbe::sim::compensation {

/// How many readings of the control a plug-in is given.
Eigen::Index readings(const PlugInTask& task);

PlugInBatch batch_of(const PlugInTask& task, const PlugInQuestion& question, Samples samples);

/// What an answer must be.
struct Expected {
  long id = 0;
  Answers answers = Answers::Correction;
  Eigen::Index samples = 0;
  const PlugInTask& task;
  const PlugInOptions& options;
};

/// Numbers a row.
Eigen::Index columns(Answers answers, const PlugInTask& task);

/// "X" or "EX"
std::string column_name(const Expected& expected, Eigen::Index column);

/// What a number of an answer would have to be instead; nothing where it may stand.
std::optional<std::string> expected_instead(double number, const Expected& expected,
                                            Eigen::Index column);

/// "batch 3 (samples 2001 to 3000)"
std::string name_of_batch(long id, Samples samples);

}  // namespace abbe::sim::compensation
