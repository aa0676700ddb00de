#include "sim/commands/command_line.h"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <string>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "sim/commands/calibration_commands.h"
#include "sim/commands/help_commands.h"
#include "sim/commands/program_commands.h"
#include "sim/commands/report_commands.h"
#include "sim/commands/run_commands.h"
#include "sim/commands/scene_commands.h"
#include "sim/commands/shell_files.h"
#include "sim/cut/scene_checks.h"
#include "sim/files/program_file.h"
#include "sim/files/terminal.h"
#include "sim/scene/library.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

/// Returns the output of `abbe --version`: version, commit, compiler with preset and flags,
/// libraries, and the folder of the scenes.
/// @param commit  from which the program was built
std::string version_text(const std::string& commit);

namespace {

/// A missing library must not prevent the version from being printed.
std::string library_text() {
  try {
    return library_folder().string();
  } catch (const BadInput& fault) {
    return fault.what();
  }
}

}  // namespace

std::string version_text(const std::string& commit) {
  const std::string preset = ABBE_PRESET;
  return fmt::format(
      "abbe {}\ncommit        {}\ncompiler      {}\npreset        {}\nflags         {}\n"
      "instructions  {}\nlibraries     {}\nscenes        {}",
      version(), commit, ABBE_COMPILER, preset.empty() ? "none" : preset, ABBE_FLAGS,
      versions()["instructions"].get<std::string>(), ABBE_LIBRARIES, library_text());
}

namespace {

using Added = std::map<std::string, CLI::Option*>;

constexpr const char* out_name = "--out";  // has a short form in every command

/// Adds an option to the parser: a bool becomes a flag.
CLI::Option* bound(CLI::App& app, const Option& option) {
  return std::visit(
      [&](auto* target) {
        if constexpr (std::is_same_v<decltype(target), bool*>)
          return app.add_flag(option.name, *target, option.help);
        else
          return app.add_option(option.name == out_name ? "-o," + option.name : option.name,
                                *target, option.help);
      },
      option.target);
}

/// Returns "expected one of a, b (nearest: b), seen c".
std::string slip(const std::string& expected, const std::string& seen,
                 const std::set<std::string>& words) {
  const auto meant = nearest(seen, words);
  return fmt::format("expected {}{}, seen {}", expected, meant ? " (nearest: " + *meant + ")" : "",
                     seen);
}

std::string joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, ", "));
}

/// Applies a rule to an option of the parser.
struct RuleMaker {
  const Option& option;
  CLI::Option& added;
  const Added& others;

  // The option has no rule.
  void operator()(std::monostate) const {}
  void operator()(const Between& rule) const {
    if (std::holds_alternative<double*>(option.target))
      added.check(CLI::Range(double(rule.least), double(rule.most)));
    else
      added.check(CLI::Range(rule.least, rule.most));
  }
  void operator()(const OneOf& rule) const {
    const auto fault = [values = rule.values](const std::string& word) -> std::string {
      if (std::ranges::find(values, word) != values.end()) return {};
      return slip("one of " + joined(values), word, {values.begin(), values.end()});
    };
    added.check(fault, "{" + joined(rule.values) + "}");
  }
  void operator()(const CommaSeparated&) const { added.delimiter(',')->allow_extra_args(); }
  void operator()(const Bare&) const { added.expected(0, 1); }
  void operator()(const Excludes& rule) const {
    for (const std::string& other : rule.options) added.excludes(others.at(other));
  }
  void operator()(const RequiresOption& rule) const { added.needs(others.at(rule.option)); }
  void operator()(const TypeName& rule) const { added.type_name(rule.name); }
  void operator()(const OptionalArgument&) const { added.required(false); }
};

/// Adds options to the parser. Positional arguments are required unless a rule says otherwise; a
/// list takes one value at a time, so that it does not swallow positional arguments.
void add(CLI::App& app, const std::vector<Option>& options, Added& added) {
  for (const Option& option : options) {
    CLI::Option& one = *(added[option.name] = bound(app, option));
    if (option.name.front() != '-')
      one.required();
    else if (one.get_items_expected_max() > 1)
      one.take_all()->allow_extra_args(false);
    for (const Rule& rule : {option.rule, option.second_rule})
      std::visit(RuleMaker{option, one, added}, rule);
  }
}

/// Adds a command with its options and examples to the parser.
void add(CLI::App& app, const Command& command) {
  CLI::App& sub = *app.add_subcommand(command.name, command.summary);
  Added added;
  add(sub, command.options, added);
  if (!command.where.empty()) {
    CLI::Option_group& where = *sub.add_option_group("where", "one of these");
    add(where, command.where, added);
    where.require_option(1);
  }
  std::string footer = "Examples:\n";
  for (const std::string& line : command.examples) footer += "  " + line + "\n";
  sub.footer(footer + command.footer);
}

/// Returns an error message if the first argument is not a command or a global option; else empty.
std::string unknown_command(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options, int argc,
                            char** argv) {
  if (argc < 2) return {};
  const std::string seen = argv[1];
  const bool option = seen.starts_with('-');
  std::set<std::string> words;
  if (option) {
    words = {"-h", "--help", "--version"};
    for (const GlobalOption& question : global_options) words.insert(question.name);
  } else {
    for (const Command& command : commands) words.insert(command.name);
  }
  if (words.contains(seen)) return {};
  return slip(option ? "a command, --help or --version" : "a command", seen, words) +
         "; abbe --help lists them";
}

