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

/// Arguments of the command line.
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

constexpr double min_progress_bytes = 4e6;  // bytes from which progress is shown

/// Return the format and the dialect of a name; the parser has checked the names.
std::optional<ProgramFormat> format_of(const std::string& word) {
  if (word == "cl") return ProgramFormat::Cl;
  if (word == "nc") return ProgramFormat::Nc;
  if (word == "pvt") return ProgramFormat::Pvt;
  if (word == "csv") return ProgramFormat::Csv;
  return std::nullopt;
}

dialects::Dialect dialect_of(const std::string& word) {
  using dialects::Dialect;
  for (const Dialect one :
       {Dialect::LinuxCnc, Dialect::Fanuc, Dialect::Siemens, Dialect::Heidenhain, Dialect::Cl})
    if (word == dialects::name_of(one)) return one;
  return Dialect::Auto;
}

/// Returns the rule near a pole. Fanuc's rule needs the values of two parameters of the control,
/// which have no default.
dialects::PoleOptions pole_of(const ProgramArguments& words) {
  using dialects::PoleRule;
  const bool fanuc = words.pole == "fanuc";
  if (fanuc && !(words.pole_near_deg > 0.0))
    throw BadUsage("--pole", "expected --pole-near and --pole-change beside fanuc");
  if (!fanuc && (words.pole_near_deg != 0.0 || words.pole_change_deg != 0.0))
    throw BadUsage("--pole-near", "expected --pole fanuc beside it and --pole-change");
  const PoleRule rule = fanuc                      ? PoleRule::Fanuc
                        : words.pole == "linuxcnc" ? PoleRule::LinuxCnc
                        : words.pole == "siemens"  ? PoleRule::Siemens
                                                   : PoleRule::AsProgrammed;
  return {rule, words.pole_near_deg * units::deg, words.pole_change_deg * units::deg};
}

/// Returns the options for programs of a turning control.
dialects::TurningOptions turning_of(const ProgramArguments& words) {
  using dialects::ControlKind, dialects::XWordMeaning;
  dialects::TurningOptions turning = words.options.turning;
  turning.control = words.control == "milling"   ? ControlKind::Milling
                    : words.control == "turning" ? ControlKind::Turning
                                                 : ControlKind::FromMachine;
  turning.x_words = words.x_words == "diameters" ? XWordMeaning::Diameters
                    : words.x_words == "radii"   ? XWordMeaning::Radii
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

/// Returns the folder of --out, by default "out/NAME".
std::filesystem::path folder_of(const CommonOptions& common, const ProgramArguments& words) {
  return common.out.empty() ? std::filesystem::path("out") / words.file.stem() : common.out;
}

struct Written {
  std::optional<std::filesystem::path> picture, program;
};

/// Writes the picture and the converted program.
Written write(const ResultFolder& folder, const ProgramArguments& words,
              const ProgramInspection& alone) {
  Written written;
  if (words.picture) {
    write_program_picture(folder / "path.png", alone);
    written.picture = (folder / "path.png").path();
  }
  if (words.options.to) {
    const std::string name = words.file.stem().string() + format_extension(*words.options.to);
    write_file(folder / name, alone.converted);
    written.program = (folder / name).path();
  }
  return written;
}

/// Prints the inspection and the files written.
void print_result(const CommonOptions& common, const ProgramInspection& alone,
                  const Written& written) {
  if (common.json) {
    nlohmann::ordered_json json = to_json(alone);
    if (written.picture) json["picture"] = written.picture->string();
    if (written.program)
      json["written"] = {{"file", written.program->string()},
                         {"bytes", alone.converted.size()},
                         {"notes", alone.notes}};
    print("{}", Lines(json_text(json)));
  } else {
    print("{}", Lines(to_text(alone)));
    if (written.picture) print("picture   {}\n", written.picture->string());
    if (written.program)
      print("written   {}, {} bytes\n", written.program->string(), alone.converted.size());
    for (const std::string& note : alone.notes) print("          {}\n", note);
  }
  print_assumptions(alone.assumptions);
  print_warnings(alone.warnings);
}

/// Inspects a program alone. Its exit code is 3 if an axis leaves its travel, because the machine
/// could not run it.
Exit look_at(const CommonOptions& common, ProgramArguments words) {
  words.options.to = format_of(words.to);
  words.options.dialect = dialect_of(words.dialect);
  if (words.interpreter == "linuxcnc") words.options.interpreter = dialects::Interpreter::LinuxCnc;
  const auto levels = program::parse_block_skip(words.block_skip);
  if (!levels) throw BadUsage("--block-skip", "expected on, off or levels such as \"1 3\"");
  words.options.block_skip = *levels;
  if (words.skip_unknown) words.options.on_unknown = dialects::UnknownWordPolicy::Warn;
  if (words.tool_radius > 0.0) words.options.tool_radius = words.tool_radius;
  if (words.unit != "as_stated") words.options.table_unit = words.unit == "mm" ? 1.0 : units::inch;
  // The converted program has no tool calls of the table, so one length must hold.
  if (!words.options.tools.empty() && words.options.to)
    throw BadUsage("--to", "expected no --tools: what is written counts with one tool length");
  if (!words.options.offsets.empty() && !words.options.offset.empty())
    throw BadUsage("--offsets", "expected no --offset beside it");
  if (!(words.tolerance_um > 0.0)) throw BadUsage("--tolerance-um", "expected more than 0");
  words.options.within = words.tolerance_um * units::um;
  words.options.pole = pole_of(words);
  words.options.turning = turning_of(words);
  words.options.pole_warning = words.pole_warning_deg * units::deg;
  words.options.trace = words.picture;
  const bool writes = words.picture || words.options.to;
  const std::filesystem::path folder = folder_of(common, words);
  const Writer writer{common.permissions, inputs_of(words.file, words.options)};
  if (writes) check_folder(folder, writer);  // before a long program is read
  std::error_code none;
  const double bytes = double(std::filesystem::file_size(words.file, none));
  std::optional<ProgressLine> progress;
  if (!none && bytes > min_progress_bytes) {
    progress.emplace(
        std::vector<Stage>{{"program", "read", 1e-7 * bytes}, {"program", "words", 1e-8 * bytes}});
    progress->begin("program");
  }
  const ProgramInspection alone =
      inspect_program(words.file, words.options, progress ? to(*progress) : Progress{});
  progress.reset();
  print_result(common, alone,
               writes ? write(ResultFolder(folder, writer), words, alone) : Written{});
  return alone.beyond_travel ? Exit::Input : Exit::Ok;
}

}  // namespace

