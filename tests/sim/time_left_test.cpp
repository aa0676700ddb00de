#include "sim/files/progress.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <random>

#include <gtest/gtest.h>

/// Simulated work on computers that are faster or slower than predicted, each kind of work by its
/// own factor, and a clock that the test turns.
namespace abbe::sim {
namespace {

/// A plan, and what its stages really take.
struct Simulated {
  std::vector<Stage> plan;
  std::vector<double> took;
  double total() const {
    double sum = 0.0;
    for (const double one : took) sum += one;
    return sum;
  }
};

using Random = std::mt19937_64;

double log_normal(Random& random, double sigma) {
  return std::exp(std::normal_distribution<double>(0.0, sigma)(random));
}

/// A comparison: a scene prepared, cases corrected and cut, files and pictures.
std::vector<Stage> comparison_of(int cases, double vertices, double samples) {
  std::vector<Stage> plan{{"prepare", "part", 3e-6 * vertices},
                          {"prepare", "program", 2e-6 * samples},
                          {"prepare", "sample", 1.5e-6 * samples},
                          {"error_free", "surface", 2.5e-5 * vertices}};
  for (int i = 0; i < cases; ++i) {
    const std::string name = "case " + std::to_string(i);
    if (i > 0) plan.push_back({name, "correct", (i % 3 + 1) * 4e-6 * samples});
    plan.push_back({name, "poses", 1e-6 * samples});
    plan.push_back({name, "surface", 2.5e-5 * vertices});
  }
  for (int i = 0; i <= cases; ++i) {
    plan.push_back({"write " + std::to_string(i), "write", 6e-6 * vertices});
    plan.push_back({"write " + std::to_string(i), "draw", 0.8 + 3e-6 * vertices});
  }
  plan.push_back({"comparison", "draw", 0.8 + 3e-6 * vertices * cases});
  return plan;
}

/// @param speed  of the computer; kinds differ from it by a fifth, single stages by a tenth
Simulated simulated(std::vector<Stage> plan, double speed, Random& random) {
  std::map<std::string, double> of_kind;
  Simulated work{std::move(plan), {}};
  for (const Stage& one : work.plan) {
    if (!of_kind.contains(one.kind)) of_kind[one.kind] = log_normal(random, 0.2);
    work.took.push_back(one.seconds * of_kind[one.kind] * log_normal(random, 0.1) / speed);
  }
  return work;
}

/// How far an estimate is off, of the time that is really left.
struct Off {
  int looks = 0;
  int beyond = 0;  ///< by more than 30 %, and more than a fiftieth of the whole
  double most = 0.0;
};

/// Runs the work and looks at the time left from its first quarter on.
template <typename Estimate>
Off looked_at(const Simulated& work, const Estimate& estimate) {
  constexpr int steps = 20;
  const double total = work.total();
  Off off;
  RemainingTime time_left(work.plan);
  double now = 0.0;
  for (std::size_t i = 0; i < work.plan.size(); ++i) {
    if (i > 0 && work.plan[i].part != work.plan[i - 1].part)
      time_left.begin(work.plan[i].part, now);
    for (int k = 0; k < steps; ++k, now += work.took[i] / steps) {
      time_left.report(work.plan[i].kind, double(k) / steps, now);
      if (now < 0.25 * total) continue;
      const double left = total - now;
      const double wrong = std::abs(estimate(time_left, now, i, double(k) / steps) - left);
      ++off.looks;
      off.beyond += wrong > 0.3 * left && wrong > 0.02 * total;
      off.most = std::max(off.most, wrong / std::max(left, 0.05 * total));
    }
  }
  return off;
}

Off add(Off a, const Off& b) {
  return {a.looks + b.looks, a.beyond + b.beyond, std::max(a.most, b.most)};
}

TEST(RemainingTime, IsWithinThirtyPercentAfterTheFirstQuarterWhereCountsOfStagesAreNot) {
  Random random(20261123);
  Off planned, counted;
  for (int i = 0; i < 300; ++i) {
    const double speed = log_normal(random, 0.8), vertices = 1e4 * (1 + i % 20);
    const Simulated work =
        simulated(comparison_of(2 + i % 5, vertices, 1e5 * (1 + i % 7)), speed, random);
    planned = add(planned, looked_at(work, [](const RemainingTime& time_left, double now, auto...) {
                    return time_left.remaining_s(now);
                  }));
    // as it was: every stage counts the same
    counted = add(counted, looked_at(work, [&](const RemainingTime&, double now, std::size_t stage,
                                               double fraction) {
                    const double done = (double(stage) + fraction) / double(work.plan.size());
                    return now * (1.0 - done) / done;
                  }));
  }
  std::cout << planned.looks << " looks: beyond 30 % " << 100.0 * planned.beyond / planned.looks
            << " %, at most " << 100.0 * planned.most << " %; by counts "
            << 100.0 * counted.beyond / counted.looks << " %\n";
  EXPECT_LT(planned.beyond, 0.02 * planned.looks);
  EXPECT_GT(counted.beyond, 0.2 * counted.looks);
}

TEST(RemainingTime, FollowsAStageThatIsFarFromItsPrediction) {
  // a single stage, three times as long as predicted, that says how far it is
  RemainingTime one({{"run", "surface", 10.0}});
  one.report("surface", 0.25, 7.5);
  EXPECT_NEAR(one.remaining_s(7.5), 22.5, 0.3 * 22.5);
  one.report("surface", 0.5, 15.0);
  EXPECT_NEAR(one.remaining_s(15.0), 15.0, 1e-9);
  EXPECT_NEAR(one.completed_fraction(15.0), 0.5, 1e-9);
  // and what it teaches counts for the next of its kind
  RemainingTime two({{"a", "surface", 10.0}, {"b", "surface", 20.0}});
  two.report("surface", 0.5, 15.0);
  EXPECT_NEAR(two.remaining_s(15.0), 15.0 + 60.0, 0.1 * 75.0);
}

TEST(RemainingTime, LearnsTheSpeedOfTheComputerAndOfEachKind) {
  RemainingTime time({{"a", "x", 10.0}, {"a", "y", 10.0}, {"b", "x", 10.0}, {"b", "y", 10.0}});
  time.report("x", 0.0, 0.0);
  time.report("y", 0.0, 40.0);  // x takes four times its prediction
  time.begin("b", 50.0);        // y what was predicted
  time.report("x", 0.0, 50.0);
  EXPECT_NEAR(time.remaining_s(50.0), 40.0 + 10.0, 5.0);
  EXPECT_EQ(time.part(), 2);
  EXPECT_EQ(time.parts(), 2);
}

TEST(RemainingTime, SkippedUnplannedAndRepeatedReportsDoNotUpsetIt) {
  RemainingTime time({{"a", "x", 1.0}, {"a", "y", 1.0}, {"b", "x", 1.0}, {"c", "x", 1.0}});
  time.report("surprise", 0.9, 0.5);  // not planned: the stage that runs goes on
  EXPECT_NEAR(time.remaining_s(0.5), 3.5, 0.5);
  time.report("x", 0.8, 0.8);
  time.report("x", 0.2, 0.9);  // never back
  time.begin("c", 1.0);        // y and b are left out
  EXPECT_NEAR(time.remaining_s(1.0), 1.0, 0.1);
  time.begin("nothing", 1.1);
  time.report("x", 1.0, 2.0);
  EXPECT_NEAR(time.remaining_s(2.0), 0.0, 1e-9);
  time.replan({{"d", "z", 5.0}});
  EXPECT_NEAR(time.remaining_s(2.0), 5.0, 1.0);
  RemainingTime nothing({});
  EXPECT_EQ(nothing.remaining_s(1.0), 0.0);
}

TEST(RemainingTime, AnOverdueStageWithoutAWordIsNeverDone) {
  RemainingTime time({{"a", "x", 1.0}});
  for (const double now : {0.9, 2.0, 100.0}) {
    EXPECT_GT(time.remaining_s(now), 0.0);
    EXPECT_LT(time.remaining_s(now), 1.0);
  }
}

TEST(RemainingTime, DurationsReadAsPeopleSayThem) {
  EXPECT_EQ(duration_text(0.4), "0 s");
  EXPECT_EQ(duration_text(89.4), "89 s");
  EXPECT_EQ(duration_text(90.0), "2 min");
  EXPECT_EQ(duration_text(3600.0), "60 min");
  EXPECT_EQ(duration_text(7800.0), "2 h 10 min");
  EXPECT_EQ(duration_text(-1.0), "0 s");
}

}  // namespace
}  // namespace abbe::sim
