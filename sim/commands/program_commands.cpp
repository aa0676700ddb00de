#include "sim/commands/program_commands.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/cut/placement.h"
#include "sim/cut/program_inspection.h"
#include "sim/cut/run_estimate.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/loop/correction_channels.h"
#include "sim/loop/correctors.h"
#include "sim/report/picture_files.h"
#include "sim/report/program_report.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {

namespace {

/// Arguments of `abbe program`.
struct ProgramArguments {
  std::filesystem::path file;
  std::string to, dialect = "auto", unit = "as_stated", interpreter = "abbe";
  bool picture = false, skip_unknown = false;
  double tool_radius = 0.0, tolerance_um = 1.0;
  std::string pole = "as_programmed";
  std::string block_skip = "on";
  std::string control = "of_machine", x_words = "of_control";
  double pole_near_deg = 0.0, pole_change_deg = 0.0, pole_warning_deg = 2.0;
  ProgramInspectionOptions options;
};

constexpr double min_progress_bytes = 4e6;  // size of a program from which progress is shown

/// Returns the format of a name; nothing for an empty name. The parser has checked the names.
std::optional<ProgramFormat> parse_format(const std::string& name) {
  if (name == "cl") return ProgramFormat::Cl;
  if (name == "nc") return ProgramFormat::Nc;
  if (name == "pvt") return ProgramFormat::Pvt;
  if (name == "csv") return ProgramFormat::Csv;
  return std::nullopt;
}

/// Returns the dialect of a name, which the parser has checked.
dialects::Dialect parse_dialect(const std::string& name) {
  using dialects::Dialect;
  for (const Dialect dialect :
       {Dialect::LinuxCnc, Dialect::Fanuc, Dialect::Siemens, Dialect::Heidenhain, Dialect::Cl})
    if (name == dialects::name_of(dialect)) return dialect;
  return Dialect::Auto;
}

/// Returns the rule near a pole. The rule of Fanuc needs two parameters of the control, which have
/// no default.
dialects::PoleOptions pole_options(const ProgramArguments& arguments) {
  using dialects::PoleRule;
  const bool is_fanuc = arguments.pole == "fanuc";
  if (is_fanuc && !(arguments.pole_near_deg > 0.0))
    throw BadUsage("--pole", "expected --pole-near and --pole-change with fanuc");
  if (!is_fanuc && (arguments.pole_near_deg != 0.0 || arguments.pole_change_deg != 0.0))
    throw BadUsage("--pole-near", "expected --pole fanuc and --pole-change with it");
  const PoleRule rule = is_fanuc                       ? PoleRule::Fanuc
                        : arguments.pole == "linuxcnc" ? PoleRule::LinuxCnc
                        : arguments.pole == "siemens"  ? PoleRule::Siemens
                                                       : PoleRule::AsProgrammed;
  return {rule, arguments.pole_near_deg * units::deg, arguments.pole_change_deg * units::deg};
}

/// Returns the options for programs of a turning control.
dialects::TurningOptions turning_options(const ProgramArguments& arguments) {
  using dialects::ControlKind, dialects::XWordMeaning;
  dialects::TurningOptions turning = arguments.options.turning;
  turning.control_kind = arguments.control == "milling"   ? ControlKind::Milling
                         : arguments.control == "turning" ? ControlKind::Turning
                                                          : ControlKind::FromMachine;
  turning.x_words = arguments.x_words == "diameters" ? XWordMeaning::Diameters
                    : arguments.x_words == "radii"   ? XWordMeaning::Radii
                                                     : XWordMeaning::FromControl;
  return turning;
}

/// Returns the extension with which a converted program is written.
const char* format_extension(ProgramFormat format) {
  switch (format) {
    case ProgramFormat::Cl:
      return ".cls";
    case ProgramFormat::Nc:
      return ".ngc";
    case ProgramFormat::Pvt:
      return ".pvt";
    case ProgramFormat::Csv:
      break;
  }
  return ".csv";
}

/// Returns the folder stated by --out; out/NAME by default.
std::filesystem::path output_folder(const CommonOptions& common,
                                    const ProgramArguments& arguments) {
  return common.out.empty() ? std::filesystem::path("out") / arguments.file.stem() : common.out;
}

/// The output files that were requested and written.
struct WrittenFiles {
  std::optional<std::filesystem::path> picture, program;
};

/// Writes the picture and the converted program.
WrittenFiles write(const ResultFolder& folder, const ProgramArguments& arguments,
                   const ProgramInspection& inspection) {
  WrittenFiles written;
  if (arguments.picture) {
    write_program_picture(folder / "path.png", inspection);
    written.picture = (folder / "path.png").path();
  }
  if (arguments.options.to) {
    const std::string name =
        arguments.file.stem().string() + format_extension(*arguments.options.to);
    write_file(folder / name, inspection.converted);
    written.program = (folder / name).path();
  }
  return written;
}

/// Prints the inspection and the files written.
void print_result(const CommonOptions& common, const ProgramInspection& inspection,
                  const WrittenFiles& written) {
  if (common.json) {
    nlohmann::ordered_json json = to_json(inspection);
    if (written.picture) json["picture"] = written.picture->string();
    if (written.program)
      json["written"] = {{"file", written.program->string()},
                         {"bytes", inspection.converted.size()},
                         {"notes", inspection.notes}};
    print("{}", MultilineText(json_text(json)));
  } else {
    print("{}", MultilineText(to_text(inspection)));
    if (written.picture) print("picture   {}\n", written.picture->string());
    if (written.program)
      print("written   {}, {} bytes\n", written.program->string(), inspection.converted.size());
    for (const std::string& note : inspection.notes) print("          {}\n", note);
  }
  print_assumptions(inspection.assumptions);
  print_warnings(inspection.warnings);
}

/// Inspects a program without a scene. The exit code is 3 if an axis leaves its travel, because the
/// machine could not run the program.
Exit inspect(const CommonOptions& common, ProgramArguments arguments) {
  arguments.options.to = parse_format(arguments.to);
  arguments.options.dialect = parse_dialect(arguments.dialect);
  if (arguments.interpreter == "linuxcnc")
    arguments.options.interpreter = dialects::Interpreter::LinuxCnc;
  const auto levels = program::parse_block_skip(arguments.block_skip);
  if (!levels) throw BadUsage("--block-skip", "expected on, off or levels such as \"1 3\"");
  arguments.options.block_skip = *levels;
  if (arguments.skip_unknown) arguments.options.on_unknown = dialects::UnknownWordPolicy::Warn;
  if (arguments.tool_radius > 0.0) arguments.options.tool_radius = arguments.tool_radius;
  if (arguments.unit != "as_stated")
    arguments.options.table_unit = arguments.unit == "mm" ? 1.0 : units::inch;
  // The converted program has no tool calls, so a single tool length must apply.
  if (!arguments.options.tools.empty() && arguments.options.to)
    throw BadUsage("--to", "expected no --tools: the written program assumes one tool length");
  if (!arguments.options.offsets.empty() && !arguments.options.offset.empty())
    throw BadUsage("--offsets", "expected no --offset with it");
  if (!(arguments.tolerance_um > 0.0)) throw BadUsage("--tolerance-um", "expected more than 0");
  arguments.options.within = arguments.tolerance_um * units::um;
  arguments.options.pole = pole_options(arguments);
  arguments.options.turning = turning_options(arguments);
  arguments.options.pole_warning = arguments.pole_warning_deg * units::deg;
  arguments.options.trace = arguments.picture;
  const bool has_output = arguments.picture || arguments.options.to;
  const std::filesystem::path folder = output_folder(common, arguments);
  const Writer writer{common.permissions, inspection_inputs(arguments.file, arguments.options)};
  if (has_output) check_folder(folder, writer);  // before a long program is read
  std::error_code size_error;
  const double bytes = double(std::filesystem::file_size(arguments.file, size_error));
  std::optional<ProgressLine> progress;
  if (!size_error && bytes > min_progress_bytes) {
    progress.emplace(
        std::vector<Stage>{{"program", "read", 1e-7 * bytes}, {"program", "words", 1e-8 * bytes}});
    progress->begin("program");
  }
  const ProgramInspection inspection = inspect_program(
      arguments.file, arguments.options, progress ? progress_function(*progress) : Progress{});
  progress.reset();
  print_result(
      common, inspection,
      has_output ? write(ResultFolder(folder, writer), arguments, inspection) : WrittenFiles{});
  return inspection.beyond_travel ? Exit::Input : Exit::Ok;
}

}  // namespace

