#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <nlohmann/json.hpp>
#include "sim/commands/shell_files.h"
#include "sim/files/atomic_output.h"
#include "sim/files/output.h"
#include "tests/safety/every_command.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

namespace abbe::safety {
namespace {

using sim::OutputFailure;
using sim::ResultFolder;
using sim::Writer;

/// Every file below a folder but marks, with its bytes.
std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> all;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().filename() != sim::manifest_name)
      all[fs::relative(entry.path(), folder).string()] = bytes(entry.path());
  return all;
}

/// What the files that were there before have become; names of those that were touched.
std::string touched(const std::map<std::string, std::string>& before, const fs::path& folder) {
  std::string names;
  const auto after = contents(folder);
  for (const auto& [name, text] : before)
    if (!after.contains(name) || after.at(name) != text) names += name + " ";
  return names;
}

std::string refusal(const std::function<void()>& act) {
  return thrown_text<OutputFailure>([&] { act(); });
}

/// A person's folder: a scene with its program, files of another run, notes.
void fill(const Folder& folder) {
  folder.write("scene.toml", small_scene());
  folder.write("p.ngc", small_program);
  for (const char* name :
       {"program.ngc", "signals.csv", "stock.vtp", "rewritten.ngc", "summary.json", "residual.vtp",
        "residual.png", "histogram.png", "temperatures.png", "EXX-temperatures.png",
        "comparison.json", "notes.txt", "check.png", "evaluation.json", "budget.json", "laser.csv",
        "difference.png"})
    folder.write(name, std::string("mine: ") + name);
}

std::string in(const Folder& folder) { return "cd " + folder.path().string() + " &&"; }

const std::string dome = (source / "scenes/gantry_dome.toml").string();

TEST(Outputs, ARunIntoTheFolderOfItsSceneIsRefusedAndTouchesNothing) {
  const Folder folder;
  fill(folder);
  const auto before = contents(folder.path());
  const std::string spellings[] = {".", "./", "../" + folder.path().filename().string(),
                                   folder.path().string(), "sub/.."};
  fs::create_directories(folder / "sub");
  for (const std::string& out : spellings)
    for (const std::string command : {"run", "compare", "measure --instrument laser"}) {
      SCOPED_TRACE(command + " --out " + out);
      const Ran ran = run(command + " scene.toml --out " + out, in(folder));
      EXPECT_EQ(ran.code, 5) << ran.text;
      EXPECT_HAS(ran.text, "result") << "a suggestion";
      EXPECT_EQ(ran.text.find("--force"), std::string::npos) << "it would not help: " << ran.text;
      EXPECT_EQ(touched(before, folder.path()), "");
    }
}

TEST(Outputs, EvenForcedNoInputIsTouched) {
  const Folder folder;
  fill(folder);
  const auto before = contents(folder.path());
  const Ran scene = run("run scene.toml --out . --force", in(folder));
  EXPECT_EQ(scene.code, 5) << scene.text;
  EXPECT_HAS(scene.text, "scene.toml");
  const auto after = contents(folder.path());
  for (const char* input : {"scene.toml", "p.ngc"}) EXPECT_EQ(after.at(input), before.at(input));
  EXPECT_EQ(after.at("notes.txt"), before.at("notes.txt"));

  EXPECT_EQ(after.at("summary.json"), before.at("summary.json")) << "refused before the work";

  // under another name no output meets an input, and what is forced is done
  folder.write("mine.toml", small_scene());
  const Ran other = run("run mine.toml --out . --force", in(folder));
  EXPECT_EQ(other.code, 0) << other.text;
  EXPECT_EQ(bytes(folder / "mine.toml"), small_scene());
  EXPECT_EQ(bytes(folder / "p.ngc"), small_program);
}

