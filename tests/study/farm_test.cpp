#include "sim/study/farm.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include "kinematics/bad_input.h"
#include "sim/compensation/plug_in.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"
#include "sim/scene/toml.h"
#include "tests/study/farm_runs.h"

namespace abbe::sim::study {
namespace {

namespace fs = std::filesystem;

std::vector<Batch> batches_of(std::uint64_t cases, std::uint64_t size) {
  std::vector<Batch> batches;
  for (std::uint64_t i = 0; i < cases; i += size) batches.push_back({i, std::min(cases, i + size)});
  return batches;
}

std::vector<std::uint64_t> firsts(const std::vector<Batch>& batches) {
  std::vector<std::uint64_t> result;
  for (const Batch& batch : batches) result.push_back(batch.first);
  return result;
}

std::vector<Row> rows_of(const Batch& batch) {
  std::vector<Row> rows;
  for (std::uint64_t i = batch.first; i < batch.last; ++i)
    rows.push_back({i, {std::sqrt(double(i))}, ""});
  return rows;
}

// ---------------------------------------------------------------- batches

TEST(OfShard, EveryBatchIsInOneShard) {
  for (const std::uint64_t cases : {0u, 1u, 7u, 100u})
    for (const int count : {1, 2, 3, 8, 200}) {
      const std::vector<Batch> all = batches_of(cases, 3);
      std::vector<std::uint64_t> found;
      for (int i = 0; i < count; ++i)
        for (const Batch& batch : shard_batches(all, {i, count})) found.push_back(batch.first);
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, firsts(all)) << cases << " cases, " << count << " shards";
    }
  for (const Shard& none : {Shard{0, 0}, Shard{3, 3}, Shard{-1, 3}, Shard{0, -1}})
    EXPECT_THROW(shard_batches({}, none), std::invalid_argument) << none.index << "/" << none.count;
}

TEST(Unfinished, IsEveryBatchWithACaseThatIsNotThere) {
  const unsigned seed = 63;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (int trial = 0; trial < 300; ++trial) {
    const std::vector<Batch> all = batches_of(random() % 40, 1 + random() % 5);
    std::set<std::uint64_t> there;
    for (unsigned n = random() % 60; n > 0; --n) there.insert(random() % 45);
    std::vector<std::uint64_t> expected;
    for (const Batch& batch : all) {
      bool whole = true;
      for (std::uint64_t i = batch.first; i < batch.last; ++i) whole = whole && there.count(i) > 0;
      if (!whole) expected.push_back(batch.first);
    }
    EXPECT_EQ(firsts(unfinished(all, {there.begin(), there.end()})), expected);
  }
}

// ---------------------------------------------------------------- alone

TEST(Farm, AloneEveryBatchIsTakenOnceOneAtATime) {
  const std::vector<Batch> all = batches_of(1000, 3);
  std::map<std::uint64_t, std::vector<Row>> taken;
  std::atomic<int> inside = 0;
  farm(all, {}, rows_of, [&](const Batch& batch, std::vector<Row> rows) {
    EXPECT_EQ(++inside, 1);
    EXPECT_TRUE(taken.emplace(batch.first, std::move(rows)).second);
    --inside;
  });
  ASSERT_EQ(taken.size(), all.size());
  for (const Batch& batch : all) EXPECT_EQ(taken[batch.first], rows_of(batch));
  farm({}, {}, rows_of, [](const Batch&, std::vector<Row>) { FAIL(); });
}

/// Has this thread wait for a parallel part that another one is slow to end.
void wait_for_others() {
  tbb::task_group parts;
  tbb::task_handle part = parts.defer([] {});
  std::thread other([slow = std::move(part)]() mutable {
    wait_ms(2);
    slow = tbb::task_handle();
  });
  parts.wait();
  other.join();
}

TEST(Farm, AThreadThatWaitsInABatchBeginsNoOther) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 8);
  tbb::task_arena arena(8);
  std::atomic<int> within = 0, computed = 0;
  const auto compute = [&](const Batch& batch) {
    static thread_local int depth = 0;
    if (++depth > 1) ++within;
    wait_for_others();
    --depth;
    ++computed;
    return rows_of(batch);
  };
  arena.execute(
      [&] { farm(batches_of(100, 1), {}, compute, [](const Batch&, std::vector<Row>) {}); });
  EXPECT_EQ(computed, 100);
  EXPECT_EQ(within, 0);
}

