#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/read_options.h"
#include "sim/program/path.h"

namespace abbe::sim::dialects {

/// A word of a program that stands in the table of its dialect.
struct UsedWord {
  std::string word;  ///< as the table has it, "G1" of G01
  Use use = Use::Read;
  std::string_view sentence;
  std::size_t count = 0;  ///< how often it stands in the file; not how often it is executed
  int line = 0;           ///< of the first
};

/// The words of a program in the order in which they first stand there, comments and texts left
/// out; of a table of locations none.
/// @param turning  read as for a turning control
std::vector<UsedWord> used_words(std::string_view text, Dialect dialect, bool turning = false);

struct ReadProgram {
  program::Path path;
  Dialect dialect = Dialect::LinuxCnc;  ///< the one taken
  bool turning = false;                 ///< read as for a turning control
  std::string sign;                     ///< by which it was taken; empty where it was given
  std::size_t blocks = 0;               ///< executed, those of loops each time; canonical commands
                                        ///< where LinuxCNC's own interpreter read it
  std::vector<SkippedWord> skipped;     ///< in the order of the program
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
