#include "sim/commands/pose_command.h"

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/cut/pose_at.h"
#include "sim/cut/pose_doubts.h"
#include "sim/cut/pose_table.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/pose_files.h"
#include "sim/report/pose_report.h"
#include "sim/report/volumetric_files.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

/// What `abbe pose` is asked for: one of `at`, `at_file` and `grid`.
struct PoseCommand {
  std::string at;                   ///< one pose, "X=100 A=30"
  std::filesystem::path at_file;    ///< many, CSV
  std::optional<std::string> grid;  ///< the work space, "X=0:400:9 Y=::5"; may be empty
  PoseWishes wishes;
  std::vector<std::string> jacobians;  ///< of the wishes, in words
  std::filesystem::path out;  ///< of many: a file, else standard output; of the work space: a
                              ///< folder, else out/SCENE/volumetric
  bool json = false;
  Permissions permissions;
};

constexpr std::size_t worth_a_line = 20000;  // poses from which progress is shown

void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) print(stderr, "abbe: warning: {}\n", warning);
}

void print_one(const Scene& scene, const PoseCommand& command) {
  const PoseAt pose = pose_at(scene, command.at, command.wishes);
  print("{}", Lines(command.json ? json_text(to_json(pose)) : to_text(pose)));
  warn(pose.warnings);
}

void print_many(const IdleMachine& idle, const PoseCommand& command) {
  const PoseTable table(idle, command.wishes);
  const auto asked = command.json ? TableFormat::Json : TableFormat::Csv;
  const TableFormat format = command.out.empty() ? asked : pose_file_format(command.out);
  Writer writer = writer_of(idle.scene, command.permissions);
  writer.inputs.push_back(command.at_file);
  if (!command.out.empty()) check_file(command.out, writer);
  const PoseList poses = read_poses_file(command.at_file, idle.machine.nominal);
  std::optional<ResultFile> out;
  if (!command.out.empty()) out = result_file(command.out, writer);
  const std::vector<std::string> warnings = doubts(idle, poses);
  warn(warnings);
  std::optional<ProgressLine> progress;
  if (poses.size() > worth_a_line) {
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

/// @throws OutputFailure for the name of a file, as --at-file takes it
std::filesystem::path folder_of_grid(const Scene& scene, const std::filesystem::path& out) {
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

void print_work_space(const IdleMachine& idle, const PoseCommand& command) {
  const PoseTable table(idle, command.wishes);
  const ResultFolder folder(folder_of_grid(idle.scene, command.out),
                            writer_of(idle.scene, command.permissions));
  const VolumetricMap map = volumetric_map(idle, pose_grid(idle, *command.grid));
  const VolumetricSummary s = summary(map);
  std::vector<std::string> warnings = doubts(idle, map.grid.poses);
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

void print_poses(const Scene& scene, const PoseCommand& command) {
  if (!command.at.empty() || (command.at_file.empty() && !command.grid))
    return print_one(scene, command);
  const IdleMachine idle = idle_machine(scene);
  if (command.grid)
    print_work_space(idle, command);
  else
    print_many(idle, command);
}

Exit execute(const Common& common, PoseCommand command) {
  const std::map<std::string, PoseJacobian> jacobians{{"axis", PoseJacobian::Axis},
                                                      {"motion", PoseJacobian::Motion},
                                                      {"location", PoseJacobian::Location}};
  for (const std::string& word : command.jacobians)
    command.wishes.jacobians.push_back(jacobians.at(word));
  command.json = common.json;
  command.permissions = common.permissions;
  if (!command.at_file.empty() && !command.out.empty())
    command.out = file_of_out(command.out, command.json ? "poses.json" : "poses.csv");
  print_poses(read_scene(common.scene, overrides(common)), command);
  return Exit::Ok;
}

}  // namespace

Command pose_command(Common& common) {
  const auto asked = std::make_shared<PoseCommand>();
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
                OneOf{{"axis", "motion", "location"}}, Commas{}},
               {"--elements", &asked->wishes.elements,
                "what these errors alone do: EXX,EC0Y,EXX_heat,tool ... or all", Commas{}},
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
