#include "sim/commands/scene_commands.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/bodies.h"
#include "sim/cut/collisions.h"
#include "sim/cut/idle_machine.h"
#include "sim/cut/placement.h"
#include "sim/cut/pose_table.h"
#include "sim/cut/run_estimate.h"
#include "sim/files/atomic_output.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/report/check_report.h"
#include "sim/report/picture_files.h"
#include "sim/report/pose_report.h"
#include "sim/report/program_report.h"
#include "sim/scene/cases.h"
#include "sim/scene/fields.h"
#include "sim/scene/library.h"
#include "sim/scene/machine.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"
#include "sim/scene/trust.h"

namespace abbe::sim {

namespace {

using kinematics::Motion;
using std::filesystem::path;

constexpr double min_unlimited_deg = 10000.0;  // a rotary axis with more travel counts as unlimited

/// Returns the comment in the first line of a file, which is its summary.
std::string first_comment(const path& file) {
  const std::string text = read_text(file, max_toml_bytes);
  const std::string line = text.substr(0, text.find('\n'));
  return line.starts_with("# ") ? line.substr(2) : std::string();
}

/// Reads the summary and the machine of a kind from its scene.
KindEntry read_kind_entry(const std::string& name, const path& library) {
  const path file = library / "new" / (name + ".toml");
  const Node scene = read_toml_file(file);
  const Node* machine = scene.find("machine");
  const std::string* machine_name = machine != nullptr ? machine->text() : nullptr;
  return {name, first_comment(file),
          machine_name != nullptr ? path(*machine_name).stem().string() : std::string()};
}

/// Reads the structural code and the travel of a machine. Linear axes come first.
MachineEntry read_machine_entry(const path& file) {
  InputErrors input_errors;
  const MachineDescription machine = read_machine(read_toml_file(file), input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  MachineEntry entry{file.stem().string(),
                     machine.summary,
                     to_string(kinematics::chain_topology(machine.joints)),
                     {}};
  for (const kinematics::Joint& joint : machine.joints) {
    // Spindles of the tool and of the workpiece have no travel.
    if (joint.motion == Motion::Spindle || joint.name == 'S') continue;
    const bool is_rotary = joint.motion == Motion::Rotary;
    const double unit = is_rotary ? units::deg : 1.0;
    const double min = joint.min / unit, max = joint.max / unit;
    // An unlimited linear axis has limits of 1e9.
    entry.axes.push_back(
        {joint.name, is_rotary, is_rotary ? max - min < min_unlimited_deg : max < 1e8, min, max});
  }
  std::ranges::sort(entry.axes, {},
                    [](const AxisTravel& axis) { return std::pair(axis.is_rotary, axis.name); });
  return entry;
}

}  // namespace

LibraryContents library_contents(const std::vector<std::string>& kinds) {
  const path library = library_folder();
  LibraryContents list;
  for (const std::string& kind : kinds) list.kinds.push_back(read_kind_entry(kind, library));
  for (const auto& directory_entry : std::filesystem::directory_iterator(library / "machines"))
    if (directory_entry.path().extension() == ".toml")
      list.machines.push_back(read_machine_entry(directory_entry.path()));
  std::ranges::sort(list.machines, {}, &MachineEntry::name);
  return list;
}

std::string travel_text(const MachineEntry& machine) {
  std::string slide_travel, rotary_travel;
  for (const AxisTravel& axis : machine.axes) {
    std::string& text = axis.is_rotary ? rotary_travel : slide_travel;
    text += text.empty() ? "" : ", ";
    if (!axis.has_limits)
      text += fmt::format("{} any", axis.name);
    else if (axis.is_rotary)
      text += fmt::format("{} {:.6g} .. {:.6g}", axis.name, axis.min, axis.max);
    else
      text += fmt::format("{} {:.6g}", axis.name, axis.max - axis.min);
  }
  if (!slide_travel.empty()) slide_travel += " mm";
  if (!rotary_travel.empty())
    slide_travel += (slide_travel.empty() ? "" : "; ") + rotary_travel + " deg";
  return slide_travel;
}

std::string to_text(const LibraryContents& library) {
  std::string text = "kinds, for abbe new KIND DIR\n";
  for (const KindEntry& kind : library.kinds)
    text += fmt::format("  {:<20} {} (machine {})\n", kind.name, kind.summary, kind.machine);
  text += "\nmachines, for machine = \"library:NAME\" and abbe program --machine NAME\n";
  for (const MachineEntry& machine : library.machines)
    text += fmt::format("  {:<20} {}\n  {:<20} {}; {}\n", machine.name, machine.summary, "",
                        machine.structural_code, travel_text(machine));
  return text;
}

nlohmann::ordered_json to_json(const LibraryContents& library) {
  nlohmann::ordered_json kinds = nlohmann::ordered_json::array(), machines = kinds;
  for (const KindEntry& kind : library.kinds)
    kinds.push_back({{"name", kind.name}, {"summary", kind.summary}, {"machine", kind.machine}});
  for (const MachineEntry& machine : library.machines) {
    nlohmann::ordered_json axes = nlohmann::ordered_json::object();
    for (const AxisTravel& axis : machine.axes) {
      nlohmann::ordered_json travel;
      if (axis.has_limits) travel = {axis.min, axis.max};
      axes[std::string(1, axis.name)] = {{"unit", axis.is_rotary ? "deg" : "mm"},
                                         {"travel", travel}};
    }
    machines.push_back({{"name", machine.name},
                        {"summary", machine.summary},
                        {"code", machine.structural_code},
                        {"axes", axes}});
  }
  return {{"kinds", kinds}, {"machines", machines}};
}

const std::vector<std::string>& scene_kinds() {
  static const std::vector<std::string> kinds{"cam",        "fanuc",      "gantry",   "head_head",
                                              "heidenhain", "lathe",      "linuxcnc", "platform",
                                              "siemens",    "three_axis", "trunnion"};
  return kinds;
}

std::vector<CopiedFile> write_new_scene(const std::string& kind,
                                        const std::filesystem::path& folder) {
  check_new_folder(folder);
  const std::vector<CopiedFile> copied_files =
      scene_copy(library_folder() / "new" / (kind + ".toml"));
  std::vector<NewFile> files;
  for (const CopiedFile& copied_file : copied_files)
    files.push_back({copied_file.name, copied_file.text});
  write_new_folder(folder, files);
  return copied_files;
}

namespace {

/// Arguments of `abbe new`.
struct NewArguments {
  std::string kind;
  std::filesystem::path folder;
  bool list = false;
};

Exit print_list(const CommonOptions& common) {
  const LibraryContents list = library_contents(scene_kinds());
  print("{}", MultilineText(common.json ? json_text(to_json(list)) : to_text(list)));
  return Exit::Ok;
}

/// Writes a first scene, and prints its files and the commands to try next.
Exit print_new_scene(const NewArguments& arguments) {
  if (arguments.kind.empty() || arguments.folder.empty())
    throw BadUsage(arguments.kind.empty() ? "KIND" : "DIR",
                   "expected a kind and a folder, such as abbe new gantry first, or --list");
  const std::filesystem::path library = library_folder();
  for (const CopiedFile& copied_file : write_new_scene(arguments.kind, arguments.folder))
    print("{:<16} from {}\n", copied_file.name,
          copied_file.from.lexically_relative(library).generic_string());
  const std::string scene = (arguments.folder / "scene.toml").string();
  const std::string out = (arguments.folder / "out").string();
  print("\nabbe check {} --picture --out {}\nabbe compare {} --out {}\n", scene, out + "/check",
        scene, out + "/compare");
  return Exit::Ok;
}

}  // namespace

Command new_command(CommonOptions& common) {
  const auto arguments = std::make_shared<NewArguments>();
  return {
      .name = "new",
      .summary = "Write a first scene with its machine, errors, tool, part and program",
      .examples = {"abbe new gantry first", "abbe new lathe parts/shaft", "abbe new --list"},
      .options = {{"KIND", &arguments->kind,
                   "machine: gantry, trunnion, three_axis, lathe, head_head or platform; or "
                   "dialect of a CAM program: cam, fanuc, siemens, heidenhain or linuxcnc",
                   OneOf{scene_kinds()}, OptionalArgument{}},
                  {"DIR", &arguments->folder, "folder for the files: new or empty",
                   OptionalArgument{}},
                  {"--list", &arguments->list, "list the kinds and the machines of the library"},
                  json_option(common)},
      .run = [arguments, &common] {
        return arguments->list ? print_list(common) : print_new_scene(*arguments);
      }};
}

namespace {

struct CheckArguments {
  bool picture = false;
  bool collisions = false;
  bool all = false;
  std::string case_name;
};

constexpr int max_terminal_lines = 40;  // printed unless --all is stated

/// Returns the first lines of a text that fit on a terminal. If some are omitted, the last line
/// states how many.
std::string first_lines(const std::string& text) {
  const auto count = std::ranges::count(text, '\n');
  if (count <= max_terminal_lines) return text;
  std::size_t end = 0;
  for (int line = 1; line < max_terminal_lines; ++line) end = text.find('\n', end) + 1;
  return text.substr(0, end) +
         fmt::format("... and {} more lines: --all prints them\n", count - max_terminal_lines + 1);
}

/// Returns the axis commands of a case.
Commands case_commands(const Job& job, const std::string& case_name, const Progress& progress) {
  if (case_name == "uncompensated") return uncompensated_commands(job);
  return compensate(job, parse_case(case_name), progress);
}

/// Searches for collisions along the program of a case.
Collisions find_collisions(const Job& job, const std::string& case_name) {
  const WorkSize size = work_size(job);
  std::vector<Stage> stages = collision_stages(case_name, size);
  if (case_name != "uncompensated")
    stages = command_stages(case_name, size, job.scene, parse_case(case_name)) + std::move(stages);
  ProgressLine progress_line(std::move(stages));
  progress_line.begin(case_name);
  const Commands commands = case_commands(job, case_name, progress_function(progress_line));
  return collisions(job, commands, case_name, progress_function(progress_line));
}

/// Checks a scene. Bodies are always read, so that errors in them are found. The exit code is 1 if
/// bodies collide.
Exit check_scene(const CommonOptions& common, const CheckArguments& arguments) {
  if (!arguments.case_name.empty() && !arguments.collisions)
    throw BadUsage("--case", "expected --collisions with it, because check cuts nothing");
  if (!arguments.case_name.empty() && arguments.case_name != "uncompensated")
    check_case(arguments.case_name);
  const Scene scene = read_scene(common.scene, overrides(common));
  const Job job = prepare(scene);
  const Placement part_placement = placement(job);
  // A program that misses the part is an error of the scene, but collisions are still searched.
  if (part_placement.fault && !arguments.collisions) throw BadInput(*part_placement.fault);
  Description description = describe(job);
  std::vector<std::string>& warnings = description.warnings;
  warnings.insert(warnings.end(), part_placement.warnings.begin(), part_placement.warnings.end());
  if (std::string text = proximity_warning(job); !text.empty() && !arguments.collisions)
    warnings.push_back(std::move(text));
  description.programs = assess_trust(scene.programs, common.permissions);
  std::optional<Collisions> found_collisions;
  if (arguments.collisions) {
    found_collisions =
        find_collisions(job, arguments.case_name.empty() ? "uncompensated" : arguments.case_name);
    warnings.insert(warnings.end(), found_collisions->warnings.begin(),
                    found_collisions->warnings.end());
  } else {
    // Reading the meshes reports those that cannot be read.
    machine_bodies(scene.machine);
    fixture_bodies(scene);
  }
  if (arguments.picture) {
    const ResultFolder folder(result_folder(common), make_writer(scene, common.permissions));
    write_check_picture(folder / "check.png", job);
    print(stderr, "picture in {}\n", (folder / "check.png").path().string());
    if (found_collisions) write_collision_pictures(folder, job, *found_collisions);
  }
  if (common.json) {
    nlohmann::ordered_json json = to_json(description);
    if (found_collisions) json["collisions"] = to_json(*found_collisions);
    print("{}", MultilineText(json_text(json)));
  } else {
    const std::string text =
        (found_collisions ? to_text(*found_collisions) + "\n" : "") + to_text(description);
    print("{}", MultilineText(arguments.all ? text : first_lines(text)));
  }
  print_assumptions(description.assumptions);
  print_warnings(warnings);
  if (part_placement.fault) throw BadInput(*part_placement.fault);
  return found_collisions && !is_clear(*found_collisions) ? Exit::LimitExceeded : Exit::Ok;
}

}  // namespace

Command check_command(CommonOptions& common) {
  const auto arguments = std::make_shared<CheckArguments>();
  return {
      "check",
      "Validate a scene and describe how it was understood, without cutting",
      {"abbe check scenes/gantry_dome.toml --picture --out out/check",
       "abbe check scenes/gantry_dome.toml --set tool=library:bull_r6_r1 --json",
       "abbe check scenes/gantry_dome.toml --collisions"},
      scene_options(
          common,
          {result_folder_option(common),
           force_option(common),
           trust_option(common),
           {"--picture", &arguments->picture, "draw machine, part and path with magnified errors"},
           {"--collisions", &arguments->collisions,
            "find collisions along the program, even if it misses the part; exit code 1 if there "
            "are any"},
           {"--all", &arguments->all, "print every line instead of the first 40"},
           {"--case", &arguments->case_name,
            "case to check for collisions: uncompensated, or belief-strategy-channel"}}),
      [arguments, &common] { return check_scene(common, *arguments); }};
}

namespace {

using nlohmann::ordered_json;

/// Arguments of `abbe pose`. One of `at`, `at_file` and `grid` is set.
struct PoseArguments {
  std::string at;                   ///< one pose, "X=100 A=30"
  std::filesystem::path at_file;    ///< many poses, CSV
  std::optional<std::string> grid;  ///< the work space, "X=0:400:9 Y=::5"; may be empty
  PoseRequest request;
  std::vector<std::string> jacobians;  ///< names of those in the request
  /// For `at_file` a file, by default standard output; for `grid` a folder, by default
  /// out/SCENE/volumetric.
  std::filesystem::path out;
  bool json = false;
  Permissions permissions;
};

constexpr std::size_t min_progress_poses = 20000;  // about 0.2 s of computing

/// Prints one pose.
void print_pose(const Scene& scene, const PoseArguments& arguments) {
  const PoseResult pose = pose_at(scene, arguments.at, arguments.request);
  print("{}", MultilineText(arguments.json ? json_text(to_json(pose)) : to_text(pose)));
  print_warnings(pose.warnings);
}

/// Prints or writes a table of poses. The output file is checked before the poses are read.
void print_pose_table(const IdleMachine& idle, const PoseArguments& arguments) {
  const PoseTable table(idle, arguments.request);
  const auto default_format = arguments.json ? TableFormat::Json : TableFormat::Csv;
  const TableFormat format =
      arguments.out.empty() ? default_format : pose_file_format(arguments.out);
  Writer writer = make_writer(idle.scene, arguments.permissions);
  writer.inputs.push_back(arguments.at_file);
  if (!arguments.out.empty()) check_file(arguments.out, writer);
  const PoseList poses = read_poses_file(arguments.at_file, idle.machine.nominal);
  std::optional<ResultFile> out;
  if (!arguments.out.empty()) out = result_file(arguments.out, writer);
  const std::vector<std::string> warnings = pose_warnings(idle, poses);
  print_warnings(warnings);
  std::optional<ProgressLine> progress;
  if (poses.size() > min_progress_poses) {
    const std::string part = fmt::format("{} poses", poses.size());
    progress.emplace(std::vector<Stage>{{part, "poses", 1e-5 * double(poses.size())}});
    progress->begin(part);
  }
  ProgressLine* const progress_line = progress ? &*progress : nullptr;
  if (!out) {
    print_poses(table, poses, format, warnings, progress_line);
    return;
  }
  const PoseStatistics s = write_pose_file(*out, table, poses, format, warnings, progress_line);
  progress.reset();
  if (arguments.json) {
    const ordered_json json{
        {"file", arguments.out.string()}, {"summary", to_json(s, poses)}, {"warnings", warnings}};
    print("{}", MultilineText(json_text(json)));
  } else {
    print("{}file              {}\n", MultilineText(to_text(s, poses)), arguments.out.string());
  }
}

/// Returns the output folder of --grid.
/// @throws OutputFailure if `out` has the extension of a file, such as --at-file accepts
std::filesystem::path grid_folder(const Scene& scene, const std::filesystem::path& out) {
  if (out.empty()) return std::filesystem::path("out") / scene.file.stem() / "volumetric";
  std::error_code ignored_error;
  if (std::filesystem::is_directory(out, ignored_error)) return out;
  for (const char* extension : {".csv", ".json", ".png", ".vts", ".vtp", ".toml"})
    if (out.extension() == extension)
      throw OutputFailure(fmt::format(
          "{}: expected a folder, since --grid writes several files (volumetric.json and "
          "others); choose one such as --out {}",
          escaped(out.string()), escaped(std::filesystem::path(out).replace_extension().string())));
  return out;
}

/// Computes and writes the volumetric map of the work space.
void print_work_space(const IdleMachine& idle, const PoseArguments& arguments) {
  const PoseTable table(idle, arguments.request);
  const ResultFolder folder(grid_folder(idle.scene, arguments.out),
                            make_writer(idle.scene, arguments.permissions));
  const VolumetricMap map = volumetric_map(idle, pose_grid(idle, *arguments.grid));
  const VolumetricSummary s = summary(map);
  std::vector<std::string> warnings = pose_warnings(idle, map.grid.poses);
  // A machine without any deviation is probably a mistake: its errors may act only in motion.
  if (s.all.max_um == 0.0 && s.all.direction_max_urad == 0.0)
    warnings.push_back("no deviation anywhere: this machine has no errors at standstill");
#if !ABBE_RENDER
  warnings.push_back("this program was built without VTK: no picture and no .vts");
#endif
  write_volumetric_files(folder, table, map, s, warnings);
  ordered_json json = to_json(idle, map, s);
  json["warnings"] = warnings;
  write_json(folder / "volumetric.json", json);
  print_warnings(warnings);
  if (arguments.json)
    print("{}", MultilineText(json_text(json)));
  else
    print("{}files in {}\n", MultilineText(to_text(idle, map, s)), folder.path().string());
}

/// Prints the poses that --at, --at-file or --grid requests.
void print_poses(const Scene& scene, const PoseArguments& arguments) {
  if (!arguments.at.empty() || (arguments.at_file.empty() && !arguments.grid))
    return print_pose(scene, arguments);
  const IdleMachine idle = idle_machine(scene);
  if (arguments.grid)
    print_work_space(idle, arguments);
  else
    print_pose_table(idle, arguments);
}

/// Parses the remaining arguments and prints the poses.
Exit run_pose_command(const CommonOptions& common, PoseArguments arguments) {
  const std::map<std::string, PoseJacobian> jacobians_by_name{{"axis", PoseJacobian::Axis},
                                                              {"motion", PoseJacobian::Motion},
                                                              {"location", PoseJacobian::Location}};
  for (const std::string& name : arguments.jacobians)
    arguments.request.jacobians.push_back(jacobians_by_name.at(name));
  arguments.json = common.json;
  arguments.permissions = common.permissions;
  if (!arguments.at_file.empty() && !arguments.out.empty())
    arguments.out = output_file(arguments.out, arguments.json ? "poses.json" : "poses.csv");
  print_poses(read_scene(common.scene, overrides(common)), arguments);
  return Exit::Ok;
}

}  // namespace

Command pose_command(CommonOptions& common) {
  const auto arguments = std::make_shared<PoseArguments>();
  return {
      "pose",
      "Compute actual and nominal poses of the tool: at one pose, many, or in the whole work space",
      {"abbe pose scenes/gantry_dome.toml --at \"X=100 Y=0 Z=50 A=30 C=90\" --elements all",
       "abbe pose scenes/gantry_dome.toml --grid \"X=-200:200:9 Y=::9 Z=0:300:7 A=30\" --out "
       "out/volume"},
      scene_options(
          common,
          {force_option(common),
           {"--jacobian", &arguments->jacobians,
            "derivatives of the nominal pose with respect to axes, error motions, location errors",
            OneOf{{"axis", "motion", "location"}}, CommaSeparated{}},
           {"--elements", &arguments->request.elements,
            "effect of each of these errors alone: EXX,EC0Y,EXX_heat,tool ... or all",
            CommaSeparated{}},
           {"--out", &arguments->out,
            "with --at-file: a .csv or .json file, or folder for it; with --grid: a folder "
            "(out/SCENE/volumetric)"}}),
      [arguments, &common] { return run_pose_command(common, *arguments); },
      "Columns and files are explained in scenes/README.md, Poses.",
      {{"--at", &arguments->at, "one pose in mm and degrees: \"X=100 Y=0 Z=50 A=30 C=90\"",
        Excludes{{"--out"}}},
       {"--at-file", &arguments->at_file,
        "poses as CSV: X_mm,Y_mm,A_deg,... and time_s; writes CSV, or JSON with --json"},
       {"--grid", &arguments->grid,
        "grid over the work space: from:to:count for moving axes, a position for the others, such "
        "as \"X=-100:100:9 Z=::5 A=30\"; linear axes not listed cover their travel",
        OptionalValue{}}}};
}

}  // namespace abbe::sim
