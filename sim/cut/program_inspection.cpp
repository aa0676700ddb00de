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

constexpr int max_tool_number = 999;  // a control without a table knows all H and D up to it
constexpr std::size_t max_trace = 2'000'000;  // points of a picture, 14 bytes each

/// Returns the file of a machine.
/// @param name  a path, or a name of the library with or without `library:`
std::filesystem::path find_machine_file(const std::string& name) {
  const bool is_name = name.find_first_of("/.:") == std::string::npos;
  std::error_code error;
  // A file of that name in the current folder precedes the library.
  const bool is_file = std::filesystem::is_regular_file(name, error);
  const std::string library_name = is_name && !is_file ? std::string(library_prefix) + name : name;
  InputErrors input_errors;
  const SourcePosition place{std::make_shared<const std::string>("--machine"), 0, 0, true};
  std::filesystem::path file = locate_file({library_name, place, "machines"}, ".", input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  return file;
}

/// Returns a scene with only a machine, a tool of the given length, and the tables of the control.
Scene make_scene(const std::filesystem::path& file, const ProgramInspectionOptions& options) {
  Scene scene;
  scene.file = file;
  InputErrors input_errors;
  scene.machine = read_machine(read_toml_file(file), input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  scene.tool.length = options.tool_length;
  const auto read_table = [&](const std::filesystem::path& file, dialects::ControlTableKind kind) {
    return ControlTableFile{file, options.table_unit,
                            dialects::read_control_table_file(file, kind, options.table_unit)};
  };
  if (!options.tools.empty())
    scene.program.tools = read_table(options.tools, dialects::ControlTableKind::Tools);
  if (!options.offsets.empty()) {
    scene.program.offsets = read_table(options.offsets, dialects::ControlTableKind::Offsets);
    check_offset_axes(scene.program.offsets->table, scene.machine.joints, input_errors);
    if (!input_errors.empty()) throw BadScene(input_errors.list());
  }
  for (int h = 1; h <= max_tool_number; ++h) scene.program.tool_length[h] = options.tool_length;
  return scene;
}

program::NcOptions make_control(const Scene& scene, const Machine& machine,
                                const ProgramInspectionOptions& options) {
  program::NcOptions control = nc_options(scene, machine);
  control.block_skip = options.block_skip;
  if (!options.offset.empty())
    control.work_offset.fill(
        parse_positions(options.offset, machine.control, "--offset", Within::Anything));
  if (scene.program.tools) {
    // G43.4 with the H of a tool needs the control's chain to the tip of that tool.
    for (const auto& [number, length] : control.tool_length) {
      Scene select_tool = scene;
      select_tool.tool.number = number;
      control.control_by_h.emplace(number, make_machine(select_tool).control);
    }
    return control;
  }
  control.tool_radius.clear();
  if (options.tool_radius)
    for (int d = 1; d <= max_tool_number; ++d) control.tool_radius[d] = *options.tool_radius;
  return control;
}

// Returns true if a program is a table of times, by its suffix or by its first line.
bool is_pvt(const std::filesystem::path& file, std::string_view text,
            const ProgramInspectionOptions& options) {
  if (options.dialect != dialects::Dialect::Auto) return false;
  if (file.extension() == ".pvt") return true;
  LineReader lines(text);
  while (const auto line = lines.next())
    if (!line->empty() && line->front() != '#') return line->starts_with("time_s");
  return false;
}

/// Records every point of a trace until there are too many, then every second one, and so on, so
/// that the memory is bounded for a program of unknown length.
class TraceRecorder {
 public:
  explicit TraceRecorder(TipTrace& trace) : trace_(trace) {}

  void add(const Eigen::Vector3d& tip_w, bool rapid) {
    // A recorded point is rapid if a move since the previous one is.
    has_rapid_ = has_rapid_ || rapid;
    if (point_count_++ % stride_ != 0) return;
    trace_.places.push_back(tip_w.cast<float>());
    trace_.rapid.push_back(has_rapid_);
    has_rapid_ = false;
    if (trace_.places.size() < max_trace) return;
    stride_ *= 2;
    std::size_t kept_count = 0;
    for (std::size_t i = 0; i < trace_.places.size(); i += 2, ++kept_count) {
      trace_.places[kept_count] = trace_.places[i];
      trace_.rapid[kept_count] = trace_.rapid[i] || (i > 0 && trace_.rapid[i - 1]);
    }
    trace_.places.resize(kept_count);
    trace_.rapid.resize(kept_count);
  }

 private:
  TipTrace& trace_;
  std::size_t point_count_ = 0, stride_ = 1;
  bool has_rapid_ = false;
};

/// Returns the tools called by M6, or by T if the program has no M6.
std::vector<ProgramTool> program_tools(const std::vector<program::ToolCall>& calls,
                                       std::size_t blocks) {
  const bool has_m6 = std::any_of(calls.begin(), calls.end(),
                                  [](const program::ToolCall& call) { return call.changes; });
  std::vector<ProgramTool> tools;
  std::size_t first_block = 0;
  ProgramTool* current = nullptr;
  const auto end_current_at = [&](std::size_t block) {
    if (current != nullptr) current->blocks += block - first_block;
    first_block = block;
  };
  tools.reserve(calls.size());
  for (const program::ToolCall& call : calls) {
    if (call.changes != has_m6) continue;
    end_current_at(call.before);
    auto tool = std::find_if(tools.begin(), tools.end(), [&](const ProgramTool& listed) {
      return listed.number == call.number;
    });
    if (tool == tools.end()) tool = tools.insert(tools.end(), {call.number, call.line, 0, 0});
    ++tool->calls;
    current = &*tool;
  }
  end_current_at(blocks);
  return tools;
}

/// Adds warnings about axes beyond their travel, poles, and moves slowed down by axis limits.
void add_machine_warnings(const ProgramInspectionOptions& options, ProgramInspection& inspection) {
  constexpr double tolerance = 1e-6;  // mm or rad, for the rounding of programmed numbers
  for (int j = 0; j < inspection.machine.control.size(); ++j) {
    const kinematics::Joint& joint = inspection.machine.control.joints()[std::size_t(j)];
    const program::AxisFigures& axis = inspection.figures.axes[std::size_t(j)];
    if (!axis.has_position || axis.remaining_travel >= -tolerance) continue;
    inspection.beyond_travel = true;
    const double unit = joint.motion == kinematics::Motion::Rotary ? units::deg : 1.0;
    const program::ValueAtLine& extreme =
        axis.lowest.value < joint.min ? axis.lowest : axis.highest;
    inspection.warnings.push_back(fmt::format(
        "{} exceeds its travel of {:.6g} to {:.6g} {} by {:.6g}, on line {} with {:.6g}",
        joint.name, joint.min / unit, joint.max / unit, unit == 1.0 ? "mm" : "deg",
        -axis.remaining_travel / unit, extreme.line, extreme.value / unit));
  }
  if (const auto& pole = inspection.figures.pole)
    if (std::string text = pole_text(*pole, inspection.machine.control, options.pole_warning,
                                     inspection.subprogram_files);
        !text.empty())
      inspection.warnings.push_back(std::move(text));
  if (inspection.figures.slowed_moves > 0)
    inspection.warnings.push_back(
        fmt::format("{} feed moves exceed an axis speed limit, by a factor of {:.3g} on line {}: a "
                    "control would slow them down",
                    inspection.figures.slowed_moves, inspection.figures.max_slow_down.value,
                    inspection.figures.max_slow_down.line));
}

/// Converts a path to the requested format.
void convert(const program::Path& path, const program::NcOptions& control,
             const ProgramInspectionOptions& options, ProgramInspection& inspection) {
  if (options.to == ProgramFormat::Pvt) {
    const program::PvtConversion pvt =
        program::convert_to_pvt(path, inspection.machine.control, {.within = options.within});
    std::vector<int> columns;
    for (int j = 0; j < inspection.machine.control.size(); ++j)
      if (inspection.figures.axes[std::size_t(j)].has_position) columns.push_back(j);
    inspection.converted = program::write_pvt(pvt.rows, control.axes, columns);
    inspection.notes.push_back(
        fmt::format("{} rows, at most {:.3g} um from the path (rotary axes at a radius of 100 mm); "
                    "the spindle is omitted",
                    pvt.rows.size(), pvt.max_deviation * 1e3));
    return;
  }
  std::vector<std::vector<program::CorrectedPoint>> points(path.blocks.size());
  std::size_t chords = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const program::Block& block = path.blocks[i];
    if (block.interpolation != program::Interpolation::Arc ||
        path.arcs[block.shape].plane_rotation < 0)
      continue;  // only an arc in a plane without NC code becomes chords
    const std::size_t chord_count =
        program::chords_of(path, block, inspection.machine.control, options.within);
    for (std::size_t k = 1; k <= chord_count; ++k) {
      const double fraction = double(k) / double(chord_count);
      points[i].push_back({fraction, program::position(path, block, fraction), {}, {}});
    }
    chords += chord_count;
  }
  // The written positions contain the offsets, so the control must add none.
  program::NcOptions without_offsets = control;
  without_offsets.work_offset = {};
  without_offsets.extra_offsets.clear();
  inspection.converted = program::rewrite_program(path, points, without_offsets,
                                                  // finer than any control reads
                                                  {.word_mm = 1e-6, .word_rad = 1e-6 * units::deg})
                             .text;
  if (chords > 0)
    inspection.notes.push_back(
        fmt::format("arcs in planes without an NC word were replaced by {} chords within {:.4g} um",
                    chords, options.within * 1e3));
  inspection.notes.push_back(
      "RS274/NGC with all offsets applied; X Y Z under G43.4 are the tip position in the "
      "workpiece");
}

}  // namespace

