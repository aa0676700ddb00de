#include "sim/files/progress.h"

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

namespace abbe::sim {
namespace {

using std::chrono::milliseconds;

/// What a progress line has said.
struct Said {
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
void do_all(const std::vector<Task>& tasks, int max_parallel, Said& said) {
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
    Said said;
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
  Said said;
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
  Said said;
  try {
    do_all(tasks, 3, said);
    FAIL() << "expected the failure of a task";
  } catch (const std::runtime_error& fault) {
    EXPECT_STREQ(fault.what(), "first");
  }
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
    Said said;
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
    Said said;
    try {
      do_all(tasks, 2, said);
      FAIL() << "expected a failure";
    } catch (const std::runtime_error& fault) {
      EXPECT_STREQ(fault.what(), "1");
    }
  }
}

TEST(TaskRunner, NothingToDoIsDone) {
  Said said;
  do_all({}, 2, said);
  EXPECT_TRUE(said.parts.empty());
}

}  // namespace
}  // namespace abbe::sim
