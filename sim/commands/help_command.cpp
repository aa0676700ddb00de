#include "sim/commands/help_command.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "sim/commands/help_topics.h"
#include "sim/files/terminal.h"

namespace abbe::sim {
namespace {

std::string row(const std::string& name, const std::string& summary) {
  return fmt::format("  {:<10} {}\n", name, summary);
}

std::string list_of_topics(const std::string& commands) {
  std::string text = "Topics, abbe help TOPIC:\n";
  std::vector<HelpTopic> topics(help_topics().begin(), help_topics().end());
  std::ranges::sort(topics, {}, &HelpTopic::name);
  for (const HelpTopic& topic : topics) text += row(topic.name, topic.summary);
  return text + "\nCommands, abbe help COMMAND:\n" + commands;
}

Exit print_help(const std::string& name, const std::string& commands) {
  const auto topic = std::ranges::find(help_topics(), name, &HelpTopic::name);
  print("{}", Lines(topic == help_topics().end() ? list_of_topics(commands) : topic->text));
  return Exit::Ok;
}

}  // namespace

Command help_command(const std::vector<Command>& others) {
  const std::string summary = "Explain a topic or a command; without one, list both";
  const auto name = std::make_shared<std::string>();
  std::vector<std::string> names;
  std::string commands;
  for (const HelpTopic& topic : help_topics()) names.push_back(topic.name);
  for (const Command& command : others) {
    names.push_back(command.name);
    commands += row(command.name, command.summary);
  }
  return {"help",
          summary,
          {"abbe help", "abbe help residual", "abbe help run"},
          {{"TOPIC", name.get(), "a topic or a command", OneOf{names}, MayBeLeftOut{}}},
          [name, text = commands + row("help", summary)] { return print_help(*name, text); }};
}

}  // namespace abbe::sim
