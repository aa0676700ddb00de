#include "sim/files/progress.h"
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <mutex>
#include "tests/test.h"

/// Simulated work on computers that are faster or slower than predicted, each kind of work by its
/// own factor, and a clock that the test turns.
namespace abbe::sim {
namespace {

using std::chrono::milliseconds;

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

/// What a progress line has said.
struct ProgressLines {
  std::mutex mutex;
  std::vector<std::string> parts, stages, remarks;

  Progress listener() {
    return [this](const std::string& text, double fraction) {
      const std::lock_guard lock(mutex);
      if (fraction < 0.0) return remarks.push_back(text);
      (text.find(": ") == std::string::npos ? parts : stages).push_back(text);
    };
  }
};

std::vector<Stage> plan_of(const std::vector<Task>& tasks) {
  std::vector<Stage> plan;
  for (const Task& task : tasks) plan.push_back({task.name, "work", 1.0});
  return plan;
}

/// With as many threads as are asked for, whatever the machine has.
void do_all(const std::vector<Task>& tasks, int max_parallel, ProgressLines& said) {
  ProgressLine line(plan_of(tasks), said.listener());
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  tbb::task_arena threads(8);
  threads.execute([&] { run_tasks(tasks, max_parallel, line); });
}

/// What never comes is a failure, not a test without end.
void wait_until(const std::function<bool()>& is_so) {
  for (int i = 0; i < 20000 && !is_so(); ++i) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_TRUE(is_so());
}

TEST(TaskRunner, EachIsDoneOnceAndNamedInOrderWhicheverIsOverFirst) {
  constexpr int count = 30;
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) names.push_back("part " + std::to_string(i));
  for (const int max_parallel : {1, 2, 3, 40}) {
    std::mt19937 random{unsigned(max_parallel)};
    std::vector<std::atomic<int>> done(count);
    std::atomic<int> at_work = 0, most = 0;
    std::vector<Task> tasks;
    for (int i = 0; i < count; ++i) {
      const milliseconds time(random() % 4);
      tasks.push_back({names[std::size_t(i)], [&, i, time](const Progress& progress) {
                         const int now = ++at_work;
                         int before = most;
                         while (before < now && !most.compare_exchange_weak(before, now)) {
                         }
                         progress("work", 0.5);
                         if (i == 0 && max_parallel > 1) wait_until([&] { return most > 1; });
                         std::this_thread::sleep_for(time);
                         progress("remark of " + std::to_string(i), -1.0);
                         ++done[std::size_t(i)];
                         --at_work;
                       }});
    }
    ProgressLines said;
    do_all(tasks, max_parallel, said);
    for (int i = 0; i < count; ++i) EXPECT_EQ(done[std::size_t(i)], 1) << i;
    EXPECT_EQ(said.parts, names) << max_parallel;
    EXPECT_EQ(said.remarks.size(), std::size_t(count));
    EXPECT_EQ(said.stages.size(), std::size_t(count));
    EXPECT_LE(most, max_parallel);
    EXPECT_EQ(most > 1, max_parallel > 1) << max_parallel;
  }
}

TEST(TaskRunner, OneAtATimeStaysInTheCallingThread) {
  const auto caller = std::this_thread::get_id();
  std::vector<Task> tasks(
      3, {"same", [&](const Progress&) { EXPECT_EQ(std::this_thread::get_id(), caller); }});
  ProgressLines said;
  do_all(tasks, 1, said);
}

TEST(TaskRunner, TheFirstFailureIsThrownAndWhatFollowsItStops) {
  std::atomic<bool> third_began = false, second_failed = false, third_stopped = false,
                    fourth_began = false;
  const auto first = [&](const Progress& progress) {
    wait_until([&] { return third_stopped.load(); });
    progress("work", 0.5);  // what comes before a failure goes on
    throw std::runtime_error("first");
  };
  const auto second = [&](const Progress&) {
    wait_until([&] { return third_began.load(); });
    second_failed = true;
    throw std::runtime_error("second");
  };
  const auto third = [&](const Progress& progress) {
    third_began = true;
    try {
      wait_until([&] {
        progress("work", 0.1);
        return false;
      });
    } catch (...) {
      third_stopped = true;
      throw;
    }
  };
  const std::vector<Task> tasks{{"first", first},
                                {"second", second},
                                {"third", third},
                                {"fourth", [&](const Progress&) { fourth_began = true; }}};
  ProgressLines said;
  const std::string message = thrown_text<std::runtime_error>([&] { do_all(tasks, 3, said); });
  EXPECT_EQ(message, "first");
  EXPECT_TRUE(third_stopped);
  EXPECT_FALSE(fourth_began);
}

TEST(TaskRunner, TheLongestBeginFirstBesideTheFirst) {
  for (const int max_parallel : {1, 2}) {
    std::atomic<int> over = 0;
    std::vector<int> begun;
    const std::vector<double> seconds{1.0, 2.0, 9.0, 2.0, 5.0};
    std::vector<Task> tasks{{"0",
                             [&](const Progress&) {
                               if (max_parallel > 1) wait_until([&] { return over == 4; });
                             },
                             seconds[0]}};
    for (int i = 1; i < int(seconds.size()); ++i) {
      const auto work = [&, i](const Progress&) {
        begun.push_back(i);
        ++over;
      };
      tasks.push_back({std::to_string(i), work, seconds[std::size_t(i)]});
    }
    ProgressLines said;
    do_all(tasks, max_parallel, said);
    EXPECT_EQ(begun,
              max_parallel == 1 ? (std::vector<int>{1, 2, 3, 4}) : (std::vector{2, 4, 1, 3}));
    EXPECT_EQ(said.parts, (std::vector<std::string>{"0", "1", "2", "3", "4"}));
  }
}

TEST(TaskRunner, AFailureDoesNotHideOneBeforeIt) {
  const auto fails = [](const char* name) {
    return [=](const Progress&) { throw std::runtime_error(name); };
  };
  for (int repeated = 0; repeated < 100; ++repeated) {
    const std::vector<Task> tasks{{"0", [](const Progress&) {}, 1.0},
                                  {"1", fails("1"), 1.0},
                                  {"2", fails("2"), 2.0},
                                  {"3", fails("3"), 3.0}};
    ProgressLines said;
    const std::string message = thrown_text<std::runtime_error>([&] { do_all(tasks, 2, said); });
    EXPECT_EQ(message, "1");
  }
}

TEST(TaskRunner, NothingToDoIsDone) {
  ProgressLines said;
  do_all({}, 2, said);
  EXPECT_TRUE(said.parts.empty());
}

}  // namespace
}  // namespace abbe::sim
