#include "sim/commands/outcome_text.h"

#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/files/one_lined.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/pictures.h"
#include "sim/report/sensor_choices_text.h"
#include "sim/scene/case_name.h"

namespace abbe::sim {
namespace {

std::string figures(const nlohmann::ordered_json& s) {
  const auto um = [](const nlohmann::ordered_json& number) {
    return number.is_null() ? std::string("-") : fmt::format("{:.4f}", number.get<double>());
  };
  return fmt::format("{:>12} {:>12} {:>12} {:>12}", um(s["pv"]), um(s["rms"]), um(s["min"]),
                     um(s["max"]));
}

/// How much of the part the figures leave out.
std::string left_out(const nlohmann::ordered_json& counts) {
  const auto& uncut = counts["uncut_percent"];
  return fmt::format(
      "{:>8} {:>7}",
      uncut.is_null() ? std::string("-") : fmt::format("{:.2f}", uncut.get<double>()),
      counts["gouged_vertices"].get<int>());
}

/// The head of a table of residuals.
std::string residual_head() {
  return fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12} {:>8} {:>7}", "residual in um", "PV",
                     "RMS", "min", "max", "uncut %", "gouged");
}

/// The line below it where the machine does not reach all of a generated program.
std::string unreached_line(const nlohmann::ordered_json& json) {
  const auto& u = json["unreached"];
  if (u.is_null()) return {};
  return fmt::format("not reached by the machine: {} of {} passes, parts of {}\n",
                     u["passes"].get<int>(), u["all_passes"].get<int>(),
                     u["broken_passes"].get<int>());
}

std::string comparison_text(const nlohmann::ordered_json& json) {
  std::string text = residual_head() + "   machine's part, RMS\n";
  for (const auto& one : json["cases"]) {
    std::string machine;
    if (!one["machine_um"].is_null() && !one["machine_um"]["rms"].is_null())
      machine = fmt::format("{:.6f}", one["machine_um"]["rms"].get<double>());
    if (!one["reduction_percent"].is_null() && !one["reduction_percent"]["machine_rms"].is_null())
      machine +=
          fmt::format("  ({:+.2f} %)", -one["reduction_percent"]["machine_rms"].get<double>());
    text += fmt::format("{:<36} {} {}   {}\n", one["name"].get<std::string>(),
                        figures(one["residual_um"]), left_out(one), machine);
  }
  return text + unreached_line(json);
}

}  // namespace

Option compensator_option(std::vector<std::filesystem::path>& files) {
  return {"--compensator", &files,
          "one of your own: a program that speaks JSON lines or a C library "
          "(sim/compensation/README.md)",
          Type{"FILE"}};
}

RunOptions run_options(const Common& common,
                       const std::vector<std::filesystem::path>& compensators) {
  RunOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  options.plug_ins = compensators;
  for (const std::filesystem::path& file : compensators) {
    try {
      plug_in_case(file);
    } catch (const std::invalid_argument& fault) {
      throw BadUsage("--compensator", fault.what());
    }
  }
  return options;
}

Exit print_outcome(const Common& common, const RunOptions& options, const Outcome& outcome) {
  if (common.json) {
    print("{}", Lines(json_text(outcome.json)));
  } else if (outcome.json.contains("cases")) {
    print("{}", Lines(comparison_text(one_lined(outcome.json))));
    print("\nfiles in {}{}\n", options.folder.string(),
          draws_pictures() ? "; comparison.png shows all cases on one scale" : "");
  } else {
    print("{}\n{:<36} {} {}\n{}files in {}\n", residual_head(),
          outcome.json["case"].get<std::string>(), figures(outcome.json["residual_um"]),
          left_out(outcome.json), Lines(unreached_line(outcome.json)), options.folder.string());
  }
  if (!common.json && outcome.sensors)
    print("{}", Lines(sensor_choices_text(*outcome.sensors)));
  print_warnings(outcome.json);
  if (!draws_pictures())
    print(stderr, "abbe: warning: this program was built without VTK: no pictures and no .vtp\n");
  for (const std::string& limit : outcome.exceeded) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : outcome.failed) print(stderr, "abbe: {}\n", Lines(failure));
  if (!outcome.failed.empty()) return Exit::PlugIn;
  return outcome.exceeded.empty() ? Exit::Ok : Exit::LimitExceeded;
}

}  // namespace abbe::sim
