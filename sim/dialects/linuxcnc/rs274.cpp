#include "sim/dialects/linuxcnc/rs274.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/linuxcnc/rs274_commands.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/files/program_file.h"

namespace abbe::sim::dialects {

/// A new folder inside the system's temporary folder that only this run uses; the destructor
/// removes it.
class PrivateFolder {
 public:
  /// Throws BadInput if no folder can be made.
  PrivateFolder();
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// How the interpreter process ended.
struct InterpreterExit {
  enum class ExitReason { Exit, Signal, Time, Bytes, Stopped } why = ExitReason::Exit;
  int number = 0;    ///< exit code or signal number, by `why`
  std::string said;  ///< start of its stderr, at most 64 kB
};

/// Runs rs274 in `folder`, which is its home and working directory and contains `machine.ini`,
/// `tool.tbl`, `numbers.var` and the file `program` (a relative path). The process inherits neither
/// our environment nor our open files, may write files of at most 16 MB and may use at most 4 GB of
/// memory. `take` is called with each line of its output as it is written, without the line end,
/// and returns false to end the run. An exception from `take` propagates once the process has been
/// ended. Throws BadInput if the process cannot be started.
InterpreterExit run_rs274(const std::filesystem::path& packages,
                          const std::filesystem::path& folder, const std::string& program,
                          const InterpreterLimits& limits,
                          const std::function<bool(std::string_view line)>& take);

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr rlim_t max_written = rlim_t(16) << 20;  // bytes of each file that it writes
constexpr rlim_t max_memory = rlim_t(4) << 30;    // bytes
constexpr std::size_t max_said = 65536;           // bytes of stderr that are read
constexpr std::size_t longest_line = 1 << 20;     // bytes; its longest command has a few hundred
constexpr std::size_t chunk = 1 << 18;            // bytes read at a time
constexpr int commands_file = 3;  // file descriptor to which it writes canonical commands

/// A pipe whose open ends are closed by the destructor.
struct PipeEnds {
  std::array<int, 2> ends{-1, -1};
  PipeEnds() {
    if (pipe2(ends.data(), O_CLOEXEC) != 0)
      throw BadInput("rs274", 0, 0, "a pipe for its commands", std::strerror(errno));
    fcntl(ends[0], F_SETPIPE_SZ, 1 << 20);  // saves context switches; failure does no harm
    // A blocking read could outlast the time limit.
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
  }
  ~PipeEnds() {
    close_end(0);
    close_end(1);
  }
  void close_end(int k) {
    if (int& end = ends[std::size_t(k)]; end >= 0) ::close(std::exchange(end, -1));
  }
};

// Debian keeps libraries in one folder per architecture, such as x86_64-linux-gnu.
std::string library_path(const fs::path& root) {
  std::string path = "root/usr/lib";
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(root / "usr/lib", failure))
    if (entry.path().filename().string().ends_with("-linux-gnu"))
      path += ":root/usr/lib/" + entry.path().filename().string();
  return path;
}

// rs274 links Python, which does not start without its standard library.
bool has_python(const fs::path& lib) {
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(lib, failure))
    if (entry.path().filename().string().starts_with("python3.") &&
        fs::is_directory(entry.path() / "encodings", failure))
      return true;
  return false;
}

/// Returns the environment of the process. Library paths are links in its folder, because the real
/// paths may contain blanks or colons, which separate entries.
std::vector<std::string> environment_of(const fs::path& packages, const fs::path& folder) {
  std::vector<std::string> all = {
      "HOME=" + folder.string(),    "LC_ALL=C",
      "PATH=/usr/bin:/bin",         "PYTHONDONTWRITEBYTECODE=1",
      "LD_PRELOAD=./all_digits.so", "LD_LIBRARY_PATH=" + library_path(packages)};
  // The unpacked packages include Python, which is used only if the system has none.
  if (has_python(packages / "usr/lib") && !has_python("/usr/lib"))
    all.push_back("PYTHONHOME=" + (folder / "root/usr").string());
  return all;
}

