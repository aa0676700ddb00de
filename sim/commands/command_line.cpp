#include "sim/commands/command_line.h"

#include <map>
#include <sstream>

#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "sim/files/terminal.h"
#include "sim/files/versions.h"

namespace abbe::sim {
namespace {

using Added = std::map<std::string, CLI::Option*>;

CLI::Option* bound(CLI::App& app, const Option& option) {
  return std::visit(
      [&](auto* target) {
        if constexpr (std::is_same_v<decltype(target), bool*>)
          return app.add_flag(option.name, *target, option.help);
        else
          return app.add_option(option.name, *target, option.help);
      },
      option.target);
}

/// Makes a rule hold for an option.
struct Holding {
  const Option& option;
  CLI::Option& added;
  const Added& others;

  void operator()(std::monostate) const {}
  void operator()(const Between& rule) const {
    if (std::holds_alternative<double*>(option.target))
      added.check(CLI::Range(double(rule.least), double(rule.most)));
    else
      added.check(CLI::Range(rule.least, rule.most));
  }
  void operator()(const OneOf& rule) const { added.check(CLI::IsMember(rule.values)); }
  void operator()(const Commas&) const { added.delimiter(',')->allow_extra_args(); }
  void operator()(const Bare&) const { added.expected(0, 1); }
  void operator()(const Excludes& rule) const {
    for (const std::string& other : rule.options) added.excludes(others.at(other));
  }
  void operator()(const Needs& rule) const { added.needs(others.at(rule.option)); }
  void operator()(const Type& rule) const { added.type_name(rule.name); }
};

void add(CLI::App& app, const std::vector<Option>& options, Added& added) {
  for (const Option& option : options) {
    CLI::Option& one = *(added[option.name] = bound(app, option));
    if (option.name.front() != '-')
      one.required();
    else if (one.get_items_expected_max() > 1)
      one.take_all()->allow_extra_args(false);
    for (const Rule& rule : {option.rule, option.second_rule})
      std::visit(Holding{option, one, added}, rule);
  }
}

void add(CLI::App& app, const Command& command) {
  CLI::App& sub = *app.add_subcommand(command.name, command.summary);
  Added added;
  add(sub, command.options, added);
  if (!command.where.empty()) {
    CLI::Option_group& where = *sub.add_option_group("where", "one of these");
    add(where, command.where, added);
    where.require_option(1);
  }
  if (!command.footer.empty()) sub.footer(command.footer);
}

Exit exit_of(const CLI::App& app, const CLI::ParseError& why) {
  std::ostringstream out, errors;
  app.exit(why, out, errors);
  print("{}", Lines(out.str()));
  print(stderr, "{}", Lines(errors.str()));
  return dynamic_cast<const CLI::Success*>(&why) ? Exit::Ok : Exit::Usage;
}

}  // namespace

Exit run_command_line(const std::vector<Command>& commands, const Common& common, int argc,
                      char** argv) {
  CLI::App app{
      "abbe: a virtual five-axis machine tool that is wrong on purpose.\n"
      "It cuts a part on a machine with errors and shows, in micrometres on the design surface, "
      "what they\ndid, with and without a compensator.\n\n"
      "Start with:  abbe compare scenes/gantry_dome.toml"};
  app.set_version_flag("--version", versions()["abbe"].get<std::string>());
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
      "4 numerical, 5 output, 6 plug-in, 130 interrupted.");
  for (const Command& command : commands) add(app, command);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ValidationError& fault) {
    print(stderr, "abbe: {}\n", fault.what());
    return Exit::Usage;
  } catch (const CLI::ParseError& why) {
    return exit_of(app, why);
  }
  std::optional<tbb::global_control> limit;
  if (common.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(common.threads));
  for (const Command& command : commands)
    if (app.got_subcommand(command.name)) return command.run();
  return Exit::Usage;
}

}  // namespace abbe::sim
