#include "sim/cut/program_inspection.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <memory>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/pose_table.h"
#include "sim/cut/process.h"
#include "sim/cut/scene_checks.h"
#include "sim/dialects/read_program.h"
#include "sim/machine/truth.h"
#include "sim/program/block_motion.h"
#include "sim/program/program_writers.h"
#include "sim/program/pvt.h"
#include "sim/program/rewrite.h"
#include "sim/scene/fields.h"
#include "sim/scene/library.h"
#include "sim/scene/machine.h"
#include "sim/scene/program.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

namespace {

constexpr int max_tools = 999;  // largest H and D number; a control that is inspected without a
                                // table knows all of them
constexpr std::size_t max_trace = 2'000'000;  // points of a picture, 14 bytes each

/// Returns the file of a machine: a path, or a name of the library with or without `library:`.
std::filesystem::path machine_file_of(const std::string& name) {
  const bool plain = name.find_first_of("/.:") == std::string::npos;
  std::error_code none;
  // A file of that name in the folder wins over the library.
  const bool is_file = std::filesystem::is_regular_file(name, none);
  const std::string full = plain && !is_file ? std::string(library_prefix) + name : name;
  InputErrors input_errors;
  const Place place{std::make_shared<const std::string>("--machine"), 0, 0, true};
  std::filesystem::path file = locate_file({full, place, "machines"}, ".", input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  return file;
}

/// Returns a scene of a machine and a tool of the given length only.
Scene scene_of(const std::filesystem::path& file, const ProgramInspectionOptions& options) {
  Scene scene;
  scene.file = file;
  InputErrors input_errors;
  scene.machine = read_machine(read_toml_file(file), input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  scene.tool.length = options.tool_length;
  const auto table_of = [&](const std::filesystem::path& file, dialects::TableKind kind) {
    return ControlTableFile{file, options.table_unit,
                            dialects::read_control_table_file(file, kind, options.table_unit)};
  };
  if (!options.tools.empty())
    scene.program.tools = table_of(options.tools, dialects::TableKind::Tools);
  if (!options.offsets.empty()) {
    scene.program.offsets = table_of(options.offsets, dialects::TableKind::Offsets);
    check_axes(scene.program.offsets->table, scene.machine.joints, input_errors);
    if (!input_errors.empty()) throw BadScene(input_errors.list());
  }
  for (int h = 1; h <= max_tools; ++h) scene.program.tool_length[h] = options.tool_length;
  return scene;
}

program::NcOptions control_of(const Scene& scene, const Machine& machine,
                              const ProgramInspectionOptions& options) {
  program::NcOptions control = nc_options(scene, machine);
  control.block_skip = options.block_skip;
  if (!options.offset.empty())
    control.work_offset.fill(
        positions_in(options.offset, machine.control, "--offset", Within::Anything));
  if (scene.program.tools) {
    // Every tool of the table needs the control's chain to its tip, for G43.4 with its H.
    for (const auto& [number, length] : control.tool_length) {
      Scene with_tool = scene;
      with_tool.tool.number = number;
      control.control_of_h.emplace(number, compile(with_tool).control);
    }
    return control;
  }
  control.tool_radius.clear();
  if (options.tool_radius)
    for (int d = 1; d <= max_tools; ++d) control.tool_radius[d] = *options.tool_radius;
  return control;
}

// The first line decides unless the ending does.
bool is_pvt(const std::filesystem::path& file, std::string_view text,
            const ProgramInspectionOptions& options) {
  if (options.dialect != dialects::Dialect::Auto) return false;
  if (file.extension() == ".pvt") return true;
  Lines lines(text);
  while (const auto line = lines.next())
    if (!line->empty() && line->front() != '#') return line->starts_with("time_s");
  return false;
}

/// Keeps every point until there are too many, then every second one, and so on. The memory is
/// bounded without knowing the length of the program.
class Tracer {
 public:
  explicit Tracer(TipTrace& trace) : trace_(trace) {}

  void add(const Eigen::Vector3d& tip_w, bool rapid) {
    // a point left out passes its rapid on to the next point kept
    rapid_since_ = rapid_since_ || rapid;
    if (count_++ % every_ != 0) return;
    trace_.places.push_back(tip_w.cast<float>());
    trace_.rapid.push_back(rapid_since_);
    rapid_since_ = false;
    if (trace_.places.size() < max_trace) return;
    every_ *= 2;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < trace_.places.size(); i += 2, ++kept) {
      trace_.places[kept] = trace_.places[i];
      trace_.rapid[kept] = trace_.rapid[i] || (i > 0 && trace_.rapid[i - 1]);
    }
    trace_.places.resize(kept);
    trace_.rapid.resize(kept);
  }

 private:
  TipTrace& trace_;
  std::size_t count_ = 0, every_ = 1;
  bool rapid_since_ = false;
};

/// Returns the tools called by M6, or by T if the program has no M6.
std::vector<ProgramTool> tools_of(const std::vector<program::ToolCall>& calls, std::size_t blocks) {
  const bool with_m6 = std::any_of(calls.begin(), calls.end(),
                                   [](const program::ToolCall& call) { return call.changes; });
  std::vector<ProgramTool> tools;
  std::size_t since = 0;
  ProgramTool* runs = nullptr;
  const auto until = [&](std::size_t block) {
    if (runs != nullptr) runs->blocks += block - since;
    since = block;
  };
  tools.reserve(calls.size());
  for (const program::ToolCall& call : calls) {
    if (call.changes != with_m6) continue;
    until(call.before);
    auto known = std::find_if(tools.begin(), tools.end(),
                              [&](const ProgramTool& one) { return one.number == call.number; });
    if (known == tools.end()) known = tools.insert(tools.end(), {call.number, call.line, 0, 0});
    ++known->calls;
    runs = &*known;
  }
  until(blocks);
  return tools;
}

/// Adds the warnings about axes beyond their travel, poles, and moves slowed down by axis limits.
void judge(const ProgramInspectionOptions& options, ProgramInspection& alone) {
  constexpr double slack = 1e-6;  // mm or rad: programmed numbers are rounded, limits are not exact
  for (int j = 0; j < alone.machine.control.size(); ++j) {
    const kinematics::Joint& joint = alone.machine.control.joints()[std::size_t(j)];
    const program::AxisFigures& axis = alone.figures.axes[std::size_t(j)];
    if (!axis.positioned || axis.left >= -slack) continue;
    alone.beyond_travel = true;
    const double unit = joint.motion == kinematics::Motion::Rotary ? units::deg : 1.0;
    const program::ValueAtLine& worst = axis.least.value < joint.min ? axis.least : axis.most;
    alone.warnings.push_back(
        fmt::format("{} leaves its travel of {:.6g} to {:.6g} {} by {:.6g}, on line {} with {:.6g}",
                    joint.name, joint.min / unit, joint.max / unit, unit == 1.0 ? "mm" : "deg",
                    -axis.left / unit, worst.line, worst.value / unit));
  }
  if (const auto& pole = alone.figures.pole)
    if (std::string text =
            pole_text(*pole, alone.machine.control, options.pole_warning, alone.more_files);
        !text.empty())
      alone.warnings.push_back(std::move(text));
  if (alone.figures.slowed > 0)
    alone.warnings.push_back(fmt::format(
        "{} moves at feed are beyond the speed of an axis, by {:.3g} times on line {}: "
        "a control slows them down",
        alone.figures.slowed, alone.figures.max_slowed.value, alone.figures.max_slowed.line));
}

/// Converts a path to the requested format.
void convert(const program::Path& path, const program::NcOptions& control,
             const ProgramInspectionOptions& options, ProgramInspection& alone) {
  if (options.to == ProgramFormat::Pvt) {
    const program::PvtConversion pvt =
        program::convert_to_pvt(path, alone.machine.control, {.within = options.within});
    std::vector<int> columns;
    for (int j = 0; j < alone.machine.control.size(); ++j)
      if (alone.figures.axes[std::size_t(j)].positioned) columns.push_back(j);
    alone.converted = program::write_pvt(pvt.rows, control.axes, columns);
    alone.notes.push_back(
        fmt::format("{} rows, {:.3g} um from the path at most (a rotary axis "
                    "counts with 100 mm); the spindle is left out",
                    pvt.rows.size(), pvt.off * 1e3));
    return;
  }
  std::vector<std::vector<program::CorrectedPoint>> points(path.blocks.size());
  std::size_t chords = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const program::Block& block = path.blocks[i];
    if (block.interpolation != program::Interpolation::Arc || path.arcs[block.shape].turned < 0)
      continue;  // its plane has an NC code
    const std::size_t n = program::chords_of(path, block, alone.machine.control, options.within);
    for (std::size_t k = 1; k <= n; ++k) {
      const double u = double(k) / double(n);
      points[i].push_back({u, program::position(path, block, u), {}, {}});
    }
    chords += n;
  }
  // offsets are written into the positions, so the control must add none
  program::NcOptions without_offsets = control;
  without_offsets.work_offset = {};
  without_offsets.more_offset.clear();
  alone.converted = program::rewritten(path, points, without_offsets,
                                       // 1e-6 mm and 1e-6 deg: finer than any control reads, so the
                                       // text adds no error
                                       {.word_mm = 1e-6, .word_rad = 1e-6 * units::deg})
                        .text;
  if (chords > 0)
    alone.notes.push_back(
        fmt::format("arcs in planes for which there is no word became {} chords within {:.4g} um",
                    chords, options.within * 1e3));
  alone.notes.push_back(
      "RS274/NGC with all offsets in the words; X Y Z under G43.4 are the tip in the workpiece");
}

}  // namespace