TEST(Farm, AFailureEndsItAndLosesNothingThatWasFinished) {
  const std::vector<Batch> all = batches_of(300, 3);
  std::atomic<int> computed = 0, begun = 0;
  int taken = 0;
  const auto compute = [&](const Batch& batch) {
    ++begun;
    if (batch.first == 90) throw BadInput("scene.toml", 3, 7, "a farm", "a garden");
    wait_ms(1);
    ++computed;
    return rows_of(batch);
  };
  EXPECT_THROW(farm(all, {}, compute, [&](const Batch&, std::vector<Row>) { ++taken; }), BadInput);
  EXPECT_EQ(taken, computed);
  EXPECT_EQ(begun, computed + 1);
  EXPECT_GE(taken, 30) << "the first ones come first";
  EXPECT_LT(taken, 90) << "none is begun after it";
}

TEST(Farm, NothingIsTakenAfterTakingFailed) {
  int taken = 0;
  const auto take = [&](const Batch&, std::vector<Row>) {
    if (++taken == 5) throw OutputFailure("no more room");
  };
  EXPECT_THROW(farm(batches_of(300, 3), {}, rows_of, take), OutputFailure);
  EXPECT_EQ(taken, 5);
}

// ---------------------------------------------------------------- messages

TEST(Messages, RowsComeBackBitForBit) {
  const BatchResult sent{{5, 8},
                         {{5, {std::nan("7"), -0.0}, ""}, {6, {}, "a fault\n µ"}, {7, {1}, ""}}};
  const std::string bytes = to_bytes(sent);
  const BatchResult found = parse_batch_result(bytes);
  EXPECT_EQ(found.batch.first, 5u);
  EXPECT_EQ(found.batch.last, 8u);
  EXPECT_EQ(found.rows, sent.rows);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(parse_batch_result(bytes.substr(0, size)), std::runtime_error) << size;
}

template <typename Failure>
std::string there_and_back(const Failure& failure) {
  try {
    std::rethrow_exception(parse_failure(to_bytes(std::make_exception_ptr(failure))));
  } catch (const Failure& found) {
    return found.what();
  } catch (...) {
    return "another type";
  }
}

TEST(Messages, AFailureKeepsItsTypeAndText) {
  const BadInput fault("scene.toml", 3, 7, "a \"farm\"", "\xff a garden");
  EXPECT_EQ(there_and_back(BadInput("a.toml", 3, 0, "b", "c")), "a.toml:3: expected b, seen c");
  EXPECT_EQ(there_and_back(BadScene({fault, BadInput("a", 1, 2, "b", "c")})).substr(0, 14),
            "scene.toml:3:7");
  EXPECT_EQ(there_and_back(OutputFailure("full")), "full");
  EXPECT_EQ(there_and_back(Interrupted()), "interrupted");
  EXPECT_EQ(there_and_back(compensation::PlugInFailure("crashed")), "crashed");
  EXPECT_EQ(there_and_back(std::bad_alloc()), std::bad_alloc().what());
  EXPECT_EQ(there_and_back(std::runtime_error("singular")), "singular");
  EXPECT_EQ(parse_failure(to_bytes(std::exception_ptr())), nullptr);
}

// ---------------------------------------------------------------- whole programs

/// Cases whose rows a run said to have added.
std::vector<std::uint64_t> added(const fs::path& out) {
  std::vector<std::uint64_t> cases;
  std::istringstream stream(text_of(out / "added.log"));
  for (std::uint64_t first, last; stream >> first >> last;)
    for (; first < last; ++first) cases.push_back(first);
  std::sort(cases.begin(), cases.end());
  return cases;
}