std::vector<char*> exec_pointers(std::vector<std::string>& texts) {
  std::vector<char*> all;
  for (std::string& text : texts) all.push_back(text.data());
  all.push_back(nullptr);
  return all;
}

void limit(int resource, rlim_t most) {
  const rlimit both{most, most};
  setrlimit(resource, &both);
}

/// Runs in the child between fork and exec, where only async-signal-safe functions may be called.
[[noreturn]] void exec_in_child(const char* folder, char* const* arguments,
                                char* const* environment, int commands, int said) {
  sigset_t none;
  sigemptyset(&none);
  // An ignored or blocked signal of abbe would survive exec.
  for (int number = 1; number < NSIG; ++number) signal(number, SIG_DFL);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  // In a process group of its own its children can be ended with it. If abbe dies, so does the
  // process.
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  limit(RLIMIT_FSIZE, max_written);
  limit(RLIMIT_AS, max_memory);
  limit(RLIMIT_CORE, 0);
  const int nothing = open("/dev/null", O_RDWR);
  const bool ready = chdir(folder) == 0 && dup2(nothing, 0) == 0 && dup2(nothing, 1) == 1 &&
                     dup2(said, 2) == 2 && dup2(commands, commands_file) == commands_file;
  if (ready) {
    // The process must not keep a file of abbe open.
    close_range(commands_file + 1, ~0u, 0);
    execve(arguments[0], arguments, environment);
  }
  _exit(127);
}

/// The running process. The destructor ends it and its children.
class InterpreterProcess {
 public:
  InterpreterProcess(const fs::path& packages, const fs::path& folder, const std::string& program)
      : said_(folder / "said.txt") {
    std::vector<std::string> arguments = {(packages / "usr/bin/rs274").string(),
                                          "-i",
                                          "machine.ini",
                                          "-t",
                                          "tool.tbl",
                                          "-v",
                                          "numbers.var",
                                          "-g",
                                          program,
                                          "/dev/fd/3"};
    std::vector<std::string> environment = environment_of(packages, folder);
    const std::vector<char*> argv = exec_pointers(arguments), envp = exec_pointers(environment);
    const std::string home = folder.string();
    // Duplicated to numbers above 0 to 3, which dup2 overwrites in the child.
    const int said = fcntl(open(said_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600),
                           F_DUPFD_CLOEXEC, 10);
    const int commands = fcntl(pipe_.ends[1], F_DUPFD_CLOEXEC, 10);
    pid_ = said < 0 || commands < 0 ? -1 : fork();
    if (pid_ == 0) exec_in_child(home.c_str(), argv.data(), envp.data(), commands, said);
    const int failure = errno;
    ::close(said);
    ::close(commands);
    pipe_.close_end(1);
    if (pid_ < 0) throw BadInput("rs274", 0, 0, "that it can be started", std::strerror(failure));
  }
  ~InterpreterProcess() { end(); }
  InterpreterProcess(const InterpreterProcess&) = delete;
  InterpreterProcess& operator=(const InterpreterProcess&) = delete;