std::vector<std::filesystem::path> inputs_of(const std::filesystem::path& program,
                                             const ProgramInspectionOptions& options) {
  std::vector<std::filesystem::path> files{program, machine_file_of(options.machine)};
  for (const std::filesystem::path& table : {options.tools, options.offsets})
    if (!table.empty()) files.push_back(table);
  return files;
}

namespace {

/// Measures, traces and writes the segments of a program while it is read.
class Looking {
 public:
  Looking(ProgramInspection& alone, const program::NcOptions& control,
          const ProgramInspectionOptions& options)
      : meter_(alone.machine.control,
               {alone.description.rapid_speed, alone.description.rapid_turn, options.pole_warning},
               &control.control_of_h),
        tracer_(alone.trace) {
    if (options.trace)
      meter_.on_tip_point = [this](const Eigen::Vector3d& tip_w, bool rapid) {
        tracer_.add(tip_w, rapid);
      };
    using Kind = program::LocationOptions::Kind;
    if (options.to == ProgramFormat::Cl || options.to == ProgramFormat::Csv)
      writer_.emplace(alone.machine.control,
                      program::LocationOptions{
                          .kind = options.to == ProgramFormat::Cl ? Kind::Apt : Kind::Table,
                          .within = options.within});
  }

  void add(const program::Path& piece) {
    meter_.add(piece);
    if (writer_) writer_->add(piece);
  }

