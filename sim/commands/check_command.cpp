#include "sim/commands/check_command.h"

#include <memory>

#include <nlohmann/json.hpp>

#include "sim/cut/reach.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/description_report.h"
#include "sim/report/pictures.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

Exit check(const Common& common, bool picture) {
  const Scene scene = read_scene(common.scene, overrides(common));
  const Job job = placed(prepare(scene));
  Description description = describe(job);
  description.programs = judged(scene.programs, common.permissions);
  if (picture) {
    const ResultFolder folder(result_folder(common), writer_of(scene, common.permissions));
    write_check_picture(folder / "check.png", job);
    print(stderr, "picture in {}\n", (folder / "check.png").path().string());
  }
  print("{}", Lines(common.json ? json_text(to_json(description)) : to_text(description)));
  print_warnings(description.warnings);
  return Exit::Ok;
}

}  // namespace

Command check_command(Common& common) {
  const auto picture = std::make_shared<bool>(false);
  return {"check",
          "Validate a scene and say how it was understood; cut nothing",
          {"abbe check scenes/gantry_dome.toml --picture --out out/check",
           "abbe check scenes/gantry_dome.toml --set tool=library:bull_r6_r1 --json"},
          scene_options(common, {result_folder_option(common),
                                 force_option(common),
                                 trust_option(common),
                                 {"--picture", picture.get(),
                                  "draw machine, part and path, errors magnified"}}),
          [picture, &common] { return check(common, *picture); }};
}

}  // namespace abbe::sim
