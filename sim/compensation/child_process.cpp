#include "sim/compensation/child_process.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include "kinematics/text.h"

extern char** environ;

namespace abbe::sim::compensation {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t max_chunk_bytes = 65536;  // bytes read at a time
constexpr std::size_t max_stderr_bytes = 4096;  // bytes of stderr that are stored
constexpr std::size_t max_tail_bytes = 1000;    // bytes of stderr that are shown
constexpr int max_tail_lines = 6;
constexpr int max_reads_after_exit = 64;  // of 64 KiB each: more than a pipe holds
constexpr auto exit_poll_interval =
    std::chrono::milliseconds(5);  // between checks for the end of the child

Clock::time_point after(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(
                            // the limit keeps the sum within the range of the clock
                            std::chrono::duration<double>(std::clamp(seconds, 0.0, 1e6)));
}

int milliseconds_until(Clock::time_point deadline) {
  const auto remaining_ms =
      std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return int(std::clamp<long long>(remaining_ms, 0, 1'000'000'000));
}

struct Pipe {
  Descriptor read;
  Descriptor write;
};

Descriptor move_above_standard_streams(Descriptor file) {
  // Descriptors 0 to 2 would be overwritten while a child is prepared.
  if (file.number() > 2) return file;
  return Descriptor(fcntl(file.number(), F_DUPFD_CLOEXEC, 3));
}

Pipe create_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    throw ChildProcessError("a pipe to the program", std::strerror(errno));
  Pipe pipe{Descriptor(ends[0]), Descriptor(ends[1])};
  pipe.read = move_above_standard_streams(std::move(pipe.read));
  pipe.write = move_above_standard_streams(std::move(pipe.write));
  fcntl(pipe.write.number(), F_SETPIPE_SZ, 1 << 20);  // optional: saves system calls
  return pipe;
}

void set_nonblocking(const Descriptor& file) {
  fcntl(file.number(), F_SETFL, fcntl(file.number(), F_GETFL) | O_NONBLOCK);
}

/// Returns pointers to the texts, in the form that exec expects.
std::vector<char*> pointers(const std::vector<std::string>& texts) {
  std::vector<char*> result;
  for (const std::string& text : texts) result.push_back(const_cast<char*>(text.c_str()));
  return result;
}

struct SpawnFileActions {
  SpawnFileActions() { posix_spawn_file_actions_init(&actions); }
  ~SpawnFileActions() { posix_spawn_file_actions_destroy(&actions); }
  posix_spawn_file_actions_t actions;
};

struct SpawnAttributes {
  SpawnAttributes() { posix_spawnattr_init(&attributes); }
  ~SpawnAttributes() { posix_spawnattr_destroy(&attributes); }
  posix_spawnattr_t attributes;
};

/// Starts a child with default signal handling, in a process group of its own, so that its
/// descendants can be killed with it.
pid_t spawn(const std::vector<std::string>& command, const std::vector<std::string>& extra,
            const std::array<int, 3>& streams) {
  SpawnFileActions file_actions;
  for (int i = 0; i < 3; ++i)
    posix_spawn_file_actions_adddup2(&file_actions.actions, streams[std::size_t(i)], i);
  posix_spawn_file_actions_addclosefrom_np(&file_actions.actions, 3);
  SpawnAttributes attributes;
  sigset_t no_signals, all_signals;
  sigemptyset(&no_signals);
  sigfillset(&all_signals);
  posix_spawnattr_setsigmask(&attributes.attributes, &no_signals);
  posix_spawnattr_setsigdefault(&attributes.attributes, &all_signals);
  posix_spawnattr_setpgroup(&attributes.attributes, 0);
  posix_spawnattr_setflags(&attributes.attributes,
                           POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::vector<char*> arguments = pointers(command);
  arguments.push_back(nullptr);
  std::vector<char*> environment = pointers(extra);
  for (char** variable = environ; variable != nullptr && *variable != nullptr; ++variable)
    environment.push_back(*variable);
  environment.push_back(nullptr);
  pid_t pid = -1;
  const int error_number =
      posix_spawnp(&pid, command.front().c_str(), &file_actions.actions, &attributes.attributes,
                   arguments.data(), environment.data());
  if (error_number != 0)
    throw ChildProcessError(fmt::format("{} to start", command.front()),
                            std::strerror(error_number));
  return pid;
}

/// Writes without raising SIGPIPE if the pipe is closed, whatever signal handling the program has.
ssize_t write_quietly(int file, std::string_view text) {
  sigset_t broken_pipe, previous_mask, pending;
  sigemptyset(&broken_pipe);
  sigaddset(&broken_pipe, SIGPIPE);
  sigpending(&pending);
  pthread_sigmask(SIG_BLOCK, &broken_pipe, &previous_mask);
  const ssize_t written = ::write(file, text.data(), text.size());
  const int error_number = errno;
  // The signal is consumed unless one was pending before.
  if (written < 0 && error_number == EPIPE && sigismember(&pending, SIGPIPE) == 0) {
    const timespec at_once{};
    sigtimedwait(&broken_pipe, nullptr, &at_once);
  }
  pthread_sigmask(SIG_SETMASK, &previous_mask, nullptr);
  errno = error_number;
  return written;
}

bool is_retryable(int error_number) { return error_number == EAGAIN || error_number == EINTR; }

/// Returns the bytes that can be read without waiting. Closes the file at its end.
std::string read_available(Descriptor& file) {
  std::string text(max_chunk_bytes, '\0');
  const ssize_t bytes = ::read(file.number(), text.data(), text.size());
  if (bytes == 0 || (bytes < 0 && !is_retryable(errno))) file.close();
  text.resize(std::size_t(std::max<ssize_t>(bytes, 0)));
  return text;
}

/// Returns a text about the unfinished line in the output of a child, for an error message.
std::string unfinished_line_text(const std::string& output) {
  if (output.empty() || output.find('\n') != std::string::npos) return {};
  return "an incomplete line, " + quoted_excerpt(output) + ", then ";
}

std::string exit_text(int status) {
  if (status >= 0 && WIFEXITED(status)) return fmt::format("exit code {}", WEXITSTATUS(status));
  if (status >= 0 && WIFSIGNALED(status))
    return fmt::format("signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  return "an unknown exit code";
}

}  // namespace

ChildProcessError::ChildProcessError(const std::string& expected, const std::string& seen)
    : std::runtime_error("expected " + expected + ", seen " + seen) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  if (this != &other) {
    close();
    number_ = std::exchange(other.number_, -1);
  }
  return *this;
}

void Descriptor::close() {
  if (number_ >= 0) ::close(number_);
  number_ = -1;
}

ChildProcess::ChildProcess(const std::vector<std::string>& command,
                           const std::vector<std::string>& extra, std::function<void()> waiting)
    : waiting_(std::move(waiting)) {
  // Three pipes, because the stderr of a plug-in must not mix with its answers.
  Pipe in = create_pipe(), out = create_pipe(), err = create_pipe();
  // The child inherits its ends of the pipes; our copies of them close at the end of this scope.
  pid_ = spawn(command, extra, {in.read.number(), out.write.number(), err.write.number()});
  in_ = std::move(in.write);
  out_ = std::move(out.read);
  err_ = std::move(err.read);
  for (const Descriptor* descriptor : {&in_, &out_, &err_}) set_nonblocking(*descriptor);
}

ChildProcess::~ChildProcess() {
  if (pid_ > 0) kill_and_reap();
}

std::string ChildProcess::exchange(std::string_view text, const LineLimits& limits) {
  const Instant deadline = after(limits.seconds);
  unsent_ = text;
  std::size_t searched = 0;
  for (;;) {
    const std::size_t end = received_.find('\n', searched);
    if (end != std::string::npos && end <= limits.max_bytes && unsent_.empty()) {
      std::string line = received_.substr(0, end);
      received_.erase(0, end + 1);
      return line;
    }
    searched = end == std::string::npos ? received_.size() : end;
    if (searched > limits.max_bytes)
      throw ChildProcessError(fmt::format("a line of at most {} bytes", limits.max_bytes),
                              "a longer line that begins with " + quoted_excerpt(received_));
    if (!out_.is_open()) {
      // The output ends shortly before the process, whose exit code explains why.
      const std::string exit_description = wait_for_exit(after(1.0));
      throw ChildProcessError(
          "a line", unfinished_line_text(received_) +
                        (exit_description.empty() ? "the end of its output"
                                                  : "the end of the program, " + exit_description));
    }
    if (Clock::now() >= deadline)
      // The most frequent cause is an output that is buffered until the end.
      throw ChildProcessError(fmt::format("a line within {} s", limits.seconds),
                              unfinished_line_text(received_) +
                                  (unsent_.empty() ? "no output (is it flushed after each line?)"
                                                   : "no output, and the request was not read"));
    poll_pipes(deadline, limits.max_bytes);
  }
}

void ChildProcess::finish(std::string_view text, double seconds) {
  const Instant deadline = after(seconds);
  unsent_ = text;
  bool is_late = false;
  while (out_.is_open() && !has_ended() && !is_late) {
    is_late = Clock::now() >= deadline;
    poll_pipes(std::min(deadline, after(0.02)), max_chunk_bytes);
    if (unsent_.empty()) in_.close();
    if (received_.size() > max_chunk_bytes) break;
  }
  while (out_.is_open() && received_.size() <= max_chunk_bytes) {  // output written before its end
    const std::string chunk = read_available(out_);
    if (chunk.empty()) break;
    received_ += chunk;
  }
  if (received_.find_first_not_of(" \t\r\n") != std::string::npos)
    throw ChildProcessError("no output after the last answer", quoted_excerpt(received_));
  const std::string exit_description = wait_for_exit(deadline);
  if (exit_description.empty())
    throw ChildProcessError(
        fmt::format("the program to end within {} s after the last answer", seconds), "none");
  if (exit_description != exit_text(0))
    throw ChildProcessError("exit code 0 after the last answer", exit_description);
}

std::string ChildProcess::stderr_tail() const {
  const std::size_t end = stderr_text_.find_last_not_of(" \t\r\n");
  if (end == std::string::npos) return {};
  std::size_t begin = end + 1;
  for (int lines = 0; begin > 0 && end + 1 - begin < max_tail_bytes; --begin)
    if (stderr_text_[begin - 1] == '\n' && ++lines == max_tail_lines) break;
  std::string tail = stderr_text_.substr(begin, end + 1 - begin);
  std::erase_if(tail,
                [](unsigned char c) { return (c < ' ' && c != '\n' && c != '\t') || c == 127; });
  return tail;
}

// With a callback the wait is divided into tenths of a second, so that an interrupt acts soon.
void ChildProcess::poll_pipes(Instant deadline, std::size_t max_received) {
  if (waiting_) {
    waiting_();
    deadline = std::min(deadline, after(0.1));
  }
  std::array<pollfd, 3> files = {
      pollfd{unsent_.empty() ? -1 : in_.number(), POLLOUT, 0},
      pollfd{received_.size() <= max_received ? out_.number() : -1, POLLIN, 0},
      pollfd{err_.number(), POLLIN, 0}};
  if (poll(files.data(), files.size(), milliseconds_until(deadline)) <= 0) return;
  if (files[0].revents != 0) write_available();
  if (files[1].revents != 0) received_ += read_available(out_);
  if (files[2].revents != 0) read_stderr();
}

void ChildProcess::write_available() {
  const ssize_t bytes = write_quietly(in_.number(), unsent_);
  if (bytes >= 0) {
    unsent_.remove_prefix(std::size_t(bytes));
  } else if (!is_retryable(errno)) {
    unsent_ = {};  // the child no longer reads, but what it wrote is still read
    in_.close();
  }
}

bool ChildProcess::read_stderr() {
  if (!err_.is_open()) return false;
  const std::string chunk = read_available(err_);
  stderr_text_ += chunk;
  if (stderr_text_.size() > max_stderr_bytes)
    stderr_text_.erase(0, stderr_text_.size() - max_stderr_bytes);
  return !chunk.empty();
}

// WNOWAIT leaves the process unreaped, so that its group number is not reused.
bool ChildProcess::has_ended() const {
  if (pid_ < 0) return true;
  siginfo_t info{};
  const int status = waitid(P_PID, id_t(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
  return status != 0 ? errno == ECHILD : info.si_pid == pid_;
}

/// Returns a text about how the child ended; an empty one if it has not ended by the deadline.
std::string ChildProcess::wait_for_exit(Instant deadline) {
  while (!has_ended()) {
    if (Clock::now() >= deadline) return {};
    poll_pipes(std::min<Instant>(deadline, Clock::now() + exit_poll_interval), 0);
  }
  const std::string exit_description = exit_text(kill_and_reap());
  for (int i = 0; i < max_reads_after_exit && read_stderr(); ++i) {
  }
  return exit_description;
}

/// Kills the remaining processes of the group before the number of its leader can be reused.
/// Returns the exit status.
int ChildProcess::kill_and_reap() {
  int status = -1;
  ::kill(-pid_, SIGKILL);
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return status;
}

}  // namespace abbe::sim::compensation