Command program_command(CommonOptions& common) {
  const auto words = std::make_shared<ProgramArguments>();
  return {
      "program",
      "What a program asks of a machine: moves, time, extents, travel",
      {"abbe program scenes/programs/face_milling.ngc --machine three_axis_table --picture",
       "abbe program scenes/programs/thin_wall.ngc --tool-length 80 --to cl --out out/thin_wall"},
      {{"FILE", &words->file, "a program, in any dialect of sim/dialects/README.md, or PVT"},
       {"--machine", &words->options.machine,
        "a machine file, or a name of the library (library:gantry_cxyza)", TypeName{"NAME"}},
       {"--tool-length", &words->options.tool_length, "mm from the nose to the tip, of every tool",
        Between{0, 10000}},
       {"--tool-radius", &words->tool_radius, "mm, for cutter compensation; none unless given",
        Between{0, 10000}},
       {"--offset", &words->options.offset,
        "of G54 to G59 each, mm and degrees: \"X=10 Z=-50\" (zero)", TypeName{"WORDS"}},
       {"--tools", &words->options.tools,
        "the control's tool table (LinuxCNC, Fanuc, Siemens, Heidenhain), instead of the two"},
       {"--offsets", &words->options.offsets, "its work offsets in a file, instead of --offset"},
       {"--unit", &words->unit, "of lengths in both files; must be given where they do not say it",
        OneOf{{"as_stated", "mm", "inch"}}},
       {"--dialect", &words->dialect, "in which it is written",
        OneOf{{"auto", "linuxcnc", "fanuc", "siemens", "heidenhain", "cl"}}},
       {"--block-skip", &words->block_skip,
        "blocks behind a /: on leaves them out, off executes them, \"1 3\" leaves out these levels "
        "(on)",
        TypeName{"LEVELS"}},
       {"--startup-code", &words->options.startup_code,
        "a block that is read before the first line: \"G20 G91\", \"T1 M6\"", TypeName{"BLOCK"}},
       {"--control", &words->control,
        "what the control is made for; of_machine: turning where a spindle turns the workpiece",
        OneOf{{"of_machine", "milling", "turning"}}},
       {"--x-words", &words->x_words, "what X counts until the program says otherwise",
        OneOf{{"of_control", "diameters", "radii"}}},
       {"--tip", &words->options.turning.tip,
        "point of a turning tool that X and Z lead, 0 to 9 (0: the centre of its nose)",
        Between{0, 9}},
       {"--interpreter", &words->interpreter,
        "what reads a program of LinuxCNC: abbe, or LinuxCNC's own rs274 (./abbe setup --linuxcnc)",
        OneOf{{"abbe", "linuxcnc"}}},
       {"--interpreter-seconds", &words->options.interpreter_limits.seconds,
        "after which LinuxCNC's own interpreter is ended (120)", Between{1, 1000000}},
       {"--interpreter-mb", &words->options.interpreter_limits.megabytes,
        "of its commands, about 120 bytes a move (4000)", Between{1, 1000000}},
       {"--max-moves", &words->options.max_moves,
        "those of loops and cycles each time; more is an input error (20000000)",
        Between{1, 2000000000}},
       {"--pole", &words->pole, "the control's rule for vectors of the tool and near a pole",
        OneOf{{"as_programmed", "linuxcnc", "fanuc", "siemens"}}},
       {"--pole-near", &words->pole_near_deg, "deg, parameter 19738, of --pole fanuc",
        Between{0, 45}},
       {"--pole-change", &words->pole_change_deg, "deg, parameter 19739, of --pole fanuc",
        Between{0, 90}},
       {"--pole-warning", &words->pole_warning_deg,
        "deg from a pole: nearer is warned of (2; 0: never)", Between{0, 45}},
       {"--skip-unknown", &words->skip_unknown, "words that the dialect has not: skip and count"},
       {"--picture", &words->picture, "draw machine and path"},
       {"--to", &words->to,
        "write it as cutter locations (APT or CSV), RS274/NGC or times and velocities",
        OneOf{{"cl", "nc", "pvt", "csv"}}},
       {"--tolerance-um", &words->tolerance_um, "of points of what the format has no word for, um",
        Between{0, 1000000}},
       {"--out", &common.out, "folder for picture and program (out/NAME)"},
       json_option(common),
       force_option(common)},
      [words, &common] { return look_at(common, *words); },
      "Ends with 3 where an axis leaves its travel. Times are of speeds, without accelerations."};
}

