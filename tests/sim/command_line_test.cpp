#include <nlohmann/json.hpp>
#include <regex>
#include "tests/safety/program_run.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

using safety::Ran;
using safety::run;

const fs::path source_folder = ABBE_SOURCE_DIR;

int files_in(const fs::path& folder) {
  int count = 0;
  if (!fs::exists(folder)) return 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    count += entry.is_regular_file() && entry.path().filename() != ".abbe-result";
  return count;
}

/// A folder of its own for every test, gone afterwards.
class CommandLine : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::temp_directory_path() / ("abbe-test-" + std::to_string(::getpid()) + "-" +
                                     testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }

  /// Scene that mills a small plane on the perfect gantry with the program text given.
  fs::path plane_scene(const std::string& program_file, const std::string& more = "") const {
    return write("scene.toml",
                 "title = \"small plane\"\n"
                 "machine = \"" +
                     (source_folder / "scenes/machines/gantry_cxyza.toml").string() +
                     "\"\n"
                     "tool = \"" +
                     (source_folder / "scenes/tools/ball_r5.toml").string() +
                     "\"\n"
                     "[part]\nsurface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\nat_mm = "
                     "[0, 0, 80]\nvertices = 200\n"
                     "[program]\nfile = \"" +
                     program_file + "\"\n" + more);
  }

  void expect_refused(const fs::path& scene, const std::string& place,
                      const std::string& expected) const {
    const fs::path out = folder_ / "out";
    const Ran ran = run("run " + scene.string() + " --out " + out.string());
    EXPECT_EQ(ran.code, 3) << ran.text;
    EXPECT_HAS(ran.text, place);
    EXPECT_HAS(ran.text, expected);
    EXPECT_EQ(files_in(out), 0) << "a refusal leaves no files";
  }

  fs::path folder_;
};

const std::string good_program =
    "%\nG21 G90 G94 G17\nG54\nG43.4 H1\nG0 X-10 Y0 Z95 A0 C0\nG1 Z80 F1000\nG1 X10\nG0 "
    "Z95\nM2\n%\n";

TEST_F(CommandLine, HelpAndVersionSucceedAndNoCommandIsAUsageFault) {
  EXPECT_EQ(run("--help").code, 0);
  EXPECT_EQ(run("--version").code, 0);
  EXPECT_EQ(run("compare --help").code, 0);
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("carve scene.toml").code, 2);
  EXPECT_EQ(run("run --nonsense").code, 2);
  EXPECT_EQ(run("run x.toml --set nonsense").code, 2);
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  EXPECT_EQ(run("run " + scene.string() + " --case nobody-iterated-ideal").code, 2);
}

TEST_F(CommandLine, AMissingSceneIsAnInputFault) {
  const Ran ran = run("run " + (folder_ / "none.toml").string());
  EXPECT_EQ(ran.code, 3);
  EXPECT_HAS(ran.text, "none.toml");
}

TEST_F(CommandLine, APictureOfTheSceneIsDrawnOrRefused) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path out = folder_ / "out";
  const Ran ran = run("check " + scene.string() + " --picture --out " + out.string());
  EXPECT_EQ(ran.code, ABBE_RENDER ? 0 : 3) << ran.text;
  EXPECT_EQ(fs::exists(out / "check.png"), bool(ABBE_RENDER));
  EXPECT_EQ(ran.text.find("picture in") != std::string::npos, bool(ABBE_RENDER)) << ran.text;
}

TEST_F(CommandLine, AGoodSceneLeavesEveryPromisedFileAndKey) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path out = folder_ / "out";
  const Ran ran = run("run " + scene.string() + " --out " + out.string());
  ASSERT_EQ(ran.code, 0) << ran.text;
  for (const char* name : {"summary.json", "scene.toml"})
    EXPECT_TRUE(fs::exists(out / name)) << name;
  for (const char* name : {"residual.vtp", "residual.png", "histogram.png"})
    EXPECT_EQ(fs::exists(out / name), bool(ABBE_RENDER)) << name;
  EXPECT_EQ(ran.text.find("built without VTK") == std::string::npos, bool(ABBE_RENDER)) << ran.text;
  const auto summary = nlohmann::json::parse(bytes(out / "summary.json"));
  for (const char* key : {"scene", "seed", "vertices", "cut_vertices", "uncut_vertices", "moves",
                          "residual_um", "tip_error_um", "direction_error_urad", "datum",
                          "alignment", "form", "timing_s", "warnings", "versions"})
    EXPECT_TRUE(summary.contains(key)) << key;
  for (const char* key :
       {"pv", "rms", "mean", "std", "min", "max", "p95_abs", "in_tolerance_percent"})
    EXPECT_TRUE(summary["residual_um"].contains(key)) << key;
  EXPECT_EQ(summary["moves"], 4);
  EXPECT_EQ(files_in(out), ABBE_RENDER ? 5 : 2) << "and nothing unfinished";
}

