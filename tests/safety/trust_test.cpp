#include "sim/scene/trust.h"
#include <sys/stat.h>
#include <nlohmann/json.hpp>
#include "tests/safety/program_run.h"
#include "tests/test.h"

namespace abbe::safety {
namespace {

/// A stranger's folder with a program that leaves a trace wherever it is run, and a user's own
/// folder of settings.
class Trust : public testing::Test {
 protected:
  Trust() {
    payload_ = folder_.program("strange/payload.py",
                               "#!/bin/sh\ntouch " + (folder_ / "ran").string() + "\nexit 3\n");
    folder_.write("strange/p.ngc", small_program);
    fs::create_directories(folder_ / "config/abbe");
  }

  Ran abbe(const std::string& arguments) const {
    return run(arguments, "cd " + (folder_ / "strange").string() +
                              " && XDG_CONFIG_HOME=" + (folder_ / "config").string());
  }
  /// What is printed as JSON; other lines are those of standard error.
  nlohmann::json json_of(const std::string& arguments) const {
    const std::string text = abbe(arguments).text;
    const std::size_t from = text.find('{');
    return nlohmann::json::parse(text.substr(from, text.rfind('}') + 1 - from));
  }
  bool ran() const { return fs::exists(folder_ / "ran"); }
  void forget() const { fs::remove(folder_ / "ran"); }

  /// Refused before anything is run or written, naming file, line and program; done with --trust.
  void expect_asked(const std::string& command, const std::string& place) const {
    SCOPED_TRACE(command);
    forget();
    const Ran refused = abbe(command + " --out out");
    EXPECT_EQ(refused.code, 3) << refused.text;
    EXPECT_HAS(refused.text, place);
    EXPECT_HAS(refused.text, "payload.py");
    EXPECT_HAS(refused.text, "--trust");
    EXPECT_FALSE(ran());
    EXPECT_FALSE(fs::exists(folder_ / "strange/out"));
  }
  void expect_run(const std::string& command) const {
    SCOPED_TRACE(command);
    forget();
    const Ran done = abbe(command + " --out out");
    EXPECT_TRUE(ran()) << done.text;
    EXPECT_EQ(done.code, 6) << "the payload is no compensator: " << done.text;
    fs::remove_all(folder_ / "strange/out");
  }

