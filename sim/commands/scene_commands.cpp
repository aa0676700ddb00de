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

constexpr double many_turns = 10000.0;  // degrees of travel from which a rotary axis counts as
                                        // unlimited

/// Returns the first comment of a file, which describes it.
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
  const std::string* of = machine != nullptr ? machine->text() : nullptr;
  return {name, first_comment(file), of != nullptr ? path(*of).stem().string() : std::string()};
}

/// Reads structural code and travel of a machine; linear axes are listed first.
MachineEntry read_machine_entry(const path& file) {
  InputErrors input_errors;
  const MachineDescription machine = read_machine(read_toml_file(file), input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  MachineEntry listed{file.stem().string(),
                      machine.summary,
                      to_string(kinematics::chain_topology(machine.joints)),
                      {}};
  for (const kinematics::Joint& joint : machine.joints) {
    // Spindles have no travel, neither the tool's nor the workpiece's.
    if (joint.motion == Motion::Spindle || joint.name == 'S') continue;
    const bool turns = joint.motion == Motion::Rotary;
    const double unit = turns ? units::deg : 1.0;
    const double min = joint.min / unit, max = joint.max / unit;
    // Unlimited axes have limits of 1e9.
    listed.axes.push_back(
        {joint.name, turns, turns ? max - min < many_turns : max < 1e8, min, max});
  }
  std::ranges::sort(listed.axes, {},
                    [](const AxisEntry& axis) { return std::pair(axis.turns, axis.name); });
  return listed;
}

}  // namespace

LibraryList library_list(const std::vector<std::string>& kinds) {
  const path library = library_folder();
  LibraryList list;
  for (const std::string& kind : kinds) list.kinds.push_back(read_kind_entry(kind, library));
  for (const auto& entry : std::filesystem::directory_iterator(library / "machines"))
    if (entry.path().extension() == ".toml")
      list.machines.push_back(read_machine_entry(entry.path()));
  std::ranges::sort(list.machines, {}, &MachineEntry::name);
  return list;
}

std::string travel_text(const MachineEntry& machine) {
  std::string slides, turns;
  for (const AxisEntry& axis : machine.axes) {
    std::string& text = axis.turns ? turns : slides;
    text += text.empty() ? "" : ", ";
    if (!axis.ends)
      text += fmt::format("{} any", axis.name);
    else if (axis.turns)
      text += fmt::format("{} {:.6g} .. {:.6g}", axis.name, axis.min, axis.max);
    else
      text += fmt::format("{} {:.6g}", axis.name, axis.max - axis.min);
  }
  if (!slides.empty()) slides += " mm";
  if (!turns.empty()) slides += (slides.empty() ? "" : "; ") + turns + " deg";
  return slides;
}

std::string to_text(const LibraryList& list) {
  std::string text = "kinds, for abbe new KIND DIR\n";
  for (const KindEntry& kind : list.kinds)
    text += fmt::format("  {:<20} {} (machine {})\n", kind.name, kind.summary, kind.machine);
  text += "\nmachines, for machine = \"library:NAME\" and abbe program --machine NAME\n";
  for (const MachineEntry& machine : list.machines)
    text += fmt::format("  {:<20} {}\n  {:<20} {}; {}\n", machine.name, machine.summary, "",
                        machine.code, travel_text(machine));
  return text;
}

nlohmann::ordered_json to_json(const LibraryList& list) {
  nlohmann::ordered_json kinds = nlohmann::ordered_json::array(), machines = kinds;
  for (const KindEntry& kind : list.kinds)
    kinds.push_back({{"name", kind.name}, {"summary", kind.summary}, {"machine", kind.machine}});
  for (const MachineEntry& machine : list.machines) {
    nlohmann::ordered_json axes = nlohmann::ordered_json::object();
    for (const AxisEntry& axis : machine.axes) {
      nlohmann::ordered_json travel;
      if (axis.ends) travel = {axis.min, axis.max};
      axes[std::string(1, axis.name)] = {{"unit", axis.turns ? "deg" : "mm"}, {"travel", travel}};
    }
    machines.push_back({{"name", machine.name},
                        {"summary", machine.summary},
                        {"code", machine.code},
                        {"axes", axes}});
  }
  return {{"kinds", kinds}, {"machines", machines}};
}