TEST_F(CommandLine, AToleranceGivesAVerdictAndAMapOfBands) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path out = folder_ / "out";
  const std::string line = "run " + scene.string() + " --out " + out.string();
  const Ran fails = run(line + " --set 'part.tolerance_um=[-1, 2]'");
  ASSERT_EQ(fails.code, 0) << "a verdict is no limit\n" << fails.text;
  EXPECT_HAS(fails.text, "FAIL by ");
  EXPECT_HAS(fails.text, ", line ");
  EXPECT_EQ(fs::exists(out / "tolerance.png"), bool(ABBE_RENDER));
  const auto summary = nlohmann::json::parse(bytes(out / "summary.json"));
  const auto& c = summary["conformance"];
  EXPECT_NEAR(c["in_percent"].get<double>() + c["over_percent"].get<double>() +
                  c["under_percent"].get<double>() + c["uncut_percent"].get<double>(),
              100.0, 1e-9);
  EXPECT_EQ(c["worst"]["at_mm"].size(), 3u);
  const Ran none = run(line);
  EXPECT_EQ(none.text.find("FAIL"), std::string::npos) << none.text;
  EXPECT_TRUE(nlohmann::json::parse(bytes(out / "summary.json"))["conformance"].is_null());
  EXPECT_FALSE(fs::exists(out / "tolerance.png")) << "of the run before";
}

TEST_F(CommandLine, FormAndTextureHaveLimits) {
  const std::string program = write("p.ngc", good_program).string();
  const fs::path out = folder_ / "out";
  const std::string line = "run " +
                           plane_scene(program, "[errors]\nEXX_um = 5\nEZX_um = 5\n").string() +
                           " --out " + out.string();
  ASSERT_EQ(run(line).code, 0);
  const auto summary = nlohmann::json::parse(bytes(out / "summary.json"));
  const auto allowed = [&](const char* key, double limit) {
    const Ran ran = run(fmt::format("{} --set limits.{}={}", line, key, limit));
    EXPECT_TRUE(ran.code == 0 || ran.code == 1) << ran.text;
    EXPECT_EQ(ran.code == 1, ran.text.find("the scene allows") != std::string::npos) << ran.text;
    return ran.code == 0;
  };
  const struct {
    const char *limit, *of, *figure;
  } limits[] = {{"form_pv_um", "form_um", "pv"},
                {"form_rms_um", "form_um", "rms"},
                {"texture_sa_um", "texture_um", "Sa"},
                {"texture_sq_um", "texture_um", "Sq"},
                {"texture_sz_um", "texture_um", "Sz"}};
  for (const auto& [limit, of, figure] : limits) {
    const double value = summary[of][figure];
    ASSERT_GT(value, 0.0) << limit;
    EXPECT_TRUE(allowed(limit, 1.01 * value)) << limit;
    EXPECT_FALSE(allowed(limit, 0.99 * value)) << limit;
  }
}

TEST_F(CommandLine, ALineHasItsProfilesByISO21920) {
  if (!ABBE_RENDER) GTEST_SKIP();
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path out = folder_ / "out";
  ASSERT_EQ(run("run " + scene.string() + " --out " + out.string()).code, 0);
  const std::string render = "render " + out.string() + " --line x --nic 0.8 --nis 50";
  const Ran text = run(render);
  EXPECT_EQ(text.code, 0) << text.text;
  for (const char* expected :
       {"profile along x", "Nis 50 um, Nic 0.8 mm (--nic, setting class Sc3)", "ISO 21920-2",
        "q   root mean square height", "um/mm", "profile-x.png", "profile-x.json", "profile-x.csv"})
    EXPECT_HAS(text.text, expected);
  const auto json = nlohmann::json::parse(bytes(out / "profile-x.json"));
  EXPECT_EQ(json["Nic_mm"], 0.8);
  EXPECT_GE(json["P"]["Pt_um"].get<double>(), json["P"]["Pq_um"].get<double>());
  EXPECT_TRUE(json["R"].contains("Rsm_mm") && json["W"].contains("Wsk"));
  const Ran printed = run(render + " --json --format svg");
  EXPECT_EQ(printed.code, 0) << printed.text;
  EXPECT_HAS(printed.text, "\"profile\": {");
  EXPECT_HAS(printed.text, "profile-x.svg");
}

