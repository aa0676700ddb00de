#include <nlohmann/json.hpp>
#include "sim/study/case_plan.h"
#include "sim/study/journal.h"
#include "sim/study/study.h"
#include "tests/study/small_disk.h"
#include "tests/study/small_study.h"
#include "tests/test.h"

/// The real program on small studies: whatever happens to it, the tables are the same bytes.
namespace abbe::sim::study {
namespace {

const std::string small_inputs =
    "scene = \"scene.toml\"\nresponses = [\"rms\"]\ninfluence = { sheet = false, checks = 1 }\n"
    "[[inputs]]\nevery = \"element\"\nof = [\"EXX\", \"EYX\", \"EAX\"]\nspread = 1\nlow = -3\n"
    "high = 3\n[[input]]\npath = \"setup.EA_urad\"\nspread = 20\n";

/// Two machines side by side; every analysis with one of the engines, as pictures take most of the
/// time.
std::string study_with(const std::string& engine) {
  const bool cut = engine == "full", estimated = engine == "influence";
  return "title = \"small " + engine + "\"\nengine = \"" + engine +
         "\"\ncases = [\"uncompensated\", \"perfect-iterated-ideal\"]\nproofs = 40\n" +
         small_inputs + "[monte_carlo]\ncases = " + (cut ? "60" : "1500") + "\n" +
         (cut ? "[one_at_a_time]\n" : "") +
         (estimated ? "[[sweep]]\ninput = \"EXX\"\nfrom = -2\nto = 2\nsteps = 5\n"
                      "[sobol_indices]\nbase_points = 64\n"
                    : "");
}

/// A study of one machine with many cut cases, so that one can come in between.
const std::string long_study =
    "engine = \"full\"\n" + small_inputs + "[monte_carlo]\ncases = 5000\n";

std::vector<std::string> words(const fs::path& study, const fs::path& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> all{ABBE_PROGRAM, "study", study.string(), "--out", out.string()};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

using Tables = std::vector<std::string>;

Tables tables(const fs::path& out) {
  Tables all;
  for (const char* name : {"cases.csv", "budget.csv", "budget.json", "budget.md", "page.json"})
    all.push_back(text_of(out / name));
  return all;
}

/// Studies stay at one place, as the place is part of what a journal belongs to.
class StudyProgram : public testing::Test {
 protected:
  static void SetUpTestSuite() { folder_ = new StudyFolder; }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static const RunFolder& folder() { return *folder_; }

  static fs::path study_of(const std::string& engine) {
    return folder().write(engine + ".toml", study_with(engine));
  }
  /// A folder for what one run leaves.
  static fs::path out(const std::string& name) {
    return folder() / (testing::UnitTest::GetInstance()->current_test_info()->name() + name);
  }
  struct Ran {
    int code = 0;
    std::string text;
  };
  static Ran ran(const std::vector<std::string>& all) {
    const fs::path log = folder() / "log";
    fs::remove(log);
    const int code = study::run(all, log);
    return {code, text_of(log)};
  }
  /// What the program calls a study: an empty shard begins a journal and computes nothing.
  static std::string study_identity(const fs::path& study) {
    const fs::path own = out(" identity");
    EXPECT_EQ(ran(words(study, own, {"--shard", "9999/10000"})).code, 0);
    return read_journal(own / "journal-9999-of-10000.sqlite").identity;
  }
  /// Tables of an undisturbed run on one thread.
  static const Tables& undisturbed(const std::string& engine) {
    static std::map<std::string, Tables> known;
    if (!known.count(engine)) {
      const fs::path out = folder() / ("undisturbed " + engine);
      const Ran one = ran(words(study_of(engine), out, {"--threads", "1"}));
      EXPECT_EQ(one.code, 0) << one.text;
      known[engine] = tables(out);
      for (const std::string& text : known[engine]) EXPECT_FALSE(text.empty());
    }
    return known[engine];
  }
  static std::uint64_t finished(const fs::path& journal) {
    try {
      return read_journal(journal).rows.size();
    } catch (const std::exception&) {
      return 0;  // not begun
    }
  }
  static nlohmann::json shown(const fs::path& study, const fs::path& out) {
    const fs::path log = folder() / "shown";
    fs::remove(log);
    EXPECT_EQ(study::run(words(study, out, {"--show", "--json"}), log), 0) << text_of(log);
    return nlohmann::json::parse(text_of(log), nullptr, false);
  }

  static StudyFolder* folder_;
};
StudyFolder* StudyProgram::folder_ = nullptr;

// ---------------------------------------------------------------- killed and resumed

class StudyKilled : public StudyProgram, public testing::WithParamInterface<const char*> {};

TEST_P(StudyKilled, AtRandomAndResumedGivesTheSameBytes) {
  const std::string engine = GetParam();
  const unsigned seed = 20;
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  const int kills = engine != "both" ? 5 : is_long ? 20 : 7;
  // In a short row of kills the last three come while tables are written.
  const int before_tables = engine == "both" && !is_long ? kills - 3 : kills;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const fs::path study = study_of(engine), out = this->out("");
  const Tables& expected = undisturbed(engine);
  const std::uint64_t cases = make_plan(read_study(study)).cases;
  int hit = 0;
  std::uint64_t before = 0;
  std::string reported;
  for (int kill = 0; kill < kills; ++kill) {
    // some before they begin anything, most some cases on, the rest while they write tables
    const std::uint64_t left = cases - before;
    const std::uint64_t more = kill >= before_tables ? left
                               : kill % 4 == 0       ? 0
                                               : std::min(left, 1 + random() % (left / 3 + 1));
    Process process(words(study, out), folder() / "log");
    wait_until(
        [&] { return process.has_ended() || finished(out / "journal.sqlite") >= before + more; },
        60);
    wait_ms(double(random() % (left == 0 ? 500 : 30)));
    process.signal(SIGKILL);
    hit += process.exit_code() == -SIGKILL;
    const std::uint64_t now = finished(out / "journal.sqlite");
    EXPECT_GE(now, before + more) << "nothing that was finished is lost";
    before = now;
    reported += " " + std::to_string(now);
  }
  std::cout << "seed " << seed << ", " << hit << " of " << kills << " killed at work, of " << cases
            << " cases finished then:" << reported << "\n";
  EXPECT_GT(hit, kills / 2);
  const Ran last = ran(words(study, out));
  EXPECT_EQ(last.code, 0) << last.text;
  EXPECT_EQ(tables(out), expected);
  EXPECT_EQ(finished(out / "journal.sqlite"), cases);
}
INSTANTIATE_TEST_SUITE_P(Engines, StudyKilled, testing::Values("influence", "full", "both"),
                         [](const auto& engine) { return std::string(engine.param); });

TEST_F(StudyProgram, EndsWith130AtCtrlCAndResumesToTheSameBytes) {
  const fs::path study = study_of("both"), out = this->out("");
  Process process(words(study, out), folder() / "log");
  ASSERT_TRUE(wait_until([&] { return finished(out / "journal.sqlite") > 0; }, 60));
  process.signal(SIGINT);
  EXPECT_EQ(process.exit_code(), 130);
  EXPECT_FALSE(fs::exists(out / "budget.md"));
  const Ran last = ran(words(study, out));
  EXPECT_EQ(last.code, 0) << last.text;
  EXPECT_EQ(tables(out), undisturbed("both"));
}

// ---------------------------------------------------------------- who computes

TEST_F(StudyProgram, OnTwoThreadsGivesTheSameBytesAndAgainWithoutAnyCaseLeft) {
  const fs::path study = study_of("both"), out = this->out("");
  EXPECT_EQ(ran(words(study, out, {"--threads", "2"})).code, 0);
  EXPECT_EQ(tables(out), undisturbed("both"));
  fs::remove(out / "budget.md");
  const Ran again = ran(words(study, out, {"--resume"}));
  EXPECT_EQ(again.code, 0);
  EXPECT_HAS(again.text, " 0 of ");
  EXPECT_EQ(tables(out), undisturbed("both"));
}

TEST_F(StudyProgram, InThreeShardsMergedGivesTheSameBytesAndSaysWhatIsMissingBefore) {
  const fs::path study = study_of("both"), out = this->out("");
  const std::uint64_t cases = make_plan(read_study(study)).cases;
  for (const char* shard : {"0/3", "1/3"})
    EXPECT_EQ(ran(words(study, out, {"--shard", shard})).code, 0);
  EXPECT_FALSE(fs::exists(out / "budget.md")) << "a shard has no tables";
  const nlohmann::json half = shown(study, out);
  EXPECT_EQ(half["cases"], cases);
  EXPECT_GT(half["finished"], 0);
  EXPECT_LT(half["finished"], cases);
  const Ran early = ran(words(study, out, {"--merge"}));
  EXPECT_EQ(early.code, 3);
  const std::string missing = std::to_string(cases - half["finished"].get<std::uint64_t>());
  EXPECT_HAS(early.text, missing + " missing of --shard 2/3");
  EXPECT_EQ(early.text.find("--shard 1/3"), std::string::npos) << early.text;
  EXPECT_EQ(ran(words(study, out, {"--shard", "2/3"})).code, 0);
  const Ran merged = ran(words(study, out, {"--merge"}));
  EXPECT_EQ(merged.code, 0) << merged.text;
  EXPECT_EQ(tables(out), undisturbed("both"));
  EXPECT_EQ(shown(study, out)["finished"], cases);
}

TEST_F(StudyProgram, OnOneTwoAndFourRanksGivesTheSameBytes) {
  if (const std::string why = no_ranks(); !why.empty()) GTEST_SKIP() << why;
  const fs::path study = study_of("both");
  for (const int ranks : {1, 2, 4}) {
    const fs::path out = this->out(std::to_string(ranks));
    const Ran one = ran(among(ranks, words(study, out)));
    EXPECT_EQ(one.code, 0) << one.text;
    EXPECT_EQ(tables(out), undisturbed("both")) << ranks << " ranks";
  }
  const fs::path other = folder().write("other.toml", study_with("both") + "[worst_case]\n");
  const Ran refused = ran(among(2, words(other, out("2"))));
  EXPECT_EQ(refused.code, 3) << "a fault of rank 0 ends all: " << refused.text;
}

// ---------------------------------------------------------------- one at a time, and its own

TEST_F(StudyProgram, RefusesASecondProcessOnTheSameJournal) {
  const fs::path study = folder().write("long.toml", long_study), out = this->out("");
  Process first(words(study, out), folder() / "first");
  ASSERT_TRUE(wait_until([&] { return finished(out / "journal.sqlite") > 0; }, 60));
  const Ran second = ran(words(study, out));
  EXPECT_EQ(second.code, 5) << second.text;
  EXPECT_HAS(second.text, "journal.sqlite");
  EXPECT_EQ(shown(study, out)["cases"], 5001) << "but anybody can look at it";
  EXPECT_FALSE(first.has_ended());
}

TEST_F(StudyProgram, RefusesTheJournalOfAnotherBuild) {
  const fs::path study = study_of("influence"), out = this->out("");
  fs::create_directories(out);
  { Journal(out / "journal.sqlite", read_study(study).identity).add({{0, {1e-3, 1e-3}, ""}}); }
  EXPECT_EQ(ran(words(study, out)).code, 3) << "it is of this test's own program";
}

TEST_F(StudyProgram, RefusesTheJournalOfAnotherStudyAndLeavesItAlone) {
  const fs::path study = study_of("influence"), out = this->out("");
  fs::create_directories(out);
  { Journal(out / "journal.sqlite", study_identity(study)).add({{0, {1e-3, 1e-3}, ""}}); }
  const std::string before = text_of(out / "journal.sqlite");
  for (const std::vector<std::string>& more : {std::vector<std::string>{"--seed", "9"},
                                               {"--seed", "9", "--show"},
                                               {"--seed", "9", "--merge"},
                                               {"--set", "set={part.vertices=400}"}}) {
    const Ran one = ran(words(study, out, more));
    EXPECT_EQ(one.code, 3) << more.back() << ": " << one.text;
    EXPECT_HAS(one.text, "journal");
  }
  EXPECT_EQ(text_of(out / "journal.sqlite"), before);
}

// ---------------------------------------------------------------- shown

TEST_F(StudyProgram, ShowsNothingHalfAndAllOfIt) {
  const fs::path study = study_of("influence"), out = this->out("");
  EXPECT_EQ(ran(words(study, out, {"--show"})).code, 3) << "no journal";
  EXPECT_FALSE(fs::exists(out)) << "looking makes nothing";
  const std::string identity = study_identity(study);
  const std::uint64_t cases = make_plan(read_study(study)).cases;
  fs::create_directories(out);
  std::uint64_t added = 0;
  for (const std::uint64_t until : {std::uint64_t(0), cases / 2, cases}) {
    {
      Journal journal(out / "journal.sqlite", identity);
      std::vector<Row> rows;
      for (; added < until; ++added) rows.push_back({added, {1e-3 * double(added), 1e-3}, ""});
      journal.add(rows);
    }
    const nlohmann::json json = shown(study, out);
    ASSERT_TRUE(json.is_object()) << until;
    EXPECT_EQ(json["finished"], until);
    EXPECT_EQ(json["cases"], cases);
    std::uint64_t sum = 0;
    for (const auto& block : json["analyses"]) sum += block["finished"].get<std::uint64_t>();
    EXPECT_EQ(sum, until);
    const Ran text = ran(words(study, out, {"--show"}));
    EXPECT_EQ(text.code, 0);
    EXPECT_HAS(text.text, std::to_string(until) + " of " + std::to_string(cases));
  }
  EXPECT_FALSE(fs::exists(out / "budget.md"));
}

// ---------------------------------------------------------------- what goes wrong

TEST_F(StudyProgram, AMachineThatLeavesItsTravelHasARowThatSaysSoAndTheStudyGoesOn) {
  const fs::path study = folder().write(
      "travel.toml",
      "scene = \"scene.toml\"\nengine = \"full\"\nresponses = [\"rms\", \"in_tolerance\"]\n"
      "[[input]]\npath = \"part.at_mm.2\"\ncentre = 80\nspread = 10\n"
      "[[sweep]]\ninput = \"part.at_mm.2\"\nvalues = [80, 340, 90]\n");
  const fs::path out = this->out("");
  const Ran one = ran(words(study, out));
  EXPECT_EQ(one.code, 0) << one.text;
  const std::string cases = text_of(out / "cases.csv");
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < cases.size(); at = cases.find('\n', at) + 1)
    lines.push_back(cases.substr(at, cases.find('\n', at) - at));
  ASSERT_EQ(lines.size(), 5u) << cases;
  EXPECT_EQ(lines[0], "case,analysis,engine,part.at_mm.2 / mm,rms_um,in_tolerance_percent,fault");
  EXPECT_TRUE(lines[3].starts_with("2,sweep,full,340,,,")) << lines[3];
  EXPECT_HAS(lines[3], "Z between");
  for (const int good : {1, 2, 4}) {
    const std::string& line = lines[std::size_t(good)];
    EXPECT_TRUE(line.ends_with(",")) << "no fault: " << line;
    EXPECT_EQ(line.find(",,"), std::string::npos) << line;
  }
  EXPECT_HAS(text_of(out / "budget.json"), "Z between") << "and a warning";
}

/// Such an arm used to have a yield of 100 % by influence maps, which know no rivals in a gouge.
TEST_F(StudyProgram, AnArmThatGougesHasNoFiguresWhicheverEngineAndTheBudgetSaysHowMuch) {
  folder().write("gouged.toml", small_scene() + "[setup]\nEX_um = 400\n[search]\nband_mm = 0.05\n");
  for (const std::string engine : {"influence", "full"}) {
    const fs::path study = folder().write(
        "gouged_study.toml",
        "scene = \"gouged.toml\"\nengine = \"" + engine +
            "\"\nresponses = [\"pv\", \"in_tolerance\"]\nlimits = { pv_um = 100 }\n" +
            (engine == "full" ? ""
                              : "influence = { sheet = false, checks = 0 }\nworst_case = {}\n") +
            "[[input]]\npath = \"setup.EY_um\"\nspread = 1\n[monte_carlo]\ncases = 20\n");
    const Ran one = ran(words(study, out(engine)));
    ASSERT_EQ(one.code, 0) << one.text;
    const auto budget = nlohmann::json::parse(text_of(out(engine) / "budget.json"));
    EXPECT_EQ(budget["failed_cases"], budget["cases"]) << engine;
    const auto& arm = budget["arms"][0];
    for (const auto& response : arm["responses"])
      for (const char* figure :
           {"base", "worst", "worst_bound", "monte_carlo", "within_limit_percent"})
        EXPECT_TRUE(response[figure].is_null())
            << engine << " " << figure << " " << response[figure];
    EXPECT_TRUE(arm["map"]["rms_um"].is_null()) << engine;
    EXPECT_NEAR(arm["map"]["gouged_percent"].get<double>(), 21.2, 0.1) << engine;
    EXPECT_NEAR(arm["map"]["uncut_percent"].get<double>(), 25.1, 0.1) << engine;
    EXPECT_HAS(budget["warnings"].dump(), "seen 68 vertices with such a gouge")
        << budget["warnings"];
  }
}

TEST_F(StudyProgram, ByInfluenceMapsOfAPartThatIsAllGougedSaysSo) {
  folder().write("sunk.toml", small_scene() + "[setup]\nEZ_um = 400\n[search]\nband_mm = 0.05\n");
  const Ran one = ran(words(folder().write("sunk_study.toml",
                                           "scene = \"sunk.toml\"\nresponses = [\"pv\"]\n"
                                           "[[input]]\npath = \"setup.EX_um\"\nspread = 1\n"
                                           "[monte_carlo]\ncases = 20\n"),
                            out("")));
  EXPECT_EQ(one.code, 3) << one.text;
  EXPECT_HAS(one.text, "seen no vertices cut within 0.05 mm, 297 vertices gouged deeper");
}

TEST_F(StudyProgram, ReportsAFullDiskAndGoesOnWhenThereIsRoom) {
  const fs::path out = this->out("");
  fs::create_directories(out);
  const SmallDisk disk(out, "120k");
  if (!disk.mounted) GTEST_SKIP() << "no right to mount a small disk";
  const fs::path study = study_of("both");
  const Ran full = ran(words(study, out));
  EXPECT_EQ(full.code, 5) << full.text;
  std::cout << full.text.substr(full.text.rfind("abbe: "));
  const std::uint64_t kept = finished(out / "journal.sqlite");
  ASSERT_TRUE(disk.resize("16m"));
  EXPECT_GE(finished(out / "journal.sqlite"), kept);
  const Ran last = ran(words(study, out));
  EXPECT_EQ(last.code, 0) << last.text;
  EXPECT_EQ(tables(out), undisturbed("both"));
}

TEST_F(StudyProgram, RefusesBadInputWithItsPlaceAndLeavesNoFiles) {
  const fs::path out = this->out("");
  const fs::path study = folder().write("bad.toml", small_inputs + "[one_at_a_time]\nstep = -1\n");
  const Ran one = ran(words(study, out));
  EXPECT_EQ(one.code, 3);
  EXPECT_HAS(one.text, "bad.toml:14:8: expected one_at_a_time.step");
  EXPECT_EQ(ran(words(study, out, {"--show"})).code, 3);
  EXPECT_EQ(ran(words(study, out, {"--slurm"})).code, 3) << "reported now, not by every shard";
  EXPECT_EQ(ran(words(folder() / "none.toml", out)).code, 3);
  EXPECT_FALSE(fs::exists(out));
  const fs::path good = study_of("influence");
  folder().write("a file", "");
  EXPECT_EQ(ran(words(good, folder() / "a file" / "out")).code, 5) << "a folder that cannot be";
}

TEST_F(StudyProgram, UnderstandsItsCommandLine) {
  const fs::path study = study_of("influence"), out = this->out("");
  const Ran help = ran({ABBE_PROGRAM, "study", "--help"});
  EXPECT_EQ(help.code, 0);
  for (const char* word :
       {"--show", "--merge", "--shard", "--slurm", "--resume", "--set", "mpirun"})
    EXPECT_HAS(help.text, word);
  EXPECT_EQ(ran({ABBE_PROGRAM, "study"}).code, 2);
  for (const std::vector<std::string>& more :
       std::vector<std::vector<std::string>>{{"--nonsense"},
                                             {"--shard", "3/3"},
                                             {"--shard", "-1/3"},
                                             {"--shard", "0/0"},
                                             {"--shard", "1"},
                                             {"--shard", "0/3x"},
                                             {"--shard", "99999999999/3"},
                                             {"--shard", "0/3", "--merge"},
                                             {"--show", "--merge"},
                                             {"--show", "--slurm"},
                                             {"--shards", "3"},
                                             {"--slurm", "--shards", "0"},
                                             {"--set", "nonsense"},
                                             {"--threads", "0"},
                                             {"--seed", "-1"}}) {
    const Ran one = ran(words(study, out, more));
    EXPECT_EQ(one.code, 2) << testing::PrintToString(more) << one.text;
  }
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(StudyProgram, PrintsAScriptForSlurmThatAShellReads) {
  const fs::path study = study_of("influence"), out = this->out(" with a space");
  const Ran one =
      ran(words(study, out, {"--slurm", "--shards", "5", "--cpus", "3", "--time", "1:00:00"}));
  ASSERT_EQ(one.code, 0) << one.text;
  for (const std::string& word :
       {std::string("#!/bin/sh"), study.string(), out.string(), std::string("--shard"),
        std::string("--merge"), std::string("1:00:00"), std::string(ABBE_PROGRAM)})
    EXPECT_HAS(one.text, word);
  const fs::path script = folder().write("job.sh", one.text);
  EXPECT_EQ(study::run({"sh", "-n", script}, folder() / "log"), 0);
  EXPECT_NE(ran(words(study, out, {"--slurm", "--time", "tomorrow"})).code, 0);
  EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace abbe::sim::study
