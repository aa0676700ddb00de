#include "sim/compensation/plug_in.h"
#include <sys/resource.h>
#include <csignal>
#include <nlohmann/json.hpp>
#include "sim/compensation/child_process.h"
#include "tests/compensation/plug_ins.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

constexpr const char* answers_nothing_else = R"(
ready()
while (ask := hear())["kind"] == "ask":
    say({"id": ask["id"], "correction": rows(ask)})
)";

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

nlohmann::json json_of(const fs::path& file) {
  std::ifstream stream(file);
  return nlohmann::json::parse(stream);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// --- what works

TEST_F(PlugIns, AnswersComeInBatchesInTheOrderOfTheSamples) {
  const fs::path file = python(R"(
ready()
sizes = []
while (ask := hear())["kind"] == "ask":
    sizes.append((ask["id"], len(ask["q"])))
    say({"id": ask["id"], "correction": [[t * 1e-3, x * 1e-3, 0, 0, 0, 0]
                                         for t, (c, x, *_) in zip(ask["time_s"], ask["q"])]})
print(sizes, task["samples"], file=sys.stderr)
)");
  const Asked asked(2501);
  const PlugInResponse answer = asked.answer(file);
  EXPECT_EQ(answer.name, "mine");
  EXPECT_EQ(answer.output, PlugInOutput::Correction);
  EXPECT_EQ(answer.stderr_text, "[(1, 1000), (2, 1000), (3, 501)] 2501");
  ASSERT_EQ(answer.rows.rows(), 2501);
  ASSERT_EQ(answer.rows.cols(), 6);
  for (Index i = 0; i < answer.rows.rows(); ++i) {
    const kinematics::AxisState& command = asked.commands[std::size_t(i)];
    ASSERT_EQ(answer.rows(i, 0), command.time_s * 1e-3);
    ASSERT_EQ(answer.rows(i, 1), command.q[1] * 1e-3);
  }
}

TEST_F(PlugIns, EveryBitOfANumberGoesThereAndBack) {
  const fs::path file = python(R"(
ready()
while (ask := hear())["kind"] == "ask":
    say({"id": ask["id"], "correction": [[0, t, 0, 0, 0, 0] for t in ask["time_s"]]})
)");
  Asked asked(1000);
  constexpr std::uint64_t seed = 4711;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> exponent(-308, 0.9), unit(-1, 1);
  for (kinematics::AxisState& command : asked.commands)
    command.time_s = unit(random) * std::pow(10.0, exponent(random));
  asked.commands[0].time_s = 0.0;
  asked.commands[1].time_s = std::numeric_limits<double>::denorm_min();
  asked.commands[2].time_s = -std::numeric_limits<double>::min();
  asked.commands[3].time_s = 0.1;
  const PlugInResponse answer = asked.answer(file);
  for (std::size_t i = 0; i < asked.commands.size(); ++i)
    ASSERT_EQ(answer.rows(Index(i), 1), asked.commands[i].time_s);
}

TEST_F(PlugIns, TheTaskAndTheQuestionSayWhatTheControlKnows) {
  const fs::path file = python(R"(
json.dump(task, open(sys.path[0] + "/task.json", "w"))
ready("deviation")
while (ask := hear())["kind"] == "ask":
    json.dump(ask, open(sys.path[0] + "/ask.json", "w"))
    say({"id": ask["id"], "deviation": [[1, 2, 3, 0.1, 0.2, 0.3] for q in ask["q"]]})
)");
  Asked asked(3);
  asked.task.log.names = {"room_C", "current_A"};
  asked.task.log.time_s = Vector3d(-60, 0.05, 0.15);
  asked.task.log.values.resize(3, 2);
  asked.task.log.values << 20.5, 1, 21, std::nan(""), 22, 3;
  const PlugInResponse answer = asked.answer(file);
  EXPECT_EQ(answer.output, PlugInOutput::Deviation);
  ASSERT_EQ(answer.rows.cols(), 6);
  EXPECT_EQ(answer.rows(2, 5), 0.3);

  const nlohmann::json task = json_of(folder / "task.json"), ask = json_of(folder / "ask.json");
  EXPECT_EQ(task["structure"], "w C' b X Y Z A s t");
  EXPECT_EQ(task["joints"][0]["name"], "C");
  EXPECT_EQ(task["joints"][0]["side"], "workpiece");
  EXPECT_EQ(task["joints"][0]["motion"], "rotary");
  EXPECT_EQ(task["joints"][0]["point"], nlohmann::json({12, -7, 0}));
  EXPECT_EQ(task["joints"][1]["direction"], nlohmann::json({1, 0, 0}));
  EXPECT_EQ(task["joints"][1]["max"], 2000);
  EXPECT_EQ(task["joints"][5]["motion"], "spindle");
  EXPECT_EQ(task["tool"]["length"], 90);
  EXPECT_EQ(task["readings"], nlohmann::json({"room_C", "current_A"}));
  EXPECT_EQ(task["log"]["time_s"], nlohmann::json({-60, 0.05, 0.15}));
  EXPECT_EQ(task["log"]["values"][0], nlohmann::json({20.5, 1}));
  EXPECT_TRUE(task["log"]["values"][1][1].is_null()) << "a reading that there was not";
  EXPECT_EQ(ask["direction"][0], nlohmann::json({1, -1, 0, 1, 0, 0}));
  EXPECT_NEAR(ask["spindle_rpm"][0].get<double>(), 314.0 * 30 / 3.14159265358979, 1e-9);
  EXPECT_EQ(ask["readings"][0][0], 20.5) << "the last reading before 0 s";
  EXPECT_EQ(ask["readings"][1][0], 21) << "the last reading before 0.1 s";
  EXPECT_EQ(ask["readings"][2][0], 22) << "the last reading before 0.2 s";
  for (Index row = 0; row < 3; ++row)
    for (Index column = 0; column < 4; ++column)
      EXPECT_EQ(ask["T_wt"][2][std::size_t(4 * row + column)].get<double>(),
                asked.T_wt[2].matrix()(row, column));
}

TEST_F(PlugIns, AProgramWithoutMotionIsAskedNothing) {
  EXPECT_EQ(Asked(0).answer(python(answers_nothing_else)).rows.rows(), 0);
}

TEST_F(PlugIns, AnyExecutableSpeaksWhetherItFlushesOrNot) {
  const fs::path shell = written("mine", R"(#!/bin/sh
read task
echo '{"abbe":1,"kind":"ready","answers":"correction"}'
read ask
echo '{"id":1,"correction":[[0.1,2,3,0.1,0.2,0]]}'
)",
                                 true);
  EXPECT_EQ(Asked(1).answer(shell).rows(0, 2), 3.0);
  const fs::path without_mark = python(answers_nothing_else);
  ::chmod(without_mark.c_str(), 0755);
  EXPECT_EQ(Asked(1).answer(without_mark).rows(0, 2), 0.0);
}