Command program_command(CommonOptions& common) {
  const auto arguments = std::make_shared<ProgramArguments>();
  return {
      "program",
      "Analyse a program on a machine: moves, time, extents, travel",
      {"abbe program scenes/programs/face_milling.ngc --machine three_axis_table --picture",
       "abbe program scenes/programs/thin_wall.ngc --tool-length 80 --to cl --out out/thin_wall"},
      {{"FILE", &arguments->file, "a program, in any dialect of sim/dialects/README.md, or PVT"},
       {"--machine", &arguments->options.machine,
        "a machine file, or a name of the library (library:gantry_cxyza)", TypeName{"NAME"}},
       {"--tool-length", &arguments->options.tool_length,
        "distance from the spindle nose to the tip for every tool, mm", NumberRange{0, 10000}},
       {"--tool-radius", &arguments->tool_radius, "radius for cutter compensation, mm (none)",
        NumberRange{0, 10000}},
       {"--offset", &arguments->options.offset,
        "offset for each of G54 to G59, mm and degrees: \"X=10 Z=-50\" (zero)", TypeName{"WORDS"}},
       {"--tools", &arguments->options.tools,
        "tool table of the control (LinuxCNC, Fanuc, Siemens, Heidenhain), instead of "
        "--tool-length and --tool-radius"},
       {"--offsets", &arguments->options.offsets,
        "file with the work offsets of the control, instead of --offset"},
       {"--unit", &arguments->unit,
        "unit of lengths in these two files; required if they do not state it",
        OneOf{{"as_stated", "mm", "inch"}}},
       {"--dialect", &arguments->dialect, "dialect of the program",
        OneOf{{"auto", "linuxcnc", "fanuc", "siemens", "heidenhain", "cl"}}},
       {"--block-skip", &arguments->block_skip,
        "blocks after a /: on skips them, off executes them, \"1 3\" skips these levels (on)",
        TypeName{"LEVELS"}},
       {"--startup-code", &arguments->options.startup_code,
        "block to execute before the first line: \"G20 G91\", \"T1 M6\"", TypeName{"BLOCK"}},
       {"--control", &arguments->control,
        "kind of control; of_machine: turning if a spindle rotates the workpiece",
        OneOf{{"of_machine", "milling", "turning"}}},
       {"--x-words", &arguments->x_words, "meaning of X words until the program changes it",
        OneOf{{"of_control", "diameters", "radii"}}},
       {"--tip", &arguments->options.turning.tip_number,
        "reference point of a turning tool for X and Z, 0 to 9 (0: centre of the nose radius)",
        NumberRange{0, 9}},
       {"--interpreter", &arguments->interpreter,
        "interpreter of LinuxCNC programs: abbe, or rs274 of LinuxCNC (./abbe setup --linuxcnc)",
        OneOf{{"abbe", "linuxcnc"}}},
       {"--interpreter-seconds", &arguments->options.interpreter_limits.seconds,
        "time limit of the LinuxCNC interpreter (120)", NumberRange{1, 1000000}},
       {"--interpreter-mb", &arguments->options.interpreter_limits.megabytes,
        "limit for the output of the LinuxCNC interpreter, about 120 bytes per move (4000)",
        NumberRange{1, 1000000}},
       {"--max-moves", &arguments->options.max_moves,
        "maximum number of moves, counting every pass of loops and cycles; more is an input error "
        "(20000000)",
        NumberRange{1, 2000000000}},
       {"--pole", &arguments->pole, "rule of the control for tool vectors and near a pole",
        OneOf{{"as_programmed", "linuxcnc", "fanuc", "siemens"}}},
       {"--pole-near", &arguments->pole_near_deg, "parameter 19738 of --pole fanuc, deg",
        NumberRange{0, 45}},
       {"--pole-change", &arguments->pole_change_deg, "parameter 19739 of --pole fanuc, deg",
        NumberRange{0, 90}},
       {"--pole-warning", &arguments->pole_warning_deg,
        "warn if closer to a pole than this, deg (2; 0: never)", NumberRange{0, 45}},
       {"--skip-unknown", &arguments->skip_unknown,
        "skip and count words that the dialect does not have"},
       {"--picture", &arguments->picture, "draw the machine and the path"},
       {"--to", &arguments->to,
        "write the program as cutter locations (APT or CSV), RS274/NGC or times and velocities",
        OneOf{{"cl", "nc", "pvt", "csv"}}},
       {"--tolerance-um", &arguments->tolerance_um,
        "tolerance for interpolating motion that the format cannot express, um",
        NumberRange{0, 1000000}},
       {"--out", &common.out, "folder for picture and program (out/NAME)"},
       json_option(common),
       force_option(common)},
      [arguments, &common] { return inspect(common, *arguments); },
      "The exit code is 3 if an axis leaves its travel. Times follow from speeds, without "
      "accelerations."};
}

