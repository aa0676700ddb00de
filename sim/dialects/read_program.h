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

/// A word used by a program that is in the word table of its dialect.
struct UsedWord {
  std::string word;  ///< as in the table, "G1" for G01
  WordTreatment use = WordTreatment::Read;
  std::string_view sentence;
  std::size_t count = 0;  ///< occurrences in the file, not executions
  int line = 0;           ///< line of the first one
};

/// Returns the words of a program in the order of first use, comments and texts excluded. A table
/// of cutter locations has no words. `turning` selects the words of turning controls.
std::vector<UsedWord> used_words(std::string_view text, Dialect dialect, bool turning = false);

/// The moves of a program, with its dialect and warnings.
struct ParsedProgram {
  program::Path path;
  Dialect dialect = Dialect::LinuxCnc;  ///< dialect that was used
  bool turning = false;                 ///< read as for a turning control
  std::string sign;                     ///< how the dialect was recognised; empty if it was given
  /// Executed blocks, those of loops each time; canonical commands if LinuxCNC's own interpreter
  /// was used.
  std::size_t blocks = 0;
  std::vector<SkippedWord> skipped;   ///< in program order
  std::vector<std::string> warnings;  ///< assumptions and words without effect, with figures
};

/// Reads a machining program. Throws BadProgram with all errors, up to 200: unknown words, words
/// rejected by name, endless loops. Throws BadInput if options.interpreter is LinuxCNC's own and it
/// is not installed, or the program has another dialect.
ParsedProgram read_program(std::string_view text, const std::string& file,
                           const ReadOptions& options);
/// Reads a program from a file. Subprograms are searched in the folder of the file unless
/// `options.folder` is set.
ParsedProgram read_program_file(const std::filesystem::path& file, ReadOptions options);

}  // namespace abbe::sim::dialects
