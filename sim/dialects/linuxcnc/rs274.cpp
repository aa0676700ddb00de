#include "sim/dialects/linuxcnc/rs274.h"

#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/dialects/linuxcnc/rs274_commands.h"
#include "sim/files/program_file.h"

namespace abbe::sim::dialects {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr rlim_t max_file_bytes = rlim_t(16) << 20;  // of each file that it writes
constexpr rlim_t max_memory_bytes = rlim_t(4) << 30;
constexpr std::size_t max_error_output_bytes = 65536;
// Its longest command has a few hundred bytes.
constexpr std::size_t max_command_bytes = 1 << 20;
constexpr std::size_t chunk_bytes = 1 << 18;  // read at a time
constexpr int commands_descriptor = 3;        // to which it writes canonical commands

/// A new folder in the system's temporary folder for this run alone; the destructor removes it.
class PrivateFolder {
 public:
  /// Throws BadInput if the folder cannot be created.
  PrivateFolder() {
    std::string name = (fs::temp_directory_path() / "abbe_rs274_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw BadInput(name, 0, 0, "a temporary folder", std::strerror(errno));
    path_ = name;
  }
  ~PrivateFolder() {
    std::error_code error;
    fs::remove_all(path_, error);
  }
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// The end of the interpreter process.
struct InterpreterExit {
  enum class ExitReason { Exit, Signal, Time, Bytes, Stopped } reason = ExitReason::Exit;
  int number = 0;            ///< exit code or signal number, by `reason`
  std::string error_output;  ///< beginning of its stderr, at most 64 kB
};

/// A pipe; the destructor closes its open ends.
struct Pipe {
  std::array<int, 2> ends{-1, -1};
  Pipe() {
    if (pipe2(ends.data(), O_CLOEXEC) != 0)
      throw BadInput("rs274", 0, 0, "a pipe for its commands", std::strerror(errno));
    // A large pipe saves context switches; a failure does no harm.
    fcntl(ends[0], F_SETPIPE_SZ, 1 << 20);
    // A blocking read could outlast the time limit.
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
  }
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  void close_end(int k) {
    if (int& end = ends[std::size_t(k)]; end >= 0) ::close(std::exchange(end, -1));
  }
};

// Debian has a library folder for each architecture, such as x86_64-linux-gnu.
std::string library_path(const fs::path& root) {
  std::string path = "root/usr/lib";
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root / "usr/lib", error))
    if (entry.path().filename().string().ends_with("-linux-gnu"))
      path += ":root/usr/lib/" + entry.path().filename().string();
  return path;
}

// rs274 links Python, which does not start without its standard library.
bool has_python(const fs::path& lib) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(lib, error))
    if (entry.path().filename().string().starts_with("python3.") &&
        fs::is_directory(entry.path() / "encodings", error))
      return true;
  return false;
}

/// Returns the environment of the process. Library paths are links in its folder, because the real
/// paths may contain blanks or colons, which separate entries.
std::vector<std::string> process_environment(const fs::path& packages, const fs::path& folder) {
  std::vector<std::string> variables = {
      "HOME=" + folder.string(),    "LC_ALL=C",
      "PATH=/usr/bin:/bin",         "PYTHONDONTWRITEBYTECODE=1",
      "LD_PRELOAD=./all_digits.so", "LD_LIBRARY_PATH=" + library_path(packages)};
  // The Python of the unpacked packages is used only if the system has none.
  if (has_python(packages / "usr/lib") && !has_python("/usr/lib"))
    variables.push_back("PYTHONHOME=" + (folder / "root/usr").string());
  return variables;
}

std::vector<char*> exec_pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

void set_limit(int resource, rlim_t max) {
  const rlimit limits{max, max};
  setrlimit(resource, &limits);
}

/// Runs in the child between fork and exec, where only async-signal-safe functions may be called.
[[noreturn]] void exec_in_child(const char* folder, char* const* arguments,
                                char* const* environment, int commands, int error_output) {
  sigset_t no_signals;
  sigemptyset(&no_signals);
  // Otherwise signals that abbe ignores or blocks would stay so after exec.
  for (int number = 1; number < NSIG; ++number) signal(number, SIG_DFL);
  sigprocmask(SIG_SETMASK, &no_signals, nullptr);
  // A process group of its own allows to end its children too. The process ends if abbe does.
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  set_limit(RLIMIT_FSIZE, max_file_bytes);
  set_limit(RLIMIT_AS, max_memory_bytes);
  set_limit(RLIMIT_CORE, 0);
  const int null_device = open("/dev/null", O_RDWR);
  const bool is_ready = chdir(folder) == 0 && dup2(null_device, 0) == 0 &&
                        dup2(null_device, 1) == 1 && dup2(error_output, 2) == 2 &&
                        dup2(commands, commands_descriptor) == commands_descriptor;
  if (is_ready) {
    // The process must not keep a file of abbe open.
    close_range(commands_descriptor + 1, ~0u, 0);
    execve(arguments[0], arguments, environment);
  }
  _exit(127);
}

