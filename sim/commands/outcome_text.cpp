#include "sim/commands/outcome_text.h"

#include <algorithm>
#include <stdexcept>
#include <string_view>

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

/// A warning without its numbers: by what is left two warnings have one cause.
std::string cause(const std::string& warning) {
  std::string text;
  for (const char c : warning)
    if (std::string_view("0123456789.-").find(c) == std::string_view::npos) text += c;
  return text;
}

std::vector<std::string> one_a_cause(const Summary& figures) { return figures.warnings; }

/// The warnings of a comparison, each cause once with the figures of the first case that has it;
/// its files tell them all.
std::vector<std::string> one_a_cause(const Comparison& all) {
  struct OfCases {
    std::string first, text;
    std::vector<std::string> others;
  };
  std::vector<std::string> lines;
  std::vector<OfCases> causes;
  for (const std::string& warning : all.warnings) {
    const std::size_t colon = std::min(warning.find(": "), warning.size());
    const std::string name = warning.substr(0, colon);
    if (std::ranges::find(all.cases, name, &CaseFigures::name) == all.cases.end()) {
      lines.push_back(warning);
      continue;
    }
    const std::string text = warning.substr(colon);
    const auto known =
        std::ranges::find(causes, cause(text), [](const OfCases& one) { return cause(one.text); });
    if (known == causes.end())
      causes.push_back({name, text, {}});
    else
      known->others.push_back(name);
  }
  for (const OfCases& one : causes) {
    const std::size_t n = one.others.size();
    const std::string others = n == 0   ? ""
                               : n == 1 ? " and " + one.others.front()
                                        : fmt::format(" and {} other cases", n);
    lines.push_back(one.first + others + one.text);
  }
  return lines;
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
  std::visit(
      [](const auto& figures) {
        print_assumptions(figures.assumptions);
        print_warnings(one_a_cause(figures));
      },
      outcome.figures);
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
