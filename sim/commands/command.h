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

/// Exit codes of the program, commands and their options, and helpers that all commands share.
namespace abbe::sim {

/// Exit codes of the program.
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

/// Thrown for an invalid value of an option, with a message such as "--set: expected ...".
struct BadUsage : std::invalid_argument {
  BadUsage(const std::string& option, const std::string& reason)
      : std::invalid_argument(option + ": " + reason) {}
};

/// Runs a program and returns its exit code. If it throws, prints the exception and returns the
/// code of its type. A failed write to standard output is treated like an exception.
Exit exit_code(const std::function<Exit()>& program);

// Commands are values with options and a function that runs them. They do not depend on the library
// that parses the command line.

/// Variable that receives the value of an option; it keeps its value if the option is not given.
using Target = std::variant<bool*, int*, double*, std::string*, std::filesystem::path*,
                            std::optional<std::int64_t>*, std::optional<std::string>*,
                            std::optional<std::filesystem::path>*, std::vector<std::string>*,
                            std::vector<std::filesystem::path>*>;

// Rules of an option. Options that a rule names must precede it in the list of options.

/// The value must be in this range.
struct NumberRange {
  std::int64_t min_value, max_value;
};
/// The value must be one of these.
struct OneOf {
  std::vector<std::string> values;
};
struct CommaSeparated {};  ///< accepts several values, separated by commas: a,b,c
struct OptionalValue {};   ///< the value may be omitted; it is then an empty string
/// The option must not be combined with these.
struct Excludes {
  std::vector<std::string> options;
};
/// The option is valid only together with this one.
struct RequiresOption {
  std::string option;
};
/// Name of the value in `--help`.
struct TypeName {
  std::string name;
};
struct OptionalArgument {};  ///< a positional argument that may be omitted
using Rule = std::variant<std::monostate, NumberRange, OneOf, CommaSeparated, OptionalValue,
                          Excludes, RequiresOption, TypeName, OptionalArgument>;

/// An option of a command.
struct Option {
  /// "--seed"; a name without dashes is a positional argument, which is required unless a rule
  /// states otherwise.
  std::string name;
  Target target;  ///< a bool makes the option a flag; a list makes it repeatable
  std::string help;
  Rule rule = {};
  Rule second_rule = {};
};

/// A command with its options and the function that runs it.
struct Command {
  std::string name, summary;
  std::vector<std::string> examples;  ///< complete lines: "abbe run scenes/gantry_dome.toml"
  std::vector<Option> options;
  std::function<Exit()> run;  ///< called after its options are parsed
  std::string footer = {};
  std::vector<Option> required_choice = {};  ///< further options, of which exactly one is required
};

/// Values of the options that several commands have.
struct CommonOptions {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::vector<std::string> set;
  std::optional<std::int64_t> seed;
  int threads = 0;         ///< 0: all threads
  double memory_gb = 0.0;  ///< 0: the memory of the computer
  bool json = false;
  Permissions permissions;
  std::string commit;  ///< commit from which the program was built
};

// Options that several commands have. Each stores its value in `common`.
Option set_option(CommonOptions& common, const std::string& help);
Option seed_option(CommonOptions& common, const std::string& help);
Option threads_option(CommonOptions& common, const std::string& help);
Option memory_option(CommonOptions& common);
Option json_option(CommonOptions& common);
Option result_folder_option(CommonOptions& common);
Option force_option(CommonOptions& common);
Option trust_option(CommonOptions& common);

/// Returns the options that every command with a scene has, followed by those of one command.
std::vector<Option> scene_options(CommonOptions& common,
                                  const std::vector<Option>& command_options);

/// Returns the overrides of --set and --seed.
/// @throws BadUsage
std::vector<Override> overrides(const CommonOptions& common);

/// Returns the output file of a command that writes one file. It is `out` if that has an extension,
/// such as belief.toml, and is not a folder; otherwise `name` in the folder `out`.
std::filesystem::path output_file(const std::filesystem::path& out, const std::string& name);

/// Returns the folder given by --out; out/SCENE by default.
std::filesystem::path result_folder(const CommonOptions& common);

/// Throws BadUsage if the name of a --case is invalid.
void check_case(const std::string& name);

/// Prints to standard error, one per line, the assumptions made while reading a program.
void print_assumptions(const std::vector<program::Assumption>& assumptions);

/// Prints warnings to standard error.
void print_warnings(const std::vector<std::string>& warnings);

// Properties of options for shell completion.

/// Returns all options of a command that begin with dashes, including `--help`, in the order of
/// `--help`.
std::vector<Option> named_options(const Command& command);

/// Returns the positional arguments of a command.
std::vector<Option> positional_options(const Command& command);

/// Returns true if an option has no value.
bool is_flag(const Option& option);

/// Returns the possible values of an option; an empty list if they are not enumerated.
std::vector<std::string> possible_values(const Option& option);

/// Kind of completion that a shell offers for a value.
enum class CompletionKind { Nothing, Words, Cases, Settings, Keys, Files };
/// Returns the kind of completion for the value of an option.
CompletionKind completion_kind(const Option& option);

/// Returns true if the keys of `--set` of a command are those of a study, not of a scene.
bool has_study_keys(const Command& command);

}  // namespace abbe::sim