TEST_F(PlugIns, TwoThreadsAskAtOnce) {
  const fs::path file = python(answers_nothing_else);
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i)
    threads.emplace_back([&] { EXPECT_EQ(Asked(1500).answer(file).rows.rows(), 1500); });
  for (std::thread& thread : threads) thread.join();
}

// --- what cannot be started

TEST_F(PlugIns, WhatCannotBeStartedIsNamed) {
  EXPECT_HAS(failure(folder / "none.py"),
             "none.py: start: expected a program or a shared library, seen no such file");
  EXPECT_HAS(failure(folder), "seen a folder");
  EXPECT_HAS(failure(written("mine.txt", "hello")), "expected an executable program (chmod +x)");
  EXPECT_HAS(failure(written("mine", "#!/no/such/interpreter\n", true)),
             "No such file or directory");
  EXPECT_HAS(failure(written("noise", "\x01\x02\x03", true)), "Exec format error");
  EXPECT_HAS(failure(written("mine.so", "not a library")), "expected a shared library, seen ");
}

TEST_F(PlugIns, PythonThatIsNotThereIsNamed) {
  const fs::path file = python(answers_nothing_else);
  const std::string before = std::getenv("PATH");
  ::setenv("PATH", folder.c_str(), 1);
  const std::string text = failure(file);
  ::setenv("PATH", before.c_str(), 1);
  EXPECT_HAS(text, "mine.py: start: expected python3 to start, seen No such file");
}

