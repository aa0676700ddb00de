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

/// Inspection of an NC program on a machine, without part, errors or cut.
namespace abbe::sim {

/// Formats to which a program can be converted: cutter locations, NC text, positions over time,
/// table.
enum class ProgramFormat { Cl, Nc, Pvt, Csv };

/// Options of an inspection: the machine, its tables, the dialect, and the conversion.
struct ProgramInspectionOptions {
  std::string machine = "library:gantry_cxyza";  ///< file or name in the library
  double tool_length = 100.0;                    ///< mm, of every tool
  std::optional<double> tool_radius;             ///< mm, for cutter compensation
  std::string offset;             ///< of each of G54 to G59, "X=10 Z=-50"; empty: zero
  std::filesystem::path tools;    ///< tool table of the control; empty: none
  std::filesystem::path offsets;  ///< work offsets of the control; empty: none
  program::BlockSkip block_skip = program::BlockSkip().set();
  std::string startup_code;          ///< block that is read before the first line
  std::optional<double> table_unit;  ///< mm per unit of length in both tables
  dialects::Dialect dialect = dialects::Dialect::Auto;
  dialects::UnknownWordPolicy on_unknown = dialects::UnknownWordPolicy::Refuse;
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  dialects::InterpreterLimits interpreter_limits = {};
  int max_moves = 20'000'000;  ///< limit on the moves and on the executed blocks; those of loops
                               ///< and cycles count each time
  dialects::PoleOptions pole = {};
  dialects::TurningOptions turning = {};
  double pole_warning = 2.0 * units::deg;  ///< distance to a pole below which a warning is given,
                                           ///< rad; 0: no warning
  std::optional<ProgramFormat> to;         ///< format of the conversion
  double within = 0.001;  ///< largest chord error of moves that the format cannot state, mm
  bool trace = false;     ///< records the path of the tip, for a picture
};

/// A tool that a program calls.
struct ProgramTool {
  int number = 0;
  int line = 0;  ///< of its first call
  std::size_t calls = 0;
  std::size_t blocks = 0;  ///< number of blocks with this tool
};

/// The path of the tip in the workpiece, at most `max_trace` points; a longer path is thinned
/// evenly.
struct TipTrace {
  std::vector<Eigen::Vector3f> places;
  std::vector<char> rapid;  ///< true if the move to the point is a rapid
};

/// The result of inspecting a program.
struct ProgramInspection {
  std::filesystem::path file;
  std::string dialect, dialect_evidence;  ///< `dialect_evidence` is the evidence for the dialect;
                                          ///< the dialect of a table of times is "pvt"
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  bool turning = false;  ///< true if read as by a turning control
  std::string machine_name;
  std::filesystem::path machine_file;
  double tool_length = 0.0;                        ///< mm, of every tool unless there is a table
  std::filesystem::path tool_table, offset_table;  ///< empty: none
  std::string offset;                              ///< as written by the user
  MachineDescription description;
  Machine machine;
  std::size_t lines = 0, bytes = 0;
  std::size_t executed = 0;  ///< number of executed blocks; those of loops count each time
  std::vector<std::string> subprogram_files = {};
  program::PathFigures figures = {};
  std::vector<dialects::UsedWord> words = {};
  std::vector<dialects::SkippedWord> skipped = {};
  std::vector<ProgramTool> tools = {};
  std::vector<program::ToolComment> tool_comments = {};
  TipTrace trace = {};
  std::string converted = {};           ///< the program in the requested format
  std::vector<std::string> notes = {};  ///< figures of the conversion
  std::vector<std::string> warnings = {};
  std::vector<program::Assumption> assumptions = {};
  bool beyond_travel = false;
};

/// Returns the files that an inspection reads.
std::vector<std::filesystem::path> inspection_inputs(const std::filesystem::path& program,
                                                     const ProgramInspectionOptions& options);

/// Inspects a program. Its blocks are not kept unless the conversion needs them.
/// @param progress  stages "read" and "words"
/// @throws BadInput, BadScene for the machine; BadProgram with all its errors
ProgramInspection inspect_program(const std::filesystem::path& program,
                                  const ProgramInspectionOptions& options,
                                  const Progress& progress = {});

}  // namespace abbe::sim