std::vector<std::filesystem::path> inspection_inputs(const std::filesystem::path& program,
                                                     const ProgramInspectionOptions& options) {
  std::vector<std::filesystem::path> files{program, find_machine_file(options.machine)};
  for (const std::filesystem::path& table : {options.tools, options.offsets})
    if (!table.empty()) files.push_back(table);
  return files;
}

namespace {

/// Measures, traces and converts the segments of a program while it is read.
class ProgramMeter {
 public:
  ProgramMeter(ProgramInspection& inspection, const program::NcOptions& control,
               const ProgramInspectionOptions& options)
      : meter_(inspection.machine.control,
               {inspection.description.rapid_speed, inspection.description.rapid_rotation_speed,
                options.pole_warning},
               &control.control_by_h),
        tracer_(inspection.trace) {
    if (options.trace)
      meter_.on_tip_point = [this](const Eigen::Vector3d& tip_w, bool rapid) {
        tracer_.add(tip_w, rapid);
      };
    using Kind = program::LocationOptions::Kind;
    if (options.to == ProgramFormat::Cl || options.to == ProgramFormat::Csv)
      writer_.emplace(inspection.machine.control,
                      program::LocationOptions{
                          .kind = options.to == ProgramFormat::Cl ? Kind::Apt : Kind::Table,
                          .within = options.within});
  }