const std::vector<std::string>& new_kinds() {
  static const std::vector<std::string> kinds{"cam",        "fanuc",      "gantry",   "head_head",
                                              "heidenhain", "lathe",      "linuxcnc", "platform",
                                              "siemens",    "three_axis", "trunnion"};
  return kinds;
}

std::vector<CopiedFile> new_scene(const std::string& kind, const std::filesystem::path& folder) {
  check_new_folder(folder);
  const std::vector<CopiedFile> copied = scene_copy(library_folder() / "new" / (kind + ".toml"));
  std::vector<NewFile> files;
  for (const CopiedFile& one : copied) files.push_back({one.name, one.text});
  write_new_folder(folder, files);
  return copied;
}

namespace {

/// Arguments of the command line: kind and folder.
struct NewArguments {
  std::string kind;
  std::filesystem::path folder;
  bool list = false;
};

Exit print_list(const CommonOptions& common) {
  const LibraryList list = library_list(new_kinds());
  print("{}", Lines(common.json ? json_text(to_json(list)) : to_text(list)));
  return Exit::Ok;
}

/// Writes a first scene and prints the commands to try next.
Exit print_new_scene(const NewArguments& words) {
  if (words.kind.empty() || words.folder.empty())
    throw BadUsage(words.kind.empty() ? "KIND" : "DIR",
                   "expected a kind and a folder, such as abbe new gantry first, or --list");
  const std::filesystem::path library = library_folder();
  for (const CopiedFile& one : new_scene(words.kind, words.folder))
    print("{:<16} from {}\n", one.name, one.from.lexically_relative(library).generic_string());
  const std::string scene = (words.folder / "scene.toml").string();
  const std::string out = (words.folder / "out").string();
  print("\nabbe check {} --picture --out {}\nabbe compare {} --out {}\n", scene, out + "/check",
        scene, out + "/compare");
  return Exit::Ok;
}

}  // namespace

Command new_command(CommonOptions& common) {
  const auto words = std::make_shared<NewArguments>();
  return {.name = "new",
          .summary = "Write a first scene with its machine, errors, tool, part and program",
          .examples = {"abbe new gantry first", "abbe new lathe parts/shaft", "abbe new --list"},
          .options =
              {{"KIND", &words->kind,
                "of machine, gantry, trunnion, three_axis, lathe, head_head or platform; or for a "
                "program of a CAM, cam, fanuc, siemens, heidenhain or linuxcnc",
                OneOf{new_kinds()}, OptionalArgument{}},
               {"DIR", &words->folder, "folder for the files: new or empty", OptionalArgument{}},
               {"--list", &words->list, "print the kinds, and the machines of the library"},
               json_option(common)},
          .run = [words, &common] {
            return words->list ? print_list(common) : print_new_scene(*words);
          }};
}