namespace {

using nlohmann::ordered_json;
using Channel = CaseDescription::Channel;

/// Returns true if a case corrects through a rewritten program.
bool has_program_channel(const Scene& scene, const CaseDescription& compensator) {
  return channel_of(scene, compensator) == Channel::Program;
}

/// Returns the case of a name, or without a name the first case of the scene with a rewritten
/// program.
CaseDescription select_case(const Scene& scene, const std::string& name) {
  const std::string file = scene.file.string();
  if (!name.empty()) {
    CaseDescription compensator;
    try {
      compensator = parse_case(name);
    } catch (const std::invalid_argument& error) {
      throw BadInput(file, 0, 0, "a case that this scene can run", error.what());
    }
    if (!has_program_channel(scene, compensator))
      throw BadInput(file, 0, 0, "a case with channel program", "\"" + name + "\"");
    return compensator;
  }
  for (const CaseDescription& compensator : scene.cases)
    if (has_program_channel(scene, compensator)) return compensator;
  throw BadInput(file, 0, 0, "a case with channel program in [compare] cases, or --case", "none");
}

/// Returns the output file, with the extension of the original program, which selects the dialect.
ResultFile output_file_of_rewrite(const Job& job, const ProgramRewriteOptions& options) {
  const std::string name = "rewritten" + std::filesystem::path(job.path.file).extension().string();
  const std::filesystem::path output =
      options.out.empty() ? std::filesystem::path("out") / job.scene.file.stem() : options.out;
  return result_file(output_file(output, name), make_writer(job.scene, options.permissions));
}

/// Adds a value. `rms` is the sum of squares until the caller completes it.
void add_value(Spread& spread_json, double value) {
  spread_json.rms += value * value;
  spread_json.max = std::max(spread_json.max, value);
}

}  // namespace

