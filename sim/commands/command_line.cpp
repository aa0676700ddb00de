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

/// Returns the folder of the library, or the error text: a missing library must not prevent
/// `abbe --version`.
std::string library_text() {
  try {
    return library_folder().string();
  } catch (const BadInput& error) {
    return error.what();
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

using ParserOptions = std::map<std::string, CLI::Option*>;

constexpr const char* out_name = "--out";  // has a short form in every command

/// Adds an option to the parser. An option with a bool becomes a flag.
CLI::Option* add_to_parser(CLI::App& app, const Option& option) {
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

/// Returns a text such as "expected one of a, b (nearest: b), seen c".
std::string unknown_value_text(const std::string& expected, const std::string& seen,
                               const std::set<std::string>& words) {
  const auto nearest_word = nearest(seen, words);
  return fmt::format("expected {}{}, seen {}", expected,
                     nearest_word ? " (nearest: " + *nearest_word + ")" : "", seen);
}

std::string comma_separated(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, ", "));
}

/// Applies a rule to an option of the parser.
struct RuleApplier {
  const Option& option;
  CLI::Option& parser_option;
  const ParserOptions& parser_options;

  // Without a rule there is nothing to apply.
  void operator()(std::monostate) const {}
  void operator()(const NumberRange& rule) const {
    if (std::holds_alternative<double*>(option.target))
      parser_option.check(CLI::Range(double(rule.min_value), double(rule.max_value)));
    else
      parser_option.check(CLI::Range(rule.min_value, rule.max_value));
  }
  void operator()(const OneOf& rule) const {
    const auto validate = [values = rule.values](const std::string& word) -> std::string {
      if (std::ranges::find(values, word) != values.end()) return {};
      return unknown_value_text("one of " + comma_separated(values), word,
                                {values.begin(), values.end()});
    };
    parser_option.check(validate, "{" + comma_separated(rule.values) + "}");
  }
  void operator()(const CommaSeparated&) const { parser_option.delimiter(',')->allow_extra_args(); }
  void operator()(const OptionalValue&) const { parser_option.expected(0, 1); }
  void operator()(const Excludes& rule) const {
    for (const std::string& other : rule.options) parser_option.excludes(parser_options.at(other));
  }
  void operator()(const RequiresOption& rule) const {
    parser_option.needs(parser_options.at(rule.option));
  }
  void operator()(const TypeName& rule) const { parser_option.type_name(rule.name); }
  void operator()(const OptionalArgument&) const { parser_option.required(false); }
};

/// Adds options to the parser. Positional arguments are required unless a rule states otherwise. A
/// list takes one value at a time, so that it does not take positional arguments.
void add(CLI::App& app, const std::vector<Option>& options, ParserOptions& parser_options) {
  for (const Option& option : options) {
    CLI::Option& parser_option = *(parser_options[option.name] = add_to_parser(app, option));
    if (option.name.front() != '-')
      parser_option.required();
    else if (parser_option.get_items_expected_max() > 1)
      parser_option.take_all()->allow_extra_args(false);
    for (const Rule& rule : {option.rule, option.second_rule})
      std::visit(RuleApplier{option, parser_option, parser_options}, rule);
  }
}

/// Adds a command with its options and examples to the parser.
void add(CLI::App& app, const Command& command) {
  CLI::App& sub = *app.add_subcommand(command.name, command.summary);
  ParserOptions parser_options;
  add(sub, command.options, parser_options);
  if (!command.required_choice.empty()) {
    CLI::Option_group& where_group = *sub.add_option_group("where", "one of these");
    add(where_group, command.required_choice, parser_options);
    where_group.require_option(1);
  }
  std::string footer = "Examples:\n";
  for (const std::string& line : command.examples) footer += "  " + line + "\n";
  sub.footer(footer + command.footer);
}

/// Returns an error message if the first argument is neither a command nor a global option;
/// otherwise an empty text.
std::string unknown_command(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options, int argc,
                            char** argv) {
  if (argc < 2) return {};
  const std::string seen = argv[1];
  const bool is_option = seen.starts_with('-');
  std::set<std::string> words;
  if (is_option) {
    words = {"-h", "--help", "--version"};
    for (const GlobalOption& global_option : global_options) words.insert(global_option.name);
  } else {
    for (const Command& command : commands) words.insert(command.name);
  }
  if (words.contains(seen)) return {};
  return unknown_value_text(is_option ? "a command, --help or --version" : "a command", seen,
                            words) +
         "; abbe --help lists them";
}

/// Returns an error message for the first argument that begins like an option but is no option of
/// the command; an empty text if there is none.
std::string unknown_option(const Command& command, int argc, char** argv) {
  std::set<std::string> words{"-h", "--help"};
  for (const std::vector<Option>& options : {command.options, command.required_choice})
    for (const Option& option : options)
      if (option.name.starts_with('-')) words.insert(option.name);
  if (words.contains(out_name)) words.insert("-o");
  // A value such as -1 also begins with a dash, so this is checked only after parsing failed.
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i], name = word.substr(0, word.find('='));
    if (name.size() > 1 && name.starts_with('-') && !words.contains(name))
      return unknown_value_text("an option of " + command.name, name, words) + "; abbe " +
             command.name + " --help lists them";
  }
  return {};
}

