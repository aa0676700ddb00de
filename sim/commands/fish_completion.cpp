#include <fmt/format.h>

#include "sim/commands/completion.h"
#include "sim/commands/option_words.h"
#include "sim/commands/questions.h"

namespace abbe::sim {
namespace {

constexpr const char* fish_head = R"FISH(# fish completion of abbe, made by: abbe --completion fish

# The scene of the line: a file that ends in .toml, or a name of the library.
function __abbe_scene
    for word in (commandline -opc)[3..-1]
        string match -q -- '-*' $word; and continue
        string match -q -- '*=*' $word; and continue
        string match -q -r -- '(\.toml$|^library:)' $word; or continue
        string replace -r -- '^~/' "$HOME/" $word
        return
    end
end

function __abbe_cases
    set -l line (commandline -opc)
    set -l found ($line[1] --cases (__abbe_scene) 2>/dev/null)
    test (count $found) -gt 0; or set found error_free uncompensated
    printf '%s\n' $found
end

# the first argument comes before the keys in the list of abbe, the second follows a key
function __abbe_keys
    set -l word (string replace -r -- '^--set=' '' (commandline -ct))
    string match -q -- '*=*' $word; and return
    set -l line (commandline -opc)
    for key in ($line[1] --keys "$argv[1]$word" 2>/dev/null)
        echo (string sub -s (math (string length -- "$argv[1]") + 1) -- $key)$argv[2]
    end
end

complete -c abbe -n __fish_use_subcommand -f
)FISH";

std::string fish_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') out += '\\';
    out += c;
  }
  return out + "'";
}

/// How the values are completed: arguments of `complete`.
std::string fish_values(const Option& option, const Command& command) {
  switch (offer_for(option)) {
    case Offer::Words:
      return "-x -a " + fish_quoted(fmt::format("{}", fmt::join(words_of(option), " ")));
    case Offer::Cases:
      return "-x -a '(__abbe_cases)'";
    case Offer::Settings:
      return sets_a_study(command) ? "-r -a '(__abbe_keys study. =)'"
                                   : "-r -a '(__abbe_keys \"\" =)'";
    case Offer::Keys:
      return "-x -a '(__abbe_keys \"\" \"\")'";
    case Offer::Files:
      return "-r -F";
    case Offer::Nothing:
      break;
  }
  return "-x";
}

std::string fish_places(const Command& command, const std::string& when) {
  std::string text;
  bool files = false;
  for (const Option& option : placed_options(command)) {
    const Offer offer = offer_for(option);
    files = files || offer == Offer::Files;
    if (offer == Offer::Words || offer == Offer::Keys)
      text += when + " " + fish_values(option, command).substr(3) + "\n";
  }
  return files ? text : text + when + " -f\n";
}

}  // namespace

std::string fish_completion(const std::vector<Command>& commands,
                            const std::vector<Question>& questions) {
  std::string text = fish_head;
  text +=
      "complete -c abbe -n __fish_use_subcommand -s h -l help -d 'say what abbe takes'\n"
      "complete -c abbe -n __fish_use_subcommand -l version -d 'print the version'\n";
  for (const Question& question : questions) {
    if (question.hidden) continue;
    const std::string values = question.argument == "SCENE" ? "-r -F"
                               : question.words.empty()
                                   ? "-x -a '(__abbe_keys \"\" \"\")'"
                                   : fmt::format("-x -a '{}'", fmt::join(question.words, " "));
    text += fmt::format("complete -c abbe -n __fish_use_subcommand -l {} {} -d {}\n",
                        question.name.substr(2), values, fish_quoted(question.help));
  }
  for (const Command& command : commands) {
    const std::string when =
        fmt::format("complete -c abbe -n '__fish_seen_subcommand_from {}'", command.name);
    text += fmt::format("complete -c abbe -n __fish_use_subcommand -f -a {} -d {}\n", command.name,
                        fish_quoted(command.summary));
    text += fish_places(command, when);
    for (const Option& option : dashed_options(command))
      text += fmt::format("{}{} -l {}{}{} -d {}\n", when, option.name == "--help" ? " -s h" : "",
                          option.name.substr(2), option.name == "--out" ? " -s o" : "",
                          is_flag(option) ? "" : " " + fish_values(option, command),
                          fish_quoted(option.help));
  }
  return text;
}

}  // namespace abbe::sim
