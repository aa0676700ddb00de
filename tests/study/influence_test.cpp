#include "sim/study/influence.h"
#include <tbb/global_control.h>
#include "cutting/map/residual.h"
#include "tests/sim/refusal.h"
#include "tests/study/small_studies.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

/// Machines of a Monte-Carlo analysis, none of which was cut to find the doubt.
MatrixXd some_machines(const Study& study, std::uint64_t count) {
  const Plan plan = make_plan(study);
  for (const Block& block : plan.blocks)
    if (block.kind == Block::Kind::MonteCarlo)
      return case_inputs(study, plan, block.first, block.first + count);
  return {};
}

/// Influence maps against the same machines cut; percent, of the worst machine.
struct Agreement {
  double map = 0.0;     ///< RMS of the difference, of the RMS of the map
  double pv = 0.0;      ///< of the PV
  double rms = 0.0;     ///< of the RMS
  double failed = 0.0;  ///< area where they differ by more than the flag, mean over the machines
  double unseen = 0.0;  ///< the same that is not flagged
};

Agreement agreement(const Study& study, const PreparedConfiguration& ready, const InfluenceMap& map,
                    const MatrixXd& x) {
  const MatrixXd estimated = maps(map, x), figures = responses(study, ready, map, x);
  const double area = map.design.area.sum();
  Agreement all;
  Job job = ready.job;
  for (Index i = 0; i < x.cols(); ++i) {
    CutCase tried = cut_at(study, ready, std::move(job), x.col(i));
    job = std::move(tried.job);
    double off = 0.0, size = 0.0;
    for (Index v = 0; v < estimated.rows(); ++v) {
      const bool cut = tried.surface.status[std::size_t(v)] == cutting::VertexStatus::Cut;
      const bool cut_there = map.status[std::size_t(v)] == cutting::VertexStatus::Cut;
      const double a = map.design.area[v];
      const double by = cut && cut_there ? estimated(v, i) - tried.surface.residual[v] : 0.0;
      off += a * by * by;
      size += cut ? a * std::pow(tried.surface.residual[v] - map.error_free[v], 2) : 0.0;
      if (cut == cut_there && std::abs(by) <= study.influence.flag_threshold) continue;
      all.failed += 100 * a / area / double(x.cols());
      if (!(map.max_error[v] > study.influence.flag_threshold))
        all.unseen += 100 * a / area / double(x.cols());
    }
    const auto percent = [](double estimate, double truth) {
      return 100 * std::abs(estimate / truth - 1.0);
    };
    EXPECT_GT(size, 0.0) << "nothing to compare in machine " << i;
    all.map = worst_of(all.map, 100 * std::sqrt(off / size));
    all.pv = worst_of(all.pv, percent(figures(0, i), tried.responses[0]));
    all.rms = worst_of(all.rms, percent(figures(1, i), tried.responses[1]));
  }
  EXPECT_GT(x.cols(), 0);
  EXPECT_TRUE(is_finite(map));
  EXPECT_TRUE(std::isfinite(all.map + all.pv + all.rms)) << "a map is no number where it is cut";
  return all;
}

Agreement told_agreement(const std::string& name, const MadeStudy& made, std::uint64_t machines) {
  const Agreement a =
      agreement(made.study, made.ready, made.map, some_machines(made.study, machines));
  std::cout << fmt::format(
      "{}: {} inputs, {} machines: PV {:.3f} %, RMS {:.3f} %, maps {:.3f} % of RMS; flagged {:.2f} "
      "% of the area, failed {:.2f} %, unseen {:.2f} %\n",
      name, made.study.inputs.size(), machines, a.pv, a.rms, a.map, made.map.flagged_percent,
      a.failed, a.unseen);
  return a;
}

void expect_agreement(const Agreement& agreement, double map, double pv) {
  EXPECT_LT(agreement.map, map);
  EXPECT_LT(agreement.pv, pv);
  EXPECT_LT(agreement.rms, map);
}

// Parts are small, so a map has fewer vertices on which its extremes could be, and passes far
// apart, so what the second order leaves out is larger than on the scenes at full size.

TEST(Influence, RandomDomesAreTheirFullRuns) {
  const MadeStudy made({ball_dome(), every("element"), "", 4});
  expect_agreement(told_agreement("dome", made, 20), 1.0, 1.5);
}

TEST(Influence, RandomDomesOfEveryNumberAreTheirFullRuns) {
  const MadeStudy made({ball_dome(), every("number"), "", 4});
  expect_agreement(told_agreement("dome", made, 20), 1.0, 1.5);
}

TEST(Influence, RandomFlatsUnderABullNoseAreTheirFullRuns) {
  const MadeStudy made({bull_flat(), every("element"), "", 4});
  expect_agreement(told_agreement("flat", made, 20), 1.0, 1.5);
}

TEST(Influence, RandomConesOfAFlankAreTheirFullRuns) {
  const MadeStudy made({flank_cone(), every("element"), "", 4});
  expect_agreement(told_agreement("cone", made, 20), 1.0, 1.5);
}

std::string every_of_the_platform() {
  return every("element") + by_path("setup.EY_um", 0, 2) +
         by_path("tool.actual.radius_mm", 0.2495, 0.0005) +
         by_path("tool.actual.centring_height_mm", 0, 0.002);
}