/// Runs a global option with its argument and returns its exit code.
Exit run_global_option(const GlobalOption& global_option, int argc, char** argv) {
  const int max_arguments = 3;
  const bool is_optional_argument = global_option.argument.starts_with('[');
  if (argc > max_arguments || (argc < max_arguments && !is_optional_argument))
    throw BadUsage(global_option.name,
                   fmt::format("expected {}{}, seen {}", is_optional_argument ? "at most one " : "",
                               global_option.argument,
                               argc > max_arguments ? argv[max_arguments] : "nothing"));
  const std::string argument = argc == max_arguments ? argv[max_arguments - 1] : "";
  const std::vector<std::string>& choices = global_option.choices;
  const bool is_known = choices.empty() || std::ranges::find(choices, argument) != choices.end();
  if (argc == max_arguments && !is_known)
    throw BadUsage(global_option.name,
                   unknown_value_text("one of " + comma_separated(choices), argument,
                                      {choices.begin(), choices.end()}));
  return global_option.run(argument);
}

/// Prints help or the version.
Exit print_help(const CLI::App& app, const CLI::Success& help) {
  std::ostringstream out, errors;
  app.exit(help, out, errors);
  print("{}", MultilineText(out.str()));
  return Exit::Ok;
}

/// Parses the arguments of a command.
/// @return the command, or the exit code if help or a usage error was printed
std::variant<const Command*, Exit> parse(const std::vector<Command>& commands,
                                         const std::string& version, int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "__complete")
    return print_completions(commands, std::vector<std::string>(argv + 2, argv + argc));
  const std::vector<GlobalOption> all_global_options = global_options();
  if (const auto global_option =
          std::ranges::find(all_global_options, argc > 1 ? argv[1] : "", &GlobalOption::name);
      global_option != all_global_options.end())
    return run_global_option(*global_option, argc, argv);
  CLI::App app{
      fmt::format("abbe: a {}.\n{}\n\nStart with:  abbe new gantry first\n"
                  "             abbe compare first/scene.toml",
                  about_line, about_text)};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  std::string argument;  // global options are listed here and handled above
  for (const GlobalOption& global_option : all_global_options)
    app.add_option(global_option.name, argument, global_option.help)
        ->type_name(global_option.argument);
  app.footer(std::string("Exit codes: ") + exit_codes_text);
  for (const Command& command : commands) add(app, command);
  const auto print_usage_error = [](const std::string& reason) {
    print(stderr, "abbe: {}\n", reason);
    return Exit::Usage;
  };
  // Checked before parsing, because the parser would not suggest the nearest command.
  if (const std::string reason = unknown_command(commands, all_global_options, argc, argv);
      !reason.empty())
    return print_usage_error(reason);
  const auto selected =
      std::ranges::find(commands, std::string(argc > 1 ? argv[1] : ""), &Command::name);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ValidationError& error) {
    return print_usage_error(error.what());
  } catch (const CLI::Success& help) {
    return print_help(app, help);
  } catch (const CLI::ParseError& error) {
    const std::string option =
        selected == commands.end() ? "" : unknown_option(*selected, argc, argv);
    if (!option.empty() || selected == commands.end())
      return print_usage_error(option.empty() ? error.what() : option);
    return print_usage_error(std::string(error.what()) + "; abbe " + selected->name +
                             " --help describes its arguments");
  }
  return &*selected;
}

}  // namespace

Exit parse_command_line(const std::vector<Command>& commands, int argc, char** argv) {
  const auto result = parse(commands, "", argc, argv);
  const Exit* exit = std::get_if<Exit>(&result);
  return exit ? *exit : Exit::Ok;
}

Exit run_command_line(const std::vector<Command>& commands, CommonOptions& common, int argc,
                      char** argv) {
  // `abbe help run` means `abbe run --help`.
  std::string help = "--help";
  std::vector<char*> arguments(argv, argv + argc);
  const auto is_command = [&](const char* word) {
    return std::ranges::find(commands, std::string(word), &Command::name) != commands.end();
  };
  if (argc == 3 && std::string(argv[1]) == "help" && is_command(argv[2])) {
    arguments = {argv[0], argv[2], help.data()};
    argv = arguments.data();
  }
  const auto result = parse(commands, version_text(common.commit), argc, argv);
  if (const Exit* exit = std::get_if<Exit>(&result)) return *exit;
  if (common.scene.string().starts_with(library_prefix)) common.scene = library_file(common.scene);
  std::optional<tbb::global_control> limit;
  // The limit lasts as long as this object.
  if (common.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(common.threads));
  constexpr double gigabyte = 1e9;
  if (common.memory_gb > 0.0) limit_memory(common.memory_gb * gigabyte);
  return std::get<const Command*>(result)->run();
}

std::vector<Command> all_commands(CommonOptions& common, int& argc, char**& argv) {
  std::vector<Command> commands{
      new_command(common),     run_command(common),      compare_command(common),
      check_command(common),   program_command(common),  animate_command(common),
      render_command(common),  report_command(common),   pose_command(common),
      measure_command(common), identify_command(common), evaluate_command(common),
      rewrite_command(common), export_command(common),   study_command(common, argc, argv),
      schema_command(),        explain_command()};
  commands.push_back(help_command(commands));
  return commands;
}

}  // namespace abbe::sim