TEST(Outputs, ForceWritesOverFilesOfOthersAndRemovesNoneThatItDoesNotWrite) {
  const Folder folder;
  folder.write("in/mine.toml", small_scene());
  folder.write("in/p.ngc", small_program);
  folder.write("out/summary.json", "mine");
  folder.write("out/stock.vtp", "mine");
  folder.write("out/notes.txt", "mine");
  const std::string command = "run in/mine.toml --out out";
  EXPECT_EQ(run(command, in(folder)).code, 5);
  EXPECT_EQ(bytes(folder / "out/summary.json"), "mine");
  const Ran forced = run(command + " --force", in(folder));
  ASSERT_EQ(forced.code, 0) << forced.text;
  EXPECT_EQ(nlohmann::json::parse(bytes(folder / "out/summary.json"))["scene"], "plane");
  EXPECT_EQ(bytes(folder / "out/stock.vtp"), "mine") << "abbe did not make it, so it stays";
  EXPECT_EQ(bytes(folder / "out/notes.txt"), "mine");
  EXPECT_EQ(run(command, in(folder)).code, 5) << "the folder is still the user's";
}

TEST(Outputs, OnlyWhatAbbeWroteIsRemoved) {
  const Folder folder;
  const ResultFolder first(folder / "out", {});
  write_file(first / "stock.vtp", "abbe");
  folder.write("out/signals.csv", "mine");
  const ResultFolder second(folder / "out", {});
  remove_file(second / "stock.vtp");
  remove_file(second / "signals.csv");
  EXPECT_FALSE(fs::exists(folder / "out/stock.vtp"));
  EXPECT_EQ(bytes(folder / "out/signals.csv"), "mine");
}

TEST(Outputs, AResultIsWrittenAgainInItsOwnFolder) {
  const Folder folder;
  folder.write("scene.toml", small_scene());
  folder.write("p.ngc", small_program);
  const std::string out = (folder / "out").string();
  const std::string command = "run scene.toml --out " + out;
  ASSERT_EQ(run(command, in(folder)).code, 0);
  const std::string mark = bytes(folder / "out/.abbe-result");
  const auto first = nlohmann::json::parse(mark.substr(0, mark.find('\n')));
  EXPECT_EQ(first["folder"], true);
  EXPECT_EQ(first["command"], "abbe " + command);
  EXPECT_FALSE(first["version"].get<std::string>().empty());
  folder.write("out/signals.csv", "the user's own, among results");
  const Ran among = run(command, in(folder));
  EXPECT_EQ(among.code, 5) << among.text;
  EXPECT_EQ(bytes(folder / "out/signals.csv"), "the user's own, among results");
  fs::remove(folder / "out/signals.csv");
  folder.write("out/stock.txt", "the user's own, of another name");
  const Ran again = run(command, in(folder));
  EXPECT_EQ(again.code, 0) << again.text;
  EXPECT_EQ(bytes(folder / "out/stock.txt"), "the user's own, of another name");
  // a result run again in place would replace its own scene
  const Ran itself = run("run out/scene.toml --out out", in(folder));
  EXPECT_EQ(itself.code, 5) << itself.text;
}

TEST(Outputs, AFolderAboveAnInputIsRefused) {
  const Folder folder;
  folder.write("set/deep/scene.toml", small_scene());
  folder.write("set/deep/p.ngc", small_program);
  const Ran above = run("run set/deep/scene.toml --out set", in(folder));
  EXPECT_EQ(above.code, 5) << above.text;
  // marked or not, by whatever name
  folder.write("set/.abbe-result", "{\"folder\":true}\n");
  fs::create_directory_symlink(folder / "set", folder / "link");
  for (const char* out : {"set", "link", "./link/deep/.."}) {
    const Ran ran = run(std::string("run set/deep/scene.toml --out ") + out, in(folder));
    EXPECT_EQ(ran.code, 5) << out << ": " << ran.text;
    EXPECT_HAS(ran.text, "scene.toml");
  }
}