// --- what goes wrong on the way: a program, and what its failure says

struct Fault {
  const char* name;
  const char* program;
  const char* says;
};

void PrintTo(const Fault& fault, std::ostream* stream) { *stream << fault.name; }

class PlugInFaults : public PlugIns, public testing::WithParamInterface<Fault> {};

constexpr const char* bad_correction = R"(
ready()
ask = hear()
row = [0] * 6
)";

const Fault input_errors[] = {
    {"ExitsBeforeItIsReady", "print('no licence', file=sys.stderr); sys.exit(3)",
     "handshake: expected a line, seen the end of the program, exit code 3\nlast lines on "
     "stderr:\n  no licence"},
    {"RaisesAnException", "raise ValueError('so wide')", "  ValueError: so wide"},
    {"IsKilledByASignal", "os.kill(os.getpid(), signal.SIGSEGV)",
     "seen the end of the program, signal 11 (Segmentation fault)"},
    {"CrashesInABatch", "ready(); hear(); sys.exit(1)",
     "batch 1 (samples 1 to 3): expected a line, seen the end of the program, exit code 1"},
    {"EndsWithoutAnAnswer", "ready(); hear()", "seen the end of the program, exit code 0"},
    {"ClosesItsOutput", "os.close(1); time.sleep(60)", "seen the end of its output"},
    {"EndsInALine", "sys.stdout.write('{\"abbe\":')",
     "seen an incomplete line, '{\"abbe\":', then the end of the program, exit code 0"},
    {"SpeaksAnotherVersion", "say({'abbe': 2, 'kind': 'ready', 'answers': 'correction'})",
     "expected \"abbe\":1, the protocol version, seen 2"},
    {"DoesNotSayItsVersion", "say({'kind': 'ready'})", "the protocol version, seen none"},
    {"IsNotReady", "say({'abbe': 1})", "expected \"kind\":\"ready\", seen none"},
    {"AnswersAnotherThing", "ready('temperature')",
     "expected \"answers\":\"correction\" or \"answers\":\"deviation\", seen \"temperature\""},
    {"Chats", "print('hello world')",
     "expected a JSON object on one line, seen 'hello world' (write messages for users to stderr)"},
    {"SaysAList", "say([1, 2])", "expected a JSON object on one line, seen '[1, 2]'"},
    {"SaysNothingInALine", "print()", "expected a JSON object on one line, seen nothing"},
    {"SaysBytes", "sys.stdout.buffer.write(b'\\xff\\x00\\xfe\\n')", "seen '\\xFF\\x00\\xFE'"},
    {"NestsDeeply", "print('[' * 60000)", "expected a JSON object on one line, seen '[[["},
    {"RefusesTheTask", "say({'error': 'needs a trunnion'})",
     "handshake: expected no error, seen needs a trunnion"},
    {"RefusesABatch", "ready(); hear(); say({'id': 1, 'error': 'too cold'})",
     "batch 1 (samples 1 to 3): expected no error, seen too cold"},
    {"AnswersNaN", "row[1] = float('nan'); say({'id': 1, 'correction': rows(ask, row)})",
     "with a number that is not finite"},
    {"AnswersInfinity", "row[1] = -1e400; say({'id': 1, 'correction': rows(ask, row)})",
     "with a number that is not finite"},
    {"AnswersNull", "row[1] = None; say({'id': 1, 'correction': rows(ask, row)})",
     "expected a finite number, seen null in row 1, X"},
    {"AnswersText", "row[0] = '0.1'; say({'id': 1, 'correction': rows(ask, row)})",
     "expected a finite number, seen \"0.1\" in row 1, C"},
    {"AnswersTooLargeANumber", "print('{\"id\":1,\"correction\":[[0,1e999,0,0,0,0]]}')",
     "with a number that is too large"},
    {"AnswersMicrometres", "row[3] = 12.5; say({'id': 1, 'correction': rows(ask, row)})",
     "expected at most 10 mm (units are mm and rad), seen 12.5 in row 1, Z"},
    {"AnswersDegrees", "row[4] = -0.6; say({'id': 1, 'correction': rows(ask, row)})",
     "expected at most 0.5 rad (units are mm and rad), seen -0.6 in row 1, A"},
    {"AnswersTooFewRows", "say({'id': 1, 'correction': rows(ask)[1:]})",
     "expected 3 rows, one per sample, seen 2"},
    {"AnswersTooManyRows", "say({'id': 1, 'correction': rows(ask) + [row]})",
     "expected 3 rows, one per sample, seen 4"},
    {"AnswersTooFewNumbers", "say({'id': 1, 'correction': rows(ask)[1:] + [[0] * 5]})",
     "expected 6 numbers per row, seen 5 in row 3"},
    {"AnswersNoLists", "say({'id': 1, 'correction': row[:3]})",
     "expected 6 numbers per row, seen no list in row 1"},
    {"AnswersAnotherId", "say({'id': 2, 'correction': rows(ask)})", "expected \"id\":1, seen 2"},
    {"AnswersWithoutId", "say({'correction': rows(ask)})", "expected \"id\":1, seen none"},
    {"AnswersAnotherKey", "say({'id': 1, 'deviation': rows(ask)})",
     "expected \"correction\":[...], seen none"},
    {"SaysMoreThanItIsAsked", "say({'id': 1, 'correction': rows(ask)}); print('bye')",
     "end: expected no output after the last answer, seen 'bye\\x0A'"},
    {"EndsBadly", "say({'id': 1, 'correction': rows(ask)}); sys.exit(4)",
     "end: expected exit code 0 after the last answer, seen exit code 4"},
    {"CrashesAtTheEnd", "say({'id': 1, 'correction': rows(ask)}); os.abort()",
     "end: expected exit code 0 after the last answer, seen signal 6 (Aborted)"},
};

