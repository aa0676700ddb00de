#include "sim/commands/shell_files.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/commands/command.h"
#include "sim/commands/help_commands.h"
#include "sim/files/program_file.h"
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
  const std::vector<GlobalOption> all = global_options(commands);
  print("{}", Lines(shell == "bash"  ? bash_completion(commands, all)
                    : shell == "zsh" ? zsh_completion(commands, all)
                                     : fish_completion(commands, all)));
  return Exit::Ok;
}

/// Lists the cases of a scene, one per line, for completion scripts.
Exit print_cases(const std::string& name) {
  const Scene scene = read_scene(name.starts_with(library_prefix) ? library_file(name)
                                                                  : std::filesystem::path(name));
  print("error_free\nuncompensated\n");
  for (const CaseDescription& one : scene.cases) print("{}\n", one.name);
  return Exit::Ok;
}

Exit print_keys(const std::string& prefix) {
  for (const std::string& key : settable_keys(prefix)) print("{}\n", key);
  return Exit::Ok;
}

}  // namespace

std::vector<GlobalOption> global_options(const std::vector<Command>& commands) {
  // Manual pages are made during installation, so the option is hidden.
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

namespace {

constexpr const char* bash_header =
    R"BASH(# bash completion of abbe, made by: abbe --completion bash

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

/// Returns the bash function that completes the value of an option.
std::string bash_action(const Option& option, const Command& command) {
  switch (completion_kind(option)) {
    case CompletionKind::Words:
      return fmt::format("_abbe_offer {}", fmt::join(words_of(option), " "));
    case CompletionKind::Cases:
      return "_abbe_cases";
    case CompletionKind::Settings:
      return has_study_keys(command) ? "_abbe_settings study." : "_abbe_settings ''";
    case CompletionKind::Keys:
      return "_abbe_keys '' ''";
    case CompletionKind::Files:
      return "_abbe_files";
    case CompletionKind::Nothing:
      break;
  }
  return ":";
}

std::string option_names(const Command& command) {
  std::string names = "-h";
  for (const Option& option : named_options(command)) names += " " + option.name;
  return names;
}

/// Returns the completions of positional arguments; those of several arguments are offered
/// together.
std::string places_of(const Command& command) {
  std::string calls;
  for (const Option& option : positional_options(command)) {
    const std::string call = bash_action(option, command);
    if (call != ":" && calls.find(call) == std::string::npos)
      calls += (calls.empty() ? "" : "; ") + call;
  }
  return calls.empty() ? ":" : calls;
}

}  // namespace

std::string bash_completion(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options) {
  std::string firsts = "-h --help --version", values, rest;
  for (const Command& command : commands) {
    firsts += " " + command.name;
    // Values of options come first: the word before the cursor decides.
    for (const Option& option : named_options(command))
      if (!is_flag(option))
        values += fmt::format("    {}/{}) {}; return ;;\n", command.name, option.name,
                              bash_action(option, command));
    rest += fmt::format("    {}) if [[ $cur == -* ]]; then _abbe_offer {}; else {}; fi ;;\n",
                        command.name, option_names(command), places_of(command));
  }
  for (const GlobalOption& question : global_options) {
    if (question.hidden) continue;
    firsts += " " + question.name;
    rest += fmt::format("    {}) {} ;;\n", question.name,
                        question.argument == "SCENE" ? "_abbe_files"
                        : question.words.empty()
                            ? "_abbe_keys '' ''"
                            : fmt::format("_abbe_offer {}", fmt::join(question.words, " ")));
  }
  return std::string(bash_header) + "  if ((at == 1)); then\n    _abbe_offer " + firsts +
         "\n    return\n  fi\n  case ${words[1]}/$option in\n" + values +
         "  esac\n  case ${words[1]} in\n" + rest + "  esac\n}\ncomplete -F _abbe abbe ./abbe\n";
}

namespace {

constexpr const char* zsh_header = R"ZSH(#compdef abbe
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

/// Returns a text quoted for `_arguments`, in single quotes, with its special characters escaped.
std::string zsh_quoted(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  }
  return out;
}

/// Returns the zsh action that completes the value of an option.
std::string zsh_action(const Option& option, const Command& command) {
  switch (completion_kind(option)) {
    case CompletionKind::Words:
      return fmt::format("({})", fmt::join(words_of(option), " "));
    case CompletionKind::Cases:
      return "_abbe_cases";
    case CompletionKind::Settings:
      return has_study_keys(command) ? "{_abbe_settings study.}" : "{_abbe_settings \"\"}";
    case CompletionKind::Keys:
      return "{_abbe_keys \"\"}";
    case CompletionKind::Files:
      return "_files";
    case CompletionKind::Nothing:
      break;
  }
  return " ";
}

/// Returns an option for `_arguments`: a list may be repeated, marked by `*`.
std::string zsh_option(const Option& option, const Command& command) {
  const std::string help = "[" + zsh_quoted(option.help) + "]";
  // Exclusive alternatives keep zsh from offering the second form of an option that is there
  // already.
  if (option.name == "--help") return "'(-h --help)'{-h,--help}'" + help + "'";
  const std::string name = (is_list(option) ? "*" : "") + option.name;
  if (is_flag(option)) return "'" + name + help + "'";
  return "'" + name + "=" + help + ":" + zsh_quoted(value_name(option)) + ":" +
         zsh_action(option, command) + "'";
}

std::string zsh_positional(const Option& option, const Command& command) {
  return fmt::format("'{}:{}:{}'",
                     is_list(option)                ? "*"
                     : is_optional_argument(option) ? ":"
                                                    : "",
                     zsh_quoted(option.name), zsh_action(option, command));
}

}  // namespace

