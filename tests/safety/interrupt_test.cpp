#include <fcntl.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <csignal>
#include "sim/files/output.h"
#include "tests/safety/every_command.h"
#include "tests/test.h"

/// SIGINT and SIGTERM at random moments of every command: it ends with 130 within a second.
namespace abbe::safety {
namespace {

constexpr double longest_s = 1.0;  // of the processor, from the signal to the end

/// A loop of three million blocks in each dialect, a fraction of which is read before the signal.
const std::map<std::string, std::string> long_loops{
    {"linuxcnc.ngc",
     "G21 G90 G94\n#1=0\no1 while [#1 LT 3000000]\nG1 X[#1 MOD 100] F1000\n#1=[#1+1]\no1 "
     "endwhile\nM2\n"},
    {"fanuc.nc",
     "%\nO1000\nG21 G90 G94\n#1=0\nWHILE[#1LT3000000]DO1\nG1X[#1/100000]F1000\n#1=#1+1\nEND1\n"
     "M30\n%\n"},
    {"siemens.mpf",
     "G71 G90 G94\nR1=0\nWHILE R1<3000000\nG1 X=R1/100000 F1000\nR1=R1+1\nENDWHILE\nM30\n"},
    {"heidenhain.h",
     "0 BEGIN PGM LONG MM\n1 Q1 = 0\n2 LBL 1\n3 Q1 = Q1 + 1\n4 Q2 = Q1 / 100000\n5 L X+Q2 F1000\n"
     "6 FN 12: IF +Q1 LT +3000000 GOTO LBL 1\n7 END PGM LONG MM\n"}};

/// A sheet of ripples, 2 n^2 triangles, in binary STL.
void write_sheet(const fs::path& file, int n) {
  std::ofstream out(file, std::ios::binary);
  const std::string head(80, ' ');
  const auto count = std::uint32_t(2 * n * n);
  out.write(head.data(), 80).write(reinterpret_cast<const char*>(&count), 4);
  const auto corner = [&](int i, int j) {
    const double x = 60.0 * i / n - 30.0, y = 60.0 * j / n - 30.0;
    return std::array<float, 3>{float(x), float(y), float(80.0 + std::sin(0.3 * x + 0.2 * y))};
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (const auto& t : {std::array{corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)},
                            std::array{corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)}}) {
        const std::array<float, 3> normal{0, 0, 1};
        const std::uint16_t none = 0;
        out.write(reinterpret_cast<const char*>(normal.data()), 12)
            .write(reinterpret_cast<const char*>(t.data()), 36)
            .write(reinterpret_cast<const char*>(&none), 2);
      }
}

void write_long_inputs(const Folder& folder) {
  write_inputs(folder);
  for (const auto& [name, text] : long_loops) folder.write(name, text);
  std::string cl = "UNITS/MM\nMULTAX/ON\nFEDRAT/1000,MMPM\n", table = "x_mm,y_mm,z_mm,i,j,k\n";
  for (int i = 0; i < 300'000; ++i) {
    cl += fmt::format("GOTO/{},{},90,0,0,1\n", i % 100, i % 77);
    table += fmt::format("{},{},90,0,0,1\n", i % 100, i % 77);
  }
  folder.write("long.cls", cl);
  folder.write("long_cl.csv", table);
  write_sheet(folder / "sheet.stl", 500);
  folder.write("sheet.toml",
               small_scene().replace(small_scene().find("[part]"),
                                     small_scene().find("[program]") - small_scene().find("[part]"),
                                     "[part]\nfile = \"sheet.stl\"\nopen = true\n"));
}

std::string shipped(const std::string& scene) { return (source / "scenes" / scene).string(); }

/// Calls that take seconds, and with those of `small_calls` all commands.
std::vector<CommandCall> long_calls() {
  const std::string dome = gantry_dome_scene(), dense = " --set part.vertices=200000";
  const std::string machine = " --machine library:gantry_cxyza --tool-length 100";
  std::vector<CommandCall> calls = small_calls();
  for (const auto& [name, text] : long_loops) calls.push_back({"program", name + machine});
  const std::vector<CommandCall> more{
      {"program", "linuxcnc.ngc --to csv" + machine},
      {"program", "long.cls" + machine},
      {"run", dome + dense},
      {"run", dome + dense + " --case perfect-iterated-ideal"},
      {"run", "sheet.toml"},
      {"run", shipped("gantry_force.toml") + " --set cutting.spacing_mm=0.2"},
      {"run", shipped("stepped_shaft.toml") + " --set part.vertices=50000"},
      {"check", dome + dense + " --collisions"},
      {"check", shipped("clamped_dome.toml") + " --collisions"},
      {"check", "sheet.toml"},
      {"compare", dome + " --report"},
      {"report", dome},
      {"pose", dome + " --grid \"X=-200:200:150 Y=-200:200:150 Z=::8\""},
      {"measure", shipped("gantry_calibration.toml")},
      {"identify", "calibration/*.csv --choose-orders"},
      {"rewrite", dome + " --case perfect-iterated-program"},
      {"export", shipped("gantry_channels.toml") + " --case perfect-position-table"},
      {"study", shipped("studies/gantry_dome_budget.toml")}};
  calls.insert(calls.end(), more.begin(), more.end());
#if ABBE_RENDER
  calls.push_back({"check", dome + dense + " --picture"});
  calls.push_back({"animate", dome + " --film none --seconds 4"});
#endif
  return calls;
}

/// The program in a process of its own, on one processor, so that its time there is that of a
/// person who waits, whatever else the computer does.
class Interruptible {
 public:
  Interruptible(const Folder& folder, const std::string& line) {
    const std::string command = "exec " ABBE_PROGRAM " " + line;
    const int cpu = std::max(0, ::sched_getcpu());
    pid_ = ::fork();
    if (pid_ != 0) return;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(std::size_t(cpu), &one);
    ::sched_setaffinity(0, sizeof one, &one);
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
    const int log = ::open((folder / "log").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (::chdir(folder.path().c_str()) != 0 || ::dup2(log, 1) < 0 || ::dup2(log, 2) < 0)
      ::_exit(126);
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  ~Interruptible() {
    if (!has_ended()) ::kill(pid_, SIGKILL), wait();
  }
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  bool has_ended() {
    if (!ended_ && ::wait4(pid_, &status_, WNOHANG, &usage_) == pid_) ended_ = true;
    return ended_;
  }
  void wait() {
    if (!ended_) ::wait4(pid_, &status_, 0, &usage_);
    ended_ = true;
  }
  void signal(int number) const { ::kill(pid_, number); }
  int code() const { return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_); }

  /// s of the processor that it has used so far, in hundredths.
  double used_s() const {
    if (ended_)
      return double(usage_.ru_utime.tv_sec + usage_.ru_stime.tv_sec) +
             1e-6 * double(usage_.ru_utime.tv_usec + usage_.ru_stime.tv_usec);
    std::ifstream in(fmt::format("/proc/{}/stat", pid_));
    std::string text{std::istreambuf_iterator<char>(in), {}};
    std::istringstream fields(text.substr(std::min(text.rfind(')') + 1, text.size())));
    std::string skipped;
    double user = 0.0, system = 0.0;
    for (int i = 0; i < 11; ++i) fields >> skipped;
    fields >> user >> system;
    return (user + system) / double(::sysconf(_SC_CLK_TCK));
  }

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
  rusage usage_{};
};

std::string unfinished_below(const fs::path& folder) {
  std::string names;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().filename().string().starts_with(".unfinished"))
      names += fs::relative(entry.path(), folder).string() + " ";
  return names;
}

/// Returns why a later run would not take one of the default folders; empty if it takes all.
/// `identify` writes into `out` itself, the other commands into folders below it.
std::string refused_folders(const fs::path& out) {
  std::string text;
  if (!fs::exists(out)) return text;
  std::vector<fs::path> folders{out};
  if (!fs::exists(out / sim::manifest_name))
    folders.assign(fs::directory_iterator(out), fs::directory_iterator());
  for (const fs::path& folder : folders) try {
      sim::check_folder(folder, {});
    } catch (const sim::OutputFailure& failure) {
      text += failure.what();
    }
  return text;
}

TEST(Interrupts, EveryCommandEndsWithinASecondWheneverItIsAsked) {
  const CommandList list;
  const std::vector<CommandCall> calls = long_calls();
  ASSERT_EQ(uncalled(list.commands, calls), "");
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  const char* given = std::getenv("ABBE_SEED");
  const std::uint64_t seed = given != nullptr ? std::stoull(given) : std::random_device{}();
  std::cout << "seed " << seed << " (ABBE_SEED sets it)\n";
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> moment(0.0, is_long ? 4.0 : 1.0);
  const Folder folder;
  write_long_inputs(folder);
  ASSERT_EQ(run("measure " + shipped("gantry_calibration.toml") + " --out calibration",
                "cd " + folder.path().string() + " &&")
                .code,
            0);
  double worst_s = 0.0;
  std::string worst;
  int interrupted = 0;
  for (const CommandCall& call : calls)
    for (int i = 0; i < (is_long ? 20 : 1); ++i) {
      for (const char* made : {"first", "out"}) fs::remove_all(folder / made);
      const double at_s = moment(random);
      const int number = random() % 2 == 0 ? SIGINT : SIGTERM;
      const std::string line = call.command + " " + call.arguments;
      Interruptible process(folder, line);
      while (!process.has_ended() && process.used_s() < at_s)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      if (process.has_ended()) {
        EXPECT_EQ(process.code(), 0) << line << ": " << bytes(folder / "log");
        continue;
      }
      const double before_s = process.used_s();
      process.signal(number);
      process.wait();
      const double took_s = process.used_s() - before_s;
      const bool was_over = process.code() == 0 && took_s < longest_s;
      // its libraries are loaded before it can watch for signals
      const bool had_not_begun = process.code() == -number && before_s < 0.3;
      EXPECT_TRUE(process.code() == 130 || was_over || had_not_begun)
          << line << ": " << process.code() << " " << bytes(folder / "log");
      EXPECT_LT(took_s, longest_s) << line << ", signal " << number << " after " << at_s << " s";
      EXPECT_EQ(unfinished_below(folder.path()), "") << line;
      EXPECT_EQ(refused_folders(folder / "out"), "") << line;
      interrupted += process.code() == 130;
      if (took_s > worst_s) {
        worst_s = took_s;
        worst = line;
      }
    }
  std::cout << interrupted << " calls interrupted; the slowest took " << worst_s << " s: " << worst
            << "\n";
  EXPECT_GT(interrupted, 15);
}

}  // namespace
}  // namespace abbe::safety