namespace {

struct CheckArguments {
  bool picture = false;
  bool collisions = false;
  bool all = false;
  std::string case_name;
};

constexpr int max_lines = 40;  // lines of a terminal

/// Returns as many lines of a text as a terminal shows, the last of them saying what is left out.
std::string first_lines(const std::string& text) {
  const auto count = std::ranges::count(text, '\n');
  if (count <= max_lines) return text;
  std::size_t end = 0;
  for (int line = 1; line < max_lines; ++line) end = text.find('\n', end) + 1;
  return text.substr(0, end) +
         fmt::format("... and {} lines more: --all prints them\n", count - max_lines + 1);
}

/// Returns the commands of the axes in a case.
Commands commands_of(const Job& job, const std::string& case_name, const Progress& progress) {
  if (case_name == "uncompensated") return uncompensated_commands(job);
  return compensate(job, parse_case(case_name), progress);
}

/// Searches collisions along the program of a case.
Collisions find_collisions(const Job& job, const std::string& case_name) {
  const WorkSize size = size_of(job);
  std::vector<Stage> stages = collision_stages(case_name, size);
  if (case_name != "uncompensated")
    stages = command_stages(case_name, size, job.scene, parse_case(case_name)) + std::move(stages);
  ProgressLine line(std::move(stages));
  line.begin(case_name);
  const Commands commands = commands_of(job, case_name, to(line));
  return collisions(job, commands, case_name, to(line));
}

/// Checks a scene. The bodies are read in any case, so that errors in them are found; the exit code
/// is 1 if bodies collide.
Exit check(const CommonOptions& common, const CheckArguments& words) {
  if (!words.case_name.empty() && !words.collisions)
    throw BadUsage("--case", "expected --collisions beside it: check cuts nothing");
  if (!words.case_name.empty() && words.case_name != "uncompensated") check_case(words.case_name);
  const Scene scene = read_scene(common.scene, overrides(common));
  const Job job = prepare(scene);
  const Placement place = placement(job);
  // A program that misses the part is an error of the scene, but collisions are still searched.
  if (place.fault && !words.collisions) throw BadInput(*place.fault);
  Description description = describe(job);
  std::vector<std::string>& warnings = description.warnings;
  warnings.insert(warnings.end(), place.warnings.begin(), place.warnings.end());
  if (std::string text = not_searched_text(job); !text.empty() && !words.collisions)
    warnings.push_back(std::move(text));
  description.programs = judged(scene.programs, common.permissions);
  std::optional<Collisions> found;
  if (words.collisions) {
    found = find_collisions(job, words.case_name.empty() ? "uncompensated" : words.case_name);
    warnings.insert(warnings.end(), found->warnings.begin(), found->warnings.end());
  } else {
    // Their meshes are read, so that one that cannot be read is an error here too.
    machine_bodies(scene.machine);
    fixture_bodies(scene);
  }
  if (words.picture) {
    const ResultFolder folder(result_folder(common), make_writer(scene, common.permissions));
    write_check_picture(folder / "check.png", job);
    print(stderr, "picture in {}\n", (folder / "check.png").path().string());
    if (found) write_collision_pictures(folder, job, *found);
  }
  if (common.json) {
    nlohmann::ordered_json json = to_json(description);
    if (found) json["collisions"] = to_json(*found);
    print("{}", Lines(json_text(json)));
  } else {
    const std::string text = (found ? to_text(*found) + "\n" : "") + to_text(description);
    print("{}", Lines(words.all ? text : first_lines(text)));
  }
  print_assumptions(description.assumptions);
  print_warnings(warnings);
  if (place.fault) throw BadInput(*place.fault);
  return found && !is_clear(*found) ? Exit::LimitExceeded : Exit::Ok;
}

}  // namespace

Command check_command(CommonOptions& common) {
  const auto words = std::make_shared<CheckArguments>();
  return {"check",
          "Validate a scene and say how it was understood; cut nothing",
          {"abbe check scenes/gantry_dome.toml --picture --out out/check",
           "abbe check scenes/gantry_dome.toml --set tool=library:bull_r6_r1 --json",
           "abbe check scenes/gantry_dome.toml --collisions"},
          scene_options(common, {result_folder_option(common),
                                 force_option(common),
                                 trust_option(common),
                                 {"--picture", &words->picture,
                                  "draw machine, part and path, errors magnified"},
                                 {"--collisions", &words->collisions,
                                  "look for what meets what along the program, also where that "
                                  "misses the part; exit 1 if anything does"},
                                 {"--all", &words->all, "print every line, not 40 of them"},
                                 {"--case", &words->case_name,
                                  "uncompensated, or belief-strategy-channel: whose commands are "
                                  "looked at"}}),
          [words, &common] { return check(common, *words); }};
}

