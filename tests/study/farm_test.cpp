#include "sim/study/farm.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>
#include "sim/compensation/plug_in.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"
#include "sim/scene/toml.h"
#include "sim/study/run_study.h"
#include "tests/study/farm_runs.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

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
  SeededRandom random(63);
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
  EXPECT_HAS(text_of(folder / "second.log"), "another process is running this study");
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
    EXPECT_HAS(text_of(log), ends.second);
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
  EXPECT_HAS(text_of(log), "journal of a study");
}

SlurmOptions options_for(const fs::path& folder) {
  return {.study = folder / "study.txt",
          .out = folder / "out",
          .program = ABBE_FARM_PROGRAM,
          .shards = 3,
          .cpus = 1,
          .time = "5"};
}

TEST(SlurmScript, IsAJobArrayWithAMergeThatDependsOnIt) {
  const std::string script = slurm_script({.study = "/data/budget.toml",
                                           .out = "/data/out",
                                           .program = "/opt/abbe/abbe",
                                           .shards = 12,
                                           .cpus = 3,
                                           .time = "2-06:00"});
  for (const char* line :
       {"#!/bin/sh\n", "#SBATCH --array=0-11\n", "#SBATCH --cpus-per-task=3\n",
        "#SBATCH --time=2-06:00\n", "#SBATCH --job-name=abbe-budget\n",
        "exec /opt/abbe/abbe study /data/budget.toml --out /data/out --threads 3 --shard "
        "\"$SLURM_ARRAY_TASK_ID/12\"\n",
        "sbatch --dependency=\"afterok:",
        "--wrap='/opt/abbe/abbe study /data/budget.toml --out /data/out --threads 3 --merge'\n"})
    EXPECT_TRUE(has(script, line)) << line << "\nin\n" << script;
}

TEST(SlurmScript, RefusesWhatSlurmCouldNotRead) {
  const SlurmOptions good = options_for("/data");
  const auto refused = [](const SlurmOptions& options) {
    EXPECT_THROW(slurm_script(options), std::invalid_argument) << options.time;
  };
  SlurmOptions bad = good;
  bad.shards = 0;
  refused(bad);
  bad = good;
  bad.cpus = -1;
  refused(bad);
  for (const char* time : {"", "soon", "1:2:3:4", "5\n#SBATCH --uid=0", "-1", "1-", "2h"}) {
    bad = good;
    bad.time = time;
    refused(bad);
  }
  for (const char* time : {"5", "90:30", "12:00:00", "2-00", "2-06:30", "1-00:00:30"}) {
    bad = good;
    bad.time = time;
    EXPECT_TRUE(has(slurm_script(bad), std::string("--time=") + time + "\n"));
  }
}

/// What the shell makes of the script's words, with programs that only tell their arguments.
TEST(SlurmScript, QuotesEveryPathForTheShell) {
  const RunFolder folder;
  const fs::path odd = folder.folder("it's 100 % \"$HOME\" `x`; \\n");
  fs::create_directories(odd / "bin");
  const auto tell = [&](const fs::path& file) {
    std::ofstream(file) << "#!/bin/sh\nfor word; do printf '%s\\n' \"$word\"; done >>'"
                        << (folder / "words").string() << "'\n";
    fs::permissions(file, fs::perms::owner_all);
  };
  tell(odd / "bin/abbe");
  tell(odd / "bin/sbatch");
  folder.write("job.sh", slurm_script({.study = odd / "study.toml",
                                       .out = odd / "out",
                                       .program = odd / "bin/abbe",
                                       .shards = 2}));
  const auto words_by = [&](const std::string& setting) {
    fs::remove(folder / "words");
    EXPECT_EQ(run({"env", setting, "sh", folder / "job.sh"}, folder / "log"), 0)
        << text_of(folder / "log");
    return text_of(folder / "words");
  };
  const std::string study = (odd / "study.toml").string(), out = (odd / "out").string();
  EXPECT_EQ(words_by("SLURM_ARRAY_TASK_ID=1"),
            "study\n" + study + "\n--out\n" + out + "\n--threads\n4\n--shard\n1/2\n");

  const std::string submitted = words_by("PATH=" + (odd / "bin").string() + ":/usr/bin:/bin");
  EXPECT_TRUE(fs::is_directory(odd / "out-logs"));
  EXPECT_FALSE(fs::exists(odd / "out")) << "abbe takes it, new or empty";
  const std::string wrap = "--wrap=";
  const std::size_t at = submitted.find(wrap);
  ASSERT_NE(at, std::string::npos) << submitted;
  const std::string merge = submitted.substr(at + wrap.size());
  fs::remove(folder / "words");
  EXPECT_EQ(run({"sh", "-c", merge.substr(0, merge.find("--merge") + 7)}, folder / "log"), 0);
  EXPECT_EQ(text_of(folder / "words"),
            "study\n" + study + "\n--out\n" + out + "\n--threads\n4\n--merge\n");
}