  /// Does the same while the next segment is read. An exception is thrown with the next segment or
  /// at the end, unless the reading ends earlier with errors of its own.
  void add_beside(program::Path piece) {
    wait();
    beside_ = std::async(std::launch::async, [this, piece = std::move(piece)] { add(piece); });
  }

  void finish(ProgramInspection& alone) {
    wait();
    alone.figures = meter_.figures();
    if (!writer_) return;
    alone.converted = writer_->take();
    if (writer_->omitted_dwells() + writer_->omitted_words() > 0)
      alone.notes.push_back(fmt::format(
          "{} dwells and {} words of tools, coolant and stops are left out: a table has none",
          writer_->omitted_dwells(), writer_->omitted_words()));
  }

 private:
  void wait() {
    if (beside_.valid()) beside_.get();
  }

  program::PathMeter meter_;
  Tracer tracer_;
  std::optional<program::LocationWriter> writer_;
  std::future<void> beside_;  // last member: its thread must end before the members it uses
};

/// Reads a program and fills the inspection; the whole path is kept only for conversions that need
/// it.
void read_alone(const std::string& text, const program::NcOptions& control,
                const ProgramInspectionOptions& options, const Progress& progress,
                ProgramInspection& alone) {
  Looking looking(alone, control, options);
  const bool whole = options.to == ProgramFormat::Nc || options.to == ProgramFormat::Pvt;
  program::Path path;
  if (is_pvt(alone.file, text, options)) {
    if (options.interpreter == dialects::Interpreter::LinuxCnc)
      throw BadInput(alone.file.string(), 0, 0,
                     "a program of LinuxCNC beside --interpreter linuxcnc", "a table of times");
    // A table of times has no NC words to count.
    path = program::read_pvt(text, alone.file.string(), control);
    alone.dialect = "pvt";
    alone.executed = path.blocks.size();
    looking.add(path);
  } else {
    dialects::ReadOptions read{.control = control,
                               .dialect = options.dialect,
                               .on_unknown = options.on_unknown,
                               .startup_code = options.startup_code,
                               .interpreter = options.interpreter,
                               .interpreter_limits = options.interpreter_limits,
                               .pole = options.pole,
                               .turning = options.turning};
    read.limits.blocks = read.control.max_moves = std::size_t(options.max_moves);
    read.control.max_move_bytes = max_move_bytes();
    read.folder = alone.file.has_parent_path() ? alone.file.parent_path() : ".";
    // Without a conversion only one segment is in memory at a time.
    if (!whole)
      read.on_path_segment = [&](program::Path piece) { looking.add_beside(std::move(piece)); };
    if (progress) read.progress = [&](double fraction) { progress("read", fraction); };
    dialects::ReadProgram done = dialects::read_program(text, alone.file.string(), read);
    if (whole) looking.add(done.path);
    alone.dialect = name_of(done.dialect);
    alone.sign = done.sign;
    alone.turning = done.turning;
    alone.executed = done.blocks;
    alone.skipped = std::move(done.skipped);
    alone.warnings = std::move(done.warnings);
    if (progress) progress("words", 0.0);
    alone.words = dialects::used_words(text, done.dialect, done.turning);
    path = std::move(done.path);
  }
  looking.finish(alone);
  alone.more_files = path.more_files;
  alone.assumptions = path.assumptions;
  alone.tools = tools_of(path.tool_calls, alone.figures.blocks);
  alone.tool_comments = path.tool_comments;
  if (whole) convert(path, control, options, alone);
}

}  // namespace

