#include "sim/commands/command.h"
#include "sim/commands/command_line.h"
#include "sim/commands/help_commands.h"
#include "sim/commands/shell_files.h"
#include "sim/scene/read_scene.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using safety::Ran;
using safety::run;
using safety::shell;

const std::string dome_file = (safety::source / "scenes/gantry_dome.toml").string();

struct CommandList {
  CommonOptions common;
  int argc = 0;
  char** argv = nullptr;
  std::vector<Command> commands = all_commands(common, argc, argv);
};

bool has_text(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::vector<std::string> lines_in(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The part of a text from one mark to the next; empty without the first.
std::string cut_out(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t begin = text.find(from);
  if (begin == std::string::npos) return "";
  const std::size_t end = text.find(to, begin + from.size());
  return text.substr(begin, end == std::string::npos ? end : end - begin);
}

bool is_there(const std::string& program) {
  return shell("command -v " + program + " > /dev/null").code == 0;
}

/// Texts that complete the last of some words.
std::vector<std::string> completed(const std::vector<Command>& commands,
                                   const std::vector<std::string>& words) {
  std::vector<std::string> texts;
  for (const Candidate& candidate : completions(commands, words, words.size() - 1).candidates)
    texts.push_back(candidate.text);
  return texts;
}

TEST(Shell, EveryOptionCompletesItsBeginning) {
  const CommandList all;
  int options = 0;
  for (const Command& command : all.commands) {
    EXPECT_EQ(completed(all.commands, {command.name}).front(), command.name);
    for (const std::vector<Option>& some : {command.options, command.required_choice})
      for (const Option& option : some) {
        ++options;
        if (!option.name.starts_with('-')) continue;
        const std::vector<std::string> texts =
            completed(all.commands, {command.name, option.name.substr(0, option.name.size() - 1)});
        EXPECT_EQ(std::ranges::count(texts, option.name), 1) << command.name << " " << option.name;
        for (const std::string& word : possible_values(option)) {
          EXPECT_EQ(completed(all.commands, {command.name, option.name, word}).front(), word);
          EXPECT_EQ(completed(all.commands, {command.name, option.name + "=" + word}).front(),
                    option.name + "=" + word);
        }
      }
  }
  EXPECT_GT(options, 150) << "too few options were looked at to mean anything";
}

TEST(Shell, ValuesThatAreFilesAreLeftToTheShell) {
  const CommandList all;
  const auto prefix = [&](const std::vector<std::string>& words) {
    const Completions found = completions(all.commands, words, words.size() - 1);
    return found.completes_files ? found.file_prefix : "no files";
  };
  EXPECT_EQ(prefix({"run", "--out", "some"}), "");
  EXPECT_EQ(prefix({"run", "--compensator", "some"}), "");
  EXPECT_EQ(prefix({"run", "--compensator=some"}), "--compensator=");
  EXPECT_EQ(prefix({"run", "--set", "part.file=some"}), "part.file=");
  EXPECT_EQ(prefix({"run", "--set=part.file=some"}), "--set=part.file=");
  EXPECT_EQ(prefix({"--cases", "some"}), "");
  EXPECT_EQ(prefix({"run", "some"}), "");
  EXPECT_EQ(prefix({"run", "--threads", "2"}), "no files");
}

TEST(Shell, WhatIsNoLineOfAbbeHasNoCompletions) {
  const CommandList all;
  EXPECT_EQ(completed(all.commands, {"nothing", ""}), std::vector<std::string>{});
  EXPECT_EQ(completed(all.commands, {"--cases", "a", ""}), std::vector<std::string>{});
  for (const std::string arguments :
       {"", "0", "4 run", "x run", "-1 run", "99999999999999999999"}) {
    const Ran ran = run("__complete " + arguments);
    EXPECT_EQ(ran.code, 2) << arguments;
    EXPECT_HAS(ran.text, "expected the index of a word");
  }
  EXPECT_EQ(run("__complete 1").text, run("__complete 1 ''").text);
}

TEST(Shell, PagesOfTheManualAreCleanAndListEveryOption) {
  if (!is_there("man") || !is_there("help2man")) GTEST_SKIP() << "man or help2man is not installed";
  const CommandList all;
  const safety::Folder folder;
  const Ran made = shell("cmake -DPROGRAM=" ABBE_PROGRAM " -DOUT=" + (folder / "shell").string() +
                         " -DVERSION=1.2 '-DABOUT=a machine' -P " ABBE_SOURCE_DIR
                         "/sim/commands/shell_files.cmake");
  ASSERT_EQ(made.code, 0) << made.text;
  const auto page = [&](const std::string& name) {
    return (folder / ("shell/man1/" + name + ".1")).string();
  };
  const auto warnings = [&](const std::string& file) {
    return shell("LC_ALL=C.UTF-8 MANROFFSEQ='' MANWIDTH=80 man --warnings -E UTF-8 -l -Tutf8 -Z " +
                 file + " 2>&1 > /dev/null | grep -v locale")
        .text;
  };
  const auto shown = [&](const std::string& name) {
    return shell("LC_ALL=C.UTF-8 MANWIDTH=200 man -l " + page(name) + " | col -b").text;
  };
  EXPECT_EQ(warnings(page("abbe")), "");
  EXPECT_HAS(shown("abbe"), "ABBE_LIBRARY");
  for (const Command& command : all.commands) {
    EXPECT_HAS(shown("abbe"), command.name) << command.name;
    EXPECT_EQ(warnings(page("abbe-" + command.name)), "") << command.name;
    const std::string text = shown("abbe-" + command.name);
    for (const std::vector<Option>& some : {command.options, command.required_choice})
      for (const Option& option : some)
        EXPECT_HAS(text, option.name) << command.name << " " << option.name;
  }
  const auto broken = folder.write("broken.1", ".TH A 1\n.no such request\n");
  EXPECT_NE(warnings(broken.string()), "") << "man warns of nothing";
}

TEST(Shell, CasesAreThoseThatCompareCuts) {
  const Ran ran = run("--cases " + dome_file);
  EXPECT_EQ(ran.code, 0);
  const std::vector<std::string> names = lines_in(ran.text);
  std::vector<std::string> expected{"error_free", "uncompensated"};
  for (const CaseDescription& one : read_scene(dome_file).cases) expected.push_back(one.name);
  EXPECT_EQ(names, expected);
  EXPECT_GT(names.size(), 3u);
  EXPECT_EQ(run("--cases library:gantry_dome").text, ran.text);
  EXPECT_EQ(run("--cases").code, 2);
  EXPECT_EQ(run("--cases nowhere.toml").code, 3);
}

TEST(Shell, KeysAreListedAsSetTakesThem) {
  const std::vector<std::string> all = settable_keys("");
  EXPECT_GT(all.size(), 500u);
  EXPECT_EQ(std::set<std::string>(all.begin(), all.end()).size(), all.size());
  for (const std::string& key : settable_keys("part.ra")) EXPECT_TRUE(key.starts_with("part.ra"));
  const auto is_only = [](const std::string& key) {
    return settable_keys(key) == std::vector<std::string>{key};
  };
  EXPECT_TRUE(is_only("tool.radius_mm"));
  EXPECT_TRUE(is_only("tool.1.radius_mm"));
  EXPECT_TRUE(is_only("instrument.laser.kind"));
  EXPECT_TRUE(is_only("machine.axis.X.travel_mm"));
  EXPECT_TRUE(is_only("study.monte_carlo.cases"));
  EXPECT_TRUE(settable_keys("monte_carlo").empty());
  EXPECT_EQ(run("--keys part.radius_mm").text, "part.radius_mm\n");
  const Ran ran = run("check " + dome_file + " --set tool.radius_mm=5 --set part.radius_mm=60");
  EXPECT_EQ(ran.code, 0) << ran.text;
}

/// What the script of bash offers for words, the last of which is under the cursor.
std::string offered(const std::vector<std::string>& words) {
  std::string line =
      std::string("source <('") + ABBE_PROGRAM + "' --completion bash); COMP_WORDS=(";
  for (const std::string& word : words) line += "'" + word + "' ";
  line += "); COMP_CWORD=" + std::to_string(words.size() - 1) +
          "; _abbe; printf \"%s\\n\" \"${COMPREPLY[@]}\"";
  const safety::Folder folder;
  return shell("bash --norc " + folder.write("try.sh", line + "\n").string()).text;
}

TEST(Shell, BashCompletesCommandsOptionsCasesAndKeys) {
  if (!is_there("bash")) GTEST_SKIP() << "bash is not installed";
  const std::string abbe = ABBE_PROGRAM;
  EXPECT_EQ(offered({abbe, "comp"}), "compare\n");
  EXPECT_EQ(offered({abbe, "run", "--thr"}), "--threads\n");
  EXPECT_EQ(offered({abbe, "run", dome_file, "--case", "perfect-d"}), "perfect-decoupled-ideal\n");
  EXPECT_EQ(offered({abbe, "run", "--case", "unc"}), "uncompensated\n");
  // as bash breaks --case=perfect-d and library:gantry_dome
  EXPECT_EQ(offered({abbe, "run", "library", ":", "gantry_dome", "--case", "=", "perfect-d"}),
            "perfect-decoupled-ideal\n");
  EXPECT_EQ(offered({abbe, "run", dome_file, "--set", "part.radius"}), "part.radius_mm=\n");
  EXPECT_EQ(offered({abbe, "study", "s.toml", "--set", "monte_carlo.ca"}), "monte_carlo.cases=\n");
  EXPECT_EQ(offered({abbe, "explain", "part.radius"}), "part.radius_mm\n");
  EXPECT_EQ(offered({abbe, "render", "--line", "r"}), "radius\n");
  EXPECT_EQ(offered({abbe, "help", "resi"}), "residual\n");
  EXPECT_EQ(offered({abbe, "run", dome_file, "--case", "nobody"}), "\n");
}

TEST(Shell, FishCompletesCasesAndKeys) {
  if (!is_there("fish")) GTEST_SKIP() << "fish is not installed";
  const auto completed_by_fish = [](const std::string& line) {
    const std::string abbe = ABBE_PROGRAM;
    const std::string folder = abbe.substr(0, abbe.rfind('/'));
    const safety::Folder home;
    return shell("HOME=" + home.path().string() + " PATH=" + folder +
                 ":$PATH fish --no-config -c \"abbe --completion fish | source; complete -C '" +
                 line + "'\"")
        .text;
  };
  EXPECT_EQ(completed_by_fish("abbe run " + dome_file + " --case perfect-d"),
            "perfect-decoupled-ideal\n");
  EXPECT_EQ(completed_by_fish("abbe run " + dome_file + " --set part.radius"), "part.radius_mm=\n");
  EXPECT_HAS(completed_by_fish("abbe comp"), "compare\t");
  EXPECT_HAS(completed_by_fish("abbe run " ABBE_SOURCE_DIR "/scenes/gantry_d"), "gantry_dome.toml");
}

TEST(Shell, ZshCompletesCasesAndKeys) {
  if (!is_there("zsh")) GTEST_SKIP() << "zsh is not installed";
  const safety::Folder folder;
  // The functions of zsh that the script calls print what they are given.
  const auto completed_by_zsh = [&](const std::string& line) {
    const auto script =
        folder.write("try.zsh",
                     "compdef() { : }; compset() { : }; _files() { print FILES }\n"
                     "_describe() { print -l -- ${(P)3} }; compadd() { shift 3; print -l -- $@ }\n"
                     "source <('" ABBE_PROGRAM "' --completion zsh)\nwords=('" ABBE_PROGRAM "' " +
                         line + ")\nCURRENT=$#words\n_abbe\n");
    return shell("zsh -f " + script.string()).text;
  };
  EXPECT_HAS(completed_by_zsh("compa"), "compare:");
  EXPECT_EQ(completed_by_zsh("run " + dome_file + " --case perfect-d"),
            "perfect-decoupled-ideal\n");
  EXPECT_EQ(completed_by_zsh("run " + dome_file + " --set part.radius"), "part.radius_mm=\n");
  EXPECT_EQ(completed_by_zsh("help resi"), "residual\n");
  EXPECT_EQ(completed_by_zsh("run s"), "FILES\n");
  EXPECT_EQ(completed_by_zsh("run --case ''"), "error_free\nuncompensated\n");
}

TEST(Shell, HelpKnowsTopicsAndCommands) {
  const Ran list = run("help");
  EXPECT_EQ(list.code, 0);
  for (const char* topic : {"frames", "signs", "residual", "cases", "files"}) {
    EXPECT_HAS(list.text, std::string("\n  ") + topic + " ") << topic;
    const Ran ran = run(std::string("help ") + topic);
    EXPECT_EQ(ran.code, 0) << topic;
    EXPECT_GT(lines_in(ran.text).size(), 8u) << topic;
    EXPECT_NE(ran.text, list.text);
  }
  const CommandList all;
  for (const Command& command : all.commands)
    EXPECT_HAS(list.text, "\n  " + command.name + " ") << command.name;
  EXPECT_EQ(run("help run").text, run("run --help").text);
  const Ran wrong = run("help resid");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_HAS(wrong.text, "(nearest: residual)");
}

TEST(Shell, EveryWordOfACaseNameInTheHelpIsOne) {
  const std::string text = run("help cases").text;
  const auto words = [&](const std::string& row) {
    const std::string line = cut_out(text, "  " + row + " ", "\n");
    std::istringstream in(line.substr(line.find(':') + 1));
    std::vector<std::string> all;
    for (std::string word; std::getline(in, word, ',');)
      all.push_back(word.substr(word.find_first_not_of(' ')));
    return all;
  };
  const auto is_case = [](const std::string& name) { EXPECT_NO_THROW(parse_case(name)) << name; };
  for (const std::string& channel : words("channel")) {
    try {
      parse_case("perfect-iterated-" + channel);
    } catch (const std::invalid_argument& fault) {  // a channel, but not for this belief
      EXPECT_FALSE(has_text(fault.what(), "expected a channel (")) << fault.what();
    }
  }
  for (const std::string& belief : words("belief")) is_case(belief + "-iterated-ideal");
  for (const std::string& strategy : words("strategy")) is_case("perfect-" + strategy + "-ideal");
  EXPECT_GE(words("belief").size(), 7u);
  EXPECT_GE(words("channel").size(), 7u);
}

TEST(Shell, QuestionsAreRefusedWithWhatTheyTake) {
  const Ran shells = run("--completion tcsh");
  EXPECT_EQ(shells.code, 2);
  EXPECT_HAS(shells.text, "expected one of bash, zsh, fish");
  EXPECT_EQ(run("--keys a b").code, 2);
  EXPECT_EQ(run("--completions bash").code, 2);
  EXPECT_HAS(run("--help").text, "--completion SHELL");
}

}  // namespace
}  // namespace abbe::sim