std::string zsh_completion(const std::vector<Command>& commands,
                           const std::vector<GlobalOption>& global_options) {
  std::string listed,
      asked = "'(-h --help)'{-h,--help}'[say what abbe takes]' '--version[print the version]'",
      cases;
  for (const Command& command : commands) {
    listed += fmt::format("      '{}:{}'\n", command.name, zsh_quoted(command.summary));
    cases += fmt::format("    {})\n      _arguments", command.name);
    for (const Option& option : named_options(command))
      cases += " \\\n        " + zsh_option(option, command);
    for (const Option& option : positional_options(command))
      cases += " \\\n        " + zsh_positional(option, command);
    cases += "\n      ;;\n";
  }
  std::string names;
  for (const GlobalOption& question : global_options) {
    if (question.hidden) continue;
    names += fmt::format("      '{}:{}'\n", question.name, zsh_quoted(question.help));
    cases += fmt::format("    {}) {} ;;\n", question.name,
                         question.argument == "SCENE" ? "_files"
                         : question.words.empty()
                             ? "_abbe_keys \"\""
                             : fmt::format("compadd {}", fmt::join(question.words, " ")));
  }
  // The file works both when loaded by compinit and when sourced.
  return std::string(zsh_header) +
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

namespace {

constexpr const char* fish_header =
    R"FISH(# fish completion of abbe, made by: abbe --completion fish

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

/// Returns the arguments of `complete` for the values of an option.
std::string fish_values(const Option& option, const Command& command) {
  switch (completion_kind(option)) {
    case CompletionKind::Words:
      return "-x -a " + fish_quoted(fmt::format("{}", fmt::join(words_of(option), " ")));
    case CompletionKind::Cases:
      return "-x -a '(__abbe_cases)'";
    case CompletionKind::Settings:
      return has_study_keys(command) ? "-r -a '(__abbe_keys study. =)'"
                                     : "-r -a '(__abbe_keys \"\" =)'";
    case CompletionKind::Keys:
      return "-x -a '(__abbe_keys \"\" \"\")'";
    case CompletionKind::Files:
      return "-r -F";
    case CompletionKind::Nothing:
      break;
  }
  return "-x";
}

/// Returns the completion of positional arguments; fish offers files unless -f forbids it.
std::string fish_positionals(const Command& command, const std::string& when) {
  std::string text;
  bool files = false;
  for (const Option& option : positional_options(command)) {
    const CompletionKind offer = completion_kind(option);
    files = files || offer == CompletionKind::Files;
    if (offer == CompletionKind::Words || offer == CompletionKind::Keys)
      text += when + " " + fish_values(option, command).substr(3) + "\n";
  }
  return files ? text : text + when + " -f\n";
}

}  // namespace

std::string fish_completion(const std::vector<Command>& commands,
                            const std::vector<GlobalOption>& global_options) {
  std::string text = fish_header;
  text +=
      "complete -c abbe -n __fish_use_subcommand -s h -l help -d 'say what abbe takes'\n"
      "complete -c abbe -n __fish_use_subcommand -l version -d 'print the version'\n";
  for (const GlobalOption& question : global_options) {
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
    text += fish_positionals(command, when);
    for (const Option& option : named_options(command))
      text += fmt::format("{}{} -l {}{}{} -d {}\n", when, option.name == "--help" ? " -s h" : "",
                          option.name.substr(2), option.name == "--out" ? " -s o" : "",
                          is_flag(option) ? "" : " " + fish_values(option, command),
                          fish_quoted(option.help));
  }
  return text;
}

namespace {

/// Returns a text for roff: dashes that can be copied, and no line that begins a request.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool begins = out.empty() || out.back() == '\n';
    if (begins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
  }
  return out;
}

/// Returns the lines of a text as paragraphs, without their indentation.
std::string roff_lines(const std::string& text) {
  std::string lines;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::size_t begin = std::min(text.find_first_not_of(' ', at), end);
    if (begin < end)
      lines += (lines.empty() ? "" : ".br\n") + roff(text.substr(begin, end - begin)) + "\n";
    at = end + 1;
  }
  return lines;
}

