#include <fmt/format.h>

#include "sim/commands/completion.h"
#include "sim/commands/option_words.h"
#include "sim/commands/questions.h"

namespace abbe::sim {
namespace {

constexpr const char* zsh_head = R"ZSH(#compdef abbe
# zsh completion of abbe, made by: abbe --completion zsh

# The scene of the line: a file that ends in .toml, or a name of the library.
_abbe_scene() {
  local word
  for word in "${(@)words[2,-1]}"; do
    case $word in
      -* | *=*) ;;
      *.toml | library:*) print -r -- ${(Q)word/#\~\//$HOME/}; return ;;
    esac
  done
}

_abbe_cases() {
  local -a found
  found=(${(f)"$($abbe --cases "$(_abbe_scene)" 2>/dev/null)"})
  (( $#found )) || found=(error_free uncompensated)
  compadd -a found
}

# $1: what comes before the keys in the list of abbe; then options of compadd
_abbe_keys() {
  local -a found
  local before=$1
  shift
  found=(${(f)"$($abbe --keys "$before$PREFIX" 2>/dev/null)"})
  compadd "$@" -- ${found#$before}
}

_abbe_settings() {
  if compset -P '*='; then
    _files
  else
    _abbe_keys "$1" -q -S =
  fi
}

_abbe() {
  local abbe=${(Q)words[1]}
)ZSH";

/// A text as a word of `_arguments` has it, in single quotes.
std::string zsh_quoted(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  }
  return out;
}

std::string zsh_action(const Option& option, const Command& command) {
  switch (offer_for(option)) {
    case Offer::Words:
      return fmt::format("({})", fmt::join(words_of(option), " "));
    case Offer::Cases:
      return "_abbe_cases";
    case Offer::Settings:
      return sets_a_study(command) ? "{_abbe_settings study.}" : "{_abbe_settings \"\"}";
    case Offer::Keys:
      return "{_abbe_keys \"\"}";
    case Offer::Files:
      return "_files";
    case Offer::Nothing:
      break;
  }
  return " ";
}

std::string zsh_option(const Option& option, const Command& command) {
  const std::string help = "[" + zsh_quoted(option.help) + "]";
  if (option.name == "--help") return "'(-h --help)'{-h,--help}'" + help + "'";
  const std::string name = (is_list(option) ? "*" : "") + option.name;
  if (is_flag(option)) return "'" + name + help + "'";
  return "'" + name + "=" + help + ":" + zsh_quoted(value_name(option)) + ":" +
         zsh_action(option, command) + "'";
}

std::string zsh_place(const Option& option, const Command& command) {
  return fmt::format("'{}:{}:{}'",
                     is_list(option)           ? "*"
                     : may_be_left_out(option) ? ":"
                                               : "",
                     zsh_quoted(option.name), zsh_action(option, command));
}

}  // namespace

std::string zsh_completion(const std::vector<Command>& commands,
                           const std::vector<Question>& questions) {
  std::string listed,
      asked = "'(-h --help)'{-h,--help}'[say what abbe takes]' '--version[print the version]'",
      cases;
  for (const Command& command : commands) {
    listed += fmt::format("      '{}:{}'\n", command.name, zsh_quoted(command.summary));
    cases += fmt::format("    {})\n      _arguments", command.name);
    for (const Option& option : dashed_options(command))
      cases += " \\\n        " + zsh_option(option, command);
    for (const Option& option : placed_options(command))
      cases += " \\\n        " + zsh_place(option, command);
    cases += "\n      ;;\n";
  }
  std::string names;
  for (const Question& question : questions) {
    if (question.hidden) continue;
    names += fmt::format("      '{}:{}'\n", question.name, zsh_quoted(question.help));
    cases += fmt::format("    {}) {} ;;\n", question.name,
                         question.argument == "SCENE" ? "_files"
                         : question.words.empty()
                             ? "_abbe_keys \"\""
                             : fmt::format("compadd {}", fmt::join(question.words, " ")));
  }
  return std::string(zsh_head) +
         "  local -a commands questions\n"
         "  if (( CURRENT == 2 )); then\n    commands=(\n" +
         listed +
         "    )\n    questions=(\n"
         "      '--help:say what abbe takes'\n      '--version:print the version'\n" +
         names +
         "    )\n    _describe -t commands command commands\n"
         "    _describe -o -t options option questions\n    return\n  fi\n"
         "  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case $command in\n" +
         cases +
         "  esac\n}\n\nif [[ $funcstack[1] == _abbe ]]; then\n  _abbe \"$@\"\nelse\n"
         "  compdef _abbe abbe\nfi\n";
}

}  // namespace abbe::sim
