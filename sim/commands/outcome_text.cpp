#include "sim/commands/outcome_text.h"

#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/pictures.h"
#include "sim/report/sensor_choices_text.h"
#include "sim/report/summary_report.h"
#include "sim/scene/case_name.h"

namespace abbe::sim {
namespace {

/// A word as a shell takes it.
std::string quoted(const std::string& word) {
  const bool is_plain = word.find_first_not_of(
                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                            "_-./=:,+") == std::string::npos;
  if (is_plain && !word.empty()) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace

Option compensator_option(std::vector<std::filesystem::path>& files) {
  return {"--compensator", &files,
          "one of your own: a program that speaks JSON lines or a C library "
          "(sim/compensation/README.md)",
          Type{"FILE"}};
}

Option save_option(std::vector<std::string>& formats) {
  return {"--save", &formats,
          "files of the map, residual.FORMAT, in place of residual.vtp alone: ply for MeshLab and "
          "CloudCompare, stl the machined surface, csv, npz for NumPy, json what it is; track: "
          "where the tool was at every sample, "
          "track.npz",
          OneOf{map_formats()}, Commas{}};
}

Option report_option(bool& report) {
  return {"--report", &report, "besides, report.html: the maps and the machine to be turned"};
}

Option language_option(std::string& language) {
  return {"--language", &language, "in which the report opens", OneOf{{"en", "zh"}}};
}

void ask_report(RunOptions& options, const Common& common, const std::string& command,
                const std::string& language) {
  options.report_language = language;
  options.command = "abbe " + command + " " + quoted(common.scene.string());
  for (const std::string& one : common.set) options.command += " --set " + quoted(one);
  if (common.seed) options.command += " --seed " + std::to_string(*common.seed);
  for (const std::filesystem::path& file : options.plug_ins)
    options.command += " --compensator " + quoted(file.string());
}

RunOptions run_options(const Common& common, const std::vector<std::filesystem::path>& compensators,
                       const std::vector<std::string>& formats) {
  RunOptions options;
  options.overrides = overrides(common);
  options.folder = result_folder(common);
  options.permissions = common.permissions;
  options.plug_ins = compensators;
  if (!formats.empty()) options.formats = formats;
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
  const bool many = std::holds_alternative<Comparison>(outcome.figures);
  std::visit(
      [&](const auto& figures) {
        print("{}", Lines(common.json ? json_text(to_json(figures)) : to_text(figures)));
      },
      outcome.figures);
  if (!common.json)
    print("{}files in {}{}\n", Lines(many ? "\n" : ""), options.folder.string(),
          many && draws_pictures() ? "; comparison.png shows all cases on one scale" : "");
  if (!common.json && outcome.sensors) print("{}", Lines(sensor_choices_text(*outcome.sensors)));
  std::visit([](const auto& figures) { print_warnings(figures.warnings); }, outcome.figures);
  if (!draws_pictures())
    print(stderr, "abbe: warning: this program was built without VTK: no pictures and no .vtp\n");
  const std::string font =
      std::visit([](const auto& figures) { return font_warning(figures.scene); }, outcome.figures);
  if (!font.empty()) print(stderr, "abbe: warning: {}\n", font);
  for (const std::string& limit : outcome.exceeded) print(stderr, "abbe: {}\n", limit);
  for (const std::string& failure : outcome.failed) print(stderr, "abbe: {}\n", Lines(failure));
  if (!outcome.failed.empty()) return Exit::PlugIn;
  return outcome.exceeded.empty() ? Exit::Ok : Exit::LimitExceeded;
}

}  // namespace abbe::sim