/// The running process. The destructor ends it and its children.
class InterpreterProcess {
 public:
  InterpreterProcess(const fs::path& packages, const fs::path& folder, const std::string& program)
      : error_file_(folder / "said.txt") {
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
    std::vector<std::string> environment = process_environment(packages, folder);
    const std::vector<char*> argv = exec_pointers(arguments), envp = exec_pointers(environment);
    const std::string home = folder.string();
    // Duplicates with numbers above 3, because dup2 overwrites 0 to 3 in the child.
    const int error_output =
        fcntl(open(error_file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600),
              F_DUPFD_CLOEXEC, 10);
    const int commands = fcntl(pipe_.ends[1], F_DUPFD_CLOEXEC, 10);
    pid_ = error_output < 0 || commands < 0 ? -1 : fork();
    if (pid_ == 0) exec_in_child(home.c_str(), argv.data(), envp.data(), commands, error_output);
    const int error = errno;
    ::close(error_output);
    ::close(commands);
    pipe_.close_end(1);
    if (pid_ < 0) throw BadInput("rs274", 0, 0, "its process to start", std::strerror(error));
  }
  ~InterpreterProcess() { end(); }
  InterpreterProcess(const InterpreterProcess&) = delete;
  InterpreterProcess& operator=(const InterpreterProcess&) = delete;