namespace {

using nlohmann::ordered_json;

/// Arguments of `abbe pose`: one of `at`, `at_file` and `grid`.
struct PoseArguments {
  std::string at;                   ///< one pose, "X=100 A=30"
  std::filesystem::path at_file;    ///< many poses, CSV
  std::optional<std::string> grid;  ///< the work space, "X=0:400:9 Y=::5"; may be empty
  PoseRequest wishes;
  std::vector<std::string> jacobians;  ///< of the request, as texts
  std::filesystem::path out;  ///< of many: a file, else standard output; of the work space: a
                              ///< folder, else out/SCENE/volumetric
  bool json = false;
  Permissions permissions;
};

constexpr std::size_t min_progress_poses = 20000;  // about 0.2 s of computing

/// Warnings go to stderr, so that the output can be piped.
void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) print(stderr, "abbe: warning: {}\n", warning);
}

/// Prints one pose.
void print_pose(const Scene& scene, const PoseArguments& command) {
  const PoseResult pose = pose_at(scene, command.at, command.wishes);
  print("{}", Lines(command.json ? json_text(to_json(pose)) : to_text(pose)));
  warn(pose.warnings);
}

/// Prints or writes a table of poses. Its output file is checked before the poses are read.
void print_pose_table(const IdleMachine& idle, const PoseArguments& command) {
  const PoseTable table(idle, command.wishes);
  const auto asked = command.json ? TableFormat::Json : TableFormat::Csv;
  const TableFormat format = command.out.empty() ? asked : pose_file_format(command.out);
  Writer writer = make_writer(idle.scene, command.permissions);
  writer.inputs.push_back(command.at_file);
  if (!command.out.empty()) check_file(command.out, writer);
  const PoseList poses = read_poses_file(command.at_file, idle.machine.nominal);
  std::optional<ResultFile> out;
  if (!command.out.empty()) out = result_file(command.out, writer);
  const std::vector<std::string> warnings = pose_warnings(idle, poses);
  warn(warnings);
  std::optional<ProgressLine> progress;
  if (poses.size() > min_progress_poses) {
    const std::string part = fmt::format("{} poses", poses.size());
    progress.emplace(std::vector<Stage>{{part, "poses", 1e-5 * double(poses.size())}});
    progress->begin(part);
  }
  ProgressLine* const shown = progress ? &*progress : nullptr;
  if (!out) {
    print_poses(table, poses, format, warnings, shown);
    return;
  }
  const PoseStatistics s = write_pose_file(*out, table, poses, format, warnings, shown);
  progress.reset();
  if (command.json) {
    const ordered_json json{
        {"file", command.out.string()}, {"summary", to_json(s, poses)}, {"warnings", warnings}};
    print("{}", Lines(json_text(json)));
  } else {
    print("{}file              {}\n", Lines(to_text(s, poses)), command.out.string());
  }
}

/// Returns the folder of --grid.
/// @throws OutputFailure for the name of a file, as --at-file takes it
std::filesystem::path grid_folder(const Scene& scene, const std::filesystem::path& out) {
  if (out.empty()) return std::filesystem::path("out") / scene.file.stem() / "volumetric";
  std::error_code none;
  if (std::filesystem::is_directory(out, none)) return out;
  for (const char* ending : {".csv", ".json", ".png", ".vts", ".vtp", ".toml"})
    if (out.extension() == ending)
      throw OutputFailure(fmt::format(
          "{}: expected a folder, since --grid writes several files (volumetric.json and "
          "others); choose one such as --out {}",
          escaped(out.string()), escaped(std::filesystem::path(out).replace_extension().string())));
  return out;
}