TEST_P(PlugInFaults, AreNamed) {
  const Fault& fault = GetParam();
  const std::string program = fault.program;
  const bool answers = has(program, "row") || has(program, "ask)") || has(program, "\"id\"");
  const std::string text = failure(python((answers ? bad_correction : "") + program));
  EXPECT_HAS(text, fault.says);
  EXPECT_EQ(text.find((folder / "mine.py").string()), 0u) << "the plug-in is named first";
  std::cout << text.substr(folder.string().size() + 1) << "\n";
}

INSTANTIATE_TEST_SUITE_P(Each, PlugInFaults, testing::ValuesIn(input_errors),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_F(PlugIns, WhatHangsIsKilledAtItsDeadline) {
  PlugInOptions options;
  const std::string note = "open(sys.path[0] + '/pid', 'w').write(str(os.getpid()))\n";
  const auto hang = [&](const std::string& program, const std::string& says) {
    fs::remove(folder / "pid");
    const auto start = std::chrono::steady_clock::now();
    const std::string text = failure(python(note + program), options);
    std::cout << text.substr(folder.string().size() + 1) << " (" << seconds_since(start) << " s)\n";
    EXPECT_HAS(text, says);
    EXPECT_LT(seconds_since(start), 20.0) << "it sleeps for 60 s";
    long pid = 0;
    std::ifstream(folder / "pid") >> pid;
    EXPECT_FALSE(pid > 0 && runs(pid));
  };
  options.start_s = 0.5;
  hang("time.sleep(60)",
       "handshake: expected a line within 0.5 s, seen no output (is it flushed after each line?)");
  options.start_s = 10;
  options.response_s = 0.5;
  hang("ready(); time.sleep(60)", "batch 1 (samples 1 to 3): expected a line within 0.5 s");
  hang("ready(); sys.stdout.write('{'); time.sleep(60)",
       "seen an incomplete line, '{', then no output");
  hang("signal.signal(signal.SIGTERM, signal.SIG_IGN); ready(); time.sleep(60)", "within 0.5 s");
  options.response_s = 2;
  hang("ready(); ask = hear(); say({'id': 1, 'correction': rows(ask)}); time.sleep(60)",
       "end: expected the program to end within 2 s after the last answer, seen none");
  hang(
      "ready(); ask = hear(); say({'id': 1, 'correction': rows(ask)}); os.close(1); "
      "time.sleep(60)",
      "end: expected the program to end within 2 s");
  options.response_s = 0.5;
  hang("ready(); os.close(0); time.sleep(60)", "expected a line within 0.5 s");
  hang("ready()\nwhile True: print('x' * 1000, file=sys.stderr)", "expected a line within 0.5 s");
}

TEST_F(PlugIns, AQuestionThatNobodyReadsDoesNotBlock) {
  PlugInOptions options;
  options.response_s = 0.5;
  options.batch_size = 20000;  // more than a pipe holds
  EXPECT_HAS(failure(python("ready(); time.sleep(60)"), options, 20000),
             "expected a line within 0.5 s, seen no output, and the request was not read");
  EXPECT_HAS(failure(python("ready(); sys.exit(7)"), options, 20000),
             "the end of the program, exit code 7");
}

TEST_F(PlugIns, AProgramThatStopsListeningBringsNoSignal) {
  struct sigaction before {};
  sigaction(SIGPIPE, nullptr, &before);
  EXPECT_EQ(before.sa_handler, SIG_DFL) << "the test would see nothing";
  Asked asked(2);
  asked.task.log.names = {"room_C"};
  asked.task.log.time_s = VectorXd::LinSpaced(300000, 0, 1);
  asked.task.log.values = MatrixXd::Constant(300000, 1, 20.123456789);
  const fs::path file = written("mine", "#!/bin/sh\nexit 5\n", true);
  const std::string said = thrown_text<PlugInFailure>([&] { asked.answer(file); });
  EXPECT_HAS(said, "seen the end of the program, exit code 5");
  sigset_t pending, blocked;
  sigpending(&pending);
  pthread_sigmask(SIG_SETMASK, nullptr, &blocked);
  EXPECT_EQ(sigismember(&pending, SIGPIPE), 0);
  EXPECT_EQ(sigismember(&blocked, SIGPIPE), 0);
}

TEST_F(PlugIns, AnEndlessLineIsRefusedInLittleMemory) {
  const auto megabytes = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return double(usage.ru_maxrss) / 1024;
  };
  const double before = megabytes();
  const std::string endless = "\nwhile True: sys.stdout.write('x' * 65536)";
  EXPECT_HAS(failure(python(endless)),
             "expected a line of at most 65536 bytes, seen a longer line");
  EXPECT_HAS(failure(python("ready()" + endless)), "expected a line of at most 66688 bytes");
  EXPECT_HAS(
      failure(python("ready(); ask = hear(); say({'id': 1, 'correction': rows(ask)})" + endless)),
      "expected no output after the last answer, seen 'xxx");
  EXPECT_HAS(failure(python("while True: print('ha')")), "seen 'ha'");
  std::cout << "grew by " << megabytes() - before << " MB\n";
  EXPECT_LT(megabytes() - before, 16);
}

