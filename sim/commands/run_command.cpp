#include "sim/commands/run_command.h"

#include <memory>

#include "sim/commands/outcome_text.h"

namespace abbe::sim {
namespace {

struct RunWords {
  std::string case_name;
  std::vector<std::filesystem::path> compensators;
  std::vector<std::string> formats;
  bool report = false;
  std::string language = "en";
};

Exit run(const Common& common, const RunWords& words) {
  RunOptions options = run_options(common, words.compensators, words.formats);
  options.case_name = words.case_name;
  if (options.plug_ins.size() > 1 || (!options.case_name.empty() && !options.plug_ins.empty()))
    throw BadUsage("--compensator", "expected one case, a --case or a --compensator");
  if (!options.case_name.empty() && options.case_name != "error_free" &&
      options.case_name != "uncompensated")
    check_case(options.case_name);
  if (words.report)
    ask_report(options, common, words.case_name.empty() ? "run" : "run --case " + words.case_name,
               words.language);
  return print_outcome(common, options, run(common.scene, options));
}

}  // namespace

Command run_command(Common& common) {
  const auto words = std::make_shared<RunWords>();
  return {"run",
          "Cut one case of a scene (uncompensated unless --case)",
          {"abbe run scenes/gantry_dome.toml --case perfect-iterated-ideal --out out/best",
           "abbe run scenes/gantry_dome.toml --set errors.scale=2 --out out/twice",
           "abbe run scenes/gantry_dome.toml --save vtp,ply,npz --out out/saved"},
          scene_options(common, {result_folder_option(common),
                                 force_option(common),
                                 memory_option(common),
                                 {"--case", &words->case_name,
                                  "error_free, uncompensated or belief-strategy-channel"},
                                 trust_option(common),
                                 compensator_option(words->compensators),
                                 save_option(words->formats),
                                 report_option(words->report),
                                 language_option(words->language)}),
          [words, &common] { return run(common, *words); }};
}

}  // namespace abbe::sim