  int commands() const { return pipe_.ends[0]; }
  std::string error_output() const {
    std::ifstream in(error_file_, std::ios::binary);
    std::string text(max_error_output_bytes, '\0');
    in.read(text.data(), std::streamsize(text.size()));
    text.resize(std::size_t(in.gcount()));
    return text;
  }
  /// Waits for the end of the process, at most until the deadline. Returns its exit status, or
  /// nothing if it is still running.
  std::optional<int> wait_until(Clock::time_point deadline) {
    for (;;) {
      siginfo_t info{};
      // WNOWAIT leaves the process a zombie, so that its number cannot be reused before `end`.
      const int result = waitid(P_PID, id_t(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
      if (result == 0 && info.si_pid == pid_) return end();
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
  Pipe pipe_;
  fs::path error_file_;
  pid_t pid_ = -1;
  int status_ = -1;
};

void create_link(const fs::path& target, const fs::path& name) {
  std::error_code error;
  fs::create_symlink(target, name, error);
  if (error) throw BadInput(name.string(), 0, 0, "a link that can be created", error.message());
}

int milliseconds_until(Clock::time_point deadline) {
  const auto milliseconds =
      std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return int(std::clamp<long long>(milliseconds, 0, 1'000'000'000));
}

/// Splits a stream of text into lines and passes each to `process_line`.
class LineSplitter {
 public:
  explicit LineSplitter(const std::function<bool(std::string_view)>& process_line)
      : process_line_(process_line) {}
  /// Adds text. Returns false once `process_line` has returned false.
  bool add(std::string_view text) {
    for (std::size_t end; (end = text.find('\n')) != std::string_view::npos;
         text.remove_prefix(end + 1)) {
      const std::string_view line_end = text.substr(0, end);
      const bool continues = incomplete_line_.empty() ? process_line_(line_end)
                                                      : process_line_(incomplete_line_ += line_end);
      incomplete_line_.clear();
      if (!continues) return false;
    }
    // A line longer than any command is truncated, so that it cannot fill the memory.
    incomplete_line_ +=
        text.substr(0, max_command_bytes - std::min(incomplete_line_.size(), max_command_bytes));
    return true;
  }

 private:
  const std::function<bool(std::string_view)>& process_line_;
  std::string incomplete_line_;
};

/// Runs rs274 in `folder`, which is its home and working directory and contains `machine.ini`,
/// `tool.tbl`, `numbers.var` and the file `program` (a relative path). The process inherits neither
/// our environment nor our open files, may write files of at most 16 MB and may use at most 4 GB of
/// memory. `process_line` is called with each line of its output, without the line end, and returns
/// false to end the run. The process is ended before an exception of `process_line` propagates.
/// Throws BadInput if the process cannot be started.
InterpreterExit run_rs274(const fs::path& packages, const fs::path& folder,
                          const std::string& program, const InterpreterLimits& limits,
                          const std::function<bool(std::string_view line)>& process_line) {
  // Links, because LD_PRELOAD and LD_LIBRARY_PATH cannot express paths with blanks or colons.
  create_link(all_digits_library(), folder / "all_digits.so");
  create_link(packages, folder / "root");
  const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(limits.seconds));
  InterpreterProcess process(packages, folder, program);
  LineSplitter lines(process_line);
  std::string buffer(chunk_bytes, '\0');
  double bytes = 0.0;
  const auto end = [&](InterpreterExit::ExitReason reason) {
    process.end();
    return InterpreterExit{reason, 0, process.error_output()};
  };
  for (;;) {
    // The clock is checked too, because the timeout of poll never expires while the process prints.
    pollfd file{process.commands(), POLLIN, 0};
    if (poll(&file, 1, milliseconds_until(deadline)) == 0 || Clock::now() >= deadline)
      return end(InterpreterExit::ExitReason::Time);
    const ssize_t byte_count = ::read(process.commands(), buffer.data(), buffer.size());
    if (byte_count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (byte_count <= 0) break;
    bytes += double(byte_count);
    if (!lines.add({buffer.data(), std::size_t(byte_count)}))
      return end(InterpreterExit::ExitReason::Stopped);
    if (bytes > 1e6 * limits.megabytes) return end(InterpreterExit::ExitReason::Bytes);
  }
  const auto status = process.wait_until(deadline);
  if (!status) return end(InterpreterExit::ExitReason::Time);
  if (WIFSIGNALED(*status))
    return {InterpreterExit::ExitReason::Signal, WTERMSIG(*status), process.error_output()};
  return {InterpreterExit::ExitReason::Exit, WEXITSTATUS(*status), process.error_output()};
}

using linuxcnc::Commands;
using linuxcnc::NumberedProgram;
using program::NcOptions;

constexpr std::string_view six_letters = "XYZABC";
constexpr std::size_t max_tools = 1000;  // size of the tool table of rs274

// On a metric machine too, rs274 reads tables and parameters in inches, and converts them with this
// factor. With 1 / 25.4 lengths would not come back unchanged.
constexpr double inch_per_mm = 0.03937007874016;

void write_text_file(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  if (!out.write(text.data(), std::streamsize(text.size())).flush())
    throw BadInput(file.string(), 0, 0, "a writable file", "a write error");
}

std::string machine_text() {
  return "[EMC]\nVERSION = 1.1\n[RS274NGC]\nPARAMETER_FILE = numbers.var\n"
         "SUBROUTINE_PATH = program\n[TRAJ]\nCOORDINATES = X Y Z A B C\nLINEAR_UNITS = mm\n"
         "ANGULAR_UNITS = deg\n";
}

/// Returns a tool table with the known and the called tools, and with other numbers up to 999,
/// because a computed number may call any of them. An unknown length or radius is a placeholder; a
/// program that uses it is an input error.
std::string tool_table(const NcOptions& control, const std::set<int>& called_tools,
                       const ProgramRun& run) {
  std::set<int> tools = called_tools;
  for (const auto* values : {&control.tool_length, &control.tool_radius})
    for (const auto& [number, mm] : *values)
      if (number > 0) tools.insert(number);
  if (tools.size() > max_tools)
    run.canon.throw_input_error(
        {}, fmt::format("at most {} tools for LinuxCNC's own interpreter", max_tools),
        fmt::format("{}", tools.size()));
  for (int n = 1; n < int(max_tools) && tools.size() < max_tools; ++n) tools.insert(n);
  const auto inches = [](const std::map<int, double>& values, int tool, double default_value) {
    return find_value(values, tool).value_or(default_value) * inch_per_mm;
  };
  const auto length_words = [&](int tool) {
    const kinematics::Chain* to_tip = chain_to_tip(control, tool);
    if (!run.is_turning() || to_tip == nullptr || !control.tool_length.contains(tool))
      return fmt::format("Z{:.17g}", inches(control.tool_length, tool, linuxcnc::unknown_length));
    const kinematics::AxisVector offset = measured_offset(run.canon, *to_tip, {});
    std::string words;
    for (const char letter : {'X', 'Y', 'Z'})
      if (const int j = run.canon.joint_of(letter); j >= 0)
        words += fmt::format("{}{:.17g} ", letter, offset[j] * inch_per_mm);
    return words;
  };
  std::string text;
  int pocket = 0;
  for (const int tool : tools)
    text += fmt::format("T{} P{} {} D{:.17g}\n", tool, ++pocket, length_words(tool),
                        // D is a diameter.
                        2 * inches(control.tool_radius, tool, linuxcnc::unknown_radius));
  return text;
}

/// Returns the text of the parameter file with the origins of the nine coordinate systems: those of
/// the scene plus `zero`.
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
            fmt::format("{}\t{:.17g}\n", 5221 + 20 * i + k, k < 3 ? value * inch_per_mm : value);
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

/// Throws BadInput if the program sets origins while those of the scene are points in the workpiece
/// (`zero` is not 0): rs274 would take the origins of the program as axis positions.
void check_origins(const NumberedProgram& program, const ProgramRun& run,
                   const Eigen::Vector3d& zero, program::Canon& canon) {
  if (zero.isZero(0.0)) return;
  for (int number = 1; number <= program.max_number(); ++number) {
    const linuxcnc::LineCodes codes = linuxcnc::parse_codes(program.text_of(number));
    const bool sets_origin = codes.has({100}) && (codes.l == 2 || codes.l < 0);
    if (!sets_origin && !codes.has_system_parameter) continue;
    const auto [file, line] = program.location_of(number);
    canon.set_line(line, file);
    run.canon.throw_input_error(
        {0, program.text_of(number)},
        "neither G10 L2 nor #5221 to #5390 for LinuxCNC's own interpreter on a machine with rotary "
        "axes whose work offset is stated in the scene");
  }
}

// Messages before "executing" come from the start of the interpreter, not from the program.
std::vector<std::string> error_lines(const std::string& error_output) {
  std::vector<std::string> lines;
  LineReader reader(error_output);
  while (const auto line = reader.next()) {
    if (*line == "executing")
      lines.clear();
    else if (!line->empty())
      lines.emplace_back(*line);
  }
  return lines;
}

// Returns the number after a word of the text, or 0.
int number_after(std::string_view text, std::string_view word) {
  const std::size_t at = text.find(word);
  int number = 0;
  if (at != std::string_view::npos)
    std::from_chars(text.data() + at + word.size(), text.data() + text.size(), number);
  return number;
}

/// Returns the input error for a message of rs274. Its location is the block that rs274 prints
/// after the message, or the line that the message itself states.
BadInput rs274_error(const std::string& error_output, const NumberedProgram& program,
                     ProgramRun& run) {
  std::vector<std::string> lines = error_lines(error_output);
  std::string message = lines.empty() ? "no message" : lines.front();
  const std::string block = lines.size() > 1 ? lines.back() : std::string();
  for (std::size_t i = 1; i + 1 < lines.size(); ++i) message += " " + lines[i];
  std::string file = program.name();
  if (const std::size_t at = message.find("file:"); at != std::string::npos) {
    const std::size_t from = at + 5, length = message.find(' ', from) - from;
    file = fs::path(message.substr(from, length)).filename().string();
    // The private folder means nothing to the user.
    message.replace(from, length, file);
  }
  int number = block.starts_with("N") ? number_after(block, "N") : 0;
  if (const int line = number_after(message, "from line: "); line > 0)
    number = program.number_of(file, line);
  if (number > 0) {
    const linuxcnc::SourceLine line = program.location_of(number);
    run.canon.set_line(line.line, line.file);
  }
  const program::NcLocation location = run.canon.place();
  return {location.file, location.line, 0, "a block accepted by LinuxCNC's own interpreter",
          message};
}

void check_interpreter_exit(const InterpreterExit& exit, const InterpreterLimits& limits,
                            const NumberedProgram& program, ProgramRun& run) {
  const auto add_error = [&](std::string expected, std::string seen) {
    const program::NcLocation location = run.canon.place();
    run.add_input_error(
        BadInput(location.file, location.line, 0, std::move(expected), std::move(seen)));
  };
  using ExitReason = InterpreterExit::ExitReason;
  if (exit.reason == ExitReason::Time)
    add_error(fmt::format("LinuxCNC's own interpreter to end within {} s", limits.seconds),
              "no end: an infinite loop, or a program that takes longer");
  else if (exit.reason == ExitReason::Bytes)
    add_error(
        fmt::format("at most {} MB of commands from LinuxCNC's own interpreter", limits.megabytes),
        "more: an infinite loop or too many repeats");
  else if (exit.reason == ExitReason::Signal && exit.number == SIGXFSZ)
    add_error("at most 16 MB of messages from LinuxCNC's own interpreter", "more");
  else if (exit.reason == ExitReason::Signal)
    add_error("a normal end of LinuxCNC's own interpreter",
              fmt::format("signal {} ({})", exit.number, strsignal(exit.number)));
  // The child exits with 127 if exec fails.
  else if (exit.reason == ExitReason::Exit && exit.number == 127)
    add_error("rs274 to start", quoted_excerpt(exit.error_output));
  else if (exit.reason == ExitReason::Exit && exit.number != 0)
    run.add_input_error(rs274_error(exit.error_output, program, run));
}

// Returns the folder of LinuxCNC's packages. Throws BadInput if there is none.
fs::path require_packages(const ProgramRun& run) {
  if (auto packages = find_linuxcnc()) return *packages;
  throw BadInput(run.canon.place().file, 0, 0,
                 "LinuxCNC's own interpreter, which ./abbe setup --linuxcnc unpacks next to the "
                 "build, or ABBE_LINUXCNC=FOLDER with usr/bin/rs274 in it",
                 "none");
}

}  // namespace

void read_by_linuxcnc(std::string_view text, const DetectedDialect& detected, ProgramRun& run) {
  const std::string file = run.canon.place().file;
  if (detected.dialect != Dialect::LinuxCnc)
    throw BadInput(file, detected.line, 0, "a LinuxCNC program with interpreter = \"linuxcnc\"",
                   std::string(name_of(detected.dialect)) +
                       (detected.evidence.empty() ? "" : ", as " + detected.evidence));
  const fs::path packages = require_packages(run);
  const Eigen::Vector3d zero = run.canon.shift_correction();
  const PrivateFolder folder;
  fs::create_directory(folder.path() / "program");
  run.try_block([&] {
    std::string before = lead_in(run.canon);
    if (!run.options().startup_code.empty()) before += run.options().startup_code + "\n";
    const NumberedProgram program(text, file, before, run, folder.path() / "program");
    check_origins(program, run, zero, run.canon);
    write_text_file(folder.path() / "machine.ini", machine_text());
    write_text_file(folder.path() / "tool.tbl",
                    tool_table(run.options().control, program.tools(), run));
    write_text_file(folder.path() / "numbers.var", parameter_text(run.canon, zero));
    run.canon.set_line(0);
    Commands commands(run, program, zero);
    const InterpreterExit end = run_rs274(
        packages, folder.path(), "program/" + program.name(), run.options().interpreter_limits,
        [&](std::string_view line) { return commands.process(line); });
    commands.finish();
    check_interpreter_exit(end, run.options().interpreter_limits, program, run);
  });
}

namespace {

using std::filesystem::path;

bool is_file(const path& file) {
  std::error_code error;
  return std::filesystem::is_regular_file(file, error);
}

}  // namespace

std::optional<path> find_linuxcnc() {
  const auto has_rs274 = [](const path& folder) { return is_file(folder / "usr/bin/rs274"); };
  // A stated folder without rs274 is an error; no other folder is searched.
  if (const char* variable = std::getenv("ABBE_LINUXCNC");
      variable != nullptr && *variable != '\0') {
    const path folder = std::filesystem::absolute(variable);
    if (has_rs274(folder)) return folder;
    return std::nullopt;
  }
  // abbe runs from build/release, its tests from build/release/tests.
  const path program = program_folder();
  for (const path& folder : {program.parent_path(), program.parent_path().parent_path()})
    if (!folder.empty() && has_rs274(folder / "linuxcnc")) return folder / "linuxcnc";
  if (has_rs274("/")) return path("/");
  return std::nullopt;
}

path all_digits_library() {
  const path name = ABBE_ALL_DIGITS_NAME;
  const path program = program_folder();
  for (const path& folder : {program, program.parent_path(), program / ABBE_MODULES_FROM_PROGRAM,
                             path(ABBE_MODULES_INSTALLED)})
    if (is_file(folder / name)) return std::filesystem::canonical(folder / name);
  throw BadInput(name.string(), 0, 0,
                 "abbe's library for LinuxCNC's digits next to the program or in " +
                     std::string(ABBE_MODULES_INSTALLED),
                 "none");
}

}  // namespace abbe::sim::dialects