TEST_F(PlugIns, WhatAPlugInStartedEndsWithIt) {
  const fs::path file = written("mine", R"(#!/bin/sh
sleep 60 &
echo $! > "$(dirname "$0")/pid"
exit 2
)",
                                true);
  const auto start = std::chrono::steady_clock::now();
  PlugInOptions options;
  options.start_s = 3.0;  // the sleeper holds the output open
  EXPECT_HAS(failure(file, options), "handshake: expected a line");
  EXPECT_LT(seconds_since(start), 20.0);
  long pid = 0;
  std::ifstream(folder / "pid") >> pid;
  ASSERT_GT(pid, 0);
  for (int i = 0; i < 100 && runs(pid); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_FALSE(runs(pid));
}

TEST_F(PlugIns, LastWordsAreFewAndReadable) {
  const std::string text = failure(python(R"(
for i in range(100000): print("line", i, file=sys.stderr)
sys.stderr.flush()
sys.stderr.buffer.write(b"\xff \x1b[31m gr\xc3\xbc\xc3\x9fe\n")
sys.exit(1)
)"));
  EXPECT_HAS(text,
             "line 99999\n  \xEF\xBF\xBD [31m gr\xC3\xBC\xC3\x9F"
             "e");
  EXPECT_FALSE(has(text, "line 99990"));
  EXPECT_LT(text.size(), 1500u);
  EXPECT_NO_THROW(nlohmann::json(text).dump()) << "a report can hold it";
}

TEST(PlugInLines, NoMutilatedLineIsMoreThanAFault) {
  const Asked asked(2);
  const PlugInOptions options;
  const ResponseRequirements expected{7, PlugInOutput::Correction, 2, asked.task, options};
  const std::string answer = R"({"id":7,"correction":[[0.1,-2e-3,3,0.1,0,0],[1e-5,2,0,0,0,0]]})";
  const std::string ready = R"({"abbe":1,"kind":"ready","name":"n","answers":"deviation"})";
  EXPECT_EQ(read_response(answer, expected)(0, 1), -2e-3);
  EXPECT_EQ(read_handshake(ready).output, PlugInOutput::Deviation);
  constexpr std::uint64_t seed = 815;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  const std::string bytes = "0123456789eE+-.,:[]{}\"nul \\\xff\x01";
  int refused = 0;
  const int times = 50000;
  for (int i = 0; i < times; ++i) {
    std::string line = i % 2 == 0 ? answer : ready;
    for (auto left = 1 + random() % 3; left > 0; --left) {
      const std::size_t at = random() % line.size();
      if (random() % 4 == 0)
        line.erase(at, 1 + random() % 8);
      else
        line[at] = bytes[random() % bytes.size()];
      if (line.empty()) line = "[";
    }
    try {
      if (i % 2 == 0) {
        const MatrixXd rows = read_response(line, expected);
        ASSERT_TRUE(rows.rows() == 2 && rows.cols() == 6) << line;
        ASSERT_LE(rows.leftCols(4).cwiseAbs().maxCoeff(), 10.0) << line;
      } else {
        read_handshake(line);
      }
    } catch (const ChildProcessError&) {
      ++refused;
    }
  }
  std::cout << refused << " of " << times << " refused\n";
  EXPECT_GT(refused, times / 2);
}

// --- shared libraries

constexpr const char* whole_library = R"(
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static int32_t answer(void* self, const abbe_batch* batch, double* rows, char* error) {
  (void)self; (void)batch; (void)rows; (void)error;
)";
const std::string library_end = R"(
  return 0;
}
const abbe_compensator_v1 abbe_compensator = {
    ABBE_COMPENSATOR_VERSION, ABBE_DEVIATION, "mine", NULL, answer, NULL};
)";

