#pragma once

#include <string>

namespace abbe::sim::program {

/// A choice that a program leaves to its control or its operator, as the reader made it. A reader
/// reports one with `Canon::assume` where the program depends on it; `abbe program`, `check`, `run`
/// and `compare` print each once, and summary.json lists them under `assumptions`.
struct Assumption {
  std::string text;         ///< what was assumed, and what follows from it here
  std::string key;          ///< scene key that changes it, "program.block_skip"
  std::string option = {};  ///< of `abbe program` that changes it, "--block-skip"; empty: none
  int line = 0;             ///< first line that depends on it; 0: the whole program
  std::string file = {};    ///< file of that line, if it is a subprogram's
};

/// Returns "line 7: block skip is on: 3 blocks left out (program.block_skip)".
std::string to_text(const Assumption& assumption);

}  // namespace abbe::sim::program
