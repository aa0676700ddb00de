#include "sim/dialects/linuxcnc_process.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "kinematics/bad_input.h"
#include "sim/dialects/linuxcnc_packages.h"

namespace abbe::sim::dialects {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr rlim_t most_written = rlim_t(16) << 20;  // bytes of a file that it writes
constexpr rlim_t most_memory = rlim_t(4) << 30;    // bytes
constexpr std::size_t most_said = 65536;           // bytes of stderr that are read
constexpr std::size_t longest_line = 1 << 20;      // bytes; its commands have some hundred
constexpr std::size_t chunk = 1 << 18;             // bytes read at a time
constexpr int commands_file = 3;                   // where the process writes its commands

/// Two ends of a pipe; what is open is closed.
struct PipeEnds {
  std::array<int, 2> ends{-1, -1};
  PipeEnds() {
    if (pipe2(ends.data(), O_CLOEXEC) != 0)
      throw BadInput("rs274", 0, 0, "a pipe for its commands", std::strerror(errno));
    fcntl(ends[0], F_SETPIPE_SZ, 1 << 20);  // fewer turns; it works without
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

std::string library_path(const fs::path& root) {
  std::string path = "root/usr/lib";
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(root / "usr/lib", failure))
    if (entry.path().filename().string().ends_with("-linux-gnu"))
      path += ":root/usr/lib/" + entry.path().filename().string();
  return path;
}

bool has_python(const fs::path& lib) {
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(lib, failure))
    if (entry.path().filename().string().starts_with("python3.") &&
        fs::is_directory(entry.path() / "encodings", failure))
      return true;
  return false;
}

/// Its environment: paths relative to the folder, whose links lead around blanks and colons in
/// ours.
std::vector<std::string> environment_of(const fs::path& packages, const fs::path& folder) {
  std::vector<std::string> all = {
      "HOME=" + folder.string(),    "LC_ALL=C",
      "PATH=/usr/bin:/bin",         "PYTHONDONTWRITEBYTECODE=1",
      "LD_PRELOAD=./all_digits.so", "LD_LIBRARY_PATH=" + library_path(packages)};
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

/// Between fork and exec, where only what is safe in a signal handler may be called.
[[noreturn]] void become(const char* folder, char* const* arguments, char* const* environment,
                         int commands, int said) {
  sigset_t none;
  sigemptyset(&none);
  for (int number = 1; number < NSIG; ++number) signal(number, SIG_DFL);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  limit(RLIMIT_FSIZE, most_written);
  limit(RLIMIT_AS, most_memory);
  limit(RLIMIT_CORE, 0);
  const int nothing = open("/dev/null", O_RDWR);
  const bool ready = chdir(folder) == 0 && dup2(nothing, 0) == 0 && dup2(nothing, 1) == 1 &&
                     dup2(said, 2) == 2 && dup2(commands, commands_file) == commands_file;
  if (ready) {
    close_range(commands_file + 1, ~0u, 0);
    execve(arguments[0], arguments, environment);
  }
  _exit(127);
}

/// The process while it runs; it and its children are ended with its name.
class Running {
 public:
  Running(const fs::path& packages, const fs::path& folder, const std::string& program)
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
    // above the numbers that are laid over
    const int said = fcntl(open(said_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600),
                           F_DUPFD_CLOEXEC, 10);
    const int commands = fcntl(pipe_.ends[1], F_DUPFD_CLOEXEC, 10);
    pid_ = said < 0 || commands < 0 ? -1 : fork();
    if (pid_ == 0) become(home.c_str(), argv.data(), envp.data(), commands, said);
    const int failure = errno;
    ::close(said);
    ::close(commands);
    pipe_.close_end(1);
    if (pid_ < 0) throw BadInput("rs274", 0, 0, "that it can be started", std::strerror(failure));
  }
  ~Running() { end(); }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  int commands() const { return pipe_.ends[0]; }
  std::string said() const {
    std::ifstream in(said_, std::ios::binary);
    std::string text(most_said, '\0');
    in.read(text.data(), std::streamsize(text.size()));
    text.resize(std::size_t(in.gcount()));
    return text;
  }
  /// Waits until then. @return its status, none if it has not ended
  std::optional<int> ended_before(Clock::time_point deadline) {
    for (;;) {
      siginfo_t info{};
      const int failed = waitid(P_PID, id_t(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
      if (failed == 0 && info.si_pid == pid_) return end();
      if (Clock::now() >= deadline) return std::nullopt;
      poll(nullptr, 0, 1);
    }
  }
  /// Ends what is left of its group before its number is free for others.
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

/// Text in pieces to whole lines.
class LineCutter {
 public:
  explicit LineCutter(const std::function<bool(std::string_view)>& take) : take_(take) {}
  /// @return false when no more is wanted
  bool add(std::string_view piece) {
    for (std::size_t end; (end = piece.find('\n')) != std::string_view::npos;
         piece.remove_prefix(end + 1)) {
      const std::string_view whole = piece.substr(0, end);
      const bool more = rest_.empty() ? take_(whole) : take_(rest_ += whole);
      rest_.clear();
      if (!more) return false;
    }
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

InterpreterEnd run_rs274(const fs::path& packages, const fs::path& folder,
                         const std::string& program, const InterpreterLimits& limits,
                         const std::function<bool(std::string_view line)>& take) {
  link(all_digits_library(), folder / "all_digits.so");
  link(packages, folder / "root");
  const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(limits.seconds));
  Running process(packages, folder, program);
  LineCutter lines(take);
  std::string buffer(chunk, '\0');
  double bytes = 0.0;
  const auto ended = [&](InterpreterEnd::Why why) {
    process.end();
    return InterpreterEnd{why, 0, process.said()};
  };
  for (;;) {
    pollfd file{process.commands(), POLLIN, 0};
    if (poll(&file, 1, milliseconds_to(deadline)) == 0 || Clock::now() >= deadline)
      return ended(InterpreterEnd::Why::Time);
    const ssize_t read = ::read(process.commands(), buffer.data(), buffer.size());
    if (read < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (read <= 0) break;
    bytes += double(read);
    if (!lines.add({buffer.data(), std::size_t(read)})) return ended(InterpreterEnd::Why::Stopped);
    if (bytes > 1e6 * limits.megabytes) return ended(InterpreterEnd::Why::Bytes);
  }
  const auto status = process.ended_before(deadline);
  if (!status) return ended(InterpreterEnd::Why::Time);
  if (WIFSIGNALED(*status)) return {InterpreterEnd::Why::Signal, WTERMSIG(*status), process.said()};
  return {InterpreterEnd::Why::Exit, WEXITSTATUS(*status), process.said()};
}

}  // namespace abbe::sim::dialects