  void add(const program::Path& segment) {
    meter_.add(segment);
    if (writer_) writer_->add(segment);
  }

  /// Adds a segment in a thread of its own while the next segment is read. An exception in the
  /// thread is thrown at the next segment or at the end.
  void add_in_background(program::Path segment) {
    wait();
    background_ =
        std::async(std::launch::async, [this, segment = std::move(segment)] { add(segment); });
  }

  void finish(ProgramInspection& inspection) {
    wait();
    inspection.figures = meter_.figures();
    if (!writer_) return;
    inspection.converted = writer_->take();
    if (writer_->omitted_dwells() + writer_->omitted_words() > 0)
      inspection.notes.push_back(
          fmt::format("{} dwells and {} words for tools, coolant and stops are omitted: a table "
                      "cannot hold them",
                      writer_->omitted_dwells(), writer_->omitted_words()));
  }

 private:
  void wait() {
    if (background_.valid()) background_.get();
  }

  program::PathMeter meter_;
  TraceRecorder tracer_;
  std::optional<program::LocationWriter> writer_;
  std::future<void> background_;  // the last member, since its thread uses those above
};

/// Reads a program and fills the inspection. The whole path is kept only if the conversion needs
/// it.
void read_and_measure(const std::string& text, const program::NcOptions& control,
                      const ProgramInspectionOptions& options, const Progress& progress,
                      ProgramInspection& inspection) {
  ProgramMeter meter(inspection, control, options);
  const bool needs_path = options.to == ProgramFormat::Nc || options.to == ProgramFormat::Pvt;
  program::Path path;
  if (is_pvt(inspection.file, text, options)) {
    if (options.interpreter == dialects::Interpreter::LinuxCnc)
      throw BadInput(inspection.file.string(), 0, 0,
                     "a LinuxCNC program with --interpreter linuxcnc", "a table of times");
    path = program::read_pvt(text, inspection.file.string(), control);
    inspection.dialect = "pvt";
    inspection.executed = path.blocks.size();
    meter.add(path);
  } else {
    dialects::ReadOptions read_options{.control = control,
                                       .dialect = options.dialect,
                                       .on_unknown = options.on_unknown,
                                       .startup_code = options.startup_code,
                                       .interpreter = options.interpreter,
                                       .interpreter_limits = options.interpreter_limits,
                                       .pole = options.pole,
                                       .turning = options.turning};
    read_options.limits.blocks = read_options.control.max_moves = std::size_t(options.max_moves);
    read_options.control.max_move_bytes = max_move_bytes();
    read_options.subprogram_folder =
        inspection.file.has_parent_path() ? inspection.file.parent_path() : ".";
    // Unless the conversion needs the path, only one segment is in memory at a time.
    if (!needs_path)
      read_options.on_path_segment = [&](program::Path segment) {
        meter.add_in_background(std::move(segment));
      };
    if (progress) read_options.progress = [&](double fraction) { progress("read", fraction); };
    dialects::ParsedProgram result =
        dialects::read_program(text, inspection.file.string(), read_options);
    if (needs_path) meter.add(result.path);
    inspection.dialect = name_of(result.dialect);
    inspection.dialect_evidence = result.sign;
    inspection.turning = result.turning;
    inspection.executed = result.blocks;
    inspection.skipped = std::move(result.skipped);
    inspection.warnings = std::move(result.warnings);
    if (progress) progress("words", 0.0);
    inspection.words = dialects::used_words(text, result.dialect, result.turning);
    path = std::move(result.path);
  }
  meter.finish(inspection);
  inspection.subprogram_files = path.subprogram_files;
  inspection.assumptions = path.assumptions;
  inspection.tools = program_tools(path.tool_calls, inspection.figures.blocks);
  inspection.tool_comments = path.tool_comments;
  if (needs_path) convert(path, control, options, inspection);
}

}  // namespace

