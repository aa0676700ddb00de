#include <fmt/format.h>

#include "sim/commands/completion.h"
#include "sim/commands/option_words.h"
#include "sim/commands/questions.h"

namespace abbe::sim {
namespace {

constexpr const char* bash_head = R"BASH(# bash completion of abbe, made by: abbe --completion bash

# The words of the line in `words`, those whole that bash breaks at = and :, and in `at` which of
# them the cursor is in.
_abbe_split() {
  local i word glue=
  words=("${COMP_WORDS[0]}") at=1
  for ((i = 1; i < ${#COMP_WORDS[@]}; i++)); do
    word=${COMP_WORDS[i]}
    if ((${#words[@]} > 1)) && [[ $glue || $word =~ ^[=:]+$ ]]; then
      words[-1]+=$word
    else
      words+=("$word")
    fi
    glue=
    [[ $word =~ ^[=:]+$ ]] && glue=1
    ((i == COMP_CWORD)) && at=$((${#words[@]} - 1))
  done
}

# Offers what completes `value`, which ends the word under the cursor; bash replaces no more than
# what follows the last break of that word.
_abbe_offer() {
  local breaks= before= begin=${cur%"$value"} one c
  for c in = :; do [[ $COMP_WORDBREAKS == *$c* ]] && breaks+=$c; done
  [[ -n $breaks ]] && before=${cur%"${cur##*[$breaks]}"}
  for one; do
    [[ $one == "$value"* ]] || continue
    one=$begin$one
    COMPREPLY+=("${one#"$before"}")
  done
}

_abbe_files() {
  local -a found
  compopt -o filenames 2>/dev/null
  mapfile -t found < <(compgen -f -- "$value")
  _abbe_offer "${found[@]}"
}

# The scene of the line: a file that ends in .toml, or a name of the library.
_abbe_scene() {
  local i
  for ((i = 2; i < ${#words[@]}; i++)); do
    ((i == at)) && continue
    case ${words[i]} in
      -* | *=*) ;;
      *.toml | library:*) printf '%s\n' "${words[i]/#\~\//$HOME/}"; return ;;
    esac
  done
}

_abbe_cases() {
  local -a found
  mapfile -t found < <("${words[0]}" --cases "$(_abbe_scene)" 2>/dev/null)
  ((${#found[@]})) || found=(error_free uncompensated)
  _abbe_offer "${found[@]}"
}

# $1: what comes before the keys in the list of abbe; $2: what follows a key on the line
_abbe_keys() {
  local -a found
  mapfile -t found < <("${words[0]}" --keys "$1$value" 2>/dev/null)
  [[ $2 ]] && compopt -o nospace 2>/dev/null
  found=("${found[@]#"$1"}")
  _abbe_offer "${found[@]/%/$2}"
}

_abbe_settings() {
  if [[ $value == *=* ]]; then
    value=${value#*=}
    _abbe_files
  else
    _abbe_keys "$1" =
  fi
}

_abbe() {
  local -a words
  local at cur value option=
  _abbe_split
  cur=${words[at]} value=$cur
  COMPREPLY=()
  if [[ $cur == --*=* ]]; then
    option=${cur%%=*} value=${cur#*=}
  elif ((at > 1)); then
    option=${words[at - 1]}
  fi
)BASH";

std::string call_of(const Option& option, const Command& command) {
  switch (offer_for(option)) {
    case Offer::Words:
      return fmt::format("_abbe_offer {}", fmt::join(words_of(option), " "));
    case Offer::Cases:
      return "_abbe_cases";
    case Offer::Settings:
      return sets_a_study(command) ? "_abbe_settings study." : "_abbe_settings ''";
    case Offer::Keys:
      return "_abbe_keys '' ''";
    case Offer::Files:
      return "_abbe_files";
    case Offer::Nothing:
      break;
  }
  return ":";
}

std::string names_of_options(const Command& command) {
  std::string names = "-h";
  for (const Option& option : dashed_options(command)) names += " " + option.name;
  return names;
}

/// What the places of a command take; several are offered together.
std::string places_of(const Command& command) {
  std::string calls;
  for (const Option& option : placed_options(command)) {
    const std::string call = call_of(option, command);
    if (call != ":" && calls.find(call) == std::string::npos)
      calls += (calls.empty() ? "" : "; ") + call;
  }
  return calls.empty() ? ":" : calls;
}

}  // namespace

std::string bash_completion(const std::vector<Command>& commands,
                            const std::vector<Question>& questions) {
  std::string firsts = "-h --help --version", values, rest;
  for (const Command& command : commands) {
    firsts += " " + command.name;
    for (const Option& option : dashed_options(command))
      if (!is_flag(option))
        values += fmt::format("    {}/{}) {}; return ;;\n", command.name, option.name,
                              call_of(option, command));
    rest += fmt::format("    {}) if [[ $cur == -* ]]; then _abbe_offer {}; else {}; fi ;;\n",
                        command.name, names_of_options(command), places_of(command));
  }
  for (const Question& question : questions) {
    if (question.hidden) continue;
    firsts += " " + question.name;
    rest += fmt::format("    {}) {} ;;\n", question.name,
                        question.argument == "SCENE" ? "_abbe_files"
                        : question.words.empty()
                            ? "_abbe_keys '' ''"
                            : fmt::format("_abbe_offer {}", fmt::join(question.words, " ")));
  }
  return std::string(bash_head) + "  if ((at == 1)); then\n    _abbe_offer " + firsts +
         "\n    return\n  fi\n  case ${words[1]}/$option in\n" + values +
         "  esac\n  case ${words[1]} in\n" + rest + "  esac\n}\ncomplete -F _abbe abbe ./abbe\n";
}

}  // namespace abbe::sim