  int commands() const { return pipe_.ends[0]; }
  std::string said() const {
    std::ifstream in(said_, std::ios::binary);
    std::string text(max_said, '\0');
    in.read(text.data(), std::streamsize(text.size()));
    text.resize(std::size_t(in.gcount()));
    return text;
  }
  /// Waits for the end of the process, at most until the deadline. Returns its exit status; empty
  /// if it is still running.
  std::optional<int> ended_before(Clock::time_point deadline) {
    for (;;) {
      siginfo_t info{};
      // WNOWAIT leaves the process a zombie, so that its number cannot be reused before `end`.
      const int failed = waitid(P_PID, id_t(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
      if (failed == 0 && info.si_pid == pid_) return end();
      if (Clock::now() >= deadline) return std::nullopt;
      poll(nullptr, 0, 1);
    }
  }
  /// Ends the process group before its number can be reused, and returns the exit status.
  int end() {
    if (pid_ <= 0) return status_;
    ::kill(-pid_, SIGKILL);
    ::kill(pid_, SIGKILL);
    while (::waitpid(pid_, &status_, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return status_;
  }

 private:
  PipeEnds pipe_;
  fs::path said_;
  pid_t pid_ = -1;
  int status_ = -1;
};

void link(const fs::path& target, const fs::path& name) {
  std::error_code failure;
  fs::create_symlink(target, name, failure);
  if (failure) throw BadInput(name.string(), 0, 0, "a link in a folder", failure.message());
}

int milliseconds_to(Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return int(std::clamp<long long>(left, 0, 1'000'000'000));
}

/// Cuts a stream of text into lines and passes each to `take`.
class LineCutter {
 public:
  explicit LineCutter(const std::function<bool(std::string_view)>& take) : take_(take) {}
  /// Adds text. Returns false if `take` wants no more lines.
  bool add(std::string_view piece) {
    for (std::size_t end; (end = piece.find('\n')) != std::string_view::npos;
         piece.remove_prefix(end + 1)) {
      const std::string_view whole = piece.substr(0, end);
      const bool more = rest_.empty() ? take_(whole) : take_(rest_ += whole);
      rest_.clear();
      if (!more) return false;
    }
    // A line longer than any command is truncated, so that it cannot fill the memory.
    rest_ += piece.substr(0, longest_line - std::min(rest_.size(), longest_line));
    return true;
  }

 private:
  const std::function<bool(std::string_view)>& take_;
  std::string rest_;
};

}  // namespace

PrivateFolder::PrivateFolder() {
  std::string name = (fs::temp_directory_path() / "abbe_rs274_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr)
    throw BadInput(name, 0, 0, "a temporary folder", std::strerror(errno));
  path_ = name;
}

PrivateFolder::~PrivateFolder() {
  std::error_code failure;
  fs::remove_all(path_, failure);
}

InterpreterExit run_rs274(const fs::path& packages, const fs::path& folder,
                          const std::string& program, const InterpreterLimits& limits,
                          const std::function<bool(std::string_view line)>& take) {
  // LD_PRELOAD and LD_LIBRARY_PATH cannot express paths with blanks or colons; links avoid them.
  link(all_digits_library(), folder / "all_digits.so");
  link(packages, folder / "root");
  const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(limits.seconds));
  InterpreterProcess process(packages, folder, program);
  LineCutter lines(take);
  std::string buffer(chunk, '\0');
  double bytes = 0.0;
  const auto ended = [&](InterpreterExit::ExitReason why) {
    process.end();
    return InterpreterExit{why, 0, process.said()};
  };
  for (;;) {
    // The clock is checked beside the timeout of poll, which never expires while the process keeps
    // printing.
    pollfd file{process.commands(), POLLIN, 0};
    if (poll(&file, 1, milliseconds_to(deadline)) == 0 || Clock::now() >= deadline)
      return ended(InterpreterExit::ExitReason::Time);
    const ssize_t read = ::read(process.commands(), buffer.data(), buffer.size());
    if (read < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (read <= 0) break;
    bytes += double(read);
    if (!lines.add({buffer.data(), std::size_t(read)}))
      return ended(InterpreterExit::ExitReason::Stopped);
    if (bytes > 1e6 * limits.megabytes) return ended(InterpreterExit::ExitReason::Bytes);
  }
  const auto status = process.ended_before(deadline);
  if (!status) return ended(InterpreterExit::ExitReason::Time);
  if (WIFSIGNALED(*status))
    return {InterpreterExit::ExitReason::Signal, WTERMSIG(*status), process.said()};
  return {InterpreterExit::ExitReason::Exit, WEXITSTATUS(*status), process.said()};
}

namespace {

using kinematics::AxisVector;
using linuxcnc::Commands;
using linuxcnc::NumberedProgram;
using program::NcOptions;

constexpr std::string_view six_letters = "XYZABC";
constexpr std::size_t max_tools = 1000;  // size of the tool table of rs274

// rs274 reads tables and parameters in inches, on a metric machine too, and converts them with this
// factor. With 1 / 25.4 lengths would not come back as given.
constexpr double inches_of_mm = 0.03937007874016;

void write_whole(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  if (!out.write(text.data(), std::streamsize(text.size())).flush())
    throw BadInput(file.string(), 0, 0, "a file that can be written", "a failure");
}

std::string machine_text() {
  return "[EMC]\nVERSION = 1.1\n[RS274NGC]\nPARAMETER_FILE = numbers.var\n"
         "SUBROUTINE_PATH = program\n[TRAJ]\nCOORDINATES = X Y Z A B C\nLINEAR_UNITS = mm\n"
         "ANGULAR_UNITS = deg\n";
}

/// Returns a tool table with the tools that are known or called, filled up with the other numbers
/// to 999, because a call with a computed number may refer to any of them. A length or radius that
/// is not known gets a placeholder, which is rejected where a program uses it.
std::string tool_table(const NcOptions& control, const std::set<int>& called,
                       const ProgramRun& run) {
  std::set<int> tools = called;
  for (const auto* all : {&control.tool_length, &control.tool_radius})
    for (const auto& [number, mm] : *all)
      if (number > 0) tools.insert(number);
  if (tools.size() > max_tools)
    run.canon.refuse({}, fmt::format("at most {} tools for LinuxCNC's own interpreter", max_tools),
                     fmt::format("{}", tools.size()));
  // The table has no room for more.
  for (int n = 1; n < int(max_tools) && tools.size() < max_tools; ++n) tools.insert(n);
  const auto known = [](const std::map<int, double>& all, int tool, double otherwise) {
    const auto found = all.find(tool);
    return (found == all.end() ? otherwise : found->second) * inches_of_mm;
  };
  const auto length = [&](int tool) {
    const kinematics::Chain* to_tip = chain_to_tip(control, tool);
    if (!run.is_turning() || to_tip == nullptr || !control.tool_length.contains(tool))
      return fmt::format("Z{:.17g}", known(control.tool_length, tool, linuxcnc::unknown_length));
    const kinematics::AxisVector offset = measured_offset(run.canon, *to_tip, {});
    std::string words;
    for (const char letter : {'X', 'Y', 'Z'})
      if (const int j = run.canon.joint_of(letter); j >= 0)
        words += fmt::format("{}{:.17g} ", letter, offset[j] * inches_of_mm);
    return words;
  };
  std::string text;
  int place = 0;
  for (const int tool : tools)
    text += fmt::format("T{} P{} {} D{:.17g}\n", tool, ++place, length(tool),
                        // D is a diameter.
                        2 * known(control.tool_radius, tool, linuxcnc::unknown_radius));
  return text;
}

/// Returns the parameter file with the origins of the nine coordinate systems: those of the scene
/// plus `zero`.
std::string parameter_text(const program::Canon& canon, const Eigen::Vector3d& zero) {
  std::string text = "5220\t1\n";
  for (std::size_t i = 0; i < 9; ++i) {
    const kinematics::AxisVector& offset = program::work_offset(canon.options(), int(i) + 1);
    for (std::size_t k = 0; k < 6; ++k) {
      const int j = canon.joint_of(six_letters[k]);
      double value = k < 3 ? zero[Eigen::Index(k)] : 0.0;
      if (j >= 0 && offset.size() > 0)
        value += canon.is_linear(j) ? offset[j] : offset[j] / units::deg;
      if (value != 0.0)
        text +=
            fmt::format("{}\t{:.17g}\n", 5221 + 20 * i + k, k < 3 ? value * inches_of_mm : value);
    }
  }
  return text;
}

/// Returns the lines that move rs274 from zero to the initial position of the machine.
std::string lead_in(const program::Canon& canon) {
  std::string words;
  for (const char letter : six_letters)
    if (const int j = canon.joint_of(letter); j >= 0 && canon.position()[j] != 0.0)
      words += fmt::format(" {}{:.17f}", letter,
                           canon.position()[j] / (canon.is_linear(j) ? 1.0 : units::deg));
  return words.empty() ? "" : "G53 G0" + words + "\nG80\n";
}

/// Throws BadInput if the program sets origins although those of the scene are points of the
/// workpiece (`zero` is not 0): rs274 would take the ones from the program as axis positions.
void refuse_systems(const NumberedProgram& program, const ProgramRun& run,
                    const Eigen::Vector3d& zero, program::Canon& canon) {
  if (zero.isZero(0.0)) return;
  for (int number = 1; number <= program.last(); ++number) {
    const linuxcnc::LineCodes codes = linuxcnc::parse_codes(program.text_of(number));
    const bool states = codes.data && (codes.data_kind == 2 || codes.data_kind < 0);
    if (!states && !codes.system) continue;
    const auto [file, line] = program.place_of(number);
    canon.set_line(line, file);
    run.canon.refuse({0, program.text_of(number)},
                     "neither G10 L2 nor #5221 to #5390 for LinuxCNC's own interpreter on a "
                     "machine with rotary axes whose work offset the scene states");
  }
}

// Messages before "executing" come from the start of the interpreter, not from the program.
std::vector<std::string> error_lines(const std::string& said) {
  std::vector<std::string> lines;
  Lines all(said);
  while (const auto line = all.next()) {
    if (*line == "executing")
      lines.clear();
    else if (!line->empty())
      lines.emplace_back(*line);
  }
  return lines;
}

int number_behind(std::string_view text, std::string_view word) {
  const std::size_t at = text.find(word);
  int number = 0;
  if (at != std::string_view::npos)
    std::from_chars(text.data() + at + word.size(), text.data() + text.size(), number);
  return number;
}

/// Returns the input error for a message of rs274. Its place is the block that rs274 prints after
/// the message, or the line that the message itself names.
BadInput rs274_error(const std::string& said, const NumberedProgram& program, ProgramRun& run) {
  std::vector<std::string> lines = error_lines(said);
  std::string message = lines.empty() ? "no message" : lines.front();
  const std::string block = lines.size() > 1 ? lines.back() : std::string();
  for (std::size_t i = 1; i + 1 < lines.size(); ++i) message += " " + lines[i];
  std::string file = program.name();
  if (const std::size_t at = message.find("file:"); at != std::string::npos) {
    const std::size_t from = at + 5, length = message.find(' ', from) - from;
    file = fs::path(message.substr(from, length)).filename().string();
    // The name of the private folder means nothing to the user.
    message.replace(from, length, file);
  }
  int number = block.starts_with("N") ? number_behind(block, "N") : 0;
  if (const int line = number_behind(message, "from line: "); line > 0)
    number = program.number_of(file, line);
  if (number > 0) {
    const linuxcnc::SourceLine place = program.place_of(number);
    run.canon.set_line(location.line, location.file);
  }
  const program::NcLocation location = run.canon.place();
  return {location.file, location.line, 0, "a block that LinuxCNC's own interpreter takes", message};
}

void check_interpreter_exit(const InterpreterExit& end, const InterpreterLimits& limits,
                            const NumberedProgram& program, ProgramRun& run) {
  const auto add = [&](std::string expected, std::string seen) {
    const program::NcLocation location = run.canon.place();
    run.add_input_error(BadInput(location.file, location.line, 0, std::move(expected), std::move(seen)));
  };
  using ExitReason = InterpreterExit::ExitReason;
  if (end.why == ExitReason::Time)
    add(fmt::format("an end of LinuxCNC's own interpreter within {} s", limits.seconds),
        "none: a loop without end, or a program that takes longer");
  else if (end.why == ExitReason::Bytes)
    add(fmt::format("at most {} MB of commands of LinuxCNC's own interpreter", limits.megabytes),
        "more: a loop without end, or too many repeats");
  else if (end.why == ExitReason::Signal && end.number == SIGXFSZ)
    add("at most 16 MB of messages of LinuxCNC's own interpreter", "more");
  else if (end.why == ExitReason::Signal)
    add("that LinuxCNC's own interpreter ends by itself",
        fmt::format("signal {} ({})", end.number, strsignal(end.number)));
  // 127 is the code with which the child exits if exec fails.
  else if (end.why == ExitReason::Exit && end.number == 127)
    add("that rs274 can be started", in_quotes(end.said));
  else if (end.why == ExitReason::Exit && end.number != 0)
    run.add_input_error(rs274_error(end.said, program, run));
}

fs::path packages_or_refuse(const ProgramRun& run) {
  if (auto packages = find_linuxcnc()) return *packages;
  throw BadInput(run.canon.place().file, 0, 0,
                 "LinuxCNC's own interpreter, which ./abbe setup --linuxcnc unpacks beside the "
                 "build, or ABBE_LINUXCNC=FOLDER with usr/bin/rs274 in it",
                 "none");
}

}  // namespace

void read_by_linuxcnc(std::string_view text, const Recognised& found, ProgramRun& run) {
  const std::string file = run.canon.place().file;
  if (found.dialect != Dialect::LinuxCnc)
    throw BadInput(
        file, found.line, 0, "a program of LinuxCNC beside interpreter = \"linuxcnc\"",
        std::string(name_of(found.dialect)) + (found.sign.empty() ? "" : ", as " + found.sign));
  const fs::path packages = packages_or_refuse(run);
  const Eigen::Vector3d zero = run.canon.shift_correction();
  const PrivateFolder folder;
  fs::create_directory(folder.path() / "program");
  run.try_block([&] {
    // The process finds everything that it needs of the program in the private folder.
    std::string before = lead_in(run.canon);
    if (!run.options().startup_code.empty()) before += run.options().startup_code + "\n";
    const NumberedProgram program(text, file, before, run, folder.path() / "program");
    refuse_systems(program, run, zero, run.canon);
    write_whole(folder.path() / "machine.ini", machine_text());
    write_whole(folder.path() / "tool.tbl",
                tool_table(run.options().control, program.tools(), run));
    write_whole(folder.path() / "numbers.var", parameter_text(run.canon, zero));
    run.canon.set_line(0);
    Commands commands(run, program, zero);
    const InterpreterExit end = run_rs274(
        packages, folder.path(), "program/" + program.name(), run.options().interpreter_limits,
        [&](std::string_view line) { return commands.take(line); });
    commands.finish();
    check_interpreter_exit(end, run.options().interpreter_limits, program, run);
  });
}

namespace {

using std::filesystem::path;

bool is_file(const path& file) {
  std::error_code failure;
  return std::filesystem::is_regular_file(file, failure);
}

}  // namespace

std::optional<path> find_linuxcnc() {
  const auto has = [](const path& folder) { return is_file(folder / "usr/bin/rs274"); };
  // A named folder without rs274 is an error and does not fall back to another one.
  if (const char* named = std::getenv("ABBE_LINUXCNC"); named != nullptr && *named != '\0') {
    const path folder = std::filesystem::absolute(named);
    if (has(folder)) return folder;
    return std::nullopt;
  }
  // abbe runs from build/release, its tests from build/release/tests.
  const path program = program_folder();
  for (const path& folder : {program.parent_path(), program.parent_path().parent_path()})
    if (!folder.empty() && has(folder / "linuxcnc")) return folder / "linuxcnc";
  if (has("/")) return path("/");
  return std::nullopt;
}

path all_digits_library() {
  const path name = ABBE_ALL_DIGITS_NAME;
  const path program = program_folder();
  for (const path& folder : {program, program.parent_path(), program / ABBE_MODULES_FROM_PROGRAM,
                             path(ABBE_MODULES_INSTALLED)})
    if (is_file(folder / name)) return std::filesystem::canonical(folder / name);
  throw BadInput(name.string(), 0, 0,
                 "abbe's library for LinuxCNC's digits beside the program or in " +
                     std::string(ABBE_MODULES_INSTALLED),
                 "none");
}

}  // namespace abbe::sim::dialects