namespace {

using nlohmann::ordered_json;
using Channel = CaseDescription::Channel;

/// Returns true if a case corrects through a rewritten program; a plug-in has its channel in the
/// scene.
bool has_program_channel(const Scene& scene, const CaseDescription& compensator) {
  return (compensator.plug_in.empty() ? compensator.channel : scene.compensation.plug_in.channel) ==
         Channel::Program;
}

/// Returns the case to write, by name or the first suitable one of the scene.
CaseDescription select_case(const Scene& scene, const std::string& name) {
  const std::string file = scene.file.string();
  if (!name.empty()) {
    CaseDescription compensator;
    try {
      compensator = parse_case(name);
    } catch (const std::invalid_argument& fault) {
      throw BadInput(file, 0, 0, "a case that this scene can run", fault.what());
    }
    if (!has_program_channel(scene, compensator))
      throw BadInput(file, 0, 0, "a case through the channel program", "\"" + name + "\"");
    return compensator;
  }
  for (const CaseDescription& compensator : scene.cases)
    if (has_program_channel(scene, compensator)) return compensator;
  throw BadInput(
      file, 0, 0,
      "a case through the channel program among those that the scene compares, or --case", "none");
}

/// Returns the output file: it has the extension of the original program, which selects the
/// dialect.
ResultFile rewritten_file(const Job& job, const ProgramRewriteOptions& options) {
  const std::string name = "rewritten" + std::filesystem::path(job.path.file).extension().string();
  const std::filesystem::path out =
      options.out.empty() ? std::filesystem::path("out") / job.scene.file.stem() : options.out;
  return result_file(output_file(out, name), make_writer(job.scene, options.permissions));
}

/// Adds a value; `rms` holds the sum of squares until the end.
void add(Spread& spread, double value) {
  spread.rms += value * value;
  spread.max = std::max(spread.max, value);
}

}  // namespace