/// Returns an error message for the first argument that looks like an option but is none of the
/// command; else empty.
std::string unknown_option(const Command& command, int argc, char** argv) {
  std::set<std::string> words{"-h", "--help"};
  for (const std::vector<Option>& options : {command.options, command.where})
    for (const Option& option : options)
      if (option.name.starts_with('-')) words.insert(option.name);
  if (words.contains(out_name)) words.insert("-o");
  // A value such as -1 also begins with a dash, so this is checked only after parsing failed.
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i], name = word.substr(0, word.find('='));
    if (name.size() > 1 && name.starts_with('-') && !words.contains(name))
      return slip("an option of " + command.name, name, words) + "; abbe " + command.name +
             " --help lists them";
  }
  return {};
}

/// Runs a global option with its argument and returns its exit code.
Exit answered(const GlobalOption& question, int argc, char** argv) {
  const int most = 3;
  const bool is_optional_argument = question.argument.starts_with('[');
  if (argc > most || (argc < most && !is_optional_argument))
    throw BadUsage(question.name,
                   fmt::format("expected {}{}, seen {}", is_optional_argument ? "at most one " : "",
                               question.argument, argc > most ? argv[most] : "nothing"));
  const std::string argument = argc == most ? argv[most - 1] : "";
  const std::vector<std::string>& words = question.words;
  if (argc == most && !words.empty() && std::ranges::find(words, argument) == words.end())
    throw BadUsage(question.name,
                   slip("one of " + joined(words), argument, {words.begin(), words.end()}));
  return question.answer(argument);
}

/// Prints help or the version.
Exit answered(const CLI::App& app, const CLI::Success& help) {
  std::ostringstream out, errors;
  app.exit(help, out, errors);
  print("{}", Lines(out.str()));
  return Exit::Ok;
}

/// Parses the arguments of a command.
/// @return the command, or the exit code if help or a usage error was printed
std::variant<const Command*, Exit> parsed(const std::vector<Command>& commands,
                                          const std::string& version, int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "__complete")
    return print_completions(commands, std::vector<std::string>(argv + 2, argv + argc));
  const std::vector<GlobalOption> asked = global_options();
  if (const auto question = std::ranges::find(asked, argc > 1 ? argv[1] : "", &GlobalOption::name);
      question != asked.end())
    return answered(*question, argc, argv);
  CLI::App app{
      fmt::format("abbe: a {}.\n{}\n\nStart with:  abbe new gantry first\n"
                  "             abbe compare first/scene.toml",
                  about_line, about_text)};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  std::string argument;  // global options are listed here and handled above
  for (const GlobalOption& question : asked)
    app.add_option(question.name, argument, question.help)
        ->type_name(question.argument);
  app.footer(std::string("Exit codes: ") + exit_codes_text);
  for (const Command& command : commands) add(app, command);
  const auto refuse = [](const std::string& why) {
    print(stderr, "abbe: {}\n", why);
    return Exit::Usage;
  };
  // Checked before parsing, because the parser would not suggest the nearest command.
  if (const std::string why = unknown_command(commands, asked, argc, argv); !why.empty())
    return refuse(why);
  const auto named =
      std::ranges::find(commands, std::string(argc > 1 ? argv[1] : ""), &Command::name);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ValidationError& fault) {
    return refuse(fault.what());
  } catch (const CLI::Success& help) {
    return answered(app, help);
  } catch (const CLI::ParseError& why) {
    const std::string option = named == commands.end() ? "" : unknown_option(*named, argc, argv);
    if (!option.empty() || named == commands.end())
      return refuse(option.empty() ? why.what() : option);
    return refuse(std::string(why.what()) + "; abbe " + named->name + " --help says what it takes");
  }
  return &*named;
}

}  // namespace

Exit parse_command_line(const std::vector<Command>& commands, int argc, char** argv) {
  const auto result = parsed(commands, "", argc, argv);
  const Exit* exit = std::get_if<Exit>(&result);
  return exit ? *exit : Exit::Ok;
}

/// Help and the version are handled by `parsed`.
Exit run_command_line(const std::vector<Command>& commands, CommonOptions& common, int argc,
                      char** argv) {
  // `abbe help run` means `abbe run --help`.
  std::string help = "--help";
  std::vector<char*> words(argv, argv + argc);
  const auto is_command = [&](const char* word) {
    return std::ranges::find(commands, std::string(word), &Command::name) != commands.end();
  };
  if (argc == 3 && std::string(argv[1]) == "help" && is_command(argv[2])) {
    words = {argv[0], argv[2], help.data()};
    argv = words.data();
  }
  const auto result = parsed(commands, version_text(common.commit), argc, argv);
  if (const Exit* exit = std::get_if<Exit>(&result)) return *exit;
  if (common.scene.string().starts_with(library_prefix)) common.scene = library_file(common.scene);
  std::optional<tbb::global_control> limit;
  // The limit holds as long as this object lives.
  if (common.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(common.threads));
  constexpr double gigabyte = 1e9;
  if (common.memory_gb > 0.0) limit_memory(common.memory_gb * gigabyte);
  return std::get<const Command*>(result)->run();
}

std::vector<Command> all_commands(CommonOptions& common, int& argc, char**& argv) {
  std::vector<Command> all{
      new_command(common),     run_command(common),      compare_command(common),
      check_command(common),   program_command(common),  animate_command(common),
      render_command(common),  report_command(common),   pose_command(common),
      measure_command(common), identify_command(common), evaluate_command(common),
      rewrite_command(common), export_command(common),   study_command(common, argc, argv),
      schema_command(),        explain_command()};
  all.push_back(help_command(all));
  return all;
}

}  // namespace abbe::sim