// ---------------------------------------------------------------- a real one

/// A port that nobody listens on, of this computer alone.
int free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ::bind(socket, reinterpret_cast<sockaddr*>(&address), size);
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(socket);
  return ntohs(address.sin_port);
}

std::string host_name() {
  char name[256] = "";
  ::gethostname(name, sizeof name - 1);
  return std::string(name).substr(0, std::string(name).find('.'));
}

/// Slurm on this computer with its own keys, ports and folders; its daemons end with it.
class OneNodeSlurm {
 public:
  OneNodeSlurm() {
    fs::permissions(folder_.path(), fs::perms(0755));  // munge lets nobody in otherwise
    std::mt19937 random(std::random_device{}());
    std::string key(1024, '\0');
    for (char& byte : key) byte = char(random());
    fs::permissions(folder_.write("key", key), fs::perms(0400));
    folder_.folder("state");
    folder_.folder("spool");
    folder_.write("slurm.conf", configuration());
    ::setenv("SLURM_CONF", (folder_ / "slurm.conf").c_str(), 1);
    begin({"munged", "-F", "--force", "--key-file=" + at("key"), "--socket=" + at("socket"),
           "--pid-file=" + at("munged.pid"), "--log-file=" + at("munged.log"),
           "--seed-file=" + at("seed")});
    wait_until([&] { return fs::exists(folder_ / "socket"); }, 5);
    begin({"slurmctld", "-D", "-f", at("slurm.conf")});
    begin({"slurmd", "-D", "-f", at("slurm.conf")});
  }
  ~OneNodeSlurm() {
    run({"scancel", "--user=root"}, log());
    wait_until([&] { return jobs().empty(); }, 5);
    for (const auto& daemon : daemons_) daemon->signal(SIGTERM);
    for (const auto& daemon : daemons_) daemon->exit_code(3);
    ::unsetenv("SLURM_CONF");
  }
  OneNodeSlurm(const OneNodeSlurm&) = delete;
  OneNodeSlurm& operator=(const OneNodeSlurm&) = delete;

  bool is_ready() const {
    return wait_until([&] { return has(answer({"sinfo", "-h", "-o", "%T"}), "idle"); }, 15);
  }
  /// Jobs that wait or run, one a line.
  std::string jobs() const { return answer({"squeue", "-h", "-o", "%i %j %T %r"}); }
  std::string answer(const std::vector<std::string>& words) const {
    const fs::path file = folder_ / "answer";
    fs::remove(file);
    run(words, file);
    return text_of(file);
  }
  fs::path log() const { return folder_ / "log"; }
  std::string messages() const { return text_of(folder_ / "daemons"); }