/// A displacement D along the cut is left out, slope D^2 / 2r: 50 nm of 25 um at r = 0.5 mm.
TEST(Influence, RandomTurnedConesAreTheirFullRunsOutsideTheirCentres) {
  const MadeStudy made(
      {turned_cone(), every_of_the_platform(), "set = { part.judged_radius_min_mm = 0.5 }", 4});
  expect_agreement(told_agreement("turned", made, 20), 1.0, 3.0);
}

TEST(Influence, AboutTheSpindleLineTurnedConesAreFlagged) {
  const MadeStudy made({turned_cone(), every_of_the_platform(), "", 8});
  const Agreement a = told_agreement("turned, with its centre", made, 20);
  EXPECT_LT(a.map, 1.0);
  EXPECT_GT(a.failed, 0.1);
  EXPECT_GT(made.map.flagged_percent, a.failed);
  // a machine that is wilder than all that were checked fails where they did not
  EXPECT_LT(a.unseen, 0.5 * a.failed);
}

TEST(Influence, RandomMachinesWithHeatClampingToolAndControlAreTheirFullRuns) {
  const std::string top = fmt::format(
      "thermal = \"{}\"\nhistory = [{{ duration_min = 30, speed_rpm = 12000, axis_speed_mm_per_min "
      "= {{ X = 8000, Y = 8000, Z = 3000 }} }}]\n",
      file_of("errors/gantry_heat.toml"));
  const MadeStudy made(
      {ball_dome("[setup]\nEX_um = 0\n[control]\ntool_length_mm = 100\n[datum]\nkind = "
                 "\"touch_off\"\ntouch = [{ point_mm = [40, 25, 80], direction = [0, 0, -1] }]\n",
                 top),
       by_path("thermal.scale", 1, 0.2) + by_path("errors.scale", 1, 0.2) +
           by_path("setup.EX_um", 0, 5) + by_path("setup.EA_urad", 0, 30) +
           by_path("tool.actual.radius_mm", 5, 0.002) +
           by_path("control.tool_length_mm", 100, 0.005) + by_element("EYX"),
       "", 4});
  expect_agreement(told_agreement("hot dome", made, 12), 1.0, 1.5);
}

TEST(Influence, CompensatedArmsAreTheirFullRuns) {
  const std::string belief =
      fmt::format("[belief]\nidentified = \"{}\"\n", file_of("beliefs/gantry.toml"));
  const MadeStudy identified(
      {ball_dome(belief), every("element"), "cases = [\"identified-iterated-ideal\"]", 4});
  EXPECT_FALSE(identified.ready.needs_commands_per_case);
  expect_agreement(told_agreement("identified", identified, 20), 1.0, 1.5);
  const MadeStudy believed(
      {ball_dome(belief), by_path("belief.scale", 1, 0.1) + by_element("EYX") + by_element("EC0Y"),
       "cases = [\"identified-iterated-ideal\"]", 4});
  EXPECT_TRUE(believed.ready.needs_commands_per_case);
  expect_agreement(told_agreement("believed", believed, 12), 1.0, 1.5);
}

/// The belief follows every machine: its elements leave nothing. The tool's radius it does not
/// know.
TEST(Influence, OfAPerfectBeliefNothingIsLeftButWhatItDoesNotKnow) {
  const MadeStudy made({ball_dome("[setup]\nEX_um = 0\n"),
                        by_element("EYX") + by_element("EC0Y") + by_element("EZS") +
                            by_path("tool.actual.radius_mm", 5, 0.005),
                        "cases = [\"perfect-iterated-ideal\"]", 4});
  const VectorXd spread = spreads(made.study);
  ASSERT_TRUE(is_finite(made.map));
  for (Index i = 0; i < 4; ++i) {
    const double most = spread[i] * made.map.slope.row(i).cwiseAbs().maxCoeff();
    std::cout << fmt::format("{}: {:.3e} um a spread\n", made.study.inputs[std::size_t(i)].name,
                             most * 1e3);
    if (i < 3)
      EXPECT_LT(most, 1e-7);  // mm: steps of the iteration end at 0.01 nm
    else
      EXPECT_GT(most, 5e-4);
  }
  expect_agreement(told_agreement("perfect", made, 12), 1.0, 1.5);
}

