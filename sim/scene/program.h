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
  std::filesystem::path file;
  dialects::Dialect dialect = dialects::Dialect::Auto;
  dialects::UnknownWordPolicy on_unknown = dialects::UnknownWordPolicy::Refuse;
  program::BlockSkip block_skip = program::BlockSkip().set();
  std::string startup_code;  ///< a block that is read before the first line
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  dialects::InterpreterLimits interpreter_limits = {};
  int max_moves = 20'000'000;  ///< limit of moves and executed blocks, counted in every iteration
                               ///< of a loop or cycle
  dialects::PoleOptions pole = {};
  dialects::TurningOptions turning = {};
  double pole_warning = 2.0 * units::deg;  ///< rad, distance from a pole below which there is a
                                           ///< warning; 0: never
};

/// Returns true for a table of positions, velocities and times: a file that ends in .csv or .pvt,
/// in another dialect than Cl.
bool is_pvt(const ProgramFile& program);

/// A tool table or work offsets of the control, read from a file.
struct ControlTableFile {
  std::filesystem::path file;
  std::optional<double> unit;  ///< mm per unit of length; none if the file states it
  dialects::ControlTable table;
};

/// A program from a file or a generator, with the tool lengths and work offsets of the control.
struct ProgramDescription {
  using File = ProgramFile;
  std::variant<File, program::Raster, program::Flank, program::Spiral> source;
  std::map<int, double> tool_length;  ///< mm by H number
  std::array<kinematics::AxisVector, 6> work_offset{};
  std::optional<ControlTableFile> tools;    ///< replaces `tool_length` and the tools of the scene
  std::optional<ControlTableFile> offsets;  ///< replaces `work_offset`
};

struct Key;

/// Reads and writes `[program]`.
/// @param joints  joints of the machine, to which the work offsets refer
ProgramDescription read_program(const Node& table, const std::vector<kinematics::Joint>& joints,
                                InputErrors& input_errors);
/// Reports offsets of axes that the machine does not have. Offsets of Siemens and Heidenhain
/// tables, which serve several machines, are removed with a note instead.
/// @param joints  joints of the machine; if empty, nothing is checked
void check_offset_axes(dialects::ControlTable& offsets,
                       const std::vector<kinematics::Joint>& joints, InputErrors& input_errors);
Node::Table program_to_table(const ProgramDescription& program,
                             const std::vector<kinematics::Joint>& joints);
std::vector<Key> program_keys();

}  // namespace abbe::sim
