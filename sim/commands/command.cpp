#include "sim/commands/command.h"

#include <limits>
#include <new>

#include <fmt/format.h>

#include "sim/compensation/plug_in.h"
#include "sim/cut/collision_events.h"
#include "sim/dialects/read_options.h"
#include "sim/files/atomic_output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/scene/cases.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

Exit exit_code(const std::function<Exit()>& program) {
  try {
    const Exit code = program();
    // Flushed here, so that a failure to write the rest of the output changes the exit code.
    flush_output();
    return code;
  } catch (const Interrupted&) {
    print(stderr, "abbe: interrupted\n");
    return Exit::Interrupted;
  } catch (const BadUsage& error) {
    print(stderr, "abbe: {}\n", error.what());
    return Exit::Usage;
  } catch (const BadScene& input_errors) {
    for (const BadInput& error : input_errors.input_errors)
      print(stderr, "abbe: {}\n", error.what());
    return Exit::Input;
    // BadProgram holds all errors of a program. It derives from BadInput, so it comes first.
  } catch (const dialects::BadProgram& input_errors) {
    for (const BadInput& error : input_errors.input_errors)
      print(stderr, "abbe: {}\n", error.what());
    return Exit::Input;
  } catch (const BadInput& error) {
    print(stderr, "abbe: {}\n", error.what());
    return Exit::Input;
  } catch (const CollisionStop& stop) {
    print(stderr, "abbe: {}\n", stop.what());
    return Exit::LimitExceeded;
  } catch (const compensation::PlugInFailure& failure) {
    print(stderr, "abbe: {}\n", MultilineText(failure.what()));
    return Exit::PlugIn;
  } catch (const OutputFailure& failure) {
    print(stderr, "abbe: {}\n", failure.what());
    return Exit::Output;
    // The scene is valid but cannot be computed, so this counts as a numerical failure.
  } catch (const std::bad_alloc&) {
    print(stderr, "abbe: not enough memory for this scene\n");
    return Exit::Numerical;
  } catch (const std::exception& failure) {
    print(stderr, "abbe: {}\n", failure.what());
    return Exit::Numerical;
  }
}

Option set_option(CommonOptions& common, const std::string& help) {
  return {"--set", &common.set, help, TypeName{"KEY=VALUE"}};
}

Option seed_option(CommonOptions& common, const std::string& help) {
  return {"--seed", &common.seed, help, NumberRange{0, std::numeric_limits<std::int64_t>::max()}};
}

Option threads_option(CommonOptions& common, const std::string& help) {
  return {"--threads", &common.threads, help, NumberRange{1, 1024}};
}

Option memory_option(CommonOptions& common) {
  return {"--memory-gb", &common.memory_gb,
          "memory limit (all of the computer): `run` and `compare` keep fewer samples of the "
          "program in memory; a job that still needs more is rejected with an estimate before it "
          "begins",
          NumberRange{0, 1'000'000}};
}

Option json_option(CommonOptions& common) {
  return {"--json", &common.json, "print JSON instead of text"};
}

Option result_folder_option(CommonOptions& common) {
  return {"--out", &common.out,
          "folder for all files (out/SCENE): new, empty, or with earlier results of abbe"};
}

Option force_option(CommonOptions& common) {
  return {"--force", &common.permissions.force,
          "write into a folder, or overwrite a file, that abbe did not create; input files are "
          "never overwritten"};
}

Option trust_option(CommonOptions& common) {
  return {"--trust", &common.permissions.trust,
          "run the programs named in the file (check lists them); permanently trusted folders are "
          "listed in ~/.config/abbe/trust"};
}

std::vector<Option> scene_options(CommonOptions& common,
                                  const std::vector<Option>& command_options) {
  std::vector<Option> options{
      {"SCENE", &common.scene, "scene file (TOML); see scenes/README.md for the format"},
      set_option(common, "change a value of the scene: --set errors.scale=2 (repeatable)"),
      seed_option(common, "seed of all random numbers"),
      threads_option(common, "maximum number of threads (all); results do not depend on it"),
      json_option(common)};
  options.insert(options.end(), command_options.begin(), command_options.end());
  return options;
}

std::vector<Override> overrides(const CommonOptions& common) {
  std::vector<Override> result;
  for (const std::string& text : common.set) {
    // Split at the first '=', because a value may contain '=' but a key may not.
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw BadUsage("--set", "expected key=value, seen " + text);
    result.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  // Appended last, so that --seed takes precedence over --set seed=...
  if (common.seed) result.emplace_back("seed", std::to_string(*common.seed));
  return result;
}

std::filesystem::path output_file(const std::filesystem::path& out, const std::string& name) {
  std::error_code ignored_error;
  return out.has_extension() && !std::filesystem::is_directory(out, ignored_error) ? out
                                                                                   : out / name;
}

std::filesystem::path result_folder(const CommonOptions& common) {
  return common.out.empty() ? std::filesystem::path("out") / common.scene.stem() : common.out;
}

void check_case(const std::string& name) {
  try {
    parse_case(name);
  } catch (const std::invalid_argument& error) {
    throw BadUsage("--case", error.what());
  }
}

void print_assumptions(const std::vector<program::Assumption>& assumptions) {
  for (const program::Assumption& assumption : assumptions)
    print(stderr, "abbe: assumed: {}\n", program::to_text(assumption));
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) print(stderr, "abbe: warning: {}\n", warning);
}

namespace {

/// Returns the rule of this type; null if the option has none.
template <typename Kind>
const Kind* find_rule(const Option& option) {
  const Kind* rule = std::get_if<Kind>(&option.rule);
  return rule ? rule : std::get_if<Kind>(&option.second_rule);
}

bool has_dashes(const Option& option) { return option.name.starts_with('-'); }

template <typename... Kinds>
bool holds_one_of(const Target& target) {
  return (std::holds_alternative<Kinds>(target) || ...);
}

/// Returns true if the value of an option is a path.
bool is_file(const Option& option) {
  return holds_one_of<std::filesystem::path*, std::optional<std::filesystem::path>*,
                      std::vector<std::filesystem::path>*>(option.target);
}

}  // namespace

std::vector<Option> named_options(const Command& command) {
  std::vector<Option> named;
  for (const std::vector<Option>& options : {command.options, command.required_choice})
    for (const Option& option : options)
      if (has_dashes(option)) named.push_back(option);
  named.push_back({"--help", static_cast<bool*>(nullptr), "print the help of this command"});
  return named;
}

std::vector<Option> positional_options(const Command& command) {
  std::vector<Option> positional;
  for (const Option& option : command.options)
    if (!has_dashes(option)) positional.push_back(option);
  return positional;
}

bool is_flag(const Option& option) { return holds_one_of<bool*>(option.target); }

std::vector<std::string> possible_values(const Option& option) {
  const OneOf* rule = find_rule<OneOf>(option);
  return rule ? rule->values : std::vector<std::string>{};
}

// The order matters: an option for a file that enumerates values must offer the values.
CompletionKind completion_kind(const Option& option) {
  if (!possible_values(option).empty()) return CompletionKind::Words;
  if (option.name == "--case") return CompletionKind::Cases;
  if (option.name == "--set") return CompletionKind::Settings;
  if (option.name == "KEY") return CompletionKind::Keys;
  return is_file(option) ? CompletionKind::Files : CompletionKind::Nothing;
}

bool has_study_keys(const Command& command) {
  const std::vector<Option> positional = positional_options(command);
  return !positional.empty() && positional.front().name == "STUDY";
}

}  // namespace abbe::sim
