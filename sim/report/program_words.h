#pragma once

#include <string>
#include <vector>

#include "sim/cut/job.h"

namespace abbe::sim {

/// The text of a program line by line, to be looked up.
class ProgramWords {
 public:
  /// Of the program that commands run; without words where its files cannot be read.
  ProgramWords(const Job& job, const Commands& commands);

  /// The words of a block on one line, control characters spelt out; empty where they are not
  /// known.
  std::string of(const program::Block& block) const;

 private:
  std::vector<std::vector<std::string>> files_;  ///< as `Block::file` counts them
};

}  // namespace abbe::sim