ProgramInspection inspect_program(const std::filesystem::path& program,
                                  const ProgramInspectionOptions& options,
                                  const Progress& progress) {
  const std::filesystem::path machine_file = find_machine_file(options.machine);
  const Scene scene = make_scene(machine_file, options);
  const Machine machine = make_machine(scene);
  const program::NcOptions control = make_control(scene, machine, options);
  if (progress) progress("read", 0.0);
  const std::string text = read_text(program, control.max_bytes);
  ProgramInspection inspection{.file = program,
                               .dialect = {},
                               .dialect_evidence = {},
                               .interpreter = options.interpreter,
                               .machine_name = scene.machine.name,
                               .machine_file = machine_file,
                               .tool_length = options.tool_length,
                               .tool_table = options.tools,
                               .offset_table = options.offsets,
                               .offset = options.offset,
                               .description = scene.machine,
                               .machine = machine};
  // The last line may lack its line end.
  inspection.lines = std::size_t(std::count(text.begin(), text.end(), '\n'));
  if (!text.empty() && text.back() != '\n') ++inspection.lines;
  inspection.bytes = text.size();
  const bool points = options.to == ProgramFormat::Cl || options.to == ProgramFormat::Csv;
  if (const int s = program::find_spindle(control.axes);
      points && s >= 0 && control.axes[std::size_t(s)].motion == kinematics::Motion::Rotary)
    throw BadInput(machine_file.string(), 0, 0,
                   "a machine whose workpiece does not spin, for cutter locations",
                   "a machine with S");
  read_and_measure(text, control, options, progress, inspection);
  std::set<int> called;
  for (const auto& [number, blocks] : inspection.figures.offsets)
    if (number >= 0) called.insert(number + 1);
  for (const auto* table : {&scene.program.tools, &scene.program.offsets})
    if (*table)
      add_warnings(table_warnings((*table)->table,
                                  inspection.dialect == "pvt" ? "" : inspection.dialect, called),
                   inspection.warnings);
  add_machine_warnings(options, inspection);
  return inspection;
}

}  // namespace abbe::sim
