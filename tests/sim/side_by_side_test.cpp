#include "sim/files/side_by_side.h"

#include <atomic>
#include <chrono>
#include <future>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

ProgressLine line_of(const std::vector<PieceOfWork>& parts) {
  std::vector<Stage> plan;
  for (const PieceOfWork& part : parts) plan.push_back({part.name, "work", 1.0});
  return ProgressLine(std::move(plan));
}

TEST(SideBySide, EveryPartIsDoneAndEachHasItsTurnOnTheLine) {
  for (const int at_a_time : {1, 2, 3, 10}) {
    std::atomic<int> done = 0;
    std::vector<PieceOfWork> parts;
    for (int i = 0; i < 6; ++i)
      parts.push_back({"part " + std::to_string(i), [&, i](const Progress& progress) {
                         std::this_thread::sleep_for(1ms * (6 - i));  // later ones end earlier
                         progress("work", 0.5);
                         ++done;
                       }});
    testing::internal::CaptureStderr();
    {
      ProgressLine line = line_of(parts);
      side_by_side(parts, at_a_time, line);
    }
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_EQ(done, 6);
    EXPECT_EQ(said,
              "[1/6] part 0\n[2/6] part 1\n[3/6] part 2\n[4/6] part 3\n[5/6] part 4\n"
              "[6/6] part 5\n")
        << at_a_time;
  }
}

TEST(SideBySide, APartMayWaitForOneBeforeIt) {
  std::promise<int> first;
  const std::shared_future<int> known = first.get_future().share();
  int seen = 0;
  const std::vector<PieceOfWork> parts{{"first",
                                        [&](const Progress&) {
                                          std::this_thread::sleep_for(5ms);
                                          first.set_value(7);
                                        }},
                                       {"second", [&](const Progress&) { seen = known.get(); }}};
  testing::internal::CaptureStderr();
  ProgressLine line = line_of(parts);
  side_by_side(parts, 2, line);
  testing::internal::GetCapturedStderr();
  EXPECT_EQ(seen, 7);
}

TEST(SideBySide, TheFirstFailureInTheOrderIsThrownAndWhatRunsBesideItStops) {
  std::atomic<bool> stopped = false;
  std::atomic<int> begun = 0;
  const std::vector<PieceOfWork> parts{{"good", [&](const Progress&) { ++begun; }},
                                       {"bad",
                                        [&](const Progress&) {
                                          ++begun;
                                          std::this_thread::sleep_for(10ms);
                                          throw std::runtime_error("the second");
                                        }},
                                       {"long",
                                        [&](const Progress& progress) {
                                          ++begun;
                                          try {
                                            for (;;) {
                                              progress("work", 0.1);
                                              std::this_thread::sleep_for(1ms);
                                            }
                                          } catch (const Interrupted&) {
                                            stopped = true;
                                            throw;
                                          }
                                        }},
                                       {"never", [&](const Progress&) { ++begun; }}};
  testing::internal::CaptureStderr();
  ProgressLine line = line_of(parts);
  std::string reason;
  try {
    side_by_side(parts, 2, line);
  } catch (const std::runtime_error& failure) {
    reason = failure.what();
  }
  testing::internal::GetCapturedStderr();
  EXPECT_EQ(reason, "the second");
  EXPECT_TRUE(stopped);
  EXPECT_EQ(begun, 3);
}

TEST(SideBySide, RemarksOfAPartStandBehindItsName) {
  const std::vector<PieceOfWork> parts{
      {"first", [](const Progress&) { std::this_thread::sleep_for(20ms); }},
      {"second", [](const Progress& progress) { progress("a remark", -1.0); }}};
  testing::internal::CaptureStderr();
  {
    ProgressLine line = line_of(parts);
    side_by_side(parts, 2, line);
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "[1/2] first\n[2/2] second\na remark\n");
}

}  // namespace
}  // namespace abbe::sim