std::string upper(std::string text) {
  for (char& c : text) c = char(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// Returns the head of a manual page with its name and summary.
std::string head(const std::string& page, const std::string& summary) {
  return fmt::format(
      ".\\\" made by abbe --man\n.TH {} 1 \"\" \"abbe {}\" \"User Commands\"\n.SH NAME\n{} \\- "
      "{}\n",
      roff(upper(page)), version(), roff(page), roff(summary));
}

std::string option_text(const Option& option) {
  std::string names = option.name == "--help"  ? "\\-h\\fR, \\fB\\-\\-help"
                      : option.name == "--out" ? "\\-o\\fR, \\fB\\-\\-out"
                                               : roff(option.name);
  std::string text = ".TP\n\\fB" + names + "\\fR";
  const bool placed = !option.name.starts_with('-');
  if (!is_flag(option) && !placed) text += " \\fI" + roff(value_name(option)) + "\\fR";
  text += "\n" + roff(option.help) + "\n";
  if (placed && !words_of(option).empty())
    text += "(" + roff(fmt::format("{}", fmt::join(words_of(option), ", "))) + ")\n";
  return text;
}

std::string synopsis(const Command& command) {
  std::string text = ".SH SYNOPSIS\n.B " + roff("abbe " + command.name) + "\n";
  for (const Option& option : positional_options(command)) {
    const std::string name = "\\fI" + roff(option.name) + "\\fR" + (is_list(option) ? " ..." : "");
    text += is_optional_argument(option) ? "[" + name + "]\n" : name + "\n";
  }
  return text + "[\\fIOPTIONS\\fR]\n";
}

std::string exit_status() { return ".SH EXIT STATUS\n" + roff(exit_codes_text) + "\n"; }

constexpr const char* files_text =
    ".SH FILES\n.TP\n.I /usr/share/abbe/scenes\nthe library: scenes to start from, what they are "
    "made of, and the description of their format; a\nname such as library:gantry_dome means a "
    "file in it\n.TP\n.I ~/.config/abbe/trust\nfolders whose programs a scene may run\n"
    ".SH ENVIRONMENT\n.TP\n.B ABBE_LIBRARY\nfolder of another library\n";

}  // namespace

std::string manual(const std::vector<Command>& commands) {
  std::string text = head("abbe", about_line);
  text += ".SH SYNOPSIS\n.B abbe\n.I COMMAND\n[\\fIOPTIONS\\fR]\n.SH DESCRIPTION\n";
  text += roff(about_text) + "\n.SH COMMANDS\n";
  for (const Command& command : commands)
    text += ".TP\n.B " + roff(command.name) + "\n" + roff(command.summary) + "\n";
  text += ".PP\n" + roff("abbe COMMAND --help lists the options of a command.") + "\n";
  text += exit_status() + files_text + ".SH SEE ALSO\n";
  for (const Command& command : commands)
    text += fmt::format(".BR {} (1){}\n", roff("abbe-" + command.name),
                        &command == &commands.back() ? "" : ",");
  return text;
}

std::string manual(const Command& command) {
  std::string text = head("abbe-" + command.name, command.summary) + synopsis(command);
  text += ".SH OPTIONS\n";
  for (const Option& option : positional_options(command)) text += option_text(option);
  for (const Option& option : named_options(command)) text += option_text(option);
  if (!command.where.empty()) {
    text += ".PP\nExactly one must be given of";
    for (const Option& option : command.where) text += " \\fB" + roff(option.name) + "\\fR";
    text += ".\n";
  }
  text += ".SH EXAMPLES\n";
  for (std::size_t i = 0; i < command.examples.size(); ++i)
    text += (i == 0 ? "" : ".br\n") + roff(command.examples[i]) + "\n";
  if (!command.footer.empty()) text += ".SH NOTES\n" + roff_lines(command.footer);
  return text + exit_status() + ".SH SEE ALSO\n.BR abbe (1)\n";
}

}  // namespace abbe::sim