namespace {

/// Adds the squares and the largest values of the changes of one tool.
void add_segment_change(const Segment& segment, const Commands& commands, ProgramChange& change) {
  for (std::size_t i = 0; i < commands.samples.states.size(); ++i) {
    // The fraction of the time of its block in the rewritten program gives the commanded axes.
    const program::Block& block = commands.path->blocks[std::size_t(commands.samples.block[i])];
    const double duration = block.end_s - block.start_s;
    const double u =
        duration > 0.0 ? (commands.samples.states[i].time_s - block.start_s) / duration : 1.0;
    const kinematics::Pose T = segment.machine.nominal.tool_in_workpiece(
        nominal_axes(segment.machine, *commands.path, block, u));
    const kinematics::Pose& nominal = commands.T_wt_nominal[i];
    add_value(change.tip, (T.translation() - nominal.translation()).norm());
    const Eigen::Vector3d a = T.linear().col(2), b = nominal.linear().col(2);
    // atan2 is exact for small angles; acos of the dot product has an error of 1e-8 rad.
    add_value(change.direction, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
}

}  // namespace

ProgramChange program_change(const Job& job, const Commands& commands) {
  ProgramChange change;
  const auto segments = job_segments(job);
  for (std::size_t i = 0; i < segments.size(); ++i)
    add_segment_change(segments[i], part_commands(commands, i), change);
  const std::size_t n = commands.samples.states.size();
  for (Spread* spread_json : {&change.tip, &change.direction})
    spread_json->rms = std::sqrt(spread_json->rms / double(std::max<std::size_t>(1, n)));
  return change;
}

RewriteOutcome rewrite(const std::filesystem::path& file, const ProgramRewriteOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = select_case(scene, options.case_name);
  if (!options.case_name.empty()) trust(scene, compensator);
  const auto remaining_stages = [&](const WorkSize& size) {
    return command_stages(compensator.name, size, scene, compensator) +
           rewriting_stages("write", size);
  };
  ProgressLine progress(scene_preparation_stages("prepare", expected_size(scene)) +
                        remaining_stages(expected_size(scene)));
  progress.begin("prepare");
  const Job job = prepare(scene, progress_function(progress));
  const ResultFile output = output_file_of_rewrite(job, options);
  progress.replan(remaining_stages(work_size(job)));
  progress.begin(compensator.name);
  const Commands commands = compensate(job, compensator, progress_function(progress));
  // A corrected program may leave the travel of an axis, and the control would then reject it.
  check_travel(job, commands);
  progress.begin("write");
  progress.report("words", 0.0);
  const ProgramChange change = program_change(job, commands);
  write_file(output, commands.rewritten_program);

  const CompensationDescription& compensation = scene.compensation;
  std::optional<RewriteOutcome::Words> word_resolution;
  if (!is_pvt(job.path))
    word_resolution = {compensation.word_resolution, compensation.angle_resolution / units::deg};
  std::vector<std::string> warnings = job.warnings;
  warnings.insert(warnings.end(), commands.warnings.begin(), commands.warnings.end());
  const Placement part_placement = placement(job);
  warnings.insert(warnings.end(), part_placement.warnings.begin(), part_placement.warnings.end());
  if (part_placement.fault)
    warnings.push_back(fmt::format("nothing of the part is cut: {}", part_placement.fault->what()));
  if (commands.not_converged > 0)
    warnings.push_back(fmt::format("{} of {} corrections did not converge", commands.not_converged,
                                   job.samples.states.size()));
  return {output.path(),
          compensator.name,
          std::size_t(job.path.motion_blocks),
          std::size_t(commands.path->motion_blocks),
          commands.rewritten_program.size(),
          change,
          path_tolerance(scene.compensation, job.path),
          word_resolution,
          commands.remaining_point_error,
          commands.remaining_direction_error,
          std::move(warnings)};
}

namespace {

ordered_json spread_json(const Spread& s, double unit) {
  return {{"rms", s.rms / unit}, {"max", s.max / unit}};
}

ordered_json to_json(const RewriteOutcome& outcome) {
  ordered_json word_resolution;
  if (outcome.words) word_resolution = {{"mm", outcome.words->mm}, {"deg", outcome.words->deg}};
  return {{"file", outcome.file.string()},
          {"case", outcome.case_name},
          {"blocks", {{"before", outcome.blocks_before}, {"after", outcome.blocks_after}}},
          {"bytes", outcome.bytes},
          {"correction_um", spread_json(outcome.correction.tip, units::um)},
          {"correction_urad", spread_json(outcome.correction.direction, units::urad)},
          {"path_tolerance_um", outcome.path_tolerance / units::um},
          {"words", word_resolution},
          {"left_um", outcome.remaining_point_error / units::um},
          {"left_urad", outcome.remaining_direction_error / units::urad},
          {"warnings", outcome.warnings}};
}

std::string to_text(const RewriteOutcome& outcome) {
  std::string text = fmt::format(
      "{} blocks became {}\ncorrection of the tip {:.4f} um RMS, {:.4f} um max; of the tool axis "
      "{:.4f} urad max\nwithin {:.4g} um of the corrected path",
      outcome.blocks_before, outcome.blocks_after, outcome.correction.tip.rms / units::um,
      outcome.correction.tip.max / units::um, outcome.correction.direction.max / units::urad,
      outcome.path_tolerance / units::um);
  if (outcome.words)
    text += fmt::format(", words rounded to {:.4g} mm and {:.4g} deg", outcome.words->mm,
                        outcome.words->deg);
  return text + fmt::format("\n{} ({}, {} bytes)\n", escaped(outcome.file.string()),
                            escaped(outcome.case_name), outcome.bytes);
}

/// Rewrites the program and prints the size of the correction.
Exit print_rewrite(const CommonOptions& common, const std::string& case_name) {
  ProgramRewriteOptions options;
  options.overrides = overrides(common);
  options.case_name = case_name;
  options.out = common.out;
  options.permissions = common.permissions;
  const RewriteOutcome outcome = rewrite(common.scene, options);
  print_warnings(outcome.warnings);
  print("{}", MultilineText(common.json ? json_text(to_json(outcome)) : to_text(outcome)));
  return Exit::Ok;
}

}  // namespace

Command rewrite_command(CommonOptions& common) {
  const auto case_name = std::make_shared<std::string>();
  return {"rewrite",
          "Write the program of a scene with the corrections of a compensator",
          {"abbe rewrite scenes/gantry_dome.toml --out out/dome.ngc",
           "abbe rewrite scenes/platform_plane.toml --case identified-position-program --out "
           "out/plane.csv"},
          scene_options(common, {{"--out", &common.out,
                                  "file for the program, or folder for it (out/SCENE/rewritten.*)"},
                                 force_option(common),
                                 trust_option(common),
                                 {"--case", case_name.get(),
                                  "belief-strategy-program (the first such case of the scene)"}}),
          [case_name, &common] { return print_rewrite(common, *case_name); }};
}

namespace {

using compensation::ControlFormat;

/// Returns the files of a control. The volumetric compensation of ISG takes deviations, all other
/// controls take tables of corrections.
compensation::ControlExport export_files(const Job& job, const LearnedCorrection& learn_correction,
                                         ControlFormat format) {
  const ControlView view = make_table_view(job);
  const kinematics::Chain& control = view.machine.control;
  try {
    if (format != ControlFormat::Isg)
      return compensation::to_control(correction_tables(view, learn_correction.corrector), control,
                                      format);
    if (!learn_correction.geometric)
      throw std::invalid_argument("expected identified geometric errors, seen none");
    return compensation::to_volumetric(*learn_correction.geometric, control, table_options(view));
  } catch (const std::logic_error& error) {  // including out_of_range: a table of the belief is too
                                             // short
    throw BadInput(job.scene.file.string(), 0, 0, "a correction that fits into tables",
                   error.what());
  }
}

}  // namespace

ExportOutcome export_tables(const std::filesystem::path& file, const ExportOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = parse_case(options.case_name);
  trust(scene, compensator);
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  const auto remaining_stages = [&](const WorkSize& size) {
    return command_stages(compensator.name, size, scene, compensator) +
           std::vector<Stage>{{"write", "tables", 0.5}};
  };
  ProgressLine progress(scene_preparation_stages("prepare", expected_size(scene)) +
                        remaining_stages(expected_size(scene)));
  progress.begin("prepare");
  const Job job = prepare(scene, progress_function(progress));
  progress.replan(remaining_stages(work_size(job)));
  progress.begin(compensator.name);
  const ControlFormat format =
      options.format.value_or(scene.compensation.table.format.value_or(ControlFormat::LinuxCnc));
  const LearnedCorrection correction =
      learn_correction(job, compensator, progress_function(progress));
  progress.begin("write");
  progress.report("tables", 0.0);
  const compensation::ControlExport output = export_files(job, correction, format);
  ExportOutcome outcome{scene.title, options.case_name, format, {}, output.omissions, output.notes};
  if (std::string text = table_tool_text(job); !text.empty())
    outcome.notes.push_back(std::move(text));
  for (const compensation::ControlFile& control_file : output.files) {
    write_file(folder / control_file.name, control_file.text);
    outcome.files.push_back((folder / control_file.name).path());
  }
  return outcome;
}

namespace {

nlohmann::ordered_json to_json(const ExportOutcome& outcome) {
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : outcome.files) files.push_back(file.string());
  return {{"scene", outcome.scene},
          {"case", outcome.case_name},
          {"format", compensation::to_string(outcome.format)},
          {"files", files},
          {"left_out", outcome.omissions},
          {"notes", outcome.notes}};
}

/// Arguments of `abbe export`.
struct ExportArguments {
  std::string format;
  ExportOptions options;
};

/// Exports the tables. Omissions are printed as warnings, because the control would not correct the
/// omitted errors.
Exit print_export(const CommonOptions& common, ExportArguments arguments) {
  arguments.options.overrides = overrides(common);
  arguments.options.folder = result_folder(common) / (common.out.empty() ? "tables" : "");
  arguments.options.permissions = common.permissions;
  using compensation::ControlFormat;
  for (const ControlFormat format : {ControlFormat::LinuxCnc, ControlFormat::Isg,
                                     ControlFormat::Siemens, ControlFormat::Heidenhain})
    if (arguments.format == compensation::to_string(format)) arguments.options.format = format;
  check_case(arguments.options.case_name);
  const ExportOutcome outcome = export_tables(common.scene, arguments.options);
  if (common.json) {
    print("{}", MultilineText(json_text(to_json(outcome))));
    return Exit::Ok;
  }
  for (const std::filesystem::path& file : outcome.files) print("{}\n", file.string());
  for (const std::string& note : outcome.notes) print("{}\n", note);
  for (const std::string& omission : outcome.omissions)
    print(stderr, "abbe: warning: omitted: {}\n", omission);
  return Exit::Ok;
}

}  // namespace

Command export_command(CommonOptions& common) {
  const auto arguments = std::make_shared<ExportArguments>();
  return {
      "export",
      "Write the compensation tables of a scene in the format of a control",
      {"abbe export scenes/platform_plane.toml --out out/tables",
       "abbe export scenes/gantry_channels.toml --format siemens --case perfect-position-table "
       "--out out/siemens"},
      scene_options(common, {{"--out", &common.out, "folder for the tables (out/SCENE/tables)"},
                             force_option(common),
                             trust_option(common),
                             {"--format", &arguments->format,
                              "control format (as in [compensation.table], else linuxcnc)",
                              OneOf{{"linuxcnc", "isg", "siemens", "heidenhain"}}},
                             {"--case", &arguments->options.case_name,
                              "case whose corrections are written (identified-position-table)"}}),
      [arguments, &common] { return print_export(common, *arguments); }};
}

}  // namespace abbe::sim