TEST(Outputs, EveryCommandTakesTheSameDoor) {
  const Folder folder;
  fill(folder);
  const std::string small =
      " --set part.vertices=300 --set program.step_over_mm=8 --set "
      "program.step_mm=8 ";
  const Ran made = run("run " + dome + small + "--out made", in(folder));
  ASSERT_EQ(made.code, 0) << made.text;
  ASSERT_EQ(run("measure " + dome + " --instrument ball_bar --out readings", in(folder)).code, 0);
  folder.write("study.toml", "scene = \"" + dome +
                                 "\"\n[set]\npart.vertices = 300\nprogram.step_over_mm = 8\n"
                                 "program.step_mm = 8\n[[input]]\nelement = \"EXX\"\nspread = 0.2\n"
                                 "[monte_carlo]\ncases = 4\n");
  const auto before = contents(folder.path());
  const std::string commands[] = {
      "run " + dome + small + "--out .",
      "compare " + dome + small + "--out .",
      "check " + dome + small + "--picture --out .",
      "program " + (source / "scenes/programs/face_milling.ngc").string() + " --picture --out .",
      "measure " + dome + " --instrument laser --out .",
      "evaluate readings/ball_bar.csv --out .",
      "evaluate readings/ball_bar.csv --out readings",
      "render made --out .",
      "study study.toml --out .",
      "study study.toml --shard 0/2 --out .",
      "export " + dome + small + " --out .",
      "rewrite " + dome + small + "--out notes.txt",
      "rewrite " + dome + small + "--out program.ngc",
      "identify readings/ball_bar.csv --elements EXX --order 1 --out notes.txt"};
  for (const std::string& command : commands) {
    const Ran ran = run(command, in(folder));
    EXPECT_EQ(ran.code, 5) << command << ": " << ran.text;
    EXPECT_EQ(touched(before, folder.path()), "") << command;
  }
  // beside what it draws, which is a result
  EXPECT_EQ(run("render made", in(folder)).code, 0);
}

TEST(Outputs, SingleFilesAreReplacedOnlyWhereAbbeMadeThem) {
  const Folder folder;
  ASSERT_EQ(run("measure " + dome + " --instrument ball_bar --out readings", in(folder)).code, 0);
  const std::string identify =
      "identify readings/ball_bar.csv --elements EXX --order 1 --out belief.toml";
  folder.write("belief.json", "mine");
  const Ran beside = run(identify, in(folder));
  EXPECT_EQ(beside.code, 5) << "the report would stand where the user's file is: " << beside.text;
  EXPECT_EQ(bytes(folder / "belief.json"), "mine");
  EXPECT_FALSE(fs::exists(folder / "belief.toml"));
  fs::remove(folder / "belief.json");
  ASSERT_EQ(run(identify, in(folder)).code, 0);
  EXPECT_EQ(run(identify, in(folder)).code, 0) << "its own, again";
  folder.write("other.toml", "mine");
  EXPECT_EQ(run("run " + dome + " --out .", in(folder)).code, 5)
      << "files of abbe's do not make the folder a result";
  EXPECT_EQ(
      run("identify readings/ball_bar.csv --elements EXX --order 1 --out other.toml", in(folder))
          .code,
      5);
  EXPECT_EQ(run("identify readings/ball_bar.csv --elements EXX --order 1 --out other.toml --force",
                in(folder))
                .code,
            0);
}

TEST(Outputs, NoLinkLeadsAWriterToAFileOfTheUsers) {
  const Folder folder;
  folder.write("user/keep.txt", "mine");
  const fs::path out = folder / "out";
  {
    const ResultFolder made(out, {});
    write_file(made / "a.txt", "abbe");
  }
  fs::create_symlink(folder / "user/keep.txt", out / "b.txt");
  fs::create_hard_link(folder / "user/keep.txt", out / "c.txt");
  const ResultFolder again(out, {});
  EXPECT_NE(refusal([&] { write_file(again / "b.txt", "abbe"); }), "");
  EXPECT_NE(refusal([&] { write_file(again / "c.txt", "abbe"); }), "");
  remove_file(again / "b.txt");
  remove_file(again / "c.txt");
  EXPECT_TRUE(fs::exists(out / "b.txt") && fs::exists(out / "c.txt"));
  EXPECT_EQ(bytes(folder / "user/keep.txt"), "mine");
  // an input by another name of the same file, forced or not
  Writer writer{{.force = true}, {folder / "user/keep.txt"}};
  const ResultFolder forced(out, writer);
  EXPECT_NE(refusal([&] { write_file(forced / "b.txt", "abbe"); }), "");
  EXPECT_NE(refusal([&] { write_file(forced / "c.txt", "abbe"); }), "");
  // a mark that is a link to somebody's file is none, and nothing is added to it
  fs::create_directories(folder / "trap");
  fs::create_symlink(folder / "user/keep.txt", folder / "trap" / sim::manifest_name);
  EXPECT_NE(refusal([&] { ResultFolder(folder / "trap", {}); }), "");
  EXPECT_NE(
      refusal([&] { write_file(ResultFolder(folder / "trap", {{.force = true}}) / "d", "x"); }),
      "");
  EXPECT_EQ(bytes(folder / "user/keep.txt"), "mine");
}