TEST_F(PlugIns, ASharedLibraryIsToldWhatAProgramIs) {
  const fs::path file = library(R"(
#include <math.h>
#include <stdio.h>
#include <string.h>
static const abbe_task* kept;
static int32_t open_it(void** self, const abbe_task* task, char* error) {
  (void)error;
  *self = &kept;
  kept = task;
  printf("%s %d %c %d %g %s %g %d %s %g %d\n", task->structure, task->joints, task->joint[0].name,
         task->joint[0].side, task->joint[0].point[1], task->tool, task->tool_length,
         (int)task->samples, task->reading[1], task->log[2], isnan(task->log[3]));
  return 0;
}
static int32_t answer(void* self, const abbe_batch* b, double* rows, char* error) {
  (void)error;
  if (self != &kept) return 1;
  for (int64_t i = 0; i < b->samples; ++i) {
    const double row[6] = {b->time_s[i], b->q[6 * i + 1], b->direction[6 * i + 1],
                           b->T_wt[12 * i + 11] * 1e-3, b->spindle_rpm[i] * 1e-6,
                           b->readings[2 * i] * 1e-3};
    memcpy(rows + 6 * i, row, sizeof row);
  }
  return 0;
}
static void close_it(void* self) { (void)self; printf("closed\n"); }
const abbe_compensator_v1 abbe_compensator = {
    ABBE_COMPENSATOR_VERSION, ABBE_DEVIATION, "mine", open_it, answer, close_it};
)");
  Asked asked(7);
  asked.task.log.names = {"room_C", "current_A"};
  asked.task.log.time_s = Vector2d(-60, 0.05);
  asked.task.log.values = (Eigen::Matrix2d() << 20.5, 1, 21, std::nan("")).finished();
  PlugInOptions options;
  options.batch_size = 3;
  options.max_mm = 1000;
  const PlugInResponse answer = asked.answer(file, options);
  EXPECT_EQ(answer.name, "mine");
  EXPECT_EQ(answer.output, PlugInOutput::Deviation);
  EXPECT_EQ(answer.stderr_text, "w C' b X Y Z A s t 6 C 1 -7 ball R5 90 7 current_A 21 1\nclosed");
  for (int i = 0; i < 7; ++i) {
    const kinematics::AxisState& command = asked.commands[std::size_t(i)];
    EXPECT_EQ(answer.rows(i, 0), command.time_s);
    EXPECT_EQ(answer.rows(i, 1), command.q[1]);
    EXPECT_EQ(answer.rows(i, 2), -1.0);
    EXPECT_EQ(answer.rows(i, 3), asked.T_wt[std::size_t(i)].translation().z() * 1e-3);
    EXPECT_NEAR(answer.rows(i, 4), 2.9985e-3, 1e-6);
    EXPECT_EQ(answer.rows(i, 5), (i == 0 ? 20.5 : 21) * 1e-3);
  }
}

