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

constexpr std::size_t chunk = 65536;          // bytes read or held at a time
constexpr std::size_t max_said = 4096;        // bytes of stderr that are kept
constexpr std::size_t max_last_words = 1000;  // bytes of stderr that are shown
constexpr int max_last_lines = 6;
constexpr int max_reads_after_its_end = 64;  // with 64 KiB each: more than a pipe holds
// interval between two checks whether the child has ended
constexpr auto moment = std::chrono::milliseconds(5);

Clock::time_point after(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(
                            // the limit keeps the sum in the range of the clock
                            std::chrono::duration<double>(std::clamp(seconds, 0.0, 1e6)));
}

int milliseconds_until(Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return int(std::clamp<long long>(left, 0, 1'000'000'000));
}

struct Pipe {
  Descriptor read;
  Descriptor write;
};

Descriptor move_above_standard_streams(Descriptor file) {
  if (file.number() > 2) return file;  // below 3 it would be overwritten while a child is prepared
  return Descriptor(fcntl(file.number(), F_DUPFD_CLOEXEC, 3));
}

Pipe new_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    throw ChildProcessError("a pipe to talk through", std::strerror(errno));
  Pipe pipe{Descriptor(ends[0]), Descriptor(ends[1])};
  pipe.read = move_above_standard_streams(std::move(pipe.read));
  pipe.write = move_above_standard_streams(std::move(pipe.write));
  fcntl(pipe.write.number(), F_SETPIPE_SZ, 1 << 20);  // fewer system calls; it works without
  return pipe;
}

void never_block(const Descriptor& file) {
  fcntl(file.number(), F_SETFL, fcntl(file.number(), F_GETFL) | O_NONBLOCK);
}

/// Returns the pointers that exec expects.
std::vector<char*> pointers(const std::vector<std::string>& texts) {
  std::vector<char*> all;
  for (const std::string& text : texts) all.push_back(const_cast<char*>(text.c_str()));
  return all;
}

struct Actions {
  Actions() { posix_spawn_file_actions_init(&actions); }
  ~Actions() { posix_spawn_file_actions_destroy(&actions); }
  posix_spawn_file_actions_t actions;
};

struct Attributes {
  Attributes() { posix_spawnattr_init(&attributes); }
  ~Attributes() { posix_spawnattr_destroy(&attributes); }
  posix_spawnattr_t attributes;
};

/// Starts a child in a process group of its own, with the signals of a fresh program. The group
/// lets its descendants be killed with it.
pid_t spawned(const std::vector<std::string>& command, const std::vector<std::string>& extra,
              const std::array<int, 3>& streams) {
  Actions files;
  for (int i = 0; i < 3; ++i)
    posix_spawn_file_actions_adddup2(&files.actions, streams[std::size_t(i)], i);
  posix_spawn_file_actions_addclosefrom_np(&files.actions, 3);
  Attributes how;
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&how.attributes, &none);
  posix_spawnattr_setsigdefault(&how.attributes, &all);
  posix_spawnattr_setpgroup(&how.attributes, 0);
  posix_spawnattr_setflags(&how.attributes,
                           POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::vector<char*> arguments = pointers(command);
  arguments.push_back(nullptr);
  std::vector<char*> environment = pointers(extra);
  for (char** one = environ; one != nullptr && *one != nullptr; ++one) environment.push_back(*one);
  environment.push_back(nullptr);
  pid_t pid = -1;
  const int failure = posix_spawnp(&pid, command.front().c_str(), &files.actions, &how.attributes,
                                   arguments.data(), environment.data());
  if (failure != 0)
    throw ChildProcessError(fmt::format("that {} can be started", command.front()),
                            std::strerror(failure));
  return pid;
}

/// Writes without raising SIGPIPE when the pipe is closed, whatever the program does with signals.
ssize_t write_quietly(int file, std::string_view text) {
  sigset_t broken_pipe, before, pending;
  sigemptyset(&broken_pipe);
  sigaddset(&broken_pipe, SIGPIPE);
  sigpending(&pending);
  pthread_sigmask(SIG_BLOCK, &broken_pipe, &before);
  const ssize_t written = ::write(file, text.data(), text.size());
  const int failure = errno;
  // take the signal back, unless one was pending before
  if (written < 0 && failure == EPIPE && sigismember(&pending, SIGPIPE) == 0) {
    const timespec at_once{};
    sigtimedwait(&broken_pipe, nullptr, &at_once);
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  errno = failure;
  return written;
}

bool would_block(int failure) { return failure == EAGAIN || failure == EINTR; }

/// Returns the bytes that can be read without waiting; closes the file at its end.
std::string some_of(Descriptor& file) {
  std::string text(chunk, '\0');
  const ssize_t bytes = ::read(file.number(), text.data(), text.size());
  if (bytes == 0 || (bytes < 0 && !would_block(errno))) file.close();
  text.resize(std::size_t(std::max<ssize_t>(bytes, 0)));
  return text;
}

// Returns the unfinished line that a child left, for an error message.
std::string begun(const std::string& heard) {
  if (heard.empty() || heard.find('\n') != std::string::npos) return {};
  return "the beginning of a line, " + in_quotes(heard) + ", then ";
}

std::string end_text(int status) {
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
  // three pipes: a plug-in's stderr must not mix with its answers
  Pipe in = new_pipe(), out = new_pipe(), err = new_pipe();
  // the child holds its own ends now; ours close when the pipes leave this scope
  pid_ = spawned(command, extra, {in.read.number(), out.write.number(), err.write.number()});
  in_ = std::move(in.write);
  out_ = std::move(out.read);
  err_ = std::move(err.read);
  for (const Descriptor* ours : {&in_, &out_, &err_}) never_block(*ours);
}

ChildProcess::~ChildProcess() {
  if (pid_ > 0) reap();
}

std::string ChildProcess::exchange(std::string_view text, const LineLimits& limits) {
  const Instant deadline = after(limits.seconds);
  unsent_ = text;
  std::size_t looked_at = 0;
  for (;;) {
    const std::size_t end = received_.find('\n', looked_at);
    if (end != std::string::npos && end <= limits.longest && unsent_.empty()) {
      std::string line = received_.substr(0, end);
      received_.erase(0, end + 1);
      return line;
    }
    looked_at = end == std::string::npos ? received_.size() : end;
    if (looked_at > limits.longest)
      throw ChildProcessError(fmt::format("a line of at most {} bytes", limits.longest),
                              "more, beginning with " + in_quotes(received_));
    if (!out_.is_open()) {
      // the end of the output comes shortly before the end of the process, whose exit code explains
      // it
      const std::string how = wait_for_exit(after(1.0));
      throw ChildProcessError(
          "a line", begun(received_) + (how.empty() ? "its output closed" : "its end, " + how));
    }
    if (Clock::now() >= deadline)
      // an output that is buffered until the end is the most frequent cause
      throw ChildProcessError(
          fmt::format("a line within {} s", limits.seconds),
          begun(received_) + (unsent_.empty() ? "nothing (is the output flushed after each line?)"
                                              : "nothing, and the question not read"));
    poll_pipes(deadline, limits.longest);
  }
}

void ChildProcess::finish(std::string_view text, double seconds) {
  const Instant deadline = after(seconds);
  unsent_ = text;
  bool too_late = false;
  while (out_.is_open() && !has_ended() && !too_late) {
    too_late = Clock::now() >= deadline;
    poll_pipes(std::min(deadline, after(0.02)), chunk);
    if (unsent_.empty()) in_.close();
    if (received_.size() > chunk) break;
  }
  while (out_.is_open() && received_.size() <= chunk) {  // output written before its end
    const std::string more = some_of(out_);
    if (more.empty()) break;
    received_ += more;
  }
  if (received_.find_first_not_of(" \t\r\n") != std::string::npos)
    throw ChildProcessError("nothing after the last answer", in_quotes(received_));
  const std::string how = wait_for_exit(deadline);
  if (how.empty())
    throw ChildProcessError(fmt::format("its end within {} s after the last answer", seconds),
                            "none");
  if (how != end_text(0)) throw ChildProcessError("exit code 0 after the last answer", how);
}

std::string ChildProcess::stderr_tail() const {
  const std::size_t end = said_.find_last_not_of(" \t\r\n");
  if (end == std::string::npos) return {};
  std::size_t begin = end + 1;
  for (int lines = 0; begin > 0 && end + 1 - begin < max_last_words; --begin)
    if (said_[begin - 1] == '\n' && ++lines == max_last_lines) break;
  std::string words = said_.substr(begin, end + 1 - begin);
  std::erase_if(words,
                [](unsigned char c) { return (c < ' ' && c != '\n' && c != '\t') || c == 127; });
  return words;
}

// With a callback the wait is cut into tenths of a second, so that an interrupt acts soon.
void ChildProcess::poll_pipes(Instant deadline, std::size_t max_heard) {
  if (waiting_) {
    waiting_();
    deadline = std::min(deadline, after(0.1));
  }
  std::array<pollfd, 3> files = {
      pollfd{unsent_.empty() ? -1 : in_.number(), POLLOUT, 0},
      pollfd{received_.size() <= max_heard ? out_.number() : -1, POLLIN, 0},
      pollfd{err_.number(), POLLIN, 0}};
  if (poll(files.data(), files.size(), milliseconds_until(deadline)) <= 0) return;
  if (files[0].revents != 0) write_some();
  if (files[1].revents != 0) received_ += some_of(out_);
  if (files[2].revents != 0) read_err();
}

void ChildProcess::write_some() {
  const ssize_t bytes = write_quietly(in_.number(), unsent_);
  if (bytes >= 0) {
    unsent_.remove_prefix(std::size_t(bytes));
  } else if (!would_block(errno)) {
    unsent_ = {};  // the child reads no more; its output before its end is still read
    in_.close();
  }
}

bool ChildProcess::read_err() {
  if (!err_.is_open()) return false;
  const std::string more = some_of(err_);
  said_ += more;
  if (said_.size() > max_said) said_.erase(0, said_.size() - max_said);
  return !more.empty();
}

// WNOWAIT leaves the process to be reaped, so that its group number is not given to another one.
bool ChildProcess::has_ended() const {
  if (pid_ < 0) return true;
  siginfo_t info{};
  const int failed = waitid(P_PID, id_t(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
  return failed != 0 ? errno == ECHILD : info.si_pid == pid_;
}

/// Returns how the child ended; empty if it has not ended by the deadline.
std::string ChildProcess::wait_for_exit(Instant deadline) {
  while (!has_ended()) {
    if (Clock::now() >= deadline) return {};
    poll_pipes(std::min<Instant>(deadline, Clock::now() + moment), 0);
  }
  const std::string how = end_text(reap());
  for (int i = 0; i < max_reads_after_its_end && read_err(); ++i) {
  }
  return how;
}

/// Kills what is left of the group before the number of its leader can be reused.
int ChildProcess::reap() {
  int status = -1;
  ::kill(-pid_, SIGKILL);
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return status;
}

}  // namespace abbe::sim::compensation
