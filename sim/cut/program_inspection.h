#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "kinematics/units.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "sim/files/progress.h"
#include "sim/machine/machine.h"
#include "sim/program/path_meter.h"
#include "sim/scene/machine.h"

/// A program read for a machine alone: no part, no errors, nothing is cut.
namespace abbe::sim {

enum class ProgramFormat { Cl, Nc, Pvt, Csv };

struct ProgramInspectionOptions {
  std::string machine = "library:gantry_cxyza";  ///< a file, or a name of the library
  double tool_length = 100.0;                    ///< mm, of every tool
  std::optional<double> tool_radius;             ///< mm, for cutter compensation
  std::string offset;                            ///< of G54 to G59 each, "X=10 Z=-50"; empty: zero
  std::filesystem::path tools;                   ///< the control's tool table; empty: none
  std::filesystem::path offsets;                 ///< its work offsets; empty: none
  program::BlockSkip block_skip = program::BlockSkip().set();
  std::string startup_code;          ///< a block that is read before the first line
  std::optional<double> table_unit;  ///< mm per unit of length in both
  dialects::Dialect dialect = dialects::Dialect::Auto;
  dialects::UnknownWordPolicy on_unknown = dialects::UnknownWordPolicy::Refuse;
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  dialects::InterpreterLimits interpreter_limits = {};
  int max_moves = 20'000'000;  ///< and blocks executed, those of loops and cycles each time
  dialects::PoleOptions pole = {};
  dialects::TurningOptions turning = {};
  double pole_warning = 2.0 * units::deg;  ///< rad, from a pole: nearer is warned of; 0: never
  std::optional<ProgramFormat> to;         ///< what it is written again as
  double within = 0.001;  ///< mm, between what the format has no word for and its points
  bool trace = false;     ///< the way of the tip, for a picture
};

/// A tool that a program calls.
struct ProgramTool {
  int number = 0;
  int line = 0;  ///< of its first call
  std::size_t calls = 0;
  std::size_t blocks = 0;  ///< until another is called
};

/// Way of the tip in the workpiece, at most `max_trace` places of it, evenly left out beyond.
struct TipTrace {
  std::vector<Eigen::Vector3f> places;
  std::vector<char> rapid;  ///< the way to each place
};

struct ProgramInspection {
  std::filesystem::path file;
  std::string dialect, sign;  ///< and by which sign it was taken; "pvt" for tables of times
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  bool turning = false;  ///< read as for a turning control
  std::string machine_name;
  std::filesystem::path machine_file;
  double tool_length = 0.0;                        ///< mm, of every tool unless there is a table
  std::filesystem::path tool_table, offset_table;  ///< empty: none
  std::string offset;                              ///< as it was stated
  MachineDescription description;
  Machine machine;
  std::size_t lines = 0, bytes = 0;
  std::size_t executed = 0;  ///< blocks, those of loops each time
  std::vector<std::string> more_files;
  program::PathFigures figures;
  std::vector<dialects::UsedWord> words;
  std::vector<dialects::SkippedWord> skipped;
  std::vector<ProgramTool> tools;
  std::vector<program::ToolComment> tool_comments;
  TipTrace trace;
  std::string converted;           ///< the program in the format that was asked for
  std::vector<std::string> notes;  ///< what the conversion did, with figures
  std::vector<std::string> warnings;
  std::vector<program::Assumption> assumptions;
  bool beyond_travel = false;
};

/// The files that it reads.
std::vector<std::filesystem::path> inputs_of(const std::filesystem::path& program,
                                             const ProgramInspectionOptions& options);

/// Reads a program; long ones without keeping their blocks, but for formats that need them whole.
/// @param progress  stages "read" and "words"
/// @throws BadInput, BadScene for the machine, BadProgram with every fault
ProgramInspection inspect_program(const std::filesystem::path& program,
                                  const ProgramInspectionOptions& options,
                                  const Progress& progress = {});

}  // namespace abbe::sim
