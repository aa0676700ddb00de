#include "sim/study/run_study.h"

#include <chrono>
#include <iostream>
#include <memory>
#include <random>
#include <sstream>
#include <stdexcept>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <gtest/gtest.h>

#include "tests/study/farm_runs.h"

namespace abbe::sim::study {
namespace {

namespace fs = std::filesystem;

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
