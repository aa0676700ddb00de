#include "sim/commands/report_command.h"

#include <memory>

#include <nlohmann/json.hpp>

#include "sim/commands/outcome_text.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"

namespace abbe::sim {
namespace {

struct ReportWords {
  std::vector<std::filesystem::path> compensators;
  std::filesystem::path file;
  std::string language = "en";
};

void check_is_scene(const std::filesystem::path& scene) {
  if (!std::filesystem::is_directory(scene)) return;
  throw BadUsage("SCENE", "expected a scene, seen the folder " + scene.string() +
                              ": saved results hold neither the machine nor its motion; give the "
                              "scene.toml that stands in the folder of a case");
}

Exit report(const Common& common, const ReportWords& words) {
  check_is_scene(common.scene);
  RunOptions options = run_options(common, words.compensators, {});
  ask_report(options, common, "report", words.language);
  const std::filesystem::path file =
      words.file.empty() ? result_folder(common) / "report.html" : words.file;
  const Reported reported = report(common.scene, options, file);
  if (common.json)
    print("{}", Lines(json_text({{"file", file.string()},
                                 {"bytes", reported.bytes},
                                 {"warnings", reported.warnings}})));
  else
    print("{}: {:.2f} MB\n", file.string(), double(reported.bytes) * 1e-6);
  print_warnings(reported.warnings);
  for (const std::string& limit : reported.exceeded) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : reported.failed) print(stderr, "abbe: {}\n", Lines(failure));
  if (!reported.failed.empty()) return Exit::PlugIn;
  return reported.exceeded.empty() ? Exit::Ok : Exit::LimitExceeded;
}

}  // namespace

Command report_command(Common& common) {
  const auto words = std::make_shared<ReportWords>();
  return {
      "report",
      "Write the cases of a scene as one HTML file: maps to turn, machine in motion, figures",
      {"abbe report scenes/gantry_dome.toml -o out/dome.html",
       "abbe report scenes/gantry_dome.toml --set errors.scale=2 --language zh --out out/twice"},
      scene_options(common,
                    {result_folder_option(common),
                     force_option(common),
                     memory_option(common),
                     trust_option(common),
                     compensator_option(words->compensators),
                     {"-o", &words->file, "the page (default: report.html in the folder of --out)",
                      Type{"FILE"}},
                     language_option(words->language)}),
      [words, &common] { return report(common, *words); }};
}

}  // namespace abbe::sim
