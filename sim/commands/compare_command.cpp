#include "sim/commands/compare_command.h"

#include <memory>

#include "sim/commands/outcome_text.h"

namespace abbe::sim {

namespace {

struct CompareWords {
  std::vector<std::filesystem::path> compensators;
  std::vector<std::string> formats;
  bool report = false;
  std::string language = "en";
};

}  // namespace

Command compare_command(Common& common) {
  const auto words = std::make_shared<CompareWords>();
  return {
      "compare",
      "Cut error-free, uncompensated and every compensator of the scene",
      {"abbe compare scenes/gantry_dome.toml --out out/dome",
       "abbe compare scenes/gantry_dome.toml --compensator scenes/compensators/table.py --out "
       "out/own",
       "abbe compare scenes/gantry_dome.toml --save csv,json --out out/tables"},
      scene_options(common, {result_folder_option(common), force_option(common),
                             memory_option(common), trust_option(common),
                             compensator_option(words->compensators), save_option(words->formats),
                             report_option(words->report), language_option(words->language)}),
      [words, &common] {
        RunOptions options = run_options(common, words->compensators, words->formats);
        if (words->report) ask_report(options, common, "compare", words->language);
        return print_outcome(common, options, compare(common.scene, options));
      }};
}

}  // namespace abbe::sim