TEST(Influence, OfTheMachinesPartIsLessTheErrorFreeMap) {
  const MadeStudy whole({ball_dome(), every("element")});
  const MadeStudy part({ball_dome(), every("element"), "of = \"machine\"", 4});
  const MatrixXd x = some_machines(part.study, 5);
  const MatrixXd a = maps(whole.map, x), b = maps(part.map, x);
  ASSERT_TRUE(a.allFinite() && b.allFinite());
  EXPECT_EQ((a - b).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_GT(part.map.error_free.cwiseAbs().maxCoeff(), 1e-3);
  const cutting::Surface error_free = cut_error_free(part.ready.job).surface;
  ASSERT_TRUE(part.map.error_free.allFinite() && error_free.residual.allFinite());
  EXPECT_EQ((part.map.error_free - error_free.residual).cwiseAbs().maxCoeff(), 0.0);
  // what is left of 4 um cusps leaves the machine's part, so what fails is more of it
  expect_agreement(told_agreement("machine's part", part, 12), 1.0, 2.0);
}

TEST(Influence, AtTheCentreIsTheBaseRun) {
  for (const std::string& scene : {ball_dome(), bull_flat(), flank_cone(), turned_cone()}) {
    const MadeStudy made({scene, every("element")});
    const MatrixXd map = maps(made.map, centre(made.study));
    const cutting::Surface surface =
        cut_at(made.study, made.ready, made.ready.job, centre(made.study)).surface;
    double most = 0.0;
    Index compared = 0;
    for (Index v = 0; v < map.rows(); ++v) {
      const Index first = made.map.first[std::size_t(v)];
      const bool cut = made.map.first[std::size_t(v) + 1] > first;
      ASSERT_EQ(cut, surface.status[std::size_t(v)] == cutting::VertexStatus::Cut);
      ASSERT_EQ(cut, made.map.status[std::size_t(v)] == cutting::VertexStatus::Cut);
      ASSERT_EQ(cut, std::isfinite(map(v, 0)));
      if (!cut) continue;
      ASSERT_EQ(map(v, 0), made.map.distance[first]);
      most = worst_of(most, std::abs(map(v, 0) - surface.residual[v]));
      ++compared;
    }
    std::cout << fmt::format("at the centre {:.2e} um off, {} vertices\n", most * 1e3, compared);
    EXPECT_GT(compared, 300);
    EXPECT_LT(most, 1e-7);  // mm, as rivals promise
  }
}

bool same_bits(const MatrixXd& a, const MatrixXd& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         ((a.array() == b.array()) || (a.array().isNaN() && b.array().isNaN())).all();
}

TEST(Influence, BitsOfACaseDoNotDependOnItsPlaceItsNeighboursOrThreads) {
  const MadeStudy made({ball_dome(), every("number"), "responses = [\"pv\", \"rms\", \"std\"]"});
  const MatrixXd x = some_machines(made.study, 64);
  const MatrixXd map = maps(made.map, x);
  const MatrixXd figures = responses(made.study, made.ready, made.map, x);
  ASSERT_TRUE(is_finite(made.map) && map.allFinite() && figures.allFinite());
  const MatrixXd back = x.rowwise().reverse();
  EXPECT_TRUE(same_bits(maps(made.map, back), map.rowwise().reverse()));
  EXPECT_TRUE(
      same_bits(responses(made.study, made.ready, made.map, back), figures.rowwise().reverse()));
  for (const auto& [from, count] : {std::pair<Index, Index>{0, 1}, {5, 1}, {63, 1}, {3, 47}}) {
    const MatrixXd some = x.middleCols(from, count);
    EXPECT_TRUE(same_bits(maps(made.map, some), map.middleCols(from, count)));
    EXPECT_TRUE(same_bits(responses(made.study, made.ready, made.map, some),
                          figures.middleCols(from, count)));
  }
  const MatrixXd many = x.replicate(1, 3);
  EXPECT_TRUE(same_bits(maps(made.map, many).middleCols(64, 64), map));
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const InfluenceMap again = influence_map(made.study, made.ready);
  EXPECT_TRUE(same_bits(again.slope, made.map.slope));
  EXPECT_TRUE(same_bits(again.shift, made.map.shift));
  EXPECT_TRUE(same_bits(maps(again, x), map));
}

TEST(Influence, FormAndTextureOfRandomDomesAreThoseOfTheirFullRuns) {
  double worst = 0.0;
  for (const char* of : {"residual", "machine"}) {
    const MadeStudy made(
        {ball_dome("", ""), by_element("EYX") + by_element("EZX") + by_element("EAX"),
         fmt::format("of = \"{}\"\nset = {{ part.vertices = 3000, part.form_cutoff_mm = 2.5 }}\n"
                     "responses = [\"form_pv\", \"form_rms\", \"texture_sa\", \"texture_sq\", "
                     "\"texture_sz\", \"pv\"]",
                     of)});
    const MatrixXd x = some_machines(made.study, 4);
    const MatrixXd figures = responses(made.study, made.ready, made.map, x);
    Job job = made.ready.job;
    for (Index i = 0; i < x.cols(); ++i) {
      CutCase tried = cut_at(made.study, made.ready, std::move(job), x.col(i));
      job = std::move(tried.job);
      ASSERT_TRUE(figures.col(i).allFinite() && tried.responses.allFinite()) << of;
      for (Index k = 0; k < tried.responses.size(); ++k) {
        const double off = std::abs(figures(k, i) / tried.responses[k] - 1.0);
        worst = worst_of(worst, off);
        EXPECT_LT(off, 0.03) << of << ", response " << k << " of machine " << i;
      }
      // of PV both: neither is more than the whole, by the rims where a plane is fitted
      EXPECT_LT(tried.responses[0], 1.2 * tried.responses[5]);
      EXPECT_LE(tried.responses[2], tried.responses[3]);
      EXPECT_LE(tried.responses[3], tried.responses[4]);
    }
  }
  std::cout << "form and texture by influence maps " << 100.0 * worst << " % off at most\n";
}

TEST(Influence, TextureThatVerticesDoNotResolveIsSaid) {
  const auto warned = [](const char* response) {
    const MadeStudy made(
        {ball_dome("", ""), by_element("EYX"), fmt::format("responses = [\"{}\"]", response)});
    for (const std::string& warning : made.ready.job.warnings)
      if (warning.find("texture figures are not resolved") != std::string::npos) return true;
    return false;
  };
  EXPECT_TRUE(warned("texture_sq"));
  EXPECT_TRUE(warned("form_pv"));
  EXPECT_FALSE(warned("pv"));
}

TEST(Influence, ResponsesAreTheStatisticsOfTheMaps) {
  double worst = 0.0;
  int compared = 0;
  for (const char* alignment : {"none", "offset", "rigid"})
    for (const char* of : {"residual", "machine"})
      for (const char* asked : {"\"pv\", \"rms\", \"mean\", \"std\", \"max_abs\"",
                                "\"pv\", \"rms\", \"mean\", \"std\", \"max_abs\", \"p95_abs\", "
                                "\"in_tolerance\", \"form_pv\", \"texture_sq\""}) {
        // 1 mm off: figures that do not see it keep their digits
        const MadeStudy made(
            {ball_dome("[setup]\nEZ_um = 1000\n", fmt::format("alignment = \"{}\"\n", alignment)),
             by_element("EYX") + by_element("EXX") + by_element("EAX") +
                 by_path("setup.EZ_um", 1000, 2),
             fmt::format("of = \"{}\"\nresponses = [{}]", of, asked)});
        const MatrixXd x = some_machines(made.study, 3), all = maps(made.map, x);
        const MatrixXd figures = responses(made.study, made.ready, made.map, x);
        for (Index i = 0; i < x.cols(); ++i) {
          const Index n = all.rows();
          const cutting::Surface surface{all.col(i), VectorXd::Zero(n),
                                         std::vector<int>(std::size_t(n), 0), made.map.status};
          const VectorXd expected =
              responses(made.study, made.ready.job, surface, made.ready.error_free);
          ASSERT_TRUE(expected.allFinite());
          for (Index k = 0; k < expected.size(); ++k) {
            const double off = std::abs(figures(k, i) - expected[k]);
            ASSERT_LT(off, 1e-12 * std::max(1.0, std::abs(expected[k])));
            // an offset or a rigid motion leaves a mean of nothing but rounding
            if (std::abs(expected[k]) <= 1e-12) continue;
            worst = worst_of(worst, off / std::abs(expected[k]));
            ++compared;
          }
        }
      }
  std::cout << compared << " responses differ from statistics by " << worst << " at most\n";
  EXPECT_GT(compared, 230);  // of 252
  EXPECT_LT(worst, 1e-12);
}

bool is_flagged(const MadeStudy& made, Index v) {
  return made.map.max_error[v] > made.study.influence.flag_threshold;
}

/// A core that some machines leave and others do not: the rivals of the base run cannot know that.
TEST(Influence, WhereOnlySomeMachinesCutIsFlaggedAndCounted) {
  const MadeStudy made({turned_cone(), by_path("tool.actual.centring_offset_mm", 0, 0.02),
                        "set = { program.end_radius_mm = 0.38 }", 16});
  const InfluenceMap& map = made.map;
  double flagged = 0.0;
  int endless = 0;
  for (Index v = 0; v < map.max_error.size(); ++v) {
    if (is_flagged(made, v)) flagged += map.design.area[v];
    if (std::isinf(map.max_error[v])) ++endless;
  }
  EXPECT_NEAR(map.flagged_percent, 100 * flagged / map.design.area.sum(), 1e-12);
  const Agreement a = told_agreement("core", made, 12);
  std::cout << fmt::format("{} vertices are cut in some machines only\n", endless);
  EXPECT_GT(endless, 0);
  EXPECT_LT(endless, 20);
  EXPECT_GT(a.failed, 0.0);
  EXPECT_LT(a.unseen, 0.2 * a.failed);
}

/// Shifts as large as ten times the reach: rivals that come from afar are not known.
TEST(Influence, ShiftsBeyondTheReachAreFlagged) {
  const MadeStudy made({ball_dome("[setup]\nEX_um = 0\n"), by_path("setup.EX_um", 0, 500), "", 8});
  const Agreement a = told_agreement("shifted dome", made, 12);
  EXPECT_GT(made.map.flagged_percent, 50.0);
  EXPECT_GT(a.failed, 1.0);
  EXPECT_LT(a.unseen, 0.2 * a.failed);
}

/// Where an axis turns back on the part the two ways meet.
TEST(Influence, BacklashOfAZigzagIsFollowedButWhereItIsFlagged) {
  const std::string backlash =
      "[EXX]\nkind = \"backlash\"\nhalf_um = 3\n"
      "[EYY]\nkind = \"backlash\"\nhalf_um = 3\n"
      "[EZZ]\nkind = \"backlash\"\nhalf_um = 3\n";
  const SceneFolder folder;
  const MadeStudy made({ball_dome(), by_element("EXX") + by_element("EYY") + by_element("EZZ"),
                        fmt::format("set = {{ program.pattern = \"zigzag\", errors = \"{}\" }}",
                                    folder.write("backlash.toml", backlash).string()),
                        8});
  const Agreement a = told_agreement("backlash", made, 12);
  EXPECT_LT(a.map, 1.0);
  EXPECT_LT(a.unseen, 0.5);
}

TEST(Influence, AWilderSpindleThanThatOfTheBaseRunCanBeCut) {
  const MadeStudy made({turned_cone(), by_element("EXS", 0.5) + by_element("EBS", 0.5)});
  VectorXd x = centre(made.study);
  for (const double factor : {-1.9, 0.0, 1.0, 4.0}) {
    x.setConstant(factor);
    const CutCase tried = cut_at(made.study, made.ready, made.ready.job, x);
    EXPECT_GT(tried.responses[0], 0.0) << factor;
  }
}

/// The passes of a hollow cutter are those of its parts, of which an influence map knows nothing.
TEST(Influence, AHollowCutterIsRefused) {
  const BallRaster dome{.part =
                            "surface = \"sphere_cap\"\nradius_mm = 20\nrim_radius_mm = 4\n"
                            "at_mm = [40, 25, 80]\nvertices = 100\n",
                        .step_over = 2.0,
                        .step = 2.0};
  const std::string common = to_toml(dome), line = common.substr(common.find("tool = "));
  const SceneFolder folder;
  folder.write("tool.toml",
               "kind = \"profile\"\nlength_mm = 100\nradii_mm = [2, 2, 5, 5]\n"
               "heights_mm = [0, 1, 1, 10]\n");
  folder.write("scene.toml", with(common, line.substr(0, line.find('\n')), "tool = \"tool.toml\""));
  const Study study = read_study(folder.write("study.toml", "scene = \"scene.toml\"\n" +
                                                                by_path("setup.EA_urad", 0.0, 1.0) +
                                                                "[monte_carlo]\ncases = 64\n"));
  const PreparedConfiguration ready = prepare_configuration(study, study.configurations.front());
  const std::string said = refusal_by([&] { influence_map(study, ready); });
  EXPECT_HAS(said, "a convex tool for influence maps");
  EXPECT_HAS(said, "tool.kind = \"profile\"");
}

/// The dome of the README, 200 machines of it, as the promise is stated. Minutes: only if asked.
TEST(Influence, TwoHundredRandomGantryDomesAreTheirFullRuns) {
  if (!std::getenv("ABBE_LONG")) GTEST_SKIP() << "set ABBE_LONG to run it";
  for (const char* what : {"element", "number"}) {
    const SceneFolder folder;
    const Study study = read_study(folder.write(
        "study.toml",
        fmt::format("scene = \"{}\"\nset = {{ part.vertices = 10000 }}\n{}\n[monte_carlo]\n"
                    "cases = 200\n[influence]\nchecks = 4\n",
                    file_of("gantry_dome.toml"), every(what))));
    const PreparedConfiguration ready = prepare_configuration(study, study.configurations.front());
    const InfluenceMap map = influence_map(study, ready);
    const Agreement a = agreement(study, ready, map, some_machines(study, 200));
    std::cout << fmt::format(
        "every {}: {} inputs, {} vertices, {} samples: PV {:.3f} %, RMS {:.3f} %, maps {:.3f} % of "
        "RMS; flagged {:.2f} % of the area, failed {:.2f} %, unseen {:.2f} %\n",
        what, study.inputs.size(), map.design.vertices.rows(), ready.job.samples.states.size(),
        a.pv, a.rms, a.map, map.flagged_percent, a.failed, a.unseen);
    EXPECT_LT(a.pv, 0.5);
    EXPECT_LT(a.rms, 0.5);
    EXPECT_LT(a.map, 1.0);
    EXPECT_LT(map.flagged_percent, 2.0);
  }
}

cutting::Surface cut(const MadeStudy& made, const VectorXd& x) {
  return cut_at(made.study, made.ready, made.ready.job, x).surface;
}

bool both_cut(const cutting::Surface& a, const cutting::Surface& b, Index v) {
  return a.status[std::size_t(v)] == cutting::VertexStatus::Cut &&
         b.status[std::size_t(v)] == cutting::VertexStatus::Cut;
}

/// Whether the pass that makes the surface in the base run still does after a step of an input.
bool stays_first(const InfluenceMap& map, Index input, Index v, double step) {
  const Index first = map.first[std::size_t(v)], last = map.first[std::size_t(v) + 1];
  for (Index r = first + 1; r < last; ++r)
    if (map.distance[r] - map.distance[first] <
        1e-6 + 2.0 * std::abs(step * (map.slope(input, r) - map.slope(input, first))))
      return false;
  return last > first;
}

/// How far a column is from the central difference of full runs.
struct Miss {
  double size = 0.0;      ///< mm per spread, largest entry of the column
  double worst = 0.0;     ///< mm per spread
  double rms = 0.0;       ///< mm per spread
  double compared = 0.0;  ///< share of the vertices at which one pass stays the first
};

Miss miss_of(const MadeStudy& made, Index input) {
  const double spread = spreads(made.study)[input], step = 0.2 * spread;
  VectorXd low = centre(made.study), high = low;
  low[input] -= step;
  high[input] += step;
  const cutting::Surface a = cut(made, low), b = cut(made, high);
  const Index n = made.map.design.vertices.rows();
  Miss miss;
  double count = 0.0, square = 0.0;
  for (Index v = 0; v < n; ++v) {
    if (!both_cut(a, b, v) || !stays_first(made.map, input, v, step)) continue;
    const double slope = spread * made.map.slope(input, made.map.first[std::size_t(v)]);
    const double off = slope - spread * (b.residual[v] - a.residual[v]) / (2 * step);
    miss.size = worst_of(miss.size, std::abs(slope));
    miss.worst = worst_of(miss.worst, std::abs(off));
    square += off * off;
    ++count;
  }
  miss.compared = count / double(n);
  miss.rms = std::sqrt(square / count);
  return miss;
}

/// What columns may miss, mm per spread: rms and worst, beside so much of their size.
struct Allowed {
  double rms = 0.0;
  double worst = 0.0;
  double relative = 2e-3;
};

void expect_columns(const MadeStudy& made, const Allowed& allowed) {
  ASSERT_TRUE(is_finite(made.map));
  for (Index i = 0; i < Index(made.study.inputs.size()); ++i) {
    const std::string& name = made.study.inputs[std::size_t(i)].name;
    const Miss miss = miss_of(made, i);
    std::cout << fmt::format(
        "{:40} {:8.4f} um a spread, off by {:.5f} um RMS, {:.5f} at most; {:.1f} % compared\n",
        name, miss.size * 1e3, miss.rms * 1e3, miss.worst * 1e3, 100 * miss.compared);
    EXPECT_GT(miss.size, 1e-6) << name << " does nothing";
    EXPECT_GT(miss.compared, 0.8) << name;
    EXPECT_LT(miss.rms, allowed.rms + allowed.relative * miss.size) << name;
    EXPECT_LT(miss.worst, allowed.worst + 5 * allowed.relative * miss.size) << name;
  }
}

// Moves of 0.5 mm on a radius of 100 mm turn by 5 mrad at each sample: there a difference sees half
// of that of the displacement along the feed, 13 nm of 5 um, and at few vertices. Where the path is
// straight or the tool turns the part, only rounding and the second order of angles is left.
constexpr Allowed on_dome{.rms = 2e-6, .worst = 1.3e-5};
constexpr Allowed off_dome{.rms = 1e-7, .worst = 1e-6};

TEST(InfluenceColumns, OfElementsAndNumbersUnderABallAreDifferencesOfFullRuns) {
  expect_columns(
      MadeStudy({ball_dome(), by_number("EXX scale and guide[1]", -5.43, 1.0) + by_element("EYX") +
                                  by_element("EAX") + by_element("ECC") + by_element("EBS") +
                                  by_element("EC0Y") + by_element("EX0C") + by_element("EA0C") +
                                  by_path("errors.scale", 1, 0.2) +
                                  by_path("errors.EZX.coefficients_um.2", -2.47, 2.0)}),
      on_dome);
}

TEST(InfluenceColumns, OfClampingAndToolUnderABallAreDifferencesOfFullRuns) {
  expect_columns(
      MadeStudy({ball_dome("[setup]\nEX_um = 3\nEA_urad = 20\n"),
                 by_path("setup.EX_um", 3, 5) + by_path("setup.EA_urad", 20, 30) +
                     by_path("setup.EC_urad", 0, 30) + by_path("tool.actual.radius_mm", 5, 0.005) +
                     by_path("tool.actual.length_mm", 100, 0.005)}),
      on_dome);
}

TEST(InfluenceColumns, FollowTheControlAndTheDatumThatItTouchesOff) {
  expect_columns(
      MadeStudy({ball_dome("[control]\ntool_length_mm = 100\n[control.axis.C]\n"
                           "point_mm = [0, 0, 0]\n[datum]\nkind = \"touch_off\"\n"
                           "touch = [{ point_mm = [40, 25, 80], direction = [0, 0, -1] }]\n"),
                 by_element("EYX") + by_element("EC0Y") + by_element("EZS") +
                     by_path("control.tool_length_mm", 100, 0.005) +
                     by_path("control.axis.C.point_mm.0", 0, 0.005) +
                     by_path("tool.actual.length_mm", 100, 0.005) +
                     by_path("datum.touch.0.point_mm.2", 80, 0.5)}),
      on_dome);
}

TEST(InfluenceColumns, UnderABullNoseAreDifferencesOfFullRuns) {
  // a larger cutter moves the contact across the joints of the coarse moves
  const Allowed allowed{.rms = 5e-7, .worst = 1e-5};
  expect_columns(
      MadeStudy({bull_flat(), by_element("EYX") + by_element("EBY") + by_element("EA0Z") +
                                  by_path("tool.actual.radius_mm", 6, 0.005) +
                                  by_path("tool.actual.corner_radius_mm", 1, 0.005)}),
      allowed);
}

TEST(InfluenceColumns, OfAFlankAreDifferencesOfFullRuns) {
  expect_columns(MadeStudy({flank_cone(), by_element("EYX") + by_element("EBY") +
                                              by_element("EB0C") + by_path("setup.EB_urad", 0, 30) +
                                              by_path("tool.actual.radius_mm", 8, 0.005)}),
                 off_dome);
}

TEST(InfluenceColumns, OfATurnedPartAreDifferencesOfFullRuns) {
  expect_columns(
      MadeStudy({turned_cone("[setup]\nEX_um = 3\nEY_um = 2\nEB_urad = 20\n"),
                 by_element("EXX") + by_element("EBX") + by_element("EB0Z") + by_element("EXS") +
                     by_element("EBS") + by_path("setup.EX_um", 3, 3) +
                     by_path("setup.EY_um", 2, 3) + by_path("setup.EB_urad", 20, 30) +
                     by_path("tool.actual.centring_offset_mm", 0, 0.003) +
                     by_path("tool.actual.radius_mm", 0.2495, 0.0005) +
                     by_path("tool.actual.wave.0.amplitude_um", 0.2, 0.05) +
                     by_path("tool.actual.wave.0.phase_deg", 40, 3)}),
      {.rms = 3e-7, .worst = 2e-6});
}

/// Without errors of its own the spindle turns by a quarter of a turn between samples. What the
/// slides do stands still meanwhile, a clamping that is off turns with the part.
TEST(InfluenceColumns, OfAClampingTurnWithThePartBetweenSamples) {
  expect_columns(
      MadeStudy({turned_cone("[setup]\nEX_um = 0\nEY_um = 0\nEZ_um = 0\nEB_urad = 0\n"),
                 by_element("EXX") + by_element("EB0Z") + by_path("setup.EX_um", 0, 3) +
                     by_path("setup.EY_um", 0, 3) + by_path("setup.EZ_um", 0, 3) +
                     by_path("setup.EB_urad", 0, 30),
                 fmt::format("set = {{ errors = \"{}\" }}", file_of("errors/platform_peng.toml"))}),
      {.rms = 3e-7, .worst = 2e-6});
}

TEST(InfluenceColumns, OfHeatAreDifferencesOfFullRuns) {
  const std::string warm = fmt::format(
      "thermal = \"{}\"\nhistory = [{{ duration_min = 30, speed_rpm = 12000, axis_speed_mm_per_min "
      "= {{ X = 8000, Y = 8000, Z = 3000 }} }}]\n",
      file_of("errors/gantry_heat.toml"));
  expect_columns(MadeStudy({ball_dome("", warm),
                            by_path("thermal.scale", 1, 0.2) +
                                by_path("thermal.element.0.offset.1.um_per_K", -1.3, 0.3) +
                                by_path("history.0.speed_rpm", 12000, 500) + by_element("EXX")}),
                 on_dome);
}

std::string soft_dome(const std::string& compliance, const std::string& more = {}) {
  const std::string material =
      fmt::format("material = \"{}\"\n", file_of("materials/al6082_t6_carbide.toml"));
  return ball_dome(more + "[compliance]\n" + compliance +
                       "[compliance.axis.X]\nstiffness_N_per_um = [20, 20, 20]\n"
                       "turning_stiffness_Nm_per_urad = [1, 1, 1]\n"
                       "[[compliance.mass]]\naxis = \"Z\"\nmass_kg = 110\n"
                       "centre_mm = [0, -60, 260]\n",
                   more.empty() ? "" : material);
}

TEST(InfluenceColumns, UnderWeightAndInertiaAreDifferencesOfFullRuns) {
  expect_columns(MadeStudy({soft_dome("gravity = [0, 0, -1]\ninertia = true\n"),
                            by_path("compliance.scale", 1, 0.2) +
                                by_path("compliance.mass.0.mass_kg", 110, 10) + by_element("EXX")}),
                 on_dome);
}

/// The force follows the depth: of a push into the part the machine gives way to some.
TEST(InfluenceColumns, UnderCuttingForceFollowTheForceThatComplianceItselfChanges) {
  expect_columns(
      MadeStudy({soft_dome("",
                           "[cutting]\nblank = \"offset\"\nallowance_mm = 0.3\nfloor_mm = -5\n"
                           "spacing_mm = 0.25\nflutes = 2\n"),
                 by_path("compliance.scale", 1, 0.2) + by_element("EZS") + by_element("EYX") +
                     by_path("setup.EZ_um", 0, 5)}),
      on_dome);
}

/// Two tools that cut one blank, each a half of a flat and a strip in the middle where they
/// compete.
SmallStudy two_tools(const std::string& inputs, const std::string& top = {},
                     const std::string& more = {}) {
  std::string program = "G21 G90 G17 G94\nG54\n";
  const auto add_passes = [&](int tool, double from, double to, double z) {
    program += fmt::format("T{0} M6\nS9000 M3\nG43 H{0}\n", tool);
    for (double y = from; y <= to + 1e-9; y += 0.5)
      program += fmt::format("G0 X-9 Y{0}\nG0 Z5\nG1 Z{1} F500\nG1 X9 F1000\nG0 Z60\n", y, z);
  };
  add_passes(1, -7, 0.25, 0.0);
  add_passes(2, -0.25, 7, -0.004);
  return {
      fmt::format(
          "machine = \"{0}\"\n{1}"
          "[errors]\nEXX_um = 4\nEZX = {{ kind = \"polynomial\", coefficients_um = [3, 20], "
          "half_range_mm = 100 }}\nEBX_urad = 150\nEAY_urad = -120\n"
          "[[tool]]\nname = \"ball\"\nkind = \"ball\"\nradius_mm = 5\n"
          "flank_length_mm = 25\nlength_mm = 100\nnumber = 1\n"
          "[[tool]]\nname = \"bull\"\nkind = \"bull\"\nradius_mm = 4\ncorner_radius_mm = 1\n"
          "flank_length_mm = 20\nlength_mm = 80\nnumber = 2\n"
          "compliance = {{ stiffness_N_per_um = [10, 10, 100] }}\n"
          "[part]\nsurface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\n"
          "vertices = 400\n[program]\nfile = \"p.ngc\"\nwork_offset.G54 = {{ Z_mm = -100 }}\n{2}",
          file_of("machines/three_axis_table.toml"), top, more),
      inputs, "", 0, program + "M30\n"};
}

TEST(InfluenceColumns, OfSeveralToolsAreDifferencesOfFullRuns) {
  const MadeStudy made(two_tools(by_element("EZX") + by_element("EAY") +
                                 by_path("tool.1.actual.length_mm", 80, 0.005) +
                                 by_path("tool.0.actual.length_mm", 100, 0.005)));
  expect_columns(made, off_dome);
  // The length of a tool acts on its own passes alone.
  const Eigen::ArrayXd bull = effects(made.map).row(2), ball = effects(made.map).row(3);
  EXPECT_GT((bull.abs() > 0.9).count(), 50);
  EXPECT_GT((ball.abs() > 0.9).count(), 50);
  EXPECT_EQ(((bull.abs() > 0.9) != (ball.abs() > 0.9)).count(), bull.size());
  EXPECT_LT(bull.abs().min(ball.abs()).maxCoeff(), 1e-9);
}

TEST(InfluenceColumns, OfSeveralToolsFollowTheForceOfEach) {
  const std::string material =
      fmt::format("material = \"{}\"\n", file_of("materials/al6082_t6_carbide.toml"));
  const std::string blank =
      "[cutting]\nblank = \"box\"\nlower_mm = [-5, -5, -5]\nupper_mm = [5, 5, 0.5]\n"
      "spacing_mm = 0.25\nflutes = 2\n";
  const std::string stiffness = by_path("tool.1.compliance.stiffness_N_per_um.2", 100, 10);
  expect_columns(MadeStudy(two_tools(
                     by_path("compliance.scale", 1, 0.2) + by_element("EZX") + stiffness, material,
                     blank + "[compliance.axis.X]\nstiffness_N_per_um = [60, 60, 60]\n")),
                 on_dome);
  // Only the second tool gives way.
  expect_columns(MadeStudy(two_tools(stiffness + by_element("EZX"), material, blank)), on_dome);
}

TEST(InfluenceColumns, LieBetweenValuesThatTheirInputsMayHave) {
  const MadeStudy made(
      {ball_dome(), by_element("EYX", 0.5, "low = 0.9\nhigh = 3") +
                        by_number("EXX scale and guide[1]", -5.43, 1.0, "low = -5.6") +
                        by_path("tool.actual.radius_mm", 5, 0.0005,
                                "distribution = \"log_normal\"\nlow = 4.998") +
                        by_path("tool.actual.length_mm", 100, 0.005,
                                "distribution = \"uniform\"\nlow = 99.996") +
                        by_path("setup.EA_urad", 0, 30, "low = -5\nhigh = 90")});
  for (Index i = 0; i < Index(made.study.inputs.size()); ++i) {
    const Distribution& d = made.study.inputs[std::size_t(i)].distribution;
    const auto [low, high] = difference_points(made.study, i);
    EXPECT_LT(d.low, low);
    EXPECT_LT(low, high);
    EXPECT_LT(high, d.high);
  }
  expect_columns(made, on_dome);
}

Index named(const Study& study, const std::string& name) {
  const auto found = std::find_if(study.inputs.begin(), study.inputs.end(),
                                  [&](const Input& input) { return input.name == name; });
  return found - study.inputs.begin();
}

/// An input of the control makes every machine's commands its own, so that all columns are
/// differences of poses; without it those of elements come from the Jacobian.
TEST(InfluenceColumns, ByTheJacobianAndByDifferencesOfPosesAgree) {
  const std::string inputs = every("element") + by_path("setup.EX_um", 0, 5);
  const auto differ = [&](const std::string& scene, const std::string& control) {
    const MadeStudy by_jacobian({scene, inputs}), by_poses({scene, inputs + control});
    const Index p = Index(by_jacobian.study.inputs.size());
    double worst = 0.0;
    Index compared = 0;
    EXPECT_TRUE(is_finite(by_jacobian.map) && is_finite(by_poses.map));
    for (Index i = 0; i < p; ++i) {
      const Index k = named(by_poses.study, by_jacobian.study.inputs[std::size_t(i)].name);
      const auto a = by_jacobian.map.slope.row(i), b = by_poses.map.slope.row(k);
      const auto c = by_jacobian.map.shift.row(i), d = by_poses.map.shift.row(k);
      const double size = std::max(a.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff());
      if (size < 1e-6) continue;
      worst = std::max(
          {worst, (a - b).cwiseAbs().maxCoeff() / size, (c - d).cwiseAbs().maxCoeff() / size});
      ++compared;
    }
    std::cout << fmt::format("{} of {} columns differ by at most {:.2e} of their size\n", compared,
                             p, worst);
    EXPECT_GT(2 * compared, p);
    return worst;
  };
  // the Jacobian is that of the machine without errors: their angles, 0.2 mrad in sum on the
  // gantry, turn every column by as much
  const std::string length = by_path("control.tool_length_mm", 100, 0.005);
  const std::string control = "[control]\ntool_length_mm = 100\n";
  EXPECT_LT(differ(ball_dome(control), length), 5e-4);
  EXPECT_LT(differ(bull_flat() + control, length), 5e-4);
  const std::string of_platform = "[control]\ntool_length_mm = 60\n";
  EXPECT_LT(differ(turned_cone(of_platform), by_path("control.tool_length_mm", 60, 0.005)), 1e-5);
}

}  // namespace
}  // namespace abbe::sim::study
