#include "sim/commands/manual.h"

#include <fmt/format.h>

#include "sim/commands/about.h"
#include "sim/commands/option_words.h"
#include "sim/files/versions.h"

namespace abbe::sim {
namespace {

/// A text as roff prints it: dashes that can be copied, no line that begins a request.
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

/// Lines of a text as paragraphs of their own, the spaces that indent them left out.
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
  for (const Option& option : placed_options(command)) {
    const std::string name = "\\fI" + roff(option.name) + "\\fR" + (is_list(option) ? " ..." : "");
    text += may_be_left_out(option) ? "[" + name + "]\n" : name + "\n";
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
  for (const Option& option : placed_options(command)) text += option_text(option);
  for (const Option& option : dashed_options(command)) text += option_text(option);
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