/// Computes and writes the volumetric map of the work space.
void print_work_space(const IdleMachine& idle, const PoseArguments& command) {
  const PoseTable table(idle, command.wishes);
  const ResultFolder folder(grid_folder(idle.scene, command.out),
                            make_writer(idle.scene, command.permissions));
  const VolumetricMap map = volumetric_map(idle, pose_grid(idle, *command.grid));
  const VolumetricSummary s = summary(map);
  std::vector<std::string> warnings = pose_warnings(idle, map.grid.poses);
  // No deviation at all is probably a mistake: the errors of the scene may act only in motion.
  if (s.all.max_um == 0.0 && s.all.direction_max_urad == 0.0)
    warnings.push_back(
        "nothing deviates anywhere: this machine has no errors while it stands still");
#if !ABBE_RENDER
  warnings.push_back("this program was built without VTK: no picture and no .vts");
#endif
  write_volumetric_files(folder, table, map, s, warnings);
  ordered_json json = to_json(idle, map, s);
  json["warnings"] = warnings;
  write_json(folder / "volumetric.json", json);
  warn(warnings);
  if (command.json)
    print("{}", Lines(json_text(json)));
  else
    print("{}files in {}\n", Lines(to_text(idle, map, s)), folder.path().string());
}

/// Prints poses for the option that was given.
void print_poses(const Scene& scene, const PoseArguments& command) {
  if (!command.at.empty() || (command.at_file.empty() && !command.grid))
    return print_pose(scene, command);
  const IdleMachine idle = idle_machine(scene);
  if (command.grid)
    print_work_space(idle, command);
  else
    print_pose_table(idle, command);
}

/// Parses the remaining arguments and prints the poses.
Exit execute(const CommonOptions& common, PoseArguments command) {
  const std::map<std::string, PoseJacobian> jacobians{{"axis", PoseJacobian::Axis},
                                                      {"motion", PoseJacobian::Motion},
                                                      {"location", PoseJacobian::Location}};
  for (const std::string& word : command.jacobians)
    command.wishes.jacobians.push_back(jacobians.at(word));
  command.json = common.json;
  command.permissions = common.permissions;
  if (!command.at_file.empty() && !command.out.empty())
    command.out = output_file(command.out, command.json ? "poses.json" : "poses.csv");
  print_poses(read_scene(common.scene, overrides(common)), command);
  return Exit::Ok;
}

}  // namespace

Command pose_command(CommonOptions& common) {
  const auto asked = std::make_shared<PoseArguments>();
  return {"pose",
          "Where the tool is and should be: at a pose, many, everywhere",
          {"abbe pose scenes/gantry_dome.toml --at \"X=100 Y=0 Z=50 A=30 C=90\" --elements all",
           "abbe pose scenes/gantry_dome.toml --grid \"X=-200:200:9 Y=::9 Z=0:300:7 A=30\" --out "
           "out/volume"},
          scene_options(
              common,
              {force_option(common),
               {"--jacobian", &asked->jacobians,
                "derivatives of the nominal pose by axes, error motions, location errors",
                OneOf{{"axis", "motion", "location"}}, CommaSeparated{}},
               {"--elements", &asked->wishes.elements,
                "what these errors alone do: EXX,EC0Y,EXX_heat,tool ... or all", CommaSeparated{}},
               {"--out", &asked->out,
                "of --at-file a .csv or .json file, or folder for it; of --grid a folder "
                "(out/SCENE/volumetric)"}}),
          [asked, &common] { return execute(common, *asked); },
          "Columns and files are explained in scenes/README.md, Poses.",
          {{"--at", &asked->at, "one pose in mm and degrees: \"X=100 Y=0 Z=50 A=30 C=90\"",
            Excludes{{"--out"}}},
           {"--at-file", &asked->at_file,
            "poses as CSV: X_mm,Y_mm,A_deg,... and time_s; writes CSV, or JSON with --json"},
           {"--grid", &asked->grid,
            "the work space: from:to:count of axes that run, places of others, such as "
            "\"X=-100:100:9 Z=::5 A=30\"; slides left out run over their travel",
            Bare{}}}};
}

}  // namespace abbe::sim
