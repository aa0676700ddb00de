#include "sim/commands/program_command.h"

#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/cut/program_alone.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/report/pictures.h"
#include "sim/report/program_report.h"

namespace abbe::sim {
namespace {

/// What stands on the command line.
struct ProgramWords {
  std::filesystem::path file;
  std::string to, dialect = "auto", unit = "as_stated", interpreter = "abbe";
  bool picture = false, skip_unknown = false;
  double tool_radius = 0.0, tolerance_um = 1.0;
  std::string pole = "as_programmed";
  std::string block_skip = "on";
  std::string control = "of_machine", x_words = "of_control";
  double pole_near_deg = 0.0, pole_change_deg = 0.0, pole_warning_deg = 2.0;
  ProgramAloneOptions options;
};

constexpr double worth_progress = 4e6;  // bytes from which progress is shown

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

dialects::PoleOptions pole_of(const ProgramWords& words) {
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

dialects::TurningOptions turning_of(const ProgramWords& words) {
  using dialects::ControlKind, dialects::XWords;
  dialects::TurningOptions turning = words.options.turning;
  turning.control = words.control == "milling"   ? ControlKind::Milling
                    : words.control == "turning" ? ControlKind::Turning
                                                 : ControlKind::OfMachine;
  turning.x_words = words.x_words == "diameters" ? XWords::Diameters
                    : words.x_words == "radii"   ? XWords::Radii
                                                 : XWords::OfControl;
  return turning;
}

const char* ending_of(ProgramFormat format) {
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

/// "out/NAME" unless said.
std::filesystem::path folder_of(const Common& common, const ProgramWords& words) {
  return common.out.empty() ? std::filesystem::path("out") / words.file.stem() : common.out;
}

struct Written {
  std::optional<std::filesystem::path> picture, program;
};

Written write(const ResultFolder& folder, const ProgramWords& words, const ProgramAlone& alone) {
  Written written;
  if (words.picture) {
    write_program_picture(folder / "path.png", alone);
    written.picture = (folder / "path.png").path();
  }
  if (words.options.to) {
    const std::string name = words.file.stem().string() + ending_of(*words.options.to);
    write_file(folder / name, alone.converted);
    written.program = (folder / name).path();
  }
  return written;
}

void print_result(const Common& common, const ProgramAlone& alone, const Written& written) {
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

Exit look_at(const Common& common, ProgramWords words) {
  words.options.to = format_of(words.to);
  words.options.dialect = dialect_of(words.dialect);
  if (words.interpreter == "linuxcnc") words.options.interpreter = dialects::Interpreter::LinuxCnc;
  const auto levels = program::block_skip_of(words.block_skip);
  if (!levels) throw BadUsage("--block-skip", "expected on, off or levels such as \"1 3\"");
  words.options.block_skip = *levels;
  if (words.skip_unknown) words.options.on_unknown = dialects::OnUnknown::Warn;
  if (words.tool_radius > 0.0) words.options.tool_radius = words.tool_radius;
  if (words.unit != "as_stated") words.options.table_unit = words.unit == "mm" ? 1.0 : units::inch;
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
  if (!none && bytes > worth_progress) {
    progress.emplace(
        std::vector<Stage>{{"program", "read", 1e-7 * bytes}, {"program", "words", 1e-8 * bytes}});
    progress->begin("program");
  }
  const ProgramAlone alone =
      program_alone(words.file, words.options, progress ? to(*progress) : Progress{});
  progress.reset();
  print_result(common, alone,
               writes ? write(ResultFolder(folder, writer), words, alone) : Written{});
  return alone.beyond_travel ? Exit::Input : Exit::Ok;
}

}  // namespace

Command program_command(Common& common) {
  const auto words = std::make_shared<ProgramWords>();
  return {
      "program",
      "What a program asks of a machine: moves, time, extents, travel",
      {"abbe program scenes/programs/face_milling.ngc --machine three_axis_table --picture",
       "abbe program scenes/programs/thin_wall.ngc --tool-length 80 --to cl --out out/thin_wall"},
      {{"FILE", &words->file, "a program, in any dialect of sim/dialects/README.md, or PVT"},
       {"--machine", &words->options.machine,
        "a machine file, or a name of the library (library:gantry_cxyza)", Type{"NAME"}},
       {"--tool-length", &words->options.tool_length, "mm from the nose to the tip, of every tool",
        Between{0, 10000}},
       {"--tool-radius", &words->tool_radius, "mm, for cutter compensation; none unless given",
        Between{0, 10000}},
       {"--offset", &words->options.offset,
        "of G54 to G59 each, mm and degrees: \"X=10 Z=-50\" (zero)", Type{"WORDS"}},
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
        Type{"LEVELS"}},
       {"--startup-code", &words->options.startup_code,
        "a block that is read before the first line: \"G20 G91\", \"T1 M6\"", Type{"BLOCK"}},
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

}  // namespace abbe::sim
