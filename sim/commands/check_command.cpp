#include "sim/commands/check_command.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/cut/bodies.h"
#include "sim/cut/collisions.h"
#include "sim/cut/reach.h"
#include "sim/cut/stages.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/report/collision_report.h"
#include "sim/report/description_report.h"
#include "sim/report/pictures.h"
#include "sim/scene/case_name.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

struct CheckWords {
  bool picture = false;
  bool collisions = false;
  bool all = false;
  std::string case_name;
};

constexpr int max_lines = 40;  // of a terminal

/// Returns as many lines of a text as a terminal shows, the last of them saying what is left out.
std::string first_lines(const std::string& text) {
  const auto count = std::ranges::count(text, '\n');
  if (count <= max_lines) return text;
  std::size_t end = 0;
  for (int line = 1; line < max_lines; ++line) end = text.find('\n', end) + 1;
  return text.substr(0, end) +
         fmt::format("... and {} lines more: --all prints them\n", count - max_lines + 1);
}

/// What the axes are commanded in a case.
Commands commands_of(const Job& job, const std::string& case_name, const Progress& progress) {
  if (case_name == "uncompensated") return as_programmed(job);
  return compensate(job, parse_case(case_name), progress);
}

Collisions looked_for(const Job& job, const std::string& case_name) {
  const WorkSize size = size_of(job);
  std::vector<Stage> stages = stages_of_collisions(case_name, size);
  if (case_name != "uncompensated")
    stages =
        stages_of_commands(case_name, size, job.scene, parse_case(case_name)) + std::move(stages);
  ProgressLine line(std::move(stages));
  line.begin(case_name);
  const Commands commands = commands_of(job, case_name, to(line));
  return collisions(job, commands, case_name, to(line));
}

Exit check(const Common& common, const CheckWords& words) {
  if (!words.case_name.empty() && !words.collisions)
    throw BadUsage("--case", "expected --collisions beside it: check cuts nothing");
  if (!words.case_name.empty() && words.case_name != "uncompensated") check_case(words.case_name);
  const Scene scene = read_scene(common.scene, overrides(common));
  const Job job = prepare(scene);
  const Placement place = placement(job);
  if (place.fault && !words.collisions) throw BadInput(*place.fault);
  Description description = describe(job);
  std::vector<std::string>& warnings = description.warnings;
  warnings.insert(warnings.end(), place.warnings.begin(), place.warnings.end());
  if (std::string text = not_searched_text(job); !text.empty() && !words.collisions)
    warnings.push_back(std::move(text));
  description.programs = judged(scene.programs, common.permissions);
  std::optional<Collisions> found;
  if (words.collisions) {
    found = looked_for(job, words.case_name.empty() ? "uncompensated" : words.case_name);
    warnings.insert(warnings.end(), found->warnings.begin(), found->warnings.end());
  } else {
    // their meshes are read, so that one that cannot be is refused here, too
    machine_bodies(scene.machine);
    fixture_bodies(scene);
  }
  if (words.picture) {
    const ResultFolder folder(result_folder(common), writer_of(scene, common.permissions));
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

Command check_command(Common& common) {
  const auto words = std::make_shared<CheckWords>();
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

}  // namespace abbe::sim