 private:
  std::string at(const std::string& name) const { return (folder_ / name).string(); }
  /// A daemon in the foreground; they are not where users' programs are.
  void begin(std::vector<std::string> words) {
    if (const std::string file = "/usr/sbin/" + words[0]; fs::exists(file)) words[0] = file;
    daemons_.push_back(std::make_unique<Process>(words, folder_ / "daemons"));
  }
  std::string configuration() const {
    std::ostringstream text;
    text << "ClusterName=abbe_test\nSlurmctldHost=" << host_name() << "(127.0.0.1)\n"
         << "SlurmUser=root\nSlurmdUser=root\nAuthType=auth/munge\nAuthInfo=socket=" << at("socket")
         << "\nSlurmctldPort=" << free_port() << "\nSlurmdPort=" << free_port()
         << "\nStateSaveLocation=" << at("state") << "\nSlurmdSpoolDir=" << at("spool")
         << "\nSlurmctldPidFile=" << at("slurmctld.pid") << "\nSlurmdPidFile=" << at("slurmd.pid")
         << "\nSlurmctldLogFile=" << at("slurmctld.log") << "\nSlurmdLogFile=" << at("slurmd.log")
         << "\nProctrackType=proctrack/pgid\nTaskPlugin=task/none\nSwitchType=switch/none\n"
         << "MpiDefault=none\nJobAcctGatherType=jobacct_gather/none\n"
         << "AccountingStorageType=accounting_storage/none\nSelectType=select/cons_tres\n"
         << "SelectTypeParameters=CR_Core\nSlurmdParameters=config_overrides\nReturnToService=2\n"
         << "SchedulerParameters=sched_min_interval=10000,batch_sched_delay=1,bf_interval=1\n"
         << "KillWait=2\nNodeName=" << host_name() << " NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN\n"
         << "PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n";
    return text.str();
  }

  RunFolder folder_;
  std::vector<std::unique_ptr<Process>> daemons_;
};

/// Why there can be no Slurm here; empty if it can.
std::string no_slurm() {
  if (::getuid() != 0) return "Slurm's daemons need root";
  for (const char* program : {"munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel"})
    if (!is_installed(program)) return std::string(program) + " is not installed";
  return "";
}

std::string logs_in(fs::path out) {
  out += "-logs";
  std::string text;
  for (const auto& entry : fs::directory_iterator(out))
    if (entry.path().extension() == ".log") text += text_of(entry.path());
  return text;
}

TEST(Slurm, AnArrayAndItsMergeGiveTheSameBytesAlsoAfterACancelledTask) {
  if (const std::string why = no_slurm(); !why.empty()) GTEST_SKIP() << why;
  const RunFolder folder;
  folder.write("study.txt", farm_study(15000));
  const fs::path script = folder.write("job.sh", slurm_script(options_for(folder.path())));
  const fs::path out = folder / "out", table = out / "table.txt";
  const auto start = std::chrono::steady_clock::now();
  const OneNodeSlurm slurm;
  ASSERT_TRUE(slurm.is_ready()) << slurm.messages();

  ASSERT_EQ(run({"sh", script}, slurm.log()), 0) << text_of(slurm.log());
  ASSERT_TRUE(wait_until([&] { return !text_of(out / "added.log").empty(); }, 20)) << slurm.jobs();
  run({"scancel", "1_0"}, slurm.log());
  EXPECT_TRUE(wait_until([&] { return slurm.jobs().empty(); }, 30)) << slurm.jobs();
  EXPECT_FALSE(fs::exists(table)) << "no merge of shards that are not done";

  folder.write("study.txt", farm_study());
  ASSERT_EQ(run({"sh", script}, slurm.log()), 0) << text_of(slurm.log());
  EXPECT_TRUE(wait_until([&] { return fs::exists(table) && slurm.jobs().empty(); }, 30))
      << slurm.jobs() << logs_in(out);
  EXPECT_EQ(text_of(table), undisturbed_table()) << logs_in(out);
  std::cout << std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()
            << " s for two submissions of three shards and a merge\n";
}

}  // namespace
}  // namespace abbe::sim::study