TEST(Outputs, TheFolderAboveResultsIsTakenWhereNothingElseLiesInIt) {
  const Folder folder;
  const ResultFolder readings(folder / "out/scene/readings", {});
  write_file(readings / "laser.csv", "abbe");
  sim::write_file(sim::result_file(folder / "out/scene/rewritten.ngc", {}), "abbe");
  EXPECT_EQ(refusal([&] { ResultFolder(folder / "out/scene", {}); }), "");
  folder.write("out/scene/mine/notes.txt", "mine");
  EXPECT_NE(refusal([&] { ResultFolder(folder / "out/scene", {}); }), "");
}

TEST(Outputs, AFolderOfJournalsIsAStudysButAnotherDatabaseIsNot) {
  const Folder folder;
  std::string journal = std::string("SQLite format 3\0", 16) + std::string(52, '\0') + "abbe";
  folder.write("a/journal-0-of-2.sqlite", journal);
  folder.write("a/journal-0-of-2.sqlite-lock", "");
  EXPECT_EQ(refusal([&] { ResultFolder(folder / "a", {}); }), "");
  journal.replace(68, 4, "user");
  folder.write("b/journal.sqlite", journal);
  EXPECT_NE(refusal([&] { ResultFolder(folder / "b", {}); }), "");
}

TEST(Outputs, AFileThatWasChangedSinceIsTheUsers) {
  const Folder folder;
  for (const char* name : {"a.txt", "b.txt", "c.txt"})
    write_file(ResultFolder(folder / "out", {}) / name, "abbe's");
  folder.write("out/a.txt", "mine, put in its place");
  folder.write("out/b.txt", "abbe,s");  // as long as it was
  const ResultFolder out(folder / "out", {});
  for (const char* name : {"a.txt", "b.txt"}) {
    const std::string text = bytes(out.path() / name);
    EXPECT_HAS(refusal([&] { write_file(out / name, "new"); }), "was changed since");
    remove_file(out / name);
    EXPECT_EQ(bytes(out.path() / name), text);
  }
  EXPECT_EQ(refusal([&] { write_file(out / "c.txt", "new"); }), "");
  // nor does a list of files make a folder with such a file one of abbe's alone
  write_file(sim::result_file(folder / "single/a.txt", {}), "abbe's");
  EXPECT_EQ(refusal([&] { ResultFolder(folder / "single", {}); }), "");
  folder.write("single/a.txt", "mine");
  EXPECT_NE(refusal([&] { ResultFolder(folder / "single", {}); }), "");
  EXPECT_NE(refusal([&] { sim::result_file(folder / "single/a.txt", {}); }), "");
  write_file(sim::result_file(folder / "single/a.txt", {{.force = true}}), "forced");
  EXPECT_EQ(bytes(folder / "single/a.txt"), "forced");
}

TEST(Outputs, ACommandRemovesOnlyWhatItWroteItself) {
  const Folder folder;
  const Writer rewrite{{.command = "abbe rewrite scene.toml --out out/rewritten.ngc"}};
  const Writer run{{.command = "abbe run scene.toml --out out"}};
  const Writer compare{{.command = "abbe compare scene.toml"}};
  write_file(sim::result_file(folder / "out/rewritten.ngc", rewrite), "by rewrite");
  const ResultFolder out(folder / "out", run);
  write_file(out / "signals.csv", "by run");
  remove_file(out / "rewritten.ngc");
  EXPECT_EQ(bytes(folder / "out/rewritten.ngc"), "by rewrite");
  remove_file(ResultFolder(folder / "out", compare) / "signals.csv");
  EXPECT_FALSE(fs::exists(folder / "out/signals.csv")) << "compare writes the files of run";
  write_file(out / "rewritten.ngc", "by run");
  remove_file(out / "rewritten.ngc");
  EXPECT_FALSE(fs::exists(folder / "out/rewritten.ngc"));
}

