#include "sim/commands/shell_files.h"

#include <algorithm>
#include <charconv>
#include <exception>
#include <filesystem>

#include "sim/commands/command.h"
#include "sim/commands/help_commands.h"
#include "sim/files/terminal.h"
#include "sim/scene/library.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {

namespace {

// The scripts know nothing of abbe's commands: they pass the words of the line to
// `abbe __complete` and offer its answer.

constexpr const char* bash_script =
    R"BASH(# bash completion of abbe, made by: abbe --completion bash

_abbe() {
  local i word glue= at=1 line text breaks= before= c
  local -a words=("${COMP_WORDS[0]}") answer files
  # bash breaks words at = and :, so they are joined again
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
  # bash replaces no more than what follows the last break of the word
  for c in = :; do [[ $COMP_WORDBREAKS == *$c* ]] && breaks+=$c; done
  word=${words[at]}
  [[ -n $breaks ]] && before=${word%"${word##*[$breaks]}"}
  COMPREPLY=()
  mapfile -t answer < <("${words[0]/#\~\//$HOME/}" __complete "$at" "${words[@]:1}" 2>/dev/null)
  for line in "${answer[@]}"; do
    if [[ $line == :files* ]]; then
      compopt -o filenames 2>/dev/null
      text=${line#:files }
      mapfile -t files < <(compgen -f -- "${word#"$text"}")
      for c in "${files[@]}"; do COMPREPLY+=("${text#"$before"}$c"); done
    else
      text=${line%%$'\t'*}
      [[ $text == *= ]] && compopt -o nospace 2>/dev/null
      COMPREPLY+=("${text#"$before"}")
    fi
  done
}
complete -F _abbe abbe ./abbe
)BASH";

// The file works both when loaded by compinit and when sourced.
constexpr const char* zsh_script = R"ZSH(#compdef abbe
# zsh completion of abbe, made by: abbe --completion zsh

_abbe() {
  local line text
  local -a answer described open
  answer=(${(f)"$(${(Q)words[1]} __complete $((CURRENT - 1)) "${(@Q)words[2,-1]}" 2>/dev/null)"})
  for line in $answer; do
    text=${line%%$'\t'*}
    if [[ $line == :files* ]]; then
      compset -P "${(b)line#:files }"
      _files
    elif [[ $text == *= ]]; then
      open+=("$text")
    else
      described+=("${text//:/\\:}${${line#$text}/$'\t'/:}")
    fi
  done
  (( $#open )) && compadd -S '' -- $open
  (( $#described )) && _describe -V abbe described
}

if [[ $funcstack[1] == _abbe ]]; then
  _abbe "$@"
else
  compdef _abbe abbe
fi
)ZSH";

constexpr const char* fish_script =
    R"FISH(# fish completion of abbe, made by: abbe --completion fish

function __abbe_complete
    set -l line (commandline -opc)
    set -l word (commandline -ct)
    for candidate in ($line[1] __complete (count $line) $line[2..-1] "$word" 2>/dev/null)
        if string match -q -- ':files*' $candidate
            set -l prefix (string replace -- ':files ' '' $candidate)
            __fish_complete_path (string sub -s (math (string length -- $prefix) + 1) -- $word)
        else
            echo $candidate
        end
    end
end
complete -c abbe -f -a '(__abbe_complete)'
)FISH";

Exit print_script(const std::string& shell) {
  print("{}", MultilineText(shell == "bash"  ? bash_script
                            : shell == "zsh" ? zsh_script
                                             : fish_script));
  return Exit::Ok;
}

std::vector<std::string> case_names(const std::string& scene_name) {
  const Scene scene =
      read_scene(scene_name.starts_with(library_prefix) ? library_file(scene_name)
                                                        : std::filesystem::path(scene_name));
  std::vector<std::string> names{"error_free", "uncompensated"};
  for (const CaseDescription& description : scene.cases) names.push_back(description.name);
  return names;
}

/// Lists the cases of a scene, one per line.
Exit print_cases(const std::string& scene_name) {
  for (const std::string& name : case_names(scene_name)) print("{}\n", name);
  return Exit::Ok;
}

Exit print_keys(const std::string& prefix) {
  for (const std::string& key : settable_keys(prefix)) print("{}\n", key);
  return Exit::Ok;
}

}  // namespace

std::vector<GlobalOption> global_options() {
  return {{"--completion",
           "SHELL",
           "print the script by which bash, zsh or fish completes a command line",
           {"bash", "zsh", "fish"},
           print_script},
          {"--cases", "SCENE", "print the names of the cases of a scene", {}, print_cases},
          {"--keys",
           "[PREFIX]",
           "print the keys of a scene as --set takes them; below study. those of a study",
           {},
           print_keys}};
}

namespace {

/// The word to complete, with its line.
struct CompletionTask {
  std::span<const std::string> words;
  std::size_t current = 0;
  std::string prefix;  ///< in front of the value: "--case="
  std::string value;   ///< beginning of the value
};

void add_candidate(Completions& completions, const CompletionTask& task, const std::string& text,
                   const std::string& description = "") {
  if (text.starts_with(task.value))
    completions.candidates.push_back({task.prefix + text, description});
}

/// Returns the names of the cases of the scene on the line: a file that ends in .toml, or a name of
/// the library.
std::vector<std::string> cases_on_line(const CompletionTask& task) {
  for (std::size_t k = 1; k < task.words.size(); ++k) {
    const std::string& word = task.words[k];
    const bool is_scene = word.ends_with(".toml") || word.starts_with(library_prefix);
    if (k == task.current || !is_scene || word.starts_with('-') ||
        word.find('=') != std::string::npos)
      continue;
    try {
      return case_names(word);
    } catch (const std::exception&) {
      break;  // a scene with errors completes nothing; the command itself will report them
    }
  }
  return {"error_free", "uncompensated"};
}

void add_files(Completions& completions, const std::string& prefix) {
  completions.has_files = true;
  completions.file_prefix = prefix;
}

/// Adds "KEY=" for `--set`, or files for the value that follows.
void add_settings(Completions& completions, const CompletionTask& task, const Command& command) {
  if (const std::size_t equals = task.value.find('='); equals != std::string::npos)
    return add_files(completions, task.prefix + task.value.substr(0, equals + 1));
  const std::string table = has_study_keys(command) ? "study." : "";
  for (const std::string& key : settable_keys(table + task.value))
    add_candidate(completions, task, key.substr(table.size()) + "=");
}

/// Adds the values of an option or of a positional argument.
void add_values(Completions& completions, const CompletionTask& task, const Option& option,
                const Command& command) {
  switch (completion_kind(option)) {
    case CompletionKind::Words:
      for (const std::string& word : possible_values(option))
        add_candidate(completions, task, word);
      break;
    case CompletionKind::Cases:
      for (const std::string& name : cases_on_line(task)) add_candidate(completions, task, name);
      break;
    case CompletionKind::Settings:
      add_settings(completions, task, command);
      break;
    case CompletionKind::Keys:
      for (const std::string& key : settable_keys(task.value))
        add_candidate(completions, task, key);
      break;
    case CompletionKind::Files:
      add_files(completions, task.prefix);
      break;
    case CompletionKind::Nothing:
      break;
  }
}

Completions first_word_completions(const std::vector<Command>& commands,
                                   const CompletionTask& task) {
  Completions result;
  for (const Command& command : commands)
    add_candidate(result, task, command.name, command.summary);
  add_candidate(result, task, "--help", "say what abbe takes");
  add_candidate(result, task, "--version", "print the version");
  for (const GlobalOption& option : global_options())
    add_candidate(result, task, option.name, option.help);
  return result;
}

Completions global_option_completions(const GlobalOption& option, const CompletionTask& task) {
  Completions result;
  for (const std::string& word : option.words) add_candidate(result, task, word);
  if (option.argument == "SCENE") add_files(result, "");
  if (option.argument == "[PREFIX]")
    for (const std::string& key : settable_keys(task.value)) add_candidate(result, task, key);
  return result;
}

/// The word completes the value of an option after it or after "=", the name of an option, or a
/// positional argument.
Completions command_completions(const Command& command, CompletionTask task) {
  Completions result;
  const std::vector<Option> options = named_options(command);
  const std::size_t equals = task.value.find('=');
  const bool is_attached = task.value.starts_with("--") && equals != std::string::npos;
  const std::string name =
      is_attached ? task.value.substr(0, equals) : task.words[task.current - 1];
  const auto option = std::ranges::find(options, name, &Option::name);
  if (is_attached) {
    task.prefix = task.value.substr(0, equals + 1);
    task.value.erase(0, equals + 1);
  }
  if (option != options.end() && !is_flag(*option)) {
    add_values(result, task, *option, command);
  } else if (task.value.starts_with('-')) {
    for (const Option& offered : options) add_candidate(result, task, offered.name, offered.help);
  } else {
    for (const Option& argument : positional_options(command))
      add_values(result, task, argument, command);
  }
  return result;
}

}  // namespace

Completions completions(const std::vector<Command>& commands, std::span<const std::string> words,
                        std::size_t current) {
  const CompletionTask task{words, current, "", current < words.size() ? words[current] : ""};
  if (current == 0) return first_word_completions(commands, task);
  const std::vector<GlobalOption> options = global_options();
  if (const auto option = std::ranges::find(options, words[0], &GlobalOption::name);
      option != options.end())
    return current == 1 ? global_option_completions(*option, task) : Completions{};
  const auto command = std::ranges::find(commands, words[0], &Command::name);
  return command == commands.end() ? Completions{} : command_completions(*command, task);
}

Exit print_completions(const std::vector<Command>& commands,
                       std::span<const std::string> arguments) {
  std::size_t current = 0;
  if (!arguments.empty())
    std::from_chars(arguments[0].data(), arguments[0].data() + arguments[0].size(), current);
  if (current == 0 || current > arguments.size())
    throw BadUsage("__complete", "expected the index of a word and the words of a line");
  const Completions all = completions(commands, arguments.subspan(1), current - 1);
  // Control characters of arguments are escaped, so the tab stands in the format.
  for (const Candidate& candidate : all.candidates)
    if (candidate.description.empty())
      print("{}\n", candidate.text);
    else
      print("{}\t{}\n", candidate.text, candidate.description);
  if (all.has_files) print(":files {}\n", all.file_prefix);
  return Exit::Ok;
}

}  // namespace abbe::sim