std::vector<std::uint64_t> in_journal(const fs::path& file) {
  std::vector<std::uint64_t> cases;
  for (const Row& row : read_journal(file).rows) cases.push_back(row.index);
  return cases;
}

bool has_rows(const fs::path& out) { return !text_of(out / "added.log").empty(); }

TEST(FarmProgram, OneAndTwoThreadsAndThreeShardsGiveTheSameBytes) {
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study(200));
  ASSERT_EQ(std::count(undisturbed_table().begin(), undisturbed_table().end(), '\n'), 200);
  for (const char* threads : {"1", "2", "4"}) {
    const fs::path out = folder.folder(threads);
    std::vector<std::string> words = command(study, out);
    words.insert(words.end(), {"--threads", threads});
    EXPECT_EQ(run(words, folder / "log"), 0) << text_of(folder / "log");
    EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table()) << threads << " threads";
  }
  const fs::path out = folder.folder("shards");
  for (const char* shard : {"2/3", "0/3", "1/3"}) {
    std::vector<std::string> words = command(study, out);
    words.insert(words.end(), {"--shard", shard});
    EXPECT_EQ(run(words, folder / "log"), 0) << text_of(folder / "log");
  }
  std::vector<std::string> words = command(study, out);
  words.push_back("--merge");
  EXPECT_EQ(run(words, folder / "log"), 0) << text_of(folder / "log");
  EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
}

TEST(FarmProgram, OneTwoAndFourRanksGiveTheSameBytes) {
  if (const std::string why = no_ranks(); !why.empty()) GTEST_SKIP() << why;
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study(200));
  for (const int ranks : {1, 2, 4}) {
    const fs::path out = folder.folder(std::to_string(ranks));
    EXPECT_EQ(run(among(ranks, command(study, out)), folder / "log"), 0) << text_of(folder / "log");
    EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table()) << ranks << " ranks";
    EXPECT_TRUE(fs::exists(out / ("rank-" + std::to_string(ranks - 1) + ".pid")));
  }
}

TEST(FarmProgram, KilledTwentyTimesAtRandomItEndsWithTheSameBytes) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::cout << "seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> moment_ms(0, 150);
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study(8000));
  fs::path out = folder.folder("0");
  int killed = 0, studies = 0;
  std::size_t max_at_once = 0, before = 0, unreported = 0;
  while (killed < 20) {
    Process process(command(study, out), folder / "log");
    wait_ms(moment_ms(random));
    process.signal(SIGKILL);
    if (process.exit_code() == 0) {
      EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
      out = folder.folder(std::to_string(++studies));
      before = unreported = 0;
      continue;
    }
    ++killed;
    if (!has_rows(out)) continue;
    const std::vector<std::uint64_t> reported = added(out), kept = in_journal(out / "journal.db");
    EXPECT_TRUE(std::includes(kept.begin(), kept.end(), reported.begin(), reported.end()))
        << "a row that was added is gone";
    EXPECT_EQ(std::adjacent_find(reported.begin(), reported.end()), reported.end())
        << "a case is done twice";
    EXPECT_LE(kept.size() - reported.size(), unreported + 3)
        << "but for the batch it was killed in";
    unreported = kept.size() - reported.size();
    max_at_once = std::max(max_at_once, kept.size() - before);
    before = kept.size();
  }
  std::cout << "killed " << killed << " times, " << before << " of 200 cases then, at most "
            << max_at_once << " between two kills, " << studies << " studies ended before\n";
  EXPECT_EQ(run(command(study, out), folder / "log"), 0) << text_of(folder / "log");
  EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
}

