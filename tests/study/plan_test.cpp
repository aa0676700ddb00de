#include "sim/study/case_plan.h"
#include "sim/study/study_text.h"
#include "tests/study/flat_machine.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

using BlockKind = Block::Kind;

/// Three inputs and every analysis.
Study whole_study() {
  Study study = study_of({{Distribution::Kind::Normal, 2.0, 0.5},
                          {Distribution::Kind::Uniform, -1.0, 3.0},
                          {Distribution::Kind::LogNormal, 4.0, 0.25}});
  study.engine = Engine::Both;
  study.verification_cases = 3;
  study.one_at_a_time = OneAtATime{1.0};
  study.monte_carlo = MonteCarlo{100, Sampling::Sobol};
  study.sobol = SobolAnalysis{8};
  study.sweeps = {{1, Vector3d(-2.0, 0.0, 7.0)}, {0, Vector2d(5.0, 6.0)}};
  return study;
}

MatrixXd all_inputs(const Study& study, const Plan& plan) {
  return case_inputs(study, plan, 0, plan.cases);
}

const Block& block(const Plan& plan, BlockKind kind, int sweep = 0) {
  for (const Block& one : plan.blocks)
    if (one.kind == kind && one.sweep == sweep) return one;
  ADD_FAILURE() << "no block " << name_of(kind);
  return plan.blocks.front();
}

// ---------------------------------------------------------------- the order

TEST(Plan, HasTheAnalysesInTheirOrderWithoutGaps) {
  const Plan plan = make_plan(whole_study());
  const std::vector<BlockKind> kinds{BlockKind::Base,  BlockKind::OneAtATime, BlockKind::MonteCarlo,
                                     BlockKind::Sobol, BlockKind::Sweep,      BlockKind::Sweep,
                                     BlockKind::Proof};
  const std::vector<std::uint64_t> counts{1, 6, 100, 8 * 5, 3, 2, 3};
  ASSERT_EQ(plan.blocks.size(), kinds.size());
  std::uint64_t first = 0;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    SCOPED_TRACE(name_of(kinds[i]));
    EXPECT_EQ(plan.blocks[i].kind, kinds[i]);
    EXPECT_EQ(plan.blocks[i].first, first);
    EXPECT_EQ(plan.blocks[i].count, counts[i]);
    EXPECT_EQ(plan.blocks[i].full, kinds[i] == BlockKind::Proof);
    EXPECT_EQ(&find_block(plan, first), &plan.blocks[i]);
    EXPECT_EQ(&find_block(plan, first + counts[i] - 1), &plan.blocks[i]);
    first += counts[i];
  }
  EXPECT_EQ(plan.cases, first);
}

TEST(Plan, OfTheFullEngineCutsAllAndProvesNothing) {
  Study study = whole_study();
  study.engine = Engine::Full;
  const Plan plan = make_plan(study);
  EXPECT_EQ(plan.blocks.size(), 6u);
  for (const Block& one : plan.blocks) EXPECT_TRUE(one.full) << name_of(one.kind);
  study.engine = Engine::Influence;
  for (const Block& one : make_plan(study).blocks) EXPECT_FALSE(one.full) << name_of(one.kind);
}

TEST(Plan, WithoutInputsIsEmptyAndWithoutQuestionsTheBaseAlone) {
  EXPECT_EQ(make_plan(study_of({})).cases, 0u);
  EXPECT_TRUE(make_batches(make_plan(study_of({}))).empty());
  EXPECT_EQ(make_plan(study_of(normals(3))).cases, 1u);
}

TEST(Plan, ProvesNoMoreCasesThanMonteCarloHas) {
  Study study = whole_study();
  study.verification_cases = 1'000'000;
  EXPECT_EQ(block(make_plan(study), BlockKind::Proof).count, 100u);
}

// ---------------------------------------------------------------- the points

TEST(PlanInputs, OfBaseAndOneAtATimeAreThoseByHand) {
  const Study study = whole_study();
  const Plan plan = make_plan(study);
  const MatrixXd x = all_inputs(study, plan);
  const Vector3d centre(2.0, -1.0, 4.0);
  EXPECT_EQ(x.col(0), centre);
  // standard deviations: of the normal its own, of the uniform half width / sqrt 3, of the
  // log-normal median exp(s^2 / 2) sqrt(exp(s^2) - 1)
  const double s2 = 0.25 * 0.25;
  const Vector3d sd(0.5, std::sqrt(3.0), 4.0 * std::exp(s2 / 2) * std::sqrt(std::expm1(s2)));
  double worst = 0.0;
  for (Index i = 0; i < 3; ++i)
    for (const int side : {0, 1}) {
      Vector3d expected = centre;
      expected[i] += (side == 0 ? -1.0 : 1.0) * sd[i];
      worst = std::max(worst, (x.col(1 + 2 * i + side) - expected).cwiseAbs().maxCoeff());
    }
  std::cout << "one at a time differs from hand by " << worst << "\n";
  EXPECT_LT(worst, 1e-9);
}

