#include "sim/commands/command.h"

#include <limits>

#include "sim/files/terminal.h"
#include "sim/scene/case_name.h"

namespace abbe::sim {

Option set_option(Common& common, const std::string& help) {
  return {"--set", &common.set, help, Type{"KEY=VALUE"}};
}

Option seed_option(Common& common, const std::string& help) {
  return {"--seed", &common.seed, help, Between{0, std::numeric_limits<std::int64_t>::max()}};
}

Option threads_option(Common& common, const std::string& help) {
  return {"--threads", &common.threads, help, Between{1, 1024}};
}

Option memory_option(Common& common) {
  return {
      "--memory-gb", &common.memory_gb,
      "memory to plan for (all of the computer): `run` holds fewer samples of the program at once; "
      "what would take more still is refused with an estimate before it begins",
      Between{0, 1'000'000}};
}

Option json_option(Common& common) {
  return {"--json", &common.json, "print JSON instead of text"};
}

Option result_folder_option(Common& common) {
  return {"--out", &common.out,
          "folder for every file (out/SCENE): new, empty, or of abbe's results"};
}

Option force_option(Common& common) {
  return {"--force", &common.permissions.force,
          "write into a folder, or over a file, that abbe did not make; what the run reads "
          "is never touched"};
}

Option trust_option(Common& common) {
  return {"--trust", &common.permissions.trust,
          "run the programs that the file names (check lists those of a scene); folders to "
          "trust for good stand in ~/.config/abbe/trust"};
}

std::vector<Option> scene_options(Common& common, const std::vector<Option>& own) {
  std::vector<Option> all{
      {"SCENE", &common.scene, "scene file (TOML); its format is in scenes/README.md"},
      set_option(common, "change a value of the scene: --set errors.scale=2 (repeatable)"),
      seed_option(common, "seed of everything that is random"),
      threads_option(common, "most threads to use (all); results do not depend on it"),
      json_option(common)};
  all.insert(all.end(), own.begin(), own.end());
  return all;
}

std::vector<Override> overrides(const Common& common) {
  std::vector<Override> all;
  for (const std::string& text : common.set) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw BadUsage("--set", "expected key=value, seen " + text);
    all.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  if (common.seed) all.emplace_back("seed", std::to_string(*common.seed));
  return all;
}

std::filesystem::path file_of_out(const std::filesystem::path& out, const std::string& name) {
  std::error_code none;
  return out.has_extension() && !std::filesystem::is_directory(out, none) ? out : out / name;
}

std::filesystem::path result_folder(const Common& common) {
  return common.out.empty() ? std::filesystem::path("out") / common.scene.stem() : common.out;
}

void check_case(const std::string& name) {
  try {
    parse_case(name);
  } catch (const std::invalid_argument& fault) {
    throw BadUsage("--case", fault.what());
  }
}

void print_assumptions(const std::vector<program::Assumption>& assumptions) {
  for (const program::Assumption& assumption : assumptions)
    print(stderr, "abbe: assumed: {}\n", program::to_text(assumption));
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) print(stderr, "abbe: warning: {}\n", warning);
}

}  // namespace abbe::sim
