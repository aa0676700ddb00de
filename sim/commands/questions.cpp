#include "sim/commands/questions.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/commands/all_keys.h"
#include "sim/commands/completion.h"
#include "sim/commands/manual.h"
#include "sim/files/terminal.h"
#include "sim/scene/library.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {
namespace {

std::vector<std::string> names_of(const std::vector<Command>& commands) {
  std::vector<std::string> names;
  for (const Command& command : commands) names.push_back(command.name);
  return names;
}

Exit print_manual(const std::vector<Command>& commands, const std::string& name) {
  const auto named = std::ranges::find(commands, name, &Command::name);
  print("{}", Lines(named == commands.end() ? manual(commands) : manual(*named)));
  return Exit::Ok;
}

Exit print_completion(const std::vector<Command>& commands, const std::string& shell) {
  const std::vector<Question> all = questions(commands);
  print("{}", Lines(shell == "bash"  ? bash_completion(commands, all)
                    : shell == "zsh" ? zsh_completion(commands, all)
                                     : fish_completion(commands, all)));
  return Exit::Ok;
}

Exit print_cases(const std::string& name) {
  const Scene scene = read_scene(name.starts_with(library_prefix) ? library_file(name)
                                                                  : std::filesystem::path(name));
  print("error_free\nuncompensated\n");
  for (const CaseDescription& one : scene.cases) print("{}\n", one.name);
  return Exit::Ok;
}

Exit print_keys(const std::string& prefix) {
  for (const std::string& key : keys_to_set(prefix)) print("{}\n", key);
  return Exit::Ok;
}

}  // namespace

std::vector<Question> questions(const std::vector<Command>& commands) {
  return {{"--completion",
           "SHELL",
           "print the script by which bash, zsh or fish completes a command line",
           {"bash", "zsh", "fish"},
           [&commands](const std::string& shell) { return print_completion(commands, shell); }},
          {"--cases", "SCENE", "print the names of the cases of a scene", {}, print_cases},
          {"--keys",
           "[PREFIX]",
           "print the keys of a scene as --set takes them; below study. those of a study",
           {},
           print_keys},
          {"--man", "[COMMAND]", "print a page of the manual, in roff", names_of(commands),
           [&commands](const std::string& name) { return print_manual(commands, name); }, true}};
}

}  // namespace abbe::sim
