#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"
#include "sim/program/path.h"

namespace abbe::sim::dialects {

/// Reads cutter locations: APT statements as CAM systems output them, or a CSV with columns x y z i
/// j k feed. Points are the tip in the workpiece (plus the work offset), vectors the tool axis from
/// the tip to the spindle. Of the solutions of `kinematics::inverse` the one with the least rotary
/// travel is taken. Between points the tip moves on a straight line, and the rotary axes move in
/// proportion.
void read_cl(std::string_view text, ProgramRun& run);

/// Returns the word table of cutter locations.
std::span<const WordTableEntry> cl_words();

/// Reads programs of Fanuc controls (Series 16i to 30i), including custom macro B. With
/// `run.is_turning()` they are programs of turning controls with G-code system A, else of milling
/// controls.
void read_fanuc(std::string_view text, ProgramRun& run);

/// Returns the word table of Fanuc milling controls.
std::span<const WordTableEntry> fanuc_words();

/// Returns the word table of Fanuc turning controls.
std::span<const WordTableEntry> fanuc_lathe_words();

/// Reads RS274/NGC as LinuxCNC does, and in addition G43.4, which abbe's own programs use.
void read_linuxcnc(std::string_view text, ProgramRun& run);

/// Returns the word table of LinuxCNC.
std::span<const WordTableEntry> linuxcnc_words();

/// Reads programs of Siemens 840D.
void read_siemens(std::string_view text, ProgramRun& run);

/// Returns the word table of Siemens 840D.
std::span<const WordTableEntry> siemens_words();

/// The front end of a dialect: the reader that issues canonical moves, and its word table.
struct FrontEnd {
  Dialect dialect;
  std::string_view title;  ///< for messages and documents, "LinuxCNC (RS274/NGC)"
  void (*read)(std::string_view text, ProgramRun& run);
  std::span<const WordTableEntry> (*words)();
  /// Word table of its turning controls; null if it is the same.
  std::span<const WordTableEntry> (*turning_words)() = nullptr;
  std::string_view turning_title = {};
};

/// Returns all front ends in the order of the README. A program of a dialect without a front end is
/// an input error that names the dialect.
std::span<const FrontEnd> front_ends();

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
/// `options.subprogram_folder` is set.
ParsedProgram read_program_file(const std::filesystem::path& file, ReadOptions options);

}  // namespace abbe::sim::dialects