TEST(Outputs, ARunLeavesTheProgramThatRewriteWroteInItsFolder) {
  const Folder folder;
  folder.write("scene.toml", small_scene("[errors]\nEXX_um = 5\n"));
  folder.write("p.ngc", small_program);
  const Ran rewritten =
      run("rewrite scene.toml --case perfect-position-program --out out/rewritten.ngc", in(folder));
  ASSERT_EQ(rewritten.code, 0) << rewritten.text;
  const std::string program = bytes(folder / "out/rewritten.ngc");
  const std::string command = "run scene.toml --out out";
  ASSERT_EQ(run(command, in(folder)).code, 0);
  EXPECT_EQ(bytes(folder / "out/rewritten.ngc"), program);
}

TEST(Outputs, TwoRunsInOneFolderKeepOneAnothersLinesOfTheMark) {
  const Folder folder;
  const auto write_forty = [&](const std::string& who) {
    const ResultFolder out(folder / "out", {{.command = "abbe " + who}});
    for (int i = 0; i < 40; ++i) write_file(out / (who + std::to_string(i)), who);
  };
  { std::jthread a(write_forty, "a"), b(write_forty, "b"); }
  // each knows what the other wrote after it began
  const ResultFolder first(folder / "out", {}), second(folder / "out", {});
  write_file(second / "late.txt", "abbe's");
  write_file(first / "late.txt", "abbe's again");
  std::ifstream mark(folder / "out/.abbe-result");
  int files = 0;
  for (std::string line; std::getline(mark, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    files += json.contains("file");
  }
  EXPECT_EQ(files, 82);
}

TEST(Outputs, AProcessKilledBetweenMarkAndFileChangesNobodysFile) {
  const Folder folder;
  write_file(ResultFolder(folder / "out", {}) / "a.txt", "abbe's");
  // killed after the line of the next text, before the text took the name
  const std::string line =
      "{\"file\":\"NAME\",\"by\":\"\",\"size\":4,\"sum\":\"0123456789abcdef\"}\n";
  for (const std::string name : {"a.txt", "b.txt"})
    std::ofstream(folder / "out/.abbe-result", std::ios::app)
        << std::string(line).replace(line.find("NAME"), 4, name);
  folder.write("out/b.txt", "user");  // as long as what was to come
  const ResultFolder out(folder / "out", {});
  EXPECT_EQ(refusal([&] { write_file(out / "a.txt", "again"); }), "") << "still abbe's";
  EXPECT_NE(refusal([&] { write_file(out / "b.txt", "again"); }), "") << "never abbe's";
  EXPECT_EQ(bytes(folder / "out/b.txt"), "user");
}

TEST(Outputs, AVariantThatSharesAFolderIsRefusedWhereTheSceneIsRead) {
  const Folder folder;
  folder.write("p.ngc", small_program);
  const auto scene = [](const std::string& cases, const std::string& variants) {
    return small_scene("[errors]\nEXX_um = 5\n[compare]\ncases = [" + cases + "]\n" + variants);
  };
  const auto variant = [](const std::string& name, const std::string& set = "errors.EXX_um = 1") {
    return "[[variant]]\nname = \"" + name + "\"\nset = { " + set + " }\n";
  };
  const std::string ideal = "\"perfect-position-ideal\"";
  const struct {
    std::string text, says;
  } input_errors[] = {
      {scene(ideal, variant("perfect-position-ideal")), "scene.toml:17:8"},
      {scene(ideal, variant("comparison.json")), "scene.toml:17:8"},
      {scene(ideal, variant("program.ngc")), "scene.toml:17:8"},
      {scene(ideal, variant("a") + variant("a-perfect-position-ideal")), "scene.toml:20:8"},
      // of a case that the variant alone has
      {scene(ideal, variant("a", "compare.cases = [\"perfect-iterated-ideal\"]") +
                        variant("a-perfect-iterated-ideal")),
       "scene.toml:20:8"},
      {scene("\"./thermal.json\"", ""), "scene.toml:15:9"}};
  for (const auto& fault : input_errors) {
    folder.write("scene.toml", fault.text);
    for (const std::string command : {"compare scene.toml --trust --out out", "check scene.toml"}) {
      const Ran ran = run(command, in(folder));
      EXPECT_EQ(ran.code, 3) << command << ": " << ran.text;
      EXPECT_HAS(ran.text, fault.says);
      EXPECT_HAS(ran.text, "a separate folder");
    }
    EXPECT_FALSE(fs::exists(folder / "out"));
  }
  // of a compensator that was typed
  folder.write("scene.toml", scene(ideal, variant("mine.py")));
  folder.write("mine.py", "");
  const Ran typed = run("compare scene.toml --compensator ./mine.py --out out", in(folder));
  EXPECT_EQ(typed.code, 3) << typed.text;
  EXPECT_HAS(typed.text, "scene.toml:17:8");
}

TEST(Outputs, FilesOfTheUsersAmongCasesAreRefusedBeforeTheWork) {
  const Folder folder;
  folder.write("scene.toml", small_scene("[errors]\nEXX_um = 5\n"));
  folder.write("p.ngc", small_program);
  ASSERT_EQ(run("compare scene.toml --out out", in(folder)).code, 0);
  folder.write("out/uncompensated/summary.json", "mine");
  const auto before = contents(folder.path());
  const Ran ran = run("compare scene.toml --out out", in(folder));
  EXPECT_EQ(ran.code, 5) << ran.text;
  EXPECT_EQ(touched(before, folder.path()), "");
}

TEST(Outputs, AStudyNeitherFollowsLinksNorWritesOverFilesUnderTheNamesOfItsJournal) {
  const Folder folder;
  folder.write("scene.toml", small_scene("[errors]\nEXX_um = 5\n"));
  folder.write("p.ngc", small_program);
  folder.write("study.toml",
               "scene = \"scene.toml\"\n[[input]]\nelement = \"EXX\"\nspread = "
               "0.2\n[monte_carlo]\ncases = 2\n");
  const std::string names[] = {"journal.sqlite", "journal.sqlite-wal", "journal.sqlite-shm",
                               "journal.sqlite-journal", "journal.sqlite-lock"};
  for (const std::string& name : names)
    for (const bool link : {false, true})
      for (const char* force : {"", " --force"}) {
        SCOPED_TRACE(name + (link ? ", a link" : ", a file") + force);
        const std::string text = "mine, and rather longer than a head";
        const Folder own;
        fs::create_directories(own / "out");
        own.write(link ? "keep.txt" : "out/" + name, text);
        if (link) fs::create_symlink(own / "keep.txt", own / ("out/" + name));
        const Ran ran = run("study study.toml --out " + (own / "out").string() + force, in(folder));
        EXPECT_EQ(ran.code, std::string(force).empty() || link || name != "journal.sqlite" ? 5 : 3)
            << ran.text;
        EXPECT_EQ(bytes(own / ("out/" + name)), text);
        EXPECT_EQ(fs::is_symlink(own / ("out/" + name)), link);
        EXPECT_HAS(ran.text, name);
      }
  ASSERT_EQ(run("study study.toml --out out", in(folder)).code, 0);
  folder.write("out/journal.sqlite-wal", "mine");
  EXPECT_EQ(run("study study.toml --out out", in(folder)).code, 5) << "beside a journal, too";
  EXPECT_EQ(bytes(folder / "out/journal.sqlite-wal"), "mine");
}

TEST(Outputs, WhatIsRefusedLeavesNoFolderBehind) {
  const Folder folder;
  const Ran missing = run("pose " + dome + " --at-file missing.csv --out new/x.csv", in(folder));
  EXPECT_EQ(missing.code, 3) << missing.text;
  const Ran readings = run("identify missing.csv --out new/x.toml", in(folder));
  EXPECT_EQ(readings.code, 3) << readings.text;
  const Ran file = run("pose " + dome + " --grid X=0:1:2 --out g.csv", in(folder));
  EXPECT_EQ(file.code, 5) << file.text;
  EXPECT_HAS(file.text, "--out g\n") << "a suggestion";
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Outputs, AFolderThatHoldsOnlyHiddenFilesIsEmpty) {
  const Folder folder;
  folder.write("kept/.gitkeep", "");
  const ResultFolder kept(folder / "kept", {});
  write_file(kept / "a.txt", "abbe's");
  EXPECT_EQ(refusal([&] { write_file(ResultFolder(folder / "kept", {}) / "a.txt", "again"); }), "");
  EXPECT_TRUE(fs::exists(folder / "kept/.gitkeep"));
  // a hidden folder may hold a whole repository, a link lead anywhere
  folder.write("repository/.git/HEAD", "mine");
  EXPECT_NE(refusal([&] { ResultFolder(folder / "repository", {}); }), "");
  fs::create_directories(folder / "linked");
  fs::create_symlink(folder / "kept", folder / "linked/.link");
  EXPECT_NE(refusal([&] { ResultFolder(folder / "linked", {}); }), "");
}

TEST(Outputs, NamesThatAreNoUtf8AreWrittenAndReported) {
  const Folder folder;
  folder.write("scene.toml", small_scene("[errors]\nEXX_um = 5\n"));
  folder.write("p.ngc", small_program);
  folder.write("poses.csv", "X_mm\n1\n");
  folder.write("study.toml",
               "scene = \"scene.toml\"\n[[input]]\nelement = \"EXX\"\nspread = "
               "0.2\n[monte_carlo]\ncases = 2\n");
  const std::string name = "$'r\\xff\\xfe'";
  const struct {
    std::string command;
    int times;  ///< its own files are known by such names, too
  } done[] = {
      {"compare scene.toml --json --out c" + name, 1},
      {"rewrite scene.toml --case perfect-position-program --json --out " + name + "/" + name, 2},
      {"pose scene.toml --at-file poses.csv --json --out " + name + "/" + name + ".json", 2},
      {"pose scene.toml --grid X=0:1:2 --json --out v" + name, 1},
      {"measure " + dome + " --instrument ball_bar --json --out m" + name, 1},
      {"evaluate m" + name + "/ball_bar.csv --json --out e" + name, 1},
      {"identify m" + name + "/ball_bar.csv --elements EXX --order 1 --json --out i" + name + "/" +
           name,
       1},
      {"study study.toml --json --out s" + name, 1},
      {"export scene.toml --case perfect-position-table --json --out x" + name, 1}};
  for (const auto& [command, times] : done) {
    const fs::path script =
        folder.write("go.sh", std::string(ABBE_PROGRAM) + " " + command + " 2>errors.txt\n");
    for (int i = 0; i < times; ++i) {
      const Ran ran = shell(in(folder) + " bash " + script.string());
      EXPECT_EQ(ran.code, 0) << command << ": " << bytes(folder / "errors.txt");
      EXPECT_TRUE(nlohmann::json::accept(ran.text)) << command << ": " << ran.text;
    }
  }
  for (const auto& entry : fs::recursive_directory_iterator(folder.path()))
    if (entry.path().extension() == ".json") {
      EXPECT_TRUE(nlohmann::json::accept(bytes(entry.path()))) << entry.path();
    }
  EXPECT_TRUE(fs::exists(folder / "r\xff\xfe/r\xff\xfe"));
}

TEST(Outputs, ATornMarkKeepsWhatItSaysBefore) {
  const Folder folder;
  write_file(ResultFolder(folder / "out", {}) / "a.txt", "abbe's");
  folder.write("out/b.txt", "whose?");
  std::ofstream(folder / "out/.abbe-result", std::ios::app) << "{\"file\":\"b.t";
  const ResultFolder out(folder / "out", {});
  write_file(out / "a.txt", "again");
  EXPECT_NE(refusal([&] { write_file(out / "b.txt", "again"); }), "");
  write_file(out / "c.txt", "new");
  write_file(ResultFolder(folder / "out", {}) / "c.txt", "newer");
  EXPECT_EQ(bytes(folder / "out/c.txt"), "newer");
  EXPECT_EQ(bytes(folder / "out/b.txt"), "whose?");
}

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
      EXPECT_HAS(ran.text, "standard output: cannot be written") << line << " " << to;
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
      EXPECT_HAS(ran.text, "cannot be written") << line;
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