TEST_F(CommandLine, AResultIsDrawnAgainAsItIsAsked) {
  if (!ABBE_RENDER) GTEST_SKIP();
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path out = folder_ / "out";
  ASSERT_EQ(run("run " + scene.string() + " --out " + out.string()).code, 0);
  const std::string render = "render " + out.string() + " --out " + (folder_ / "again").string();
  for (const char* format : {"png", "svg", "pdf"}) {
    const Ran ran =
        run(render + " --bands -1,2 --view -y --size 640x480 --isolines --format " + format);
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_TRUE(fs::exists(folder_ / "again" / (std::string("rendered.") + format)));
  }
  const struct {
    const char *options, *expected;
  } slips[] = {
      {"--view up", "--view: expected +x, -x"},
      {"--line x --nic 0", "--nic: expected millimetres above 0"},
      {"--line x --nis small", "--nis: expected micrometres above 0"},
      {"--line x --sections 0", "--sections"},
      {"--nic 2", "--line"},
      {"--view 0,0,0", "--view: expected +x, -x"},
      {"--bands 8,2", "--bands: expected micrometres such as 5 or -2,8"},
      {"--bands x", "--bands: expected micrometres"},
      {"--range -1", "--range: expected micrometres above 0"},
      {"--size 1600", "--size: expected pixels such as 1600x1200"},
      {"--size 10x10", "--size: expected pixels such as 1600x1200"},
      {"--format bmp", "bmp"},
      {"--colours tolerance", "--bands, or a result with a tolerance in its summary.json"}};
  for (const auto& slip : slips) {
    const Ran ran = run(render + " " + slip.options);
    EXPECT_NE(ran.code, 0) << slip.options;
    EXPECT_HAS(ran.text, slip.expected) << slip.options;
  }
}

TEST_F(CommandLine, TheResolvedSceneRunsAgainToTheSameBytes) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path first = folder_ / "first", second = folder_ / "second";
  ASSERT_EQ(run("run " + scene.string() + " --set errors.EXX_um=7 --out " + first.string()).code,
            0);
  const Ran again = run("run " + (first / "scene.toml").string() + " --out " + second.string());
  ASSERT_EQ(again.code, 0) << again.text;
  if (ABBE_RENDER) {
    EXPECT_EQ(bytes(first / "residual.vtp"), bytes(second / "residual.vtp"));
  }
  EXPECT_EQ(bytes(first / "scene.toml"), bytes(second / "scene.toml"));
}

TEST_F(CommandLine, BadProgramsAreRefusedAtTheirPlace) {
  const struct {
    std::string line, column, expected;
  } cases[] = {
      {"G5 X1", "5:1", "G5"},
      {"G1 X1e20 F100", "5:6", "e20"},
      {"G1 X1 Q5 F100", "5:7", "Q"},
      {"G1 X1 F0", "5:", "F"},
      {"G2 X1 Y0 I0 J0 F100", "5:", ""},
      {"G2 X5 Y0 R1 F100", "5:", "R"},
      {"G1 X1 X2 F100", "5:7", "X"},
      {"G1 X1 B5 F100", "5:7", "B"},
      {"M199", "5:1", "M199"},
      {"G1 X- F100", "5:", ""},
  };
  for (const auto& one : cases) {
    const fs::path file =
        write("bad.ngc", "%\nG21 G90 G94 G17\nG54\nG43.4 H1\n" + one.line + "\nM2\n%\n");
    SCOPED_TRACE(one.line);
    expect_refused(plane_scene(file.string()), "bad.ngc:" + one.column, one.expected);
  }
}

TEST_F(CommandLine, AnAxisBeyondItsTravelIsNamedWithBlockAndValue) {
  const fs::path file =
      write("far.ngc", "G21 G90 G94\nG43.4 H1\nG1 X0 Y0 Z95 F1000\nG1 X900\nM2\n");
  expect_refused(plane_scene(file.string()), "far.ngc:4", "X between -300 and 300 mm");
}

TEST_F(CommandLine, NulAndRandomBytesAndMissingFilesAreRefused) {
  expect_refused(plane_scene(write("nul.ngc", std::string("G1 X1\0Y2\n", 9)).string()), "nul.ngc:1",
                 "");
  std::mt19937 random(7);
  std::string noise(5000, ' ');
  for (char& c : noise) c = char(random());
  expect_refused(plane_scene(write("noise.ngc", noise).string()), "noise.ngc:1", "");
  expect_refused(plane_scene((folder_ / "absent.ngc").string()), "absent.ngc", "");
}

TEST_F(CommandLine, CarriageReturnsAndAByteOrderMarkAreAccepted) {
  std::string crlf = "\xEF\xBB\xBF";
  for (const char c : good_program) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const fs::path scene = plane_scene(write("crlf.ngc", crlf).string());
  const Ran ran = run("run " + scene.string() + " --out " + (folder_ / "out").string());
  EXPECT_EQ(ran.code, 0) << ran.text;
}

TEST_F(CommandLine, EveryFaultOfASceneIsToldAtOnce) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string(),
                                     "[serch]\nband_mm = 2\n[view]\nrange_um = \"wide\"\n");
  const Ran ran = run("run " + scene.string() + " --out " + (folder_ / "out").string());
  EXPECT_EQ(ran.code, 3);
  EXPECT_HAS(ran.text, "serch");
  EXPECT_HAS(ran.text, "range_um");
  EXPECT_EQ(files_in(folder_ / "out"), 0);
}

