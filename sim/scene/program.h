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

/// A program in a file.
struct ProgramFile {
  std::filesystem::path file;  ///< .csv .pvt are PVT unless `dialect` is Cl, others machining
                               ///< programs
  dialects::Dialect dialect = dialects::Dialect::Auto;
  dialects::UnknownWordPolicy on_unknown = dialects::UnknownWordPolicy::Refuse;
  program::BlockSkip block_skip = program::BlockSkip().set();
  std::string startup_code;  ///< a block that is read before the first line
  dialects::Interpreter interpreter = dialects::Interpreter::Abbe;
  dialects::InterpreterLimits interpreter_limits = {};
  int max_moves = 20'000'000;  ///< and blocks executed, those of loops and cycles each time
  dialects::PoleOptions pole = {};
  dialects::TurningOptions turning = {};
  double pole_warning = 2.0 * units::deg;  ///< rad, from a pole: nearer is warned of; 0: never
};

/// A table of the control in a file, as it was read with the scene.
struct ControlTableFile {
  std::filesystem::path file;
  std::optional<double> unit;  ///< mm per unit of length; none where the file says it
  dialects::ControlTable table;
};

/// A program: a file, or a generator that writes one.
struct ProgramDescription {
  using File = ProgramFile;
  std::variant<File, program::Raster, program::Flank, program::Spiral> source;
  std::map<int, double> tool_length;  ///< mm by H number; H of the tool in use is there already
  std::array<kinematics::AxisVector, 6> work_offset{};
  std::optional<ControlTableFile> tools;    ///< instead of `tool_length` and the scene's tools
  std::optional<ControlTableFile> offsets;  ///< instead of `work_offset`
};

struct Key;

/// @param joints  of the machine, for the words of work offsets
ProgramDescription read_program(const Node& table, const std::vector<kinematics::Joint>& joints,
                                InputErrors& input_errors);
/// Refuses offsets of axes that a machine has not; those that their control refuses where they are
/// called and missing are taken out and noted instead. @param joints  none: nothing is looked at
void check_axes(dialects::ControlTable& offsets, const std::vector<kinematics::Joint>& joints,
                InputErrors& input_errors);
Node::Table written_program(const ProgramDescription& program,
                            const std::vector<kinematics::Joint>& joints);
std::vector<Key> program_keys();

}  // namespace abbe::sim