ProgramInspection inspect_program(const std::filesystem::path& program,
                                  const ProgramInspectionOptions& options,
                                  const Progress& progress) {
  const std::filesystem::path machine_file = machine_file_of(options.machine);
  const Scene scene = scene_of(machine_file, options);
  const Machine machine = compile(scene);
  const program::NcOptions control = control_of(scene, machine, options);
  if (progress) progress("read", 0.0);
  const std::string text = read_text(program, control.max_bytes);
  ProgramInspection alone{.file = program,
                          .dialect = {},
                          .sign = {},
                          .interpreter = options.interpreter,
                          .machine_name = scene.machine.name,
                          .machine_file = machine_file,
                          .tool_length = options.tool_length,
                          .tool_table = options.tools,
                          .offset_table = options.offsets,
                          .offset = options.offset,
                          .description = scene.machine,
                          .machine = machine};
  // the last line may lack its line end
  alone.lines = std::size_t(std::count(text.begin(), text.end(), '\n'));
  if (!text.empty() && text.back() != '\n') ++alone.lines;
  alone.bytes = text.size();
  const bool points = options.to == ProgramFormat::Cl || options.to == ProgramFormat::Csv;
  if (const int s = program::find_spindle(control.axes);
      points && s >= 0 && control.axes[std::size_t(s)].motion == kinematics::Motion::Rotary)
    throw BadInput(machine_file.string(), 0, 0,
                   "a machine whose workpiece does not spin, for cutter locations", "one with S");
  read_alone(text, control, options, progress, alone);
  std::set<int> called;
  for (const auto& [number, blocks] : alone.figures.offsets)
    if (number >= 0) called.insert(number + 1);
  for (const auto* table : {&scene.program.tools, &scene.program.offsets})
    if (*table)
      add_warnings(
          table_warnings((*table)->table, alone.dialect == "pvt" ? "" : alone.dialect, called),
          alone.warnings);
  judge(options, alone);
  return alone;
}

}  // namespace abbe::sim
