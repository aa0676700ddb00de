#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "sim/commands/exit_code.h"
#include "sim/files/permissions.h"
#include "sim/program/assumption.h"
#include "sim/scene/override.h"

/// Commands as values: what each takes, and what runs it. None knows the library that reads the
/// command line.
namespace abbe::sim {

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
struct Commas {};  ///< a list may be given at once: a,b,c
struct Bare {};    ///< without a value it is there and empty
struct Excludes {
  std::vector<std::string> options;
};
struct Needs {
  std::string option;
};
struct Type {
  std::string name;  ///< of its value in `--help`
};
struct MayBeLeftOut {};  ///< of an option that is known by its place
using Rule =
    std::variant<std::monostate, Between, OneOf, Commas, Bare, Excludes, Needs, Type, MayBeLeftOut>;

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
struct Common {
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
Option set_option(Common& common, const std::string& help);
Option seed_option(Common& common, const std::string& help);
Option threads_option(Common& common, const std::string& help);
Option memory_option(Common& common);
Option json_option(Common& common);
Option result_folder_option(Common& common);
Option force_option(Common& common);
Option trust_option(Common& common);

/// What every command takes that reads a scene, and then its own.
std::vector<Option> scene_options(Common& common, const std::vector<Option>& own);

/// What --set and --seed change. @throws BadUsage
std::vector<Override> overrides(const Common& common);

/// The file of a command that writes one: what --out names if that has an ending, as belief.toml,
/// and is no folder; else `name` in that folder.
std::filesystem::path file_of_out(const std::filesystem::path& out, const std::string& name);

/// The folder of --out, else out/SCENE.
std::filesystem::path result_folder(const Common& common);

/// @throws BadUsage for a --case that there cannot be
void check_case(const std::string& name);

/// Prints what a reader of programs assumed, one line each, on standard error.
void print_assumptions(const std::vector<program::Assumption>& assumptions);

/// Warnings of a result, on standard error.
void print_warnings(const std::vector<std::string>& warnings);

}  // namespace abbe::sim
