#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "kinematics/chain.h"
#include "kinematics/units.h"
#include "sim/dialects/control_table_files.h"
#include "sim/dialects/read_options.h"
#include "sim/program/generators.h"
#include "sim/program/nc_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// A program stored in a file.
struct ProgramFile {
  std::filesystem::path file;  ///< .csv and .pvt are PVT unless `dialect` is Cl; other files are
                               ///< machining programs
  dialects::Dialect dialect = dialects::Dialect::Auto;
  dialects::UnknownWordPolicy on_unknown = dialects::UnknownWordPolicy::Refuse;
  program::BlockSkip block_skip = program::BlockSkip().set();
  std::string startup_code;  ///< a block that is read before the first line
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  dialects::InterpreterLimits interpreter_limits = {};
  int max_moves = 20'000'000;  ///< limit of moves and executed blocks; each pass of a loop or cycle
                               ///< counts
  dialects::PoleOptions pole = {};
  dialects::TurningOptions turning = {};
  double pole_warning = 2.0 * units::deg;  ///< rad, distance from a pole below which a warning is
                                           ///< given; 0: never
};

/// A table of the control from a file, read together with the scene.
struct ControlTableFile {
  std::filesystem::path file;
  std::optional<double> unit;  ///< mm per unit of length; none if the file states it
  dialects::ControlTable table;
};

/// A program, either from a file or written by a generator.
struct ProgramDescription {
  using File = ProgramFile;
  std::variant<File, program::Raster, program::Flank, program::Spiral> source;
  std::map<int, double> tool_length;  ///< mm by H number; that of the tool in use is present
                                      ///< already
  std::array<kinematics::AxisVector, 6> work_offset{};
  std::optional<ControlTableFile> tools;    ///< replaces `tool_length` and the tools of the scene
  std::optional<ControlTableFile> offsets;  ///< replaces `work_offset`
};

struct Key;

/// Reads `program`.
/// @param joints  of the machine, for the words of work offsets
ProgramDescription read_program(const Node& table, const std::vector<kinematics::Joint>& joints,
                                InputErrors& input_errors);
/// Rejects offsets of axes that the machine lacks. Offsets that their control itself rejects when
/// they are called and absent are removed and noted instead.
/// @param joints  of the machine; if empty, nothing is checked
void check_axes(dialects::ControlTable& offsets, const std::vector<kinematics::Joint>& joints,
                InputErrors& input_errors);
Node::Table written_program(const ProgramDescription& program,
                            const std::vector<kinematics::Joint>& joints);
std::vector<Key> program_keys();

}  // namespace abbe::sim
