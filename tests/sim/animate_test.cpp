// `abbe animate`: which moments a film shows, what stands where in its frames, and what is left on
// the disk.

#include "sim/cut/bodies.h"
#include "sim/cut/cut.h"
#include "sim/report/program_film.h"
#include "sim/report/result_files.h"
#include "tests/safety/program_run.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif
#if ABBE_RENDER
#include "sim/report/program_film.h"
#endif

namespace abbe::sim {
namespace {

using safety::Ran;

// --- which moments

program::Path film_blocks() {
  program::Path path;
  for (const int line : {3, 4, 7}) {
    program::Block block;
    block.line = line;
    block.start_s = path.blocks.empty() ? 0.0 : path.blocks.back().end_s;
    block.end_s = block.start_s + line;
    path.blocks.push_back(block);
  }
  return path;
}

TEST(FilmPlan, FramesAreSpreadEvenlyFromTheBeginningToTheEnd) {
  const FilmPlan plan = film_plan({2.0, 14.0}, 0.5, 10.0);
  ASSERT_EQ(plan.time_s.size(), 5u);
  const std::vector<double> by_hand{2.0, 5.0, 8.0, 11.0, 14.0};
  for (std::size_t k = 0; k < by_hand.size(); ++k) EXPECT_EQ(plan.time_s[k], by_hand[k]);
  EXPECT_DOUBLE_EQ(speed_factor(plan), 24.0);
  EXPECT_EQ(speed_text(plan), "24 × faster than real time");
}

TEST(FilmPlan, AShortFilmHasOneFrameAtTheEnd) {
  const FilmPlan plan = film_plan({1.0, 3.0}, 1e-3, 25.0);
  ASSERT_EQ(plan.time_s.size(), 1u);
  EXPECT_EQ(plan.time_s.front(), 3.0);
}

TEST(FilmPlan, TheSpeedIsSaidAsAPersonWould) {
  EXPECT_EQ(speed_text(film_plan({0.0, 10.0}, 10.0, 25.0)), "in real time");
  EXPECT_EQ(speed_text(film_plan({0.0, 2.0}, 10.0, 25.0)), "5.0 × slower than real time");
  EXPECT_EQ(speed_text(film_plan({0.0, 45.0}, 10.0, 25.0)), "4.5 × faster than real time");
  EXPECT_EQ(speed_text(film_plan({1.0, 1.0}, 10.0, 25.0)), "one instant of the program");
}

TEST(FilmPlan, AStretchRunsFromItsFirstBlockToTheEndOfItsLast) {
  program::Path path = film_blocks();
  const auto all = line_time_interval(path, std::nullopt);
  ASSERT_TRUE(all);
  EXPECT_EQ(all->begin_s, 0.0);
  EXPECT_EQ(all->end_s, 14.0);
  const auto some = line_time_interval(path, LineRange{4, 6});
  ASSERT_TRUE(some);
  EXPECT_EQ(some->begin_s, 3.0);
  EXPECT_EQ(some->end_s, 7.0);
  EXPECT_FALSE(line_time_interval(path, LineRange{5, 6}));
  EXPECT_FALSE(line_time_interval(path, LineRange{8, 100}));
  path.blocks[1].file = 1;  // of a subprogram
  EXPECT_FALSE(line_time_interval(path, LineRange{4, 4}));
}

// --- how the encoder is called

TEST(FilmEncoder, IsCalledWithEveryFrameAndNoShell) {
  const FilmEncoding encoding{"/some/where 100%", 7, 12.5};
  const auto command = encoder_command("ffmpeg", encoding, "/out/film.mp4");
  const auto at = std::ranges::find(command, "-i");
  ASSERT_NE(at, command.end());
  EXPECT_EQ(*(at + 1), "/some/where 100%%/frame_%05d.png") << "a percent sign of a folder is none";
  EXPECT_NE(std::ranges::find(command, "7"), command.end());
  EXPECT_NE(std::ranges::find(command, "libx264"), command.end());
  EXPECT_EQ(command.back(), "/out/film.mp4");
  const std::string text = shell_text(command);
  EXPECT_HAS(text, "'/some/where 100%%/frame_%05d.png'");
  EXPECT_EQ(shell_text({"it's"}), "'it'\\''s'");
}

// --- scenes

std::string film_passes() {
  std::string text =
      "%\nG21 G90 G94 G17\nG54\nG43.4 H1\nS8000 M3\nG0 X-14 Y-4 Z95 A0 C0\nG1 Z80 F3000\n";
  for (int i = 0; i < 5; ++i)
    text += fmt::format("G1 Y{} F3000\nG1 X{} A{} C{}\n", -4 + 2 * i, i % 2 == 0 ? 14 : -14, 3 * i,
                        10 * i);
  return text + "G0 Z95\nM2\n%\n";
}

const std::string film_errors =
    "[errors]\nEXX_um = 4\nEZX_um = -6\nEBX_urad = 150\nEC0Y_urad = 60\nEX0C_um = 9\n";
const std::string film_blank =
    "[cutting]\nblank = \"box\"\nlower_mm = [-10, -10, -6]\nupper_mm = [10, 10, 1]\nspacing_mm = "
    "0.8\n";

/// A plane of 16 x 12 mm on the wrong gantry.
std::string film_plane(const std::string& more) {
  const std::string scenes = packaged("").string();
  return fmt::format(
      "title = \"small plane\"\nmachine = \"{0}machines/gantry_cxyza.toml\"\ntool = "
      "\"{0}tools/ball_r5.toml\"\n[part]\nsurface = \"rectangle\"\nlength_x_mm = 16\nlength_y_mm = "
      "12\nat_mm = [0, 0, 80]\nvertices = 400\n[program]\nfile = \"p.ngc\"\n{1}",
      scenes, more);
}

#if ABBE_RENDER

Job film_job(const std::string& more) {
  const SceneFolder folder;
  folder.write("p.ngc", film_passes());
  return prepare(read_scene(folder.write("s.toml", film_plane(more))));
}

FilmPlan whole_plan(const Job& job, double frames) {
  return film_plan(*line_time_interval(job.path, std::nullopt), frames, 1.0);
}

void expect_film_pose(const kinematics::Pose& a, const kinematics::Pose& b) {
  EXPECT_LT((a.matrix() - b.matrix()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(ProgramFilm, BodiesStandWhereTheActualAxesCarryThem) {
  const Job job = film_job(film_errors);
  const Commands commands = uncompensated_commands(job);
  const Cut made = cut(job, commands);
  ProgramFilm film({job, commands, made.process, &made.surface}, whole_plan(job, 6));
  std::vector<SolidBody> moved;  // in the order of the film: of the machine, then the tool
  for (const SolidBody& body : segment_bodies(job, job))
    if (body.kind != SolidBody::Kind::Part) moved.push_back(body);
  ASSERT_EQ(film.setting().bodies.size(), moved.size());
  const Carriers carriers{job.truth.actual.size()};
  double turned = 0.0;
  for (std::size_t k = 0; k < film.frames(); ++k) {
    const render::FilmState state = film.state(k);
    const double time = whole_plan(job, 6).time_s[k];
    std::size_t i = 0;
    while (i + 1 < job.samples.states.size() && commands.samples.states[i + 1].time_s <= time) ++i;
    const kinematics::AxisState& axes = commands.samples.states[i];
    kinematics::AxisVector q = axes.q;
    if (const auto spindle = find_spindle(job.machine)) q[*spindle] = 0.0;
    const auto T = carrier_poses(job.truth.actual, q, deviations(job.truth, axes).joints);
    for (std::size_t b = 0; b < moved.size(); ++b) {
      ASSERT_TRUE(state.T_b[b]);
      expect_film_pose(*state.T_b[b], T[std::size_t(moved[b].frame)]);
    }
    expect_film_pose(state.T_bw, T[std::size_t(carriers.workpiece())]);
    turned = std::max(turned, std::abs(axes.q[0]));
  }
  EXPECT_GT(turned, 0.1) << "the table turns, or the test means little";
}

TEST(ProgramFilm, TheToolStandsAtItsErrorsMagnified) {
  const Job job = film_job(film_errors);
  const Commands commands = uncompensated_commands(job);
  const Cut made = cut(job, commands);
  const FilmSource filmed{job, commands, made.process, &made.surface};
  ProgramFilm plain(filmed, whole_plan(job, 4));
  ProgramFilm large(filmed, whole_plan(job, 4), {320, 240, 100.0});
  for (std::size_t k = 0; k < 4; ++k) {
    const render::FilmState a = plain.state(k), b = large.state(k);
    EXPECT_TRUE(a.paths.empty());
    const auto tip = [](const render::FilmState& state) -> Vector3d {
      return (state.T_bw.inverse() * *state.T_b.back()).translation();
    };
    const double error_um = std::stod(a.values.at(4));
    ASSERT_EQ(plain.setting().labels.at(4).name, "tool error");
    EXPECT_NEAR((tip(b) - tip(a)).norm(), 99.0 * error_um * 1e-3, 99.0 * 0.06e-3);
    EXPECT_GT(error_um, 1.0);
    if (k < 2) continue;
    ASSERT_EQ(b.paths.size(), 2u);
    EXPECT_EQ(b.paths[0].segments, b.paths[1].segments);
    EXPECT_GT((b.paths[0].points - b.paths[1].points).rowwise().norm().maxCoeff(), 0.1);
  }
  EXPECT_HAS(large.setting().subtitle, "errors magnified 100 ×");
}

TEST(ProgramFilm, TheDesignIsColouredAsItIsCut) {
  const Job job = film_job(film_errors);
  const Commands commands = uncompensated_commands(job);
  const Cut made = cut(job, commands);
  ProgramFilm film({job, commands, made.process, &made.surface}, whole_plan(job, 5));
  long before = -1;
  for (std::size_t k = 0; k < film.frames(); ++k) {
    const render::FilmState state = film.state(k);
    const long fresh = std::ranges::count(state.vertex_styles, 1);
    EXPECT_GE(fresh, before);
    EXPECT_TRUE(k > 0 || fresh == 0);
    before = fresh;
  }
  EXPECT_EQ(before, std::ranges::count(made.surface.status, cutting::VertexStatus::Cut));
  EXPECT_GT(before, 100);
}

/// The stock of the last frame against that of the run.
void expect_stock_of_the_run(const Job& job, double of_run, const Commands& commands,
                             const Process& process) {
  ProgramFilm film({job, commands, process}, whole_plan(job, 4));
  const double whole = film.volume();
  double before = whole;
  for (std::size_t k = 0; k < film.frames(); ++k) {
    const render::FilmState state = film.state(k);
    EXPECT_LE(film.volume(), before);
    before = film.volume();
    ASSERT_EQ(state.vertex_styles.size(), std::size_t(state.part->vertices.rows()));
  }
  std::cout << "blank " << whole << ", film " << before << ", run " << of_run << " mm^3\n";
  EXPECT_NEAR(before, of_run, 1e-9 * whole);
  EXPECT_LT(before, 0.99 * whole);
}

TEST(ProgramFilm, TheStockOfTheLastFrameIsThatOfTheRun) {
  const Job job = film_job(film_blank + film_errors);
  const Commands commands = uncompensated_commands(job);
  const Process process = cut_process(job, commands);
  expect_stock_of_the_run(job, cutting::volume(*process.stock), commands, process);
}

TEST(ProgramFilm, ATurnedStockIsThatOfTheRun) {
  const Job job = job_of("stepped_shaft.toml", {{"part.vertices", "400"}});
  const Commands commands = uncompensated_commands(job);
  const Process process = cut_process(job, commands);
  expect_stock_of_the_run(job, cutting::volume(*process.turned), commands, process);
}

TEST(ProgramFilm, AMachineWithoutBodiesIsSchematicAndSaysSo) {
  Job job = film_job(film_errors);
  job.scene.machine.bodies.clear();
  const Commands commands = uncompensated_commands(job);
  const Cut made = cut(job, commands);
  const ProgramFilm film({job, commands, made.process, &made.surface}, whole_plan(job, 2));
  EXPECT_HAS(film.setting().machine_name, "schematic");
  EXPECT_GE(film.setting().bodies.size(), std::size_t(5 + 2)) << "five axes, cutter and shank";
}

#endif

// --- on the disk

class Animate : public testing::Test {
 protected:
  Animate() {
    folder_.write("p.ngc", film_passes());
    folder_.write("plain.toml", film_plane(film_errors));
    folder_.write("stock.toml", film_plane(film_blank + film_errors));
  }
  Ran animate(const std::string& arguments, const std::string& before = "") const {
    return safety::run("animate " + arguments, "cd " + folder_.path().string() + " && " + before);
  }
  std::vector<std::string> frames(const std::string& out) const {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_.path() / out / "frames", none))
      if (entry.path().filename() != ".abbe-result") names.push_back(entry.path().filename());
    std::ranges::sort(names);
    return names;
  }
  std::string frame(const std::string& out, int number) const {
    return bytes(folder_.path() / out / "frames" / fmt::format("frame_{:05d}.png", number));
  }
  SceneFolder folder_;
};

/// Width and height that a PNG says.
std::pair<int, int> size_of_png(const std::string& png) {
  const auto number = [&](std::size_t at) {
    int value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value = value << 8 | static_cast<unsigned char>(png[at + i]);
    return value;
  };
  return png.size() > 24 ? std::pair(number(16), number(20)) : std::pair(0, 0);
}

const std::string tiny_film = " --seconds 0.4 --fps 10 --size 400x300 --film none";

TEST_F(Animate, LeavesTheFramesThatWereAskedForWithTheSameBytesEachTime) {
  if (!ABBE_RENDER) GTEST_SKIP();
  for (const std::string scene : {"plain", "stock"}) {
    const std::string line = scene + ".toml --magnify auto" + tiny_film + " --out ";
    const Ran ran = animate(line + scene);
    ASSERT_EQ(ran.code, 0) << ran.text;
    EXPECT_HAS(ran.text, "4 frames in");
    EXPECT_EQ(frames(scene).size(), 4u);
    ASSERT_EQ(animate(line + "again --threads 1").code, 0);
    for (int k = 1; k <= 4; ++k) {
      EXPECT_EQ(size_of_png(frame(scene, k)), std::pair(400, 300));
      EXPECT_TRUE(frame(scene, k) == frame("again", k)) << scene << " " << k;
    }
    EXPECT_FALSE(frame(scene, 1) == frame(scene, 4));
  }
}

TEST_F(Animate, TurningIsFilmed) {
  if (!ABBE_RENDER) GTEST_SKIP();
  const std::string shaft = packaged("stepped_shaft.toml").string();
  const Ran ran = animate(shaft + " --set part.vertices=400 --set cutting.spacing_mm=0.2" +
                          tiny_film + " --out shaft");
  ASSERT_EQ(ran.code, 0) << ran.text;
  EXPECT_EQ(frames("shaft").size(), 4u);
}

TEST_F(Animate, AShorterFilmIsNotMixedWithAnEarlierOne) {
  if (!ABBE_RENDER) GTEST_SKIP();
  ASSERT_EQ(animate("plain.toml" + tiny_film + " --out film").code, 0);
  ASSERT_EQ(frames("film").size(), 4u);
  folder_.write("film/frames/notes.txt", "of the user");
  const Ran ran =
      animate("plain.toml --seconds 0.2 --fps 10 --size 400x300 --film none --out film");
  ASSERT_EQ(ran.code, 0) << ran.text;
  EXPECT_EQ(frames("film"),
            (std::vector<std::string>{"frame_00001.png", "frame_00002.png", "notes.txt"}));
}

TEST_F(Animate, WithoutFfmpegTheFramesStayAndTheCommandIsSaid) {
  if (!ABBE_RENDER) GTEST_SKIP();
  const Ran ran = animate("plain.toml --seconds 0.2 --fps 10 --size 400x300 --out film", "PATH= ");
  EXPECT_EQ(ran.code, 0) << ran.text;
  EXPECT_EQ(frames("film").size(), 2u);
  EXPECT_FALSE(fs::exists(folder_.path() / "film/film.mp4"));
  EXPECT_HAS(ran.text, "no ffmpeg on the PATH");
  EXPECT_HAS(ran.text, "ffmpeg -hide_banner");
}

TEST_F(Animate, FfmpegMakesOneFile) {
  if (!ABBE_RENDER || !find_executable("ffmpeg")) GTEST_SKIP();
  for (const std::string format : {"mp4", "webm"}) {
    const Ran ran =
        animate("plain.toml --seconds 0.4 --fps 10 --size 400x300 --out film --film " + format);
    EXPECT_EQ(ran.code, 0) << ran.text;
    const std::string film = bytes(folder_.path() / "film" / ("film." + format));
    EXPECT_GT(film.size(), 1000u);
    EXPECT_HAS(film, format == "mp4" ? "ftyp" : "webm");
    EXPECT_HAS(ran.text, "film in");
  }
  EXPECT_FALSE(fs::exists(folder_.path() / "film/film.mp4")) << "of the film before";
}

TEST_F(Animate, AnEncoderThatFailsIsAFaultOfTheOutputAndLeavesNoFilm) {
  if (!ABBE_RENDER) GTEST_SKIP();
  const fs::path ffmpeg = folder_.write(
      "bin/ffmpeg", "#!/bin/sh\necho half > film/film.mp4.half\necho no codec >&2\nexit 1\n");
  fs::permissions(ffmpeg, fs::perms::owner_all);
  const Ran ran = animate("plain.toml --seconds 0.2 --fps 10 --size 400x300 --out film",
                          "PATH=" + (folder_.path() / "bin").string() + ":$PATH ");
  EXPECT_EQ(ran.code, 5) << ran.text;
  EXPECT_HAS(ran.text, "no codec");
  EXPECT_FALSE(fs::exists(folder_.path() / "film/film.mp4"));
  EXPECT_EQ(frames("film").size(), 2u);
}

TEST_F(Animate, OptionsThatCannotBeAreRefusedBeforeAnythingIsCut) {
  const struct {
    const char *options, *expected;
  } slips[] = {{"--fps 0", "--fps: expected 1 to 120"},
               {"--fps nan", "--fps"},
               {"--seconds 0", "--seconds: expected 0.001 to 100000 seconds"},
               {"--seconds -3", "--seconds: expected 0.001 to 100000 seconds"},
               {"--seconds 1000", "--seconds: expected at most 10000 frames"},
               {"--size 0x0", "--size: expected pixels such as 1280x720"},
               {"--size 100000x100000", "--size: expected pixels such as 1280x720"},
               {"--size 1280", "--size: expected pixels such as 1280x720"},
               {"--size 641x480", "--size: expected even numbers for mp4"},
               {"--magnify 0", "--magnify: expected a factor from 1"},
               {"--magnify much", "--magnify: expected a factor from 1"},
               {"--lines 9:", "--lines: expected first and last line"},
               {"--lines 9:3", "--lines: expected first and last line"},
               {"--case nobody-iterated-ideal", "--case"},
               {"--film gif", "--film"}};
  for (const auto& [options, expected] : slips) {
    const Ran ran = animate("plain.toml --out film " + std::string(options));
    EXPECT_EQ(ran.code, 2) << options << "\n" << ran.text;
    EXPECT_HAS(ran.text, expected) << options;
  }
  EXPECT_FALSE(fs::exists(folder_.path() / "film"));
  if (!ABBE_RENDER) return;
  const Ran outside = animate("plain.toml --out film --lines 500:600");
  EXPECT_EQ(outside.code, 2) << outside.text;
  EXPECT_HAS(outside.text, "--lines: expected lines with motion blocks");
  const Ran one = animate("plain.toml --out film --lines 500");
  EXPECT_HAS(one.text, "--lines: expected lines with motion blocks");
}

TEST_F(Animate, WithoutVtkItSaysSo) {
  if (ABBE_RENDER) GTEST_SKIP();
  const Ran ran = animate("plain.toml --out film");
  EXPECT_EQ(ran.code, 3);
  EXPECT_HAS(ran.text, "-DABBE_RENDER=ON");
}

}  // namespace
}  // namespace abbe::sim