TEST_F(CommandLine, AcceptanceLimitsDecideTheExitCode) {
  const fs::path scene =
      plane_scene(write("p.ngc", good_program).string(), "[limits]\npv_um = 0.001\n");
  const Ran ran = run("run " + scene.string() + " --out " + (folder_ / "out").string());
  EXPECT_EQ(ran.code, 1) << ran.text;
  EXPECT_HAS(ran.text, "PV");
}

TEST_F(CommandLine, AFolderThatCannotBeWrittenIsAnOutputFault) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const fs::path file = write("occupied", "a file where a folder should be");
  const Ran ran = run("run " + scene.string() + " --out " + (file / "deeper").string());
  EXPECT_EQ(ran.code, 5) << ran.text;
  EXPECT_HAS(ran.text, "occupied");
}

TEST_F(CommandLine, AFullDiskIsAnOutputFault) {
  const fs::path disk = folder_ / "disk";
  fs::create_directories(disk);
  if (std::system(("mount -t tmpfs -o size=24k tmpfs " + disk.string() + " 2>/dev/null").c_str()) !=
      0)
    GTEST_SKIP() << "a small disk can be mounted only by root";
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const Ran ran = run("run " + scene.string() + " --out " + (disk / "out").string());
  int unfinished = 0;
  for (const auto& entry : fs::recursive_directory_iterator(disk))
    unfinished += entry.path().filename().string().find(".unfinished") != std::string::npos;
  std::system(("umount " + disk.string()).c_str());
  EXPECT_EQ(ran.code, 5) << ran.text;
  EXPECT_EQ(unfinished, 0);
}

TEST_F(CommandLine, ResultsAreTheSameBytesForOneAndTwoThreadsAndASecondTime) {
  const std::string scene = (source_folder / "scenes/gantry_tilted_flat.toml").string();
  const std::string small =
      " --set part.vertices=3000 --set program.step_over_mm=4 --set program.step_mm=4 ";
  const auto compare = [&](const std::string& name, int threads) {
    const fs::path out = folder_ / name;
    const Ran ran = run("compare " + scene + small + "--threads " + std::to_string(threads) +
                        " --out " + out.string());
    EXPECT_EQ(ran.code, 0) << ran.text;
    return out;
  };
  const fs::path one = compare("one", 1), two = compare("two", 2), again = compare("again", 2);
  int compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(one)) {
    if (!entry.is_regular_file() || entry.path().filename() == ".abbe-result") continue;
    const fs::path name = fs::relative(entry.path(), one);
    for (const fs::path& other : {two, again}) {
      if (name.filename() == "summary.json") {
        auto a = nlohmann::json::parse(bytes(entry.path())),
             b = nlohmann::json::parse(bytes(other / name));
        a.erase("timing_s");
        b.erase("timing_s");
        EXPECT_EQ(a.dump(), b.dump()) << name;
      } else {
        EXPECT_EQ(bytes(entry.path()), bytes(other / name)) << name;
      }
      ++compared;
    }
  }
  std::cout << compared << " files compared byte by byte\n";
  EXPECT_GE(compared, 2 * (ABBE_RENDER ? 30 : 12));
}

TEST_F(CommandLine, ASceneThatCutsNothingIsRefusedByEveryCommandThatCuts) {
  const fs::path still = write("still.ngc", "G21 G90\nG4 P1\nM2\n");
  expect_refused(plane_scene(still.string()), "still.ngc", "a program without motion");
  const fs::path high =
      write("high.ngc", "G21 G90 G43.4 H1\nG0 X-3 Y0 Z160\nG1 X3 F1000\nG0 Z170\nM2\n");
  const fs::path scene = plane_scene(high.string());
  expect_refused(scene, "high.ngc:3", "the lowest cut is 80.0 mm above the part");
  const fs::path study =
      write("study.toml",
            "scene = \"scene.toml\"\n[[input]]\npath = \"setup.EA_urad\"\nspread "
            "= 5\n[monte_carlo]\ncases = 10\n");
  for (const std::string& command :
       {"compare " + scene.string(), "check " + scene.string(), "study " + study.string()}) {
    const Ran ran = run(command + " --out " + (folder_ / "c").string());
    EXPECT_EQ(ran.code, 3) << command << ran.text;
    EXPECT_HAS(ran.text, "80.0 mm above the part");
  }
}