ProgramChange program_change(const Job& job, const Commands& commands) {
  ProgramChange change;
  const std::size_t n = commands.samples.states.size();
  for (std::size_t i = 0; i < n; ++i) {
    // A sample belongs to a block of the rewritten program; its fraction of the block's time gives
    // the commanded axes.
    const program::Block& block = commands.path->blocks[std::size_t(commands.samples.block[i])];
    const double duration = block.end_s - block.start_s;
    const double u =
        duration > 0.0 ? (commands.samples.states[i].time_s - block.start_s) / duration : 1.0;
    const kinematics::Pose T =
        job.machine.nominal.tool_in_workpiece(nominal_axes(job.machine, *commands.path, block, u));
    const kinematics::Pose& wanted = commands.T_wt_nominal[i];
    add(change.tip, (T.translation() - wanted.translation()).norm());
    const Eigen::Vector3d a = T.linear().col(2), b = wanted.linear().col(2);
    // atan2 is exact for small angles, where acos of the dot product has an error of 1e-8 rad.
    add(change.direction, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
  for (Spread* spread : {&change.tip, &change.direction})
    spread->rms = std::sqrt(spread->rms / double(std::max<std::size_t>(1, n)));
  return change;
}

RewriteOutcome rewrite(const std::filesystem::path& file, const ProgramRewriteOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = select_case(scene, options.case_name);
  if (!options.case_name.empty()) trust(scene, compensator);
  const auto rest = [&](const WorkSize& size) {
    return command_stages(compensator.name, size, scene, compensator) +
           rewriting_stages("write", size);
  };
  ProgressLine progress(scene_preparation_stages("prepare", expected_size(scene)) +
                        rest(expected_size(scene)));
  progress.begin("prepare");
  const Job job = prepare(scene, to(progress));
  const ResultFile out = rewritten_file(job, options);
  progress.replan(rest(size_of(job)));
  progress.begin(compensator.name);
  const Commands commands = compensate(job, compensator, to(progress));
  // A corrected program may leave the travel of an axis, which the control would not run.
  check_travel(job, commands);
  progress.begin("write");
  progress.report("words", 0.0);
  const ProgramChange change = program_change(job, commands);
  write_file(out, commands.rewritten_program);

  const CompensationDescription& words = scene.compensation;
  std::optional<RewriteOutcome::Words> step;
  if (!is_pvt(job.path)) step = {words.word_resolution, words.angle_resolution / units::deg};
  std::vector<std::string> warnings = job.warnings;
  warnings.insert(warnings.end(), commands.warnings.begin(), commands.warnings.end());
  const Placement place = placement(job);
  warnings.insert(warnings.end(), place.warnings.begin(), place.warnings.end());
  if (place.fault)
    warnings.push_back(fmt::format("nothing of the part is cut: {}", place.fault->what()));
  if (commands.not_converged > 0)
    warnings.push_back(fmt::format("{} of {} corrections did not converge", commands.not_converged,
                                   job.samples.states.size()));
  return {out.path(),
          compensator.name,
          std::size_t(job.path.motion_blocks),
          std::size_t(commands.path->motion_blocks),
          commands.rewritten_program.size(),
          change,
          path_tolerance(scene.compensation, job.path),
          step,
          commands.point_left,
          commands.direction_left,
          std::move(warnings)};
}

namespace {

ordered_json spread(const Spread& s, double unit) {
  return {{"rms", s.rms / unit}, {"max", s.max / unit}};
}

ordered_json to_json(const RewriteOutcome& done) {
  ordered_json words;
  if (done.words) words = {{"mm", done.words->mm}, {"deg", done.words->deg}};
  return {{"file", done.file.string()},
          {"case", done.case_name},
          {"blocks", {{"before", done.blocks_before}, {"after", done.blocks_after}}},
          {"bytes", done.bytes},
          {"correction_um", spread(done.correction.tip, units::um)},
          {"correction_urad", spread(done.correction.direction, units::urad)},
          {"path_tolerance_um", done.path_tolerance / units::um},
          {"words", words},
          {"left_um", done.point_left / units::um},
          {"left_urad", done.direction_left / units::urad},
          {"warnings", done.warnings}};
}

std::string to_text(const RewriteOutcome& done) {
  std::string text = fmt::format(
      "{} blocks became {}\ncorrection of the tip {:.4f} um rms, {:.4f} um at most; of the tool "
      "axis "
      "{:.4f} urad at most\nwithin {:.4g} um of the corrected path",
      done.blocks_before, done.blocks_after, done.correction.tip.rms / units::um,
      done.correction.tip.max / units::um, done.correction.direction.max / units::urad,
      done.path_tolerance / units::um);
  if (done.words)
    text +=
        fmt::format(", words rounded to {:.4g} mm and {:.4g} deg", done.words->mm, done.words->deg);
  return text + fmt::format("\n{} ({}, {} bytes)\n", escaped(done.file.string()),
                            escaped(done.case_name), done.bytes);
}

/// Rewrites the program and prints the size of the correction.
Exit print_rewrite(const CommonOptions& common, const std::string& case_name) {
  ProgramRewriteOptions options;
  options.overrides = overrides(common);
  options.case_name = case_name;
  options.out = common.out;
  options.permissions = common.permissions;
  const RewriteOutcome done = rewrite(common.scene, options);
  print_warnings(done.warnings);
  print("{}", Lines(common.json ? json_text(to_json(done)) : to_text(done)));
  return Exit::Ok;
}

}  // namespace

Command rewrite_command(CommonOptions& common) {
  const auto case_name = std::make_shared<std::string>();
  return {"rewrite",
          "Write the program of a scene with a compensator's corrections in it",
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

/// Returns the files of a control. ISG's volumetric compensation takes the errors themselves, all
/// others tables of corrections.
compensation::Export exported(const Job& job, const LearnedCorrection& learned_correction,
                              ControlFormat format) {
  const kinematics::Chain& control = job.machine.control;
  try {
    if (format != ControlFormat::Isg)
      return compensation::to_control(
          tables_of(make_control_view(job), learned_correction.corrector), control, format);
    if (!learned_correction.geometric)
      throw std::invalid_argument("expected geometric errors that are identified, seen none");
    return compensation::to_volumetric(*learned_correction.geometric, control,
                                       table_options(make_control_view(job)));
  } catch (const std::logic_error& fault) {  // including out_of_range: a table of the belief is too
                                             // short
    throw BadInput(job.scene.file.string(), 0, 0, "a correction that tables can hold",
                   fault.what());
  }
}

}  // namespace

ExportOutcome export_tables(const std::filesystem::path& file, const ExportOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = parse_case(options.case_name);
  trust(scene, compensator);
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  const auto rest = [&](const WorkSize& size) {
    return command_stages(compensator.name, size, scene, compensator) +
           std::vector<Stage>{{"write", "tables", 0.5}};
  };
  ProgressLine progress(scene_preparation_stages("prepare", expected_size(scene)) +
                        rest(expected_size(scene)));
  progress.begin("prepare");
  const Job job = prepare(scene, to(progress));
  progress.replan(rest(size_of(job)));
  progress.begin(compensator.name);
  const ControlFormat format =
      options.format.value_or(scene.compensation.table.format.value_or(ControlFormat::LinuxCnc));
  const LearnedCorrection known = learned_correction(job, compensator, to(progress));
  progress.begin("write");
  progress.report("tables", 0.0);
  const compensation::Export out = exported(job, known, format);
  ExportOutcome done{scene.title, options.case_name, format, {}, out.left_out, out.notes};
  for (const compensation::ControlFile& one : out.files) {
    write_file(folder / one.name, one.text);
    done.files.push_back((folder / one.name).path());
  }
  return done;
}

namespace {

nlohmann::ordered_json to_json(const ExportOutcome& done) {
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : done.files) files.push_back(file.string());
  return {{"scene", done.scene},
          {"case", done.case_name},
          {"format", compensation::to_string(done.format)},
          {"files", files},
          {"left_out", done.left_out},
          {"notes", done.notes}};
}

/// Arguments of the command line.
struct ExportArguments {
  std::string format;
  ExportOptions options;
};

/// Exports the tables. Omissions are warnings, because the control would not correct these errors.
Exit print_export(const CommonOptions& common, ExportArguments words) {
  words.options.overrides = overrides(common);
  words.options.folder = result_folder(common) / (common.out.empty() ? "tables" : "");
  words.options.permissions = common.permissions;
  using compensation::ControlFormat;
  for (const ControlFormat one : {ControlFormat::LinuxCnc, ControlFormat::Isg,
                                  ControlFormat::Siemens, ControlFormat::Heidenhain})
    if (words.format == compensation::to_string(one)) words.options.format = one;
  check_case(words.options.case_name);
  const ExportOutcome done = export_tables(common.scene, words.options);
  if (common.json) {
    print("{}", Lines(json_text(to_json(done))));
    return Exit::Ok;
  }
  for (const std::filesystem::path& file : done.files) print("{}\n", file.string());
  for (const std::string& note : done.notes) print("{}\n", note);
  for (const std::string& one : done.left_out) print(stderr, "abbe: warning: left out: {}\n", one);
  return Exit::Ok;
}

}  // namespace

Command export_command(CommonOptions& common) {
  const auto words = std::make_shared<ExportArguments>();
  return {"export",
          "Write the compensation tables of a scene as a control reads them",
          {"abbe export scenes/platform_plane.toml --out out/tables",
           "abbe export scenes/gantry_channels.toml --format siemens --case perfect-position-table "
           "--out out/siemens"},
          scene_options(common, {{"--out", &common.out, "folder for the tables (out/SCENE/tables)"},
                                 force_option(common),
                                 trust_option(common),
                                 {"--format", &words->format,
                                  "of which control (that of [compensation.table], else linuxcnc)",
                                  OneOf{{"linuxcnc", "isg", "siemens", "heidenhain"}}},
                                 {"--case", &words->options.case_name,
                                  "what the tables are made from (identified-position-table)"}}),
          [words, &common] { return print_export(common, *words); }};
}

}  // namespace abbe::sim