TEST(PlanInputs, OneAtATimeStayWithinTheirDistributions) {
  Study study = study_of({{Distribution::Kind::Normal, 0.0, 1.0, -0.5, 2.0},
                          {Distribution::Kind::Uniform, 10.0, 1.0},
                          {Distribution::Kind::Triangular, 10.0, 1.0},
                          {Distribution::Kind::LogNormal, 1.0, 2.0}});
  study.one_at_a_time = OneAtATime{50.0};
  const Plan plan = make_plan(study);
  const MatrixXd x = all_inputs(study, plan);
  EXPECT_EQ(x(0, 1), -0.5);
  EXPECT_EQ(x(0, 2), 2.0);
  for (const Index i : {1, 2}) {
    EXPECT_NEAR(x(i, 1 + 2 * i), 9.0, 1e-12);
    EXPECT_NEAR(x(i, 2 + 2 * i), 11.0, 1e-12);
  }
  EXPECT_GE(x(3, 7), 0.0) << "a log-normal number is never negative";
}

TEST(PlanInputs, OfMonteCarloAreTheSequenceThroughTheDistributions) {
  for (const Sampling sampling : {Sampling::Sobol, Sampling::Random}) {
    Study study = whole_study();
    study.monte_carlo->sampling = sampling;
    const Plan plan = make_plan(study);
    const Block& mc = block(plan, BlockKind::MonteCarlo);
    const MatrixXd x = case_inputs(study, plan, mc.first, mc.first + mc.count);
    const MatrixXd u = points({sampling, 3, study.seed}, 0, 100);
    for (Index k = 0; k < u.cols(); ++k)
      for (Index i = 0; i < 3; ++i)
        ASSERT_EQ(x(i, k), quantile(study.inputs[std::size_t(i)].distribution, u(i, k)));
  }
}

TEST(PlanInputs, OfProofsAreTheFirstOfMonteCarlo) {
  const Study study = whole_study();
  const Plan plan = make_plan(study);
  const Block &mc = block(plan, BlockKind::MonteCarlo), &proof = block(plan, BlockKind::Proof);
  EXPECT_EQ(case_inputs(study, plan, proof.first, proof.first + proof.count),
            case_inputs(study, plan, mc.first, mc.first + proof.count));
}

TEST(PlanInputs, OfSobolAreAAndBAndAWithOneColumnOfB) {
  const Study study = whole_study();
  const Plan plan = make_plan(study);
  const Block& sobol = block(plan, BlockKind::Sobol);
  const MatrixXd x = case_inputs(study, plan, sobol.first, sobol.first + sobol.count);
  for (Index point = 0; point < 8; ++point) {
    const Vector3d a = x.col(5 * point), b = x.col(5 * point + 1);
    for (Index i = 0; i < 3; ++i) {
      EXPECT_NE(a[i], b[i]);
      Vector3d mixed = a;
      mixed[i] = b[i];
      EXPECT_EQ(x.col(5 * point + 2 + i), mixed) << point << " " << i;
    }
  }
  const Block& mc = block(plan, BlockKind::MonteCarlo);
  EXPECT_NE(x.col(0), case_inputs(study, plan, mc.first, mc.first + 1).col(0))
      << "a stream of their own";
}

TEST(PlanInputs, OfSweepsMoveOneInputAlone) {
  const Study study = whole_study();
  const Plan plan = make_plan(study);
  const Block& first = block(plan, BlockKind::Sweep, 0);
  const MatrixXd x = case_inputs(study, plan, first.first, first.first + 5);
  MatrixXd expected(3, 5);
  expected << 2, 2, 2, 5, 6,  //
      -2, 0, 7, -1, -1,       //
      4, 4, 4, 4, 4;
  EXPECT_EQ(x, expected);
}

TEST(PlanInputs, DependOnTheSeedAndOnNoOtherAnalysis) {
  const Study study = whole_study();
  const Plan plan = make_plan(study);
  const auto of = [](const Study& one, BlockKind kind, std::uint64_t count) {
    const Plan its = make_plan(one);
    const std::uint64_t first = block(its, kind).first;
    return case_inputs(one, its, first, first + count);
  };
  Study other = study;
  other.seed = study.seed + 1;
  EXPECT_NE(of(other, BlockKind::MonteCarlo, 5), of(study, BlockKind::MonteCarlo, 5));
  EXPECT_NE(of(other, BlockKind::Sobol, 5), of(study, BlockKind::Sobol, 5));
  EXPECT_EQ(of(other, BlockKind::OneAtATime, 5), of(study, BlockKind::OneAtATime, 5));
  Study longer = study;
  longer.monte_carlo->cases = 1000;
  longer.sobol->base_points = 64;
  EXPECT_EQ(of(longer, BlockKind::MonteCarlo, 100), of(study, BlockKind::MonteCarlo, 100))
      << "more cases add to those that were there";
  EXPECT_EQ(of(longer, BlockKind::Sobol, 40), of(study, BlockKind::Sobol, 40));
}