TEST_F(PlugIns, FaultsOfASharedLibraryAreNamed) {
  const auto fault = [&](const std::string& body, const std::string& says) {
    PlugInOptions options;
    if (has(body, "for (;;)")) options.response_s = 0.5;
    const std::string text = failure(library(whole_library + body + library_end), options);
    EXPECT_HAS(text, says);
    std::cout << text.substr(folder.string().size() + 1) << "\n";
  };
  fault(
      "*(volatile int*)0 = 1;",
      "mine.so: batch 1 (samples 1 to 3): expected a line, seen the end of the program, signal 11");
  fault("abort();", "seen the end of the program, signal 6 (Aborted)");
  fault("exit(9);", "seen the end of the program, exit code 9");
  fault("for (;;) {}", "expected a line within 0.5 s, seen no output");
  fault("rows[0] = 1;", "expected a finite number, seen null in row 1, EY");
  fault("snprintf(error, ABBE_ERROR_BYTES, \"no table for %d\", 7); return 1;",
        "expected no error, seen no table for 7");
  fault("return 5;", "expected no error, seen answer returned 5");
  fault("memset(error, 'x', ABBE_ERROR_BYTES); return 1;", "expected no error, seen xxx");
}

TEST_F(PlugIns, ASharedLibraryOfAnotherVersionIsRefused) {
  EXPECT_HAS(failure(library("const abbe_compensator_v1 abbe_compensator = {7, 0, 0, 0, 0, 0};")),
             "expected version 1 of abbe_compensator.h, seen 7");
  EXPECT_HAS(failure(library("const abbe_compensator_v1 abbe_compensator = {1, 5, 0, 0, 0, 0};")),
             "expected answers = ABBE_CORRECTION or ABBE_DEVIATION, seen 5");
  EXPECT_HAS(failure(library("const abbe_compensator_v1 abbe_compensator = {1, 0, 0, 0, 0, 0};")),
             "expected a function answer, seen NULL");
  EXPECT_HAS(failure(library("int mine;")),
             "expected the object abbe_compensator of abbe_compensator.h, seen none");
}

TEST_F(PlugIns, AHostThatIsNoneIsNamedAndStartsNoOther) {
  const fs::path file = library(whole_library + library_end);
  PlugInOptions options;
  options.host = "/bin/echo";
  EXPECT_HAS(failure(file, options), "expected a JSON object on one line, seen 'plug-in-host /");
  ::setenv("ABBE_PLUG_IN_HOST", "1", 1);
  const std::string text = failure(file);
  ::unsetenv("ABBE_PLUG_IN_HOST");
  EXPECT_HAS(text,
             "expected a host whose main calls plug_in_host first, seen a host that does not");
}

// --- the examples

const fs::path source = ABBE_SOURCE_DIR;