TEST(FarmProgram, AKilledWorkerEndsTheJobAndAResumeGivesTheSameBytes) {
  if (const std::string why = no_ranks(); !why.empty()) GTEST_SKIP() << why;
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study(30000)), out = folder.folder("out");
  std::vector<std::string> words = command(study, out);
  words.insert(words.end(), {"--threads", "1"});
  for (const char* worker : {"rank-1.pid", "rank-2.pid"}) {
    const std::size_t before = added(out).size();
    fs::remove(out / worker);
    Process process(among(3, words), folder / "log");
    ASSERT_TRUE(wait_until([&] { return added(out).size() > before + 20; }, 20));
    ::kill(std::stoi(text_of(out / worker)), SIGKILL);
    EXPECT_NE(process.exit_code(), 0) << text_of(folder / "log");
    EXPECT_FALSE(fs::exists(out / "table.txt"));
    const std::vector<std::uint64_t> reported = added(out), kept = in_journal(out / "journal.db");
    EXPECT_TRUE(std::includes(kept.begin(), kept.end(), reported.begin(), reported.end()));
    std::cout << kept.size() << " of 200 cases when " << worker << " was killed\n";
  }
  folder.write("study.txt", farm_study());
  EXPECT_EQ(run(among(3, command(study, out)), folder / "log"), 0) << text_of(folder / "log");
  EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
}

TEST(FarmProgram, TheSecondOfTwoAtOnceIsTurnedAway) {
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study(4000)), out = folder.folder("out");
  Process first(command(study, out), folder / "first.log");
  ASSERT_TRUE(wait_until([&] { return has_rows(out); }, 20));
  EXPECT_EQ(run(command(study, out), folder / "second.log"), 5);
  EXPECT_NE(text_of(folder / "second.log").find("another process is running this study"),
            std::string::npos);
  EXPECT_EQ(first.exit_code(), 0) << text_of(folder / "first.log");
  EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
  EXPECT_EQ(added(out).size(), 200u);
}

TEST(FarmProgram, InterruptedItKeepsWhatIsFinished) {
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study(4000)), out = folder.folder("out");
  Process first(command(study, out), folder / "log");
  ASSERT_TRUE(wait_until([&] { return has_rows(out); }, 20));
  first.signal(SIGINT);
  EXPECT_EQ(first.exit_code(), 130);
  const std::vector<std::uint64_t> kept = in_journal(out / "journal.db");
  EXPECT_EQ(added(out), kept);
  EXPECT_LT(kept.size(), 200u);
  EXPECT_EQ(run(command(study, out), folder / "log"), 0);
  EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
  EXPECT_EQ(added(out).size(), 200u) << "nothing is done twice";
}

TEST(FarmProgram, AFailureAmongRanksReachesRank0WithItsTextAndEndsAll) {
  if (const std::string why = no_ranks(); !why.empty()) GTEST_SKIP() << why;
  const RunFolder folder;
  const std::map<std::string, std::pair<int, std::string>> failures{
      {"BadInput", {3, "scene.toml:3:7: expected a farm, seen a garden"}},
      {"OutputFailure", {5, "no more room"}},
      {"other", {4, "a case that cannot be"}},
      {"Interrupted", {130, ""}}};
  for (const auto& [failure, ends] : failures) {
    const fs::path study =
        folder.write(failure, farm_study(200, "fail_at 100\nfailure " + failure + "\n"));
    const fs::path out = folder.folder("out-" + failure), log = folder / (failure + ".log");
    EXPECT_EQ(run(among(3, command(study, out)), log), ends.first) << text_of(log);
    EXPECT_NE(text_of(log).find(ends.second), std::string::npos) << text_of(log);
    EXPECT_EQ(added(out), in_journal(out / "journal.db"));
    EXPECT_GE(added(out).size(), 90u) << "what was finished is kept";
    folder.write(failure, farm_study());
    EXPECT_EQ(run(among(2, command(study, out)), log), 0) << text_of(log);
    EXPECT_EQ(text_of(out / "table.txt"), undisturbed_table());
  }
}

TEST(FarmProgram, AFailureOfRank0EndsTheRanksThatWaitForIt) {
  if (const std::string why = no_ranks(); !why.empty()) GTEST_SKIP() << why;
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", farm_study()), log = folder / "log";
  folder.write("journal.db", "no journal");
  EXPECT_EQ(run(among(3, command(study, folder.path())), log), 3) << text_of(log);
  EXPECT_NE(text_of(log).find("journal of a study"), std::string::npos) << text_of(log);
}

}  // namespace
}  // namespace abbe::sim::study
