#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <set>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "sim/commands/shell_files.h"
#include "sim/files/atomic_output.h"
#include "tests/safety/every_command.h"

namespace abbe::safety {
namespace {

std::string at(const Folder& folder) { return "cd " + folder.path().string() + " &&"; }

/// Every line that prints, of the commands and of the program itself.
std::vector<std::string> printing_lines(const CommandList& list) {
  std::vector<std::string> lines{"--help", "--version"};
  for (const sim::GlobalOption& question : sim::global_options())
    lines.push_back(question.name + (question.name == "--completion" ? " bash"
                                     : question.name == "--cases"    ? " scene.toml"
                                                                     : ""));
  lines.push_back("__complete 1");
  for (const sim::Command& command : list.commands) lines.push_back(command.name + " --help");
  for (const CommandCall& call : small_calls()) {
    const std::string line = call.command + " " + call.arguments;
    const auto command = std::ranges::find(list.commands, call.command, &sim::Command::name);
    lines.push_back(line);
    if (has_option(*command, "--json")) lines.push_back(line + " --json");
  }
  return lines;
}

TEST(LostOutput, IsAnOutputErrorOfEveryCommand) {
  const CommandList list;
  ASSERT_EQ(uncalled(list.commands, small_calls()), "");
  const Folder folder;
  write_inputs(folder);
  int lost = 0;
  for (const std::string& line : printing_lines(list)) {
    if (line.starts_with("new gantry")) fs::remove_all(folder / "first");
    const Ran kept = run(line + " > printed.txt", at(folder));
    EXPECT_EQ(kept.code, 0) << line << ": " << kept.text;
    EXPECT_GT(fs::file_size(folder / "printed.txt"), 0u) << line;
    for (const std::string to : {"> /dev/full", ">&-"}) {
      if (line.starts_with("new gantry")) fs::remove_all(folder / "first");
      if (to == ">&-" && (line.ends_with(" --help") || line.ends_with(" --json"))) continue;
      const Ran ran = run(line + " " + to + ")", at(folder) + " (");
      EXPECT_EQ(ran.code, 5) << line << " " << to << ": " << ran.text;
      EXPECT_NE(ran.text.find("standard output: cannot be written"), std::string::npos)
          << line << " " << to << ": " << ran.text;
      lost += ran.code == 5;
    }
  }
  std::cout << lost << " lines whose output was lost said so\n";
  EXPECT_GT(lost, 70);
}

TEST(LostOutput, AClosedStreamIsNoFile) {
  const Folder folder;
  ASSERT_EQ(run("new gantry first > /dev/null", at(folder)).code, 0);
  EXPECT_EQ(shell(at(folder) + " (" + ABBE_PROGRAM + " new gantry second <&- >&- 2>&-)").code, 5);
  for (const auto& entry : fs::directory_iterator(folder / "first"))
    EXPECT_EQ(bytes(folder / ("second/" + entry.path().filename().string())), bytes(entry.path()))
        << entry.path();
}

TEST(LostOutput, AReaderThatLeavesEndsTheProgramAsOthers) {
  const Ran ran =
      shell("bash -c '" ABBE_PROGRAM " schema | head -c 1; echo \" ${PIPESTATUS[0]}\"'");
  EXPECT_EQ(ran.text, "{ 141\n");
}

/// Names of the files below a folder that are not finished.
std::string unfinished_in(const fs::path& folder) {
  std::string names;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().filename().string().starts_with(".unfinished"))
      names += fs::relative(entry.path(), folder).string() + " ";
  return names;
}

TEST(LostOutput, TheLimitOnFilesIsAnOutputErrorOfEveryCommandAndInNoLaterRunsWay) {
  const CommandList list;
  const Folder folder;
  write_inputs(folder);
  std::set<std::string> failed;
  for (const CommandCall& call : small_calls()) {
    // blocks of 512 or 1024 bytes: what is larger fails half way, as on a full disk
    const std::string line = call.command + " " + call.arguments;
    fs::remove_all(folder / "out");  // so that a call meets only what its own failure left
    const Ran ran =
        run(line + " 2>&1 | cat; exit ${PIPESTATUS[0]}'", at(folder) + " bash -c 'ulimit -f 1;");
    EXPECT_TRUE(ran.code == 0 || ran.code == 5) << line << ": " << ran.code << " " << ran.text;
    if (ran.code == 5) {
      failed.insert(call.command);
      EXPECT_NE(ran.text.find("cannot be written"), std::string::npos) << line << ": " << ran.text;
      EXPECT_EQ(ran.text.find(".unfinished"), std::string::npos) << line << ": " << ran.text;
      const Ran again = run(line, at(folder));
      EXPECT_EQ(again.code, 0) << line << ", after it had failed: " << again.text;
    }
    EXPECT_EQ(unfinished_in(folder.path()), "") << line;
  }
  for (const char* command :
       {"new", "run", "compare", "report", "measure", "identify", "evaluate", "study"})
    EXPECT_TRUE(failed.contains(command)) << command << " writes more than a block";
}

TEST(LostOutput, WhatADeadProcessLeftIsRemovedAndNothingElse) {
  const Folder folder;
  fs::create_directories(folder / "out");
  const pid_t child = ::fork();
  if (child == 0) {
    new sim::UnfinishedFile(folder / "out", "residual.vtp");  // killed before it is finished
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
  ASSERT_NE(unfinished_in(folder.path()), "");
  const sim::UnfinishedFile alive(folder / "out", "summary.json");
  folder.write("out/.unfinished-business", "mine");
  folder.write("out/.unfinished-12", "mine");
  fs::create_directories(folder / "out/.unfinished-1-0-folder");
  folder.write("mine.txt", "mine");
  fs::create_symlink(folder / "mine.txt", folder / "out/.unfinished-1-0-link");
  const std::string left = "out/.unfinished-" + std::to_string(child) + "-0-residual.vtp";
  EXPECT_TRUE(fs::exists(folder / left));
  sim::remove_abandoned_files(folder / "out");
  EXPECT_FALSE(fs::exists(folder / left));
  EXPECT_TRUE(fs::exists(alive.path()));
  for (const char* name : {"business", "12", "1-0-folder", "1-0-link"})
    EXPECT_TRUE(fs::is_symlink(folder / (std::string("out/.unfinished-") + name)) ||
                fs::exists(folder / (std::string("out/.unfinished-") + name)))
        << name;
  EXPECT_EQ(bytes(folder / "mine.txt"), "mine");
}

TEST(LostOutput, ALaterRunRemovesWhatAKilledOneLeft) {
  const Folder folder;
  write_inputs(folder);
  folder.write("made/.unfinished-1-0-residual.vtp", "half of it");
  ASSERT_EQ(run("run scene.toml --out made", at(folder)).code, 0);
  EXPECT_EQ(unfinished_in(folder.path()), "");
}

}  // namespace
}  // namespace abbe::safety