TEST_F(CommandLine, AGougeDeeperThanTheBandFailsEveryLimitAndIsCounted) {
  const fs::path scene = plane_scene(
      write("p.ngc", "G21 G90 G43.4 H1\nG0 X-3 Y0 Z90\nG1 X0 Z80 F1000\nG1 Z72\nG0 Z90\nM2\n")
          .string(),
      "[limits]\npv_um = 1e6\n");
  const fs::path out = folder_ / "out";
  const Ran ran = run("run " + scene.string() + " --out " + out.string());
  EXPECT_EQ(ran.code, 1) << ran.text;
  EXPECT_HAS(ran.text, "gouged deeper than the band of 2 mm, the deepest by 7.99");
  const auto summary = nlohmann::json::parse(bytes(out / "summary.json"));
  EXPECT_GT(summary["gouged_vertices"], 100);
  EXPECT_NEAR(summary["deepest_gouge_um"].get<double>(), 8000.0,
              10.0);  // no vertex is right below the tip
  EXPECT_EQ(summary["deepest_gouge_is_bound"], false);
  EXPECT_EQ(summary["cut_vertices"].get<int>() + summary["uncut_vertices"].get<int>() +
                summary["gouged_vertices"].get<int>(),
            summary["vertices"].get<int>());
  ASSERT_FALSE(summary["warnings"].empty());
  const Ran compared = run("compare " + scene.string() + " --out " + out.string());
  EXPECT_EQ(compared.code, 1) << compared.text;
  const auto comparison = nlohmann::json::parse(bytes(out / "comparison.json"));
  EXPECT_EQ(comparison["cases"][1]["gouged_vertices"], summary["gouged_vertices"]);
  EXPECT_FALSE(comparison["warnings"].empty());
}

TEST_F(CommandLine, CheckWarnsOfTheToolThatIsNotTheScenes) {
  const fs::path scene =
      plane_scene(write("p.ngc", "T7 M6\n" + std::string(good_program)).string());
  for (const std::string command : {"check ", "run "}) {
    const Ran ran = run(command + scene.string() + " --out " + (folder_ / "c").string());
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_HAS(ran.text, "T7 on line 1 is cut with the scene's tool ball R5");
  }
}

TEST_F(CommandLine, AGeneratedProgramThatLeavesTheTravelLeavesNoFile) {
  const fs::path out = folder_ / "out";
  const Ran ran =
      run("run " + (source_folder / "scenes/gantry_dome.toml").string() +
          " --set part.at_mm=[400,0,0] --set part.vertices=500 --set program.step_mm=5 --out " +
          out.string());
  EXPECT_EQ(ran.code, 3) << ran.text;
  EXPECT_HAS(ran.text, "program.ngc:");
  EXPECT_EQ(files_in(out), 0);
}

TEST_F(CommandLine, AVariantIsMeasuredAgainstItsOwnErrorFreeMap) {
  const fs::path scene = write(
      "variants.toml",
      "title = \"v\"\nmachine = \"" +
          (source_folder / "scenes/machines/gantry_cxyza.toml").string() + "\"\nerrors = \"" +
          (source_folder / "scenes/errors/gantry_typical.toml").string() + "\"\ntool = \"" +
          (source_folder / "scenes/tools/ball_r5.toml").string() +
          "\"\n[part]\nsurface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nat_mm = [0, 0, "
          "80]\n"
          "turn_deg = [30, 0, 0]\nvertices = 400\n[program]\ngenerator = \"raster\"\nstep_over_mm "
          "= 0.5\n"
          "step_mm = 0.5\nlead_deg = 5\npattern = \"one_way\"\n[compare]\ncases = "
          "[\"perfect-iterated-ideal\"]\n"
          "[[variant]]\nname = \"coarse\"\nset = { \"program.step_over_mm\" = 1.0, "
          "\"part.vertices\" = 200 }\n");
  const fs::path out = folder_ / "out";
  const Ran ran = run("compare " + scene.string() + " --out " + out.string());
  ASSERT_EQ(ran.code, 0) << ran.text;
  const auto json = nlohmann::json::parse(bytes(out / "comparison.json"));
  ASSERT_EQ(json["cases"].size(), 5u);
  EXPECT_EQ(json["cases"][3]["name"], "coarse");
  EXPECT_EQ(json["cases"][4]["name"], "coarse-perfect-iterated-ideal");
  EXPECT_LT(json["cases"][4]["machine_um"]["rms"].get<double>(), 1e-3);
  EXPECT_TRUE(fs::exists(out / "coarse" / "program.ngc"));
  // a finished case names itself, so that its scene cuts it again
  const fs::path again = folder_ / "again";
  ASSERT_EQ(run("run " + (out / "coarse-perfect-iterated-ideal" / "scene.toml").string() +
                " --out " + again.string())
                .code,
            0);
  const auto first =
      nlohmann::json::parse(bytes(out / "coarse-perfect-iterated-ideal" / "summary.json"));
  const auto second = nlohmann::json::parse(bytes(again / "summary.json"));
  EXPECT_EQ(first["residual_um"].dump(), second["residual_um"].dump());
}