  Folder folder_;
  fs::path payload_;
};

TEST_F(Trust, AProgramThatASceneNamesIsRunOnlyWithTrust) {
  const struct {
    std::string sections, place, command;
  } doors[] = {
      {"[compare]\ncases = [\"./payload.py\"]\n", "scene.toml:13:", "compare scene.toml"},
      {"[[variant]]\nname = \"v\"\nset = { compare.cases = [\"./payload.py\"] }\n",
       "scene.toml:14:", "compare scene.toml"},
      {"[[variant]]\nname = \"v\"\n[variant.set]\n\"compare.cases\" = [\"./payload.py\"]\n",
       "scene.toml:15:", "compare scene.toml"},
      {"[[instrument]]\nkind = \"cmm\"\ncase = \"./payload.py\"\n",
       "scene.toml:14:", "measure scene.toml"},
  };
  for (const auto& door : doors) {
    folder_.write("strange/scene.toml", small_scene(door.sections));
    expect_asked(door.command, door.place);
  }
  expect_run("measure scene.toml --trust");
  folder_.write("strange/scene.toml", "case = \"./payload.py\"\n" + small_scene());
  expect_asked("run scene.toml", "scene.toml:1:");
  expect_run("run scene.toml --trust");
}

TEST_F(Trust, ASharedLibraryAndASubFileAndATrainingSceneAreAskedForToo) {
  folder_.write("strange/lib.so", "no library");
  folder_.write("strange/scene.toml", small_scene("[compare]\ncases = [\"./lib.so\"]\n"));
  const Ran library = abbe("compare scene.toml --out out");
  EXPECT_EQ(library.code, 3) << library.text;
  EXPECT_HAS(library.text, "lib.so");

  folder_.write(
      "strange/training.toml",
      small_scene("[[instrument]]\nname = \"m\"\nkind = \"cmm\"\ncase = \"./payload.py\"\n"));
  folder_.write("strange/scene.toml",
                small_scene("[belief.force]\nfrom = \"current\"\ntraining = { file = "
                            "\"training.toml\", instrument = \"m\" }\n"));
  expect_asked("run scene.toml", "training.toml:15:");
}

TEST_F(Trust, AStudyAsksForItsOwnProgramsAndThoseOfItsScene) {
  const std::string study =
      "scene = \"scene.toml\"\n[[input]]\npath = \"errors.EXX_um\"\ncentre = 1\nspread = 1\n"
      "[monte_carlo]\ncases = 2\n";
  folder_.write("strange/scene.toml", small_scene("[errors]\nEXX_um = 1\n"));
  folder_.write("strange/study.toml", "engine = \"full\"\ncases = [\"./payload.py\"]\n" + study);
  expect_asked("study study.toml", "study.toml:2:");
  folder_.write("strange/study.toml", study);
  folder_.write("strange/scene.toml",
                small_scene("[errors]\nEXX_um = 1\n[compare]\ncases = [\"./payload.py\"]\n"));
  expect_asked("study study.toml", "scene.toml:15:");
  folder_.write("strange/scene.toml", small_scene("[errors]\nEXX_um = 1\n"));
  folder_.write("strange/study.toml", "set = { compare.cases = [\"./payload.py\"] }\n" + study);
  expect_asked("study study.toml", "study.toml:1:");
}

TEST_F(Trust, WhatTheUserTypesIsTrusted) {
  folder_.write("strange/scene.toml", small_scene());
  expect_run("run scene.toml --compensator payload.py");
  expect_run("run scene.toml --case ./payload.py");
  expect_run("compare scene.toml --set 'compare.cases=[\"./payload.py\"]'");
  // but not what a file names beside it
  folder_.program("strange/other.py", "#!/bin/sh\nexit 3\n");
  folder_.write("strange/scene.toml", small_scene("[compare]\ncases = [\"./payload.py\"]\n"));
  const Ran beside = abbe("compare scene.toml --compensator ./other.py --out out");
  EXPECT_EQ(beside.code, 3) << beside.text;
}

TEST_F(Trust, CheckListsWhatASceneWouldRunAndRunsNothing) {
  folder_.write("strange/scene.toml", small_scene("[compare]\ncases = [\"./payload.py\"]\n"));
  const Ran text = abbe("check scene.toml");
  EXPECT_EQ(text.code, 0) << text.text;
  EXPECT_HAS(text.text, "payload.py");
  EXPECT_HAS(text.text, "NOT trusted");
  const auto json = json_of("check scene.toml --json");
  ASSERT_EQ(json["programs"].size(), 1u);
  EXPECT_EQ(json["programs"][0]["line"], 13);
  EXPECT_EQ(json["programs"][0]["trusted"], false);
  EXPECT_EQ(json_of("check scene.toml --json --trust")["programs"][0]["trusted"], true);
  EXPECT_EQ(abbe("pose scene.toml --at X=0").code, 0);
  EXPECT_FALSE(ran());
}

TEST_F(Trust, TheTrustFileCoversSceneAndProgramAlike) {
  const std::string strange = (folder_ / "strange").string();
  folder_.write("strange/scene.toml", small_scene("[compare]\ncases = [\"./payload.py\"]\n"));
  folder_.write("config/abbe/trust", "# folders\n" + (folder_ / "elsewhere").string() + "\n");
  expect_asked("compare scene.toml", "scene.toml:13:");
  folder_.write("config/abbe/trust", "# folders\n  " + strange + "/  \n");
  expect_run("compare scene.toml");
  // a folder whose name only begins alike is another one
  folder_.write("config/abbe/trust", strange.substr(0, strange.size() - 1) + "\n");
  expect_asked("compare scene.toml", "scene.toml:13:");
  // the program must lie there too, wherever a link to it does
  folder_.write("config/abbe/trust", strange + "\n");
  folder_.program("elsewhere/payload.py", bytes(payload_));
  folder_.write("strange/scene.toml",
                small_scene("[compare]\ncases = [\"../elsewhere/payload.py\"]\n"));
  expect_asked("compare scene.toml", "scene.toml:13:");
  fs::create_directories(folder_ / "strange/linked");
  fs::create_symlink(folder_ / "elsewhere/payload.py", folder_ / "strange/linked/payload.py");
  folder_.write("strange/scene.toml", small_scene("[compare]\ncases = [\"linked/payload.py\"]\n"));
  expect_asked("compare scene.toml", "scene.toml:13:");
}

TEST_F(Trust, ATrustFileThatOthersCanWriteIsRefused) {
  const fs::path file = folder_.write("config/abbe/trust", (folder_ / "strange").string() + "\n");
  const auto refusal = [&] { return thrown_text<BadInput>([&] { sim::trusted_folders(file); }); };
  ::chmod(file.c_str(), 0600);
  EXPECT_EQ(refusal(), "");
  for (const ::mode_t mode : {0620, 0602, 0666}) {
    ::chmod(file.c_str(), mode);
    EXPECT_HAS(refusal(), "others can write") << mode;
    folder_.write("strange/scene.toml", small_scene("[compare]\ncases = [\"./payload.py\"]\n"));
    EXPECT_EQ(abbe("compare scene.toml --out out").code, 3);
    EXPECT_FALSE(ran());
  }
  ::chmod(file.c_str(), 0600);
  ::chmod(file.parent_path().c_str(), 0777);
  EXPECT_HAS(refusal(), "others can write");
  ::chmod(file.parent_path().c_str(), 0700);
  folder_.write("config/abbe/trust", "strange\n");
  EXPECT_HAS(refusal(), "trust:1");
}

TEST_F(Trust, TheResolvedSceneOfAResultAsksAgain) {
  folder_.write("strange/scene.toml", small_scene());
  const fs::path mirror = source / "scenes/compensators/mirror.py";
  ASSERT_EQ(abbe("run scene.toml --compensator " + mirror.string() + " --out first").code, 0);
  const Ran again = abbe("run first/scene.toml --out again");
  EXPECT_EQ(again.code, 3) << again.text;
  EXPECT_HAS(again.text, "mirror.py");
  EXPECT_EQ(abbe("run first/scene.toml --out again --trust").code, 0);
}

}  // namespace
}  // namespace abbe::safety
