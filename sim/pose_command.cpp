#include "sim/pose_command.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/output.h"
#include "sim/pose_at.h"
#include "sim/pose_files.h"
#include "sim/volumetric_files.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t worth_a_line = 20000;  // poses from which progress is shown

void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "abbe: warning: {}\n", warning);
}

/// What a column of time cannot say of this machine.
std::vector<std::string> doubts_of_time(const IdleMachine& idle, const PoseList& poses) {
  std::vector<std::string> doubts;
  if (!poses.is_timed()) return doubts;
  if (!idle.truth.heat) {
    doubts.push_back("time changes nothing: the machine of this scene has no heat");
    return doubts;
  }
  std::size_t after = 0, before = 0;
  const double begin_s = idle.truth.heat->run.knots.front().time_s;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double time_s = poses.state(i).time_s;
    after += time_s > 0.0;
    before += time_s < begin_s;
  }
  if (after > 0)
    doubts.push_back(
        fmt::format("{} of {} poses come after time 0: the last phase of the history "
                    "goes on, no program runs",
                    after, poses.size()));
  if (before > 0)
    doubts.push_back(
        fmt::format("{} of {} poses come before the history, which begins at {:.6g} s: "
                    "the machine is as at its beginning",
                    before, poses.size(), begin_s));
  return doubts;
}

void print_one(const Scene& scene, const PoseCommand& command) {
  const ordered_json pose = pose_at(scene, command.at, command.wishes);
  fmt::print("{}", command.json ? pose.dump(2) + "\n" : pose_text(pose));
  warn(pose["warnings"].get<std::vector<std::string>>());
}

void print_many(const IdleMachine& idle, const PoseCommand& command) {
  const PoseTable table(idle, command.wishes);
  const auto asked = command.json ? TableFormat::Json : TableFormat::Csv;
  const TableFormat format =
      command.out.empty() ? asked
                          : pose_file_format(command.out, {idle.scene.file, command.at_file});
  const PoseList poses = read_poses_file(command.at_file, idle.machine.nominal);
  std::vector<std::string> warnings = left_out_at_rest(idle);
  for (std::string& doubt : doubts_of_time(idle, poses)) warnings.push_back(std::move(doubt));
  warn(warnings);
  std::optional<ProgressLine> progress;
  if (poses.size() > worth_a_line) {
    progress.emplace(1);
    progress->begin(fmt::format("{} poses", poses.size()));
  }
  ProgressLine* const shown = progress ? &*progress : nullptr;
  if (command.out.empty()) {
    print_poses(table, poses, format, warnings, shown);
    return;
  }
  if (command.out.has_parent_path()) prepare_folder(command.out.parent_path());
  const PoseStatistics s = write_pose_file(command.out, table, poses, format, warnings, shown);
  progress.reset();
  if (command.json) {
    const ordered_json json{
        {"file", command.out.string()}, {"summary", to_json(s, poses)}, {"warnings", warnings}};
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{}file              {}\n", to_text(s, poses), command.out.string());
  }
}

void print_work_space(const IdleMachine& idle, const PoseCommand& command) {
  const PoseTable table(idle, command.wishes);
  const std::filesystem::path folder =
      command.out.empty() ? std::filesystem::path("out") / idle.scene.file.stem() / "volumetric"
                          : command.out;
  const VolumetricMap map = volumetric_map(idle, pose_grid(idle, *command.grid));
  const VolumetricSummary s = summary(map);
  std::vector<std::string> warnings = left_out_at_rest(idle);
  if (s.all.max_um == 0.0 && s.all.direction_max_urad == 0.0)
    warnings.push_back(
        "nothing deviates anywhere: this machine has no errors while it stands still");
#if !ABBE_RENDER
  warnings.push_back("this program was built without VTK: no picture and no .vts");
#endif
  prepare_folder(folder);
  const auto files = write_volumetric_files(folder, table, map, s);
  ordered_json json = to_json(idle, map, s);
  json["warnings"] = warnings;
  write_file(folder / "volumetric.json", json.dump(2) + "\n");
  warn(warnings);
  if (command.json)
    fmt::print("{}\n", json.dump(2));
  else
    fmt::print("{}files in {}\n", to_text(idle, map, s), folder.string());
}

}  // namespace

void pose_command(const Scene& scene, const PoseCommand& command) {
  if (!command.at.empty() || (command.at_file.empty() && !command.grid))
    return print_one(scene, command);
  const IdleMachine idle = idle_machine(scene);
  if (command.grid)
    print_work_space(idle, command);
  else
    print_many(idle, command);
}

}  // namespace abbe::sim