TEST_F(CommandLine, PoseGivesTheDeviationInTheWorkpiece) {
  const std::string scene = (source_folder / "scenes/gantry_perfect.toml").string();
  const Ran ran =
      run("pose " + scene + " --set errors.EX0C_um=16 --at \"X=10 Y=20 Z=100 A=0 C=90\" --json");
  ASSERT_EQ(ran.code, 0) << ran.text;
  const auto pose = nlohmann::json::parse(ran.text);
  // the table stands 16 um towards +x of the bed; turned by C = 90 degrees that is -y of the
  // workpiece
  EXPECT_NEAR(pose["deviation_mm"][0].get<double>(), 0.0, 1e-12);
  EXPECT_NEAR(pose["deviation_mm"][1].get<double>(), -0.016, 1e-12);
  EXPECT_EQ(run("pose " + scene + " --at \"Q=1\"").code, 3);
  EXPECT_EQ(run("pose " + scene + " --at \"X=1 X=2\"").code, 3);
  EXPECT_EQ(run("pose " + scene + " --at \"X=abc\"").code, 3);
  EXPECT_EQ(run("pose " + scene + " --at \"Z=99999\"").code, 3);
}

TEST_F(CommandLine, CheckPrintsTheLowOrderBodyArrayAndWritesNothing) {
  const fs::path here = fs::current_path();
  fs::current_path(folder_);
  const Ran ran =
      run("check " + (source_folder / "scenes/gantry_tilted_flat.toml").string() + " --json");
  const int left = files_in(folder_);
  fs::current_path(here);
  ASSERT_EQ(ran.code, 0) << ran.text;
  const auto check = nlohmann::json::parse(ran.text);
  EXPECT_EQ(check["structural_code"], "w C' b X Y Z A s t");
  EXPECT_EQ(check["low_order_body_array"].dump(), "[0,1,0,3,4,5,6,7]");
  EXPECT_EQ(left, 0);
}

/// What is left of both streams without the lines "[2/3] write" of the one.
std::string without_progress(const std::string& text) {
  static const std::regex progress(R"(\[\d+/\d+\] [^\n]*\n)");
  return std::regex_replace(text, progress, "");
}

TEST_F(CommandLine, MeasureIdentifyAndEvaluateWorkOnEachOthersFiles) {
  const std::string scene = (source_folder / "scenes/gantry_dome.toml").string();
  const fs::path readings = folder_ / "readings";
  const Ran measured = run("measure " + scene + " --instrument laser --instrument ball_bar --out " +
                           readings.string() + " --json");
  ASSERT_EQ(measured.code, 0) << measured.text;
  const auto list = nlohmann::json::parse(without_progress(measured.text));
  ASSERT_EQ(list.size(), 2u);
  EXPECT_GT(list[0]["hours"].get<double>(), 0.5);
  const std::string laser = (readings / "laser.csv").string();
  EXPECT_TRUE(fs::exists(laser));

  const fs::path belief = folder_ / "belief.toml";
  const Ran identified = run("identify " + laser + " --out " + belief.string());
  ASSERT_EQ(identified.code, 0) << identified.text;
  EXPECT_HAS(identified.text, "unobservable");
  EXPECT_TRUE(fs::exists(belief));
  EXPECT_TRUE(fs::exists(folder_ / "belief.json"));
  const Ran pose =
      run("pose " + scene + " --set 'errors=\"" + belief.string() + "\"' --at \"X=10\"");
  EXPECT_EQ(pose.code, 0) << "a belief is an errors file: " << pose.text;

  const fs::path report = folder_ / "report";
  const Ran evaluated =
      run("evaluate " + (readings / "ball_bar.csv").string() + " --out " + report.string());
  ASSERT_EQ(evaluated.code, 0) << evaluated.text;
  EXPECT_HAS(evaluated.text, "ISO 230-4");
  EXPECT_TRUE(fs::exists(report / "evaluation.json"));
}

TEST_F(CommandLine, BrokenReadingsAndInstrumentsAreInputFaults) {
  const std::string dome = (source_folder / "scenes/gantry_dome.toml").string();
  const std::string out = " --out " + (folder_ / "out").string();
  const std::string broken =
      write("broken.csv", "target_mm,direction,run,deviation_um\n0,up,1,x\n");
  const Ran evaluated = run("evaluate " + broken + out);
  EXPECT_EQ(evaluated.code, 3) << evaluated.text;
  EXPECT_HAS(evaluated.text, "broken.csv:2:8");
  EXPECT_EQ(run("evaluate " + (folder_ / "absent.csv").string() + out).code, 3);
  EXPECT_EQ(run("identify " + broken + " --out " + (folder_ / "b.toml").string()).code, 3);
  EXPECT_FALSE(fs::exists(folder_ / "b.toml"));
  const Ran unknown = run("measure " + dome + " --instrument lasre" + out);
  EXPECT_EQ(unknown.code, 3);
  EXPECT_HAS(unknown.text, "ball_bar");
  const Ran none = run("measure " + dome + out);
  EXPECT_EQ(none.code, 3) << none.text;
  EXPECT_EQ(run("identify").code, 2);
  EXPECT_EQ(run("identify " + broken + " --basis wavelets").code, 2);
  EXPECT_EQ(run("identify " + broken + " --order 99").code, 2);
  EXPECT_EQ(run("evaluate").code, 2);

  const fs::path scene =
      write("three.toml",
            "title = \"t\"\nmachine = \"" +
                (source_folder / "scenes/machines/three_axis_table.toml").string() +
                "\"\ntool = \"" + (source_folder / "scenes/tools/ball_r5.toml").string() +
                "\"\n[part]\nsurface = \"disc\"\nradius_mm = 5\n[program]\ngenerator = \"raster\"\n"
                "[[instrument]]\nkind = \"r_test\"\n");
  const Ran cannot = run("measure " + scene.string() + out);
  EXPECT_EQ(cannot.code, 3) << cannot.text;
  EXPECT_HAS(cannot.text, "three.toml:10:");
  EXPECT_EQ(files_in(folder_ / "out"), 0) << "a refusal leaves no files";
}