TEST(PlanInputs, FollowTheCorrelations) {
  Study study = study_of(normals(2), {}, {{0, 1, 1.0}});
  study.monte_carlo = MonteCarlo{50, Sampling::Random};
  const Plan plan = make_plan(study);
  const MatrixXd x = case_inputs(study, plan, 1, 51);
  EXPECT_LT((x.row(0) - x.row(1)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_GT(x.row(0).cwiseAbs().maxCoeff(), 1.0);
}

TEST(PlanInputs, AreTheSameBitsInWhateverStretchesTheyAreAskedFor) {
  SeededRandom random(12);
  const Study study = whole_study();
  const Plan plan = make_plan(study);
  const MatrixXd whole = all_inputs(study, plan);
  for (int trial = 0; trial < 200; ++trial) {
    const std::uint64_t first = random() % plan.cases;
    const std::uint64_t last = first + 1 + random() % (plan.cases - first);
    ASSERT_EQ(case_inputs(study, plan, first, last),
              whole.middleCols(Index(first), Index(last - first)))
        << first << " to " << last;
  }
}

// ---------------------------------------------------------------- batches

TEST(PlanBatches, CoverEveryCaseOnceAndNeverTwoBlocks) {
  for (const Engine engine : {Engine::Influence, Engine::Full, Engine::Both})
    for (const std::uint64_t cases : {2u, 71u, 72u, 73u, 1000u}) {
      Study study = whole_study();
      study.engine = engine;
      study.monte_carlo->cases = cases;
      const Plan plan = make_plan(study);
      std::uint64_t next = 0;
      for (const Batch& batch : make_batches(plan)) {
        ASSERT_EQ(batch.first, next) << "in their order";
        ASSERT_LT(batch.first, batch.last);
        const Block& of = find_block(plan, batch.first);
        ASSERT_EQ(&find_block(plan, batch.last - 1), &of);
        ASSERT_LE(batch.last - batch.first, of.full ? 1u : 72u);
        next = batch.last;
      }
      EXPECT_EQ(next, plan.cases);
    }
}

TEST(PlanBatches, OfALargeStudyTakeNoTimeToFind) {
  Study study = study_of(normals(10));
  study.engine = Engine::Full;
  study.monte_carlo = MonteCarlo{1'000'000, Sampling::Sobol};
  const Plan plan = make_plan(study);
  EXPECT_EQ(make_batches(plan).size(), 1'000'001u);
  EXPECT_TRUE(case_inputs(study, plan, 999'990, 1'000'001).allFinite());
}

TEST(TextStyle, ColumnsCountWhatATerminalShows) {
  EXPECT_EQ(terminal_width("PV, µm"), 6u);
  EXPECT_EQ(terminal_width("误差"), 4u);
  EXPECT_EQ(terminal_width("e\u0301"), 1u);
  EXPECT_EQ(terminal_width("Πι"), 2u);
  EXPECT_EQ(terminal_width(""), 0u);
  EXPECT_EQ(terminal_width("\xff\xc3"), terminal_width("\xff\xc3")) << "what is no UTF-8 ends";
}

TEST(TextStyle, ATableOfATerminalStandsInColumns) {
  const TextTable rows{{"input", "empty", "share"}, {{"误差 EXX", "", "41 %"}, {"x", "", "8.2 %"}}};
  EXPECT_EQ(table(TextStyle::Terminal, rows),
            "input     share\n"
            "--------  -----\n"
            "误差 EXX   41 %\n"
            "x         8.2 %\n\n");
  EXPECT_EQ(table(TextStyle::Markdown, rows),
            "| input | share |\n|---|---:|\n| 误差 EXX | 41 % |\n| x | 8.2 % |\n\n");
}

TEST(TextStyle, MarkUpIsForFiles) {
  EXPECT_EQ(user_text(TextStyle::Markdown, "a|b*"), "a\\|b\\*");
  EXPECT_EQ(user_text(TextStyle::Terminal, "a|b*"), "a|b*");
  EXPECT_EQ(bold_text(TextStyle::Terminal, "a"), "a");
  EXPECT_EQ(heading(TextStyle::Terminal, 1, "dome"), "dome\n====\n\n");
  EXPECT_EQ(heading(TextStyle::Markdown, 2, "dome"), "## dome\n\n");
  EXPECT_EQ(warning_paragraph(TextStyle::Terminal, "take care"), "warning: take care\n\n");
}

}  // namespace
}  // namespace abbe::sim::study
