#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "sim/files/output.h"
#include "sim/program/path.h"
#include "sim/scene/document.h"

namespace abbe::sim {

/// What the program says to the shell.
enum class Exit {
  Ok = 0,
  LimitExceeded = 1,
  Usage = 2,
  Input = 3,
  Numerical = 4,
  Output = 5,
  PlugIn = 6,
  Interrupted = 130
};

/// A value of an option that the command cannot take. what(): "--set: expected ..."
struct BadUsage : std::invalid_argument {
  BadUsage(const std::string& option, const std::string& reason)
      : std::invalid_argument(option + ": " + reason) {}
};

/// Returns the exit code of a program, or the one that its exception stands for, which is printed.
/// Standard output that was lost counts as an exception.
Exit exit_code(const std::function<Exit()>& program);

// Commands as values: what each takes, and what runs it. None knows the library that reads the
// command line.

/// Where the words of an option go; what is not on the command line stays as it is.
using Target = std::variant<bool*, int*, double*, std::string*, std::filesystem::path*,
                            std::optional<std::int64_t>*, std::optional<std::string>*,
                            std::optional<std::filesystem::path>*, std::vector<std::string>*,
                            std::vector<std::filesystem::path>*>;

// Rules of an option. Those that it names stand before it in the list.
struct Between {
  std::int64_t least, most;
};
struct OneOf {
  std::vector<std::string> values;
};
struct CommaSeparated {};  ///< a list may be given at once: a,b,c
struct Bare {};            ///< without a value it is there and empty
struct Excludes {
  std::vector<std::string> options;
};
struct RequiresOption {
  std::string option;
};
struct TypeName {
  std::string name;  ///< of its value in `--help`
};
struct OptionalArgument {};  ///< of an option that is known by its place
using Rule = std::variant<std::monostate, Between, OneOf, CommaSeparated, Bare, Excludes,
                          RequiresOption, TypeName, OptionalArgument>;

/// An option as `--help` lists it.
struct Option {
  std::string name;  ///< "--seed"; without dashes it is known by its place, and must be there
                     ///< unless a rule says otherwise
  Target target;     ///< a bool is a flag; a list is repeatable
  std::string help;
  Rule rule = {};
  Rule second_rule = {};
};

struct Command {
  std::string name, summary;
  std::vector<std::string> examples;  ///< whole lines: "abbe run scenes/gantry_dome.toml"
  std::vector<Option> options;
  std::function<Exit()> run;  ///< with its options read
  std::string footer = {};
  std::vector<Option> where = {};  ///< besides, exactly one of these
};

/// What several commands take.
struct CommonOptions {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::vector<std::string> set;
  std::optional<std::int64_t> seed;
  int threads = 0;         ///< 0: all
  double memory_gb = 0.0;  ///< 0: what the computer has
  bool json = false;
  Permissions permissions;
  std::string commit;  ///< from which the program was built
};

// options that several commands have
Option set_option(CommonOptions& common, const std::string& help);
Option seed_option(CommonOptions& common, const std::string& help);
Option threads_option(CommonOptions& common, const std::string& help);
Option memory_option(CommonOptions& common);
Option json_option(CommonOptions& common);
Option result_folder_option(CommonOptions& common);
Option force_option(CommonOptions& common);
Option trust_option(CommonOptions& common);

/// What every command takes that reads a scene, and then its own.
std::vector<Option> scene_options(CommonOptions& common, const std::vector<Option>& own);

/// What --set and --seed change. @throws BadUsage
std::vector<Override> overrides(const CommonOptions& common);

/// The file of a command that writes one: what --out names if that has an ending, as belief.toml,
/// and is no folder; else `name` in that folder.
std::filesystem::path output_file(const std::filesystem::path& out, const std::string& name);

/// The folder of --out, else out/SCENE.
std::filesystem::path result_folder(const CommonOptions& common);

/// @throws BadUsage for a --case that there cannot be
void check_case(const std::string& name);

/// Prints what a reader of programs assumed, one line each, on standard error.
void print_assumptions(const std::vector<program::Assumption>& assumptions);

/// Warnings of a result, on standard error.
void print_warnings(const std::vector<std::string>& warnings);

// What pages of the manual and completions ask of an option.

/// Every option of a command that has dashes, `--help` among them, in the order of `--help`.
std::vector<Option> named_options(const Command& command);

/// What a command takes by its place.
std::vector<Option> positional_options(const Command& command);

bool is_flag(const Option& option);
bool is_list(const Option& option);
bool is_optional_argument(const Option& option);

/// The words that its value may be; empty where they are not listed.
std::vector<std::string> words_of(const Option& option);

/// Its value as a page calls it: "FILE", "N", "KEY=VALUE", "x|y|radius"; empty for a flag.
std::string value_name(const Option& option);

/// What a shell offers for a value.
enum class CompletionKind { Nothing, Words, Cases, Settings, Keys, Files };
CompletionKind completion_kind(const Option& option);

/// Whether `--set` of a command changes a study, not a scene.
bool has_study_keys(const Command& command);

}  // namespace abbe::sim