/// A program that can be run.
fs::path executable(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
  fs::permissions(file, fs::perms::owner_all);
  return file;
}

TEST_F(CommandLine, APlugInIsComparedUnderItsFileName) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string(),
                                     "[errors]\nEXX_um = 5\nEZS_um = 3\n[compare]\ncases = "
                                     "[\"perfect-iterated-ideal\"]\n");
  const fs::path mirror = source_folder / "scenes/compensators/mirror.py";
  const fs::path out = folder_ / "out";
  const Ran ran = run("compare " + scene.string() + " --compensator " + mirror.string() +
                      " --out " + out.string() + " --json");
  ASSERT_EQ(ran.code, 0) << ran.text;
  const auto json = nlohmann::json::parse(bytes(out / "comparison.json"));
  ASSERT_EQ(json["cases"].size(), 4u);
  EXPECT_EQ(json["cases"][2]["name"], "perfect-iterated-ideal");
  EXPECT_EQ(json["cases"][3]["name"], "mirror.py");
  EXPECT_TRUE(json["cases"][3].contains("reduction_percent"));
  EXPECT_TRUE(!json.contains("failed") || json["failed"].empty()) << json.dump();
  EXPECT_TRUE(fs::exists(out / "mirror.py" / "summary.json"));
  EXPECT_NE(bytes(out / "mirror.py" / "summary.json"), bytes(out / "uncompensated/summary.json"));

  // `run` cuts the same, and so does the scene that it leaves
  const fs::path one = folder_ / "one", again = folder_ / "again";
  ASSERT_EQ(
      run("run " + scene.string() + " --compensator " + mirror.string() + " --out " + one.string())
          .code,
      0);
  const fs::path finished = out / "mirror.py" / "scene.toml";
  const Ran rerun = run("run " + finished.string() + " --trust --out " + again.string());
  ASSERT_EQ(rerun.code, 0) << rerun.text;
  for (const fs::path& other : {one, again}) {
    const auto first = nlohmann::json::parse(bytes(out / "mirror.py" / "summary.json"));
    const auto second = nlohmann::json::parse(bytes(other / "summary.json"));
    EXPECT_EQ(first["residual_um"].dump(), second["residual_um"].dump()) << other;
    if (ABBE_RENDER) {
      EXPECT_EQ(bytes(out / "mirror.py" / "residual.vtp"), bytes(other / "residual.vtp")) << other;
    }
  }
}

TEST_F(CommandLine, APlugInThatFailsIsNamedEndsWithSixAndLeavesTheOthersUnharmed) {
  const std::string sections =
      "[errors]\nEXX_um = 5\n[compare]\ncases = "
      "[\"perfect-iterated-ideal\"]\n";
  const fs::path scene = plane_scene(write("p.ngc", good_program).string(), sections);
  const fs::path dies = executable(folder_ / "dies.sh", "#!/bin/sh\nexit 3\n");
  const fs::path babbles = executable(folder_ / "babbles.sh", "#!/bin/sh\necho hello\ncat\n");
  const fs::path absent = folder_ / "absent.py";
  const fs::path good = source_folder / "scenes/compensators/mirror.py";
  const fs::path out = folder_ / "out", alone = folder_ / "alone";
  const Ran ran = run("compare " + scene.string() + " --compensator " + dies.string() +
                      " --compensator " + babbles.string() + " --compensator " + good.string() +
                      " --compensator " + absent.string() + " --out " + out.string());
  EXPECT_EQ(ran.code, 6) << ran.text;
  const auto json = nlohmann::json::parse(bytes(out / "comparison.json"));
  ASSERT_EQ(json["failed"].size(), 3u) << json["failed"].dump();
  EXPECT_EQ(json["failed"][0]["name"], "dies.sh");
  EXPECT_EQ(json["failed"][1]["name"], "babbles.sh");
  EXPECT_EQ(json["failed"][2]["name"], "absent.py");
  for (const auto& one : json["failed"]) {
    const std::string name = one["name"];
    EXPECT_FALSE(one["reason"].get<std::string>().empty()) << one.dump();
    EXPECT_HAS(ran.text, name);
    EXPECT_FALSE(fs::exists(out / name / "summary.json"));
  }
  ASSERT_EQ(json["cases"].size(), 4u);
  EXPECT_EQ(json["cases"][3]["name"], "mirror.py");
  // the same cases, bit for bit, as without those that fail
  ASSERT_EQ(run("compare " + scene.string() + " --compensator " + good.string() + " --out " +
                alone.string())
                .code,
            0);
  const auto plain = nlohmann::json::parse(bytes(alone / "comparison.json"));
  EXPECT_EQ(json["cases"].dump(), plain["cases"].dump());

  const fs::path none = folder_ / "none";
  const Ran single =
      run("run " + scene.string() + " --compensator " + dies.string() + " --out " + none.string());
  EXPECT_EQ(single.code, 6) << single.text;
  EXPECT_HAS(single.text, "dies.sh");
  EXPECT_FALSE(fs::exists(none / "summary.json"));
}

