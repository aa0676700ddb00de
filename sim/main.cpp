#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "sim/compare.h"
#include "sim/describe.h"
#include "sim/output.h"
#include "sim/pictures.h"
#include "sim/pose_at.h"
#include "sim/progress.h"

namespace abbe::sim {
namespace {

enum Exit {
  ok = 0,
  limit_exceeded = 1,
  usage = 2,
  input = 3,
  numerical = 4,
  output = 5,
  plug_in = 6,
  interrupted = 130
};

/// What several commands take.
struct Common {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::vector<std::string> set;
  std::optional<std::int64_t> seed;
  int threads = 0;
  bool json = false;
};

std::vector<Override> overrides(const Common& common) {
  std::vector<Override> all;
  for (const std::string& text : common.set) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw CLI::ValidationError("--set", "expected key=value, seen " + text);
    all.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  if (common.seed) all.emplace_back("seed", std::to_string(*common.seed));
  return all;
}

RunOptions run_options(const Common& common) {
  RunOptions options;
  options.overrides = overrides(common);
  options.folder =
      common.out.empty() ? std::filesystem::path("out") / common.scene.stem() : common.out;
  return options;
}

void add_common(CLI::App& command, Common& common, bool writes) {
  command.add_option("SCENE", common.scene, "scene file (TOML); its format is in scenes/README.md")
      ->required();
  command
      .add_option("--set", common.set,
                  "change a value of the scene: --set errors.scale=2 (repeatable)")
      ->type_name("KEY=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  command.add_option("--seed", common.seed, "seed of everything that is random")
      ->check(CLI::Range(std::int64_t(0), std::numeric_limits<std::int64_t>::max()));
  command
      .add_option("--threads", common.threads,
                  "most threads to use (all); results do not depend on it")
      ->check(CLI::Range(1, 1024));
  command.add_flag("--json", common.json, "print JSON instead of text");
  if (writes) command.add_option("--out", common.out, "folder for every file (out/SCENE)");
}

std::string figures(const nlohmann::ordered_json& s) {
  const auto um = [](const nlohmann::ordered_json& number) {
    return number.is_null() ? std::string("-") : fmt::format("{:.4f}", number.get<double>());
  };
  return fmt::format("{:>12} {:>12} {:>12} {:>12}", um(s["pv"]), um(s["rms"]), um(s["min"]),
                     um(s["max"]));
}

std::string comparison_text(const nlohmann::ordered_json& json) {
  std::string text = fmt::format("{:<36} {:>12} {:>12} {:>12} {:>12}   {}\n", "residual in um",
                                 "PV", "RMS", "min", "max", "machine's part, RMS");
  for (const auto& one : json["cases"]) {
    std::string machine;
    if (!one["machine_um"].is_null() && !one["machine_um"]["rms"].is_null())
      machine = fmt::format("{:.6f}", one["machine_um"]["rms"].get<double>());
    if (!one["reduction_percent"].is_null() && !one["reduction_percent"]["machine_rms"].is_null())
      machine +=
          fmt::format("  (-{:.2f} %)", one["reduction_percent"]["machine_rms"].get<double>());
    text += fmt::format("{:<36} {}   {}\n", one["name"].get<std::string>(),
                        figures(one["residual_um"]), machine);
  }
  return text;
}

int finish(const Common& common, const RunOptions& options, const Outcome& outcome) {
  if (common.json) {
    fmt::print("{}\n", outcome.json.dump(2));
  } else if (outcome.json.contains("cases")) {
    fmt::print("{}", comparison_text(outcome.json));
    fmt::print("\nfiles in {}; comparison.png shows all cases on one scale\n",
               options.folder.string());
  } else {
    fmt::print("{:<36} {:>12} {:>12} {:>12} {:>12}\n", "residual in um", "PV", "RMS", "min", "max");
    fmt::print("{:<36} {}\nfiles in {}\n", outcome.json["case"].get<std::string>(),
               figures(outcome.json["residual_um"]), options.folder.string());
  }
  if (outcome.json.contains("warnings"))
    for (const auto& warning : outcome.json["warnings"])
      fmt::print(stderr, "abbe: warning: {}\n", warning.get<std::string>());
  for (const std::string& limit : outcome.exceeded) fmt::print(stderr, "abbe: {}\n", limit);
  return outcome.exceeded.empty() ? ok : limit_exceeded;
}

int run_command(const Common& common, const std::string& case_name) {
  RunOptions options = run_options(common);
  options.case_name = case_name;
  if (!case_name.empty() && case_name != "error_free" && case_name != "uncompensated") {
    try {
      parse_case(case_name);
    } catch (const std::invalid_argument& fault) {
      throw CLI::ValidationError("--case", fault.what());
    }
  }
  return finish(common, options, run(common.scene, options));
}

int compare_command(const Common& common) {
  const RunOptions options = run_options(common);
  return finish(common, options, compare(common.scene, options));
}

int pose_command(const Common& common, const std::string& at) {
  const Scene scene = read_scene(common.scene, overrides(common));
  const nlohmann::ordered_json pose = pose_at(scene, at);
  fmt::print("{}", common.json ? pose.dump(2) + "\n" : pose_text(pose));
  return ok;
}

int check_command(const Common& common, bool picture) {
  const Scene scene = read_scene(common.scene, overrides(common));
  const Job job = prepare(scene);
  const nlohmann::ordered_json description = describe(job);
  if (picture) {
    const std::filesystem::path folder = run_options(common).folder;
    prepare_folder(folder);
    write_check_picture(folder / "check.png", job);
    fmt::print(stderr, "picture in {}\n", (folder / "check.png").string());
  }
  fmt::print("{}", common.json ? description.dump(2) + "\n" : to_text(description));
  return ok;
}

/// Everything that can stand on the command line.
struct CommandLine {
  Common common;
  std::string case_name;
  std::string at;
  bool picture = false;
  RenderOptions rendering;
};

void add_scene_commands(CLI::App& app, CommandLine& line) {
  CLI::App& run_app =
      *app.add_subcommand("run", "Cut one case of a scene (uncompensated unless --case)");
  add_common(run_app, line.common, true);
  run_app.add_option("--case", line.case_name,
                     "error_free, uncompensated or belief-strategy-channel");

  add_common(*app.add_subcommand(
                 "compare", "Cut error-free, uncompensated and every compensator of the scene"),
             line.common, true);

  CLI::App& pose_app =
      *app.add_subcommand("pose", "Where the tool is and should be for given axis positions");
  add_common(pose_app, line.common, false);
  pose_app
      .add_option("--at", line.at, "positions in mm and degrees: \"X=100 Y=0 Z=50 A=30 C=90\"")
      ->required();

  CLI::App& check_app =
      *app.add_subcommand("check", "Validate a scene and say how it was understood; cut nothing");
  add_common(check_app, line.common, true);
  check_app.add_flag("--picture", line.picture, "draw machine, part and path, errors magnified");
}

void add_render_command(CLI::App& app, CommandLine& line) {
  CLI::App& render_app =
      *app.add_subcommand("render", "Draw a finished result again, or a difference of two");
  render_app
      .add_option("RESULT", line.rendering.result, "residual.vtp or a folder that has one")
      ->required();
  render_app.add_option("--minus", line.rendering.minus,
                        "another result, taken away vertex by vertex");
  render_app
      .add_option("--line", line.rendering.line, "profile along x, y or radius instead of the map")
      ->check(CLI::IsMember({"x", "y", "radius"}));
  render_app.add_option("--out", line.rendering.out, "folder for the pictures (that of RESULT)");
  render_app.add_option("--threads", line.common.threads, "most threads to use")
      ->check(CLI::Range(1, 1024));
}

int dispatch(const CLI::App& app, const CommandLine& line) {
  std::optional<tbb::global_control> limit;
  if (line.common.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(line.common.threads));
  if (app.got_subcommand("run")) return run_command(line.common, line.case_name);
  if (app.got_subcommand("compare")) return compare_command(line.common);
  if (app.got_subcommand("pose")) return pose_command(line.common, line.at);
  if (app.got_subcommand("check")) return check_command(line.common, line.picture);
  fmt::print("picture in {}\n", render_result(line.rendering).string());
  return ok;
}

int command_line(int argc, char** argv) {
  CLI::App app{
      "abbe: a virtual five-axis machine tool that is wrong on purpose.\n"
      "It cuts a part on a machine with errors and shows, in micrometres on the design surface, "
      "what they\ndid, with and without a compensator.\n\n"
      "Start with:  abbe compare scenes/gantry_dome.toml"};
  app.set_version_flag("--version", versions()["abbe"].get<std::string>());
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
      "4 numerical, 5 output, 130 interrupted.");
  CommandLine line;
  add_scene_commands(app, line);
  add_render_command(app, line);
  try {
    app.parse(argc, argv);
    return dispatch(app, line);
  } catch (const CLI::Success& asked) {
    return app.exit(asked);
  } catch (const CLI::ValidationError& fault) {
    fmt::print(stderr, "abbe: {}\n", fault.what());
  } catch (const CLI::ParseError& fault) {
    app.exit(fault);
  }
  return usage;
}

}  // namespace
}  // namespace abbe::sim

int main(int argc, char** argv) {
  using namespace abbe;
  sim::watch_interrupts();
  try {
    return sim::command_line(argc, argv);
  } catch (const sim::Interrupted&) {
    fmt::print(stderr, "abbe: interrupted\n");
    return 130;
  } catch (const sim::BadScene& faults) {
    for (const BadInput& fault : faults.faults) fmt::print(stderr, "abbe: {}\n", fault.what());
    return sim::input;
  } catch (const BadInput& fault) {
    fmt::print(stderr, "abbe: {}\n", fault.what());
    return sim::input;
  } catch (const sim::OutputFailure& failure) {
    fmt::print(stderr, "abbe: {}\n", failure.what());
    return sim::output;
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "abbe: not enough memory for this scene\n");
    return sim::numerical;
  } catch (const std::exception& failure) {
    fmt::print(stderr, "abbe: {}\n", failure.what());
    return sim::numerical;
  }
}
