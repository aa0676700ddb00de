#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/read_options.h"
#include "sim/program/path.h"

namespace abbe::sim::dialects {

struct ReadProgram {
  program::Path path;
  Dialect dialect = Dialect::LinuxCnc;  ///< the one taken
  bool turning = false;                 ///< read as for a turning control
  std::string sign;                     ///< by which it was taken; empty where it was given
  std::size_t blocks = 0;               ///< executed, those of loops each time; canonical commands
                                        ///< where LinuxCNC's own interpreter read it
  std::vector<Skipped> skipped;         ///< in the order of the program
  std::vector<std::string> warnings;    ///< what is assumed or without effect, with figures
};

/// Reads a machining program.
/// @throws BadProgram with every fault, up to 200: words that the dialect has not, what is refused
/// by
///         name, loops without end; BadInput where options.interpreter is LinuxCNC's own and it is
///         not there, or the program is of another dialect
ReadProgram read_program(std::string_view text, const std::string& file,
                         const ReadOptions& options);
/// The same from a file; subprograms are looked for beside it unless `folder` is stated.
ReadProgram read_program_file(const std::filesystem::path& file, ReadOptions options);

}  // namespace abbe::sim::dialects