TEST_F(PlugIns, TheSessionOfTheReadmeIsWordForWord) {
  std::ifstream readme(source / "sim/compensation/README.md");
  ChildProcess program({source / "scenes/compensators/mirror.py"});
  std::string line, asked;
  int answers = 0;
  while (std::getline(readme, line)) {
    if (line.rfind("> ", 0) == 0) asked = line.substr(2) + "\n";
    if (line.rfind("< ", 0) != 0) continue;
    ++answers;
    const auto seen = nlohmann::json::parse(program.exchange(asked, {}));
    const auto expected = nlohmann::json::parse(line.substr(2));
    if (!expected.contains("deviation")) {
      EXPECT_EQ(seen, expected);
      continue;
    }
    ASSERT_EQ(seen["deviation"].size(), expected["deviation"].size());
    for (std::size_t i = 0; i < expected["deviation"].size(); ++i)
      for (std::size_t j = 0; j < 6; ++j)
        EXPECT_NEAR(seen["deviation"][i][j].get<double>(),
                    expected["deviation"][i][j].get<double>(), 1e-15);
  }
  EXPECT_EQ(answers, 3);
  EXPECT_EQ(asked, "{\"kind\":\"end\"}\n");
  program.finish(asked, 10);
}

TEST_F(PlugIns, TheMirrorBelievesWhatTheChainSaysOfSuchASpindle) {
  Asked asked(50);
  const kinematics::Chain chain = machines::gantry();
  kinematics::JointDeviation nose;
  nose.motion << 0.003, -0.002, 0.005, 12e-6, -15e-6, 0;
  std::vector<kinematics::JointDeviation> deviations(5);
  deviations.push_back(nose);
  const PlugInResponse answer = asked.answer(source / "scenes/compensators/mirror.py");
  ASSERT_EQ(answer.output, PlugInOutput::Deviation);
  double largest = 0.0;
  for (std::size_t i = 0; i < asked.commands.size(); ++i) {
    const kinematics::Pose E = kinematics::error_transform(
        asked.T_wt[i], chain.tool_in_workpiece(asked.commands[i].q, deviations));
    Eigen::Matrix<double, 6, 1> expected;
    expected << E.translation(), kinematics::rotation_vector(E.linear());
    largest = std::max(largest, (answer.rows.row(Index(i)).transpose() - expected).norm());
  }
  std::cout << "mirror.py and the chain differ by " << largest * 1e6 << " nm\n";
  EXPECT_LT(largest, 1e-7);  // mm; the second order of 20 urad over 90 mm is 2e-8
}

TEST_F(PlugIns, TheTableIsTheSameAsProgramAndAsLibrary) {
  std::ifstream readme(source / "sim/compensation/README.md");
  std::string line, command;
  while (std::getline(readme, line))
    if (has(line, "    cc ")) command = line.substr(line.find("cc ") + 3);
  const std::string output = "-o table.so";
  ASSERT_TRUE(has(command, output)) << "the README says how a library is made";
  command.replace(command.find(output), output.size(),
                  "-o '" + (folder / "table.so").string() + "'");
  command = "cd '" + source.string() +
            "' && " ABBE_C_COMPILER " -Wall -Wextra -Wpedantic -Werror " + command;
  ASSERT_EQ(std::system(command.c_str()), 0) << command;

  Asked asked(1500);
  const double awkward[] = {-300, 300, -1e9, 1e9, 0, 1e-12, -1e-12, 100, -50, 350, 50};
  for (std::size_t i = 0; i < std::size(awkward); ++i) asked.commands[i].q.setConstant(awkward[i]);
  const PlugInResponse program = asked.answer(source / "scenes/compensators/table.py");
  const PlugInResponse as_library = asked.answer(folder / "table.so");
  EXPECT_EQ(program.name, "laser table");
  EXPECT_EQ(as_library.name, "laser table");
  EXPECT_EQ(program.rows, as_library.rows) << "bit for bit";
  EXPECT_DOUBLE_EQ(program.rows(0, 1), -0.006);
  EXPECT_DOUBLE_EQ(program.rows(1, 1), 0.0102);
  EXPECT_DOUBLE_EQ(program.rows(3, 3), 0.0103);
  EXPECT_EQ(program.rows(0, 0), 0.0) << "C has no table";
}

}  // namespace
}  // namespace abbe::sim::compensation

/// The tests are their own host of shared libraries.
int main(int argc, char** argv) {
  if (const auto code = abbe::sim::compensation::plug_in_host(argc, argv)) return *code;
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