TEST_F(CommandLine, CompensatorsThatShareANameOrHaveNoneAreUsageOrInputFaults) {
  const fs::path scene = plane_scene(write("p.ngc", good_program).string());
  const std::string out = " --out " + (folder_ / "out").string();
  fs::create_directories(folder_ / "a");
  const fs::path one = executable(folder_ / "mine.sh", "#!/bin/sh\nexit 3\n");
  const fs::path other = executable(folder_ / "a" / "mine.sh", "#!/bin/sh\nexit 3\n");
  const Ran twice = run("compare " + scene.string() + " --compensator " + one.string() +
                        " --compensator " + other.string() + out);
  EXPECT_TRUE(twice.code == 2 || twice.code == 3) << twice.code << ": " << twice.text;
  const Ran taken =
      run("compare " + scene.string() + " --compensator " +
          executable(folder_ / "uncompensated", "#!/bin/sh\nexit 3\n").string() + out);
  EXPECT_TRUE(taken.code == 2 || taken.code == 3) << taken.code << ": " << taken.text;
  EXPECT_EQ(run("compare " + scene.string() + " --compensator /" + out).code, 2);
  EXPECT_EQ(run("run " + scene.string() + " --case perfect-iterated-ideal --compensator " +
                one.string() + out)
                .code,
            2);
  EXPECT_EQ(files_in(folder_ / "out"), 0);
}

TEST_F(CommandLine, ExportedTablesAreReadBackAsTheChannelOfTheSameFormat) {
  const std::string errors =
      "[belief.identified]\nEXX = [{ kind = \"polynomial\", centre_mm = 0, half_range_mm = 300, "
      "coefficients_um = [0, 20, 15] }]\nEYX = [{ kind = \"polynomial\", centre_mm = 0, "
      "half_range_mm = 300, "
      "coefficients_um = [0, 0, 30] }]\n";
  const fs::path scene = plane_scene(write("p.ngc", good_program).string(), errors);
  for (const std::string format : {"linuxcnc", "isg", "siemens", "heidenhain"}) {
    SCOPED_TRACE(format);
    const fs::path tables = folder_ / format, out = folder_ / (format + "_cut");
    const Ran ran = run("export " + scene.string() + " --format " + format + " --out " +
                        tables.string() + " --json");
    ASSERT_EQ(ran.code, 0) << ran.text;
    EXPECT_TRUE(nlohmann::json::accept(without_progress(ran.text))) << ran.text;
    ASSERT_GT(files_in(tables), 0);
    for (const auto& entry : fs::directory_iterator(tables))
      EXPECT_GT(fs::file_size(entry.path()), 0u) << entry.path();
    // a second export has the same bytes
    const fs::path second = folder_ / (format + "_again");
    ASSERT_EQ(
        run("export " + scene.string() + " --format " + format + " --out " + second.string()).code,
        0);
    for (const auto& entry : fs::directory_iterator(tables))
      if (entry.path().filename() != ".abbe-result") {
        EXPECT_EQ(bytes(entry.path()), bytes(second / entry.path().filename())) << entry.path();
      }
    const Ran cut =
        run("run " + scene.string() + " --case identified-position-table --set " +
            "compensation.table.format='\"" + format + "\"' --out '" + out.string() + "'");
    EXPECT_EQ(cut.code, 0) << cut.text;
    const auto summary = nlohmann::json::parse(bytes(out / "summary.json"));
    EXPECT_GT(summary["tip_error_um"]["max"].get<double>(), 0.0) << "the belief is wrong here";
  }
  EXPECT_EQ(run("export " + scene.string() + " --format fanuc").code, 2);
  EXPECT_EQ(run("export " + scene.string() + " --case perfect-twice-ideal").code, 2);
}

}  // namespace
}  // namespace abbe::sim
