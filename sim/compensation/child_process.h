#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/types.h>

/// A child process that exchanges lines of text with abbe, for plug-ins.
namespace abbe::sim::compensation {

/// Thrown if a child process violates an expectation, with the message "expected ..., seen ...".
struct ChildProcessError : std::runtime_error {
  using std::runtime_error::runtime_error;
  ChildProcessError(const std::string& expected, const std::string& seen);
};

/// Limits on the waiting time and the length of a line.
struct LineLimits {
  double seconds = 10.0;
  std::size_t max_bytes = 65536;  ///< bytes
};

/// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept;
  ~Descriptor() { close(); }
  void close();
  bool is_open() const { return number_ >= 0; }
  int number() const { return number_; }

 private:
  int number_;
};

/// A program connected by three pipes, in a process group of its own. It inherits the environment
/// and the working directory, but no open file. Linux only.
class ChildProcess {
 public:
  /// Starts the program.
  /// @param command  program, found on the PATH unless it has a slash, and its arguments
  /// @param extra    "NAME=value" of the environment, in addition to that of this process
  /// @param waiting  called repeatedly during a wait; if it throws, the child is killed
  /// @throws ChildProcessError if the program cannot be started
  explicit ChildProcess(const std::vector<std::string>& command,
                        const std::vector<std::string>& extra = {},
                        std::function<void()> waiting = {});
  /// Kills the remaining processes of the group.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Sends a text, waits for one line and returns it without its line end. Further output is kept
  /// for the next call. Never stores much more than the limit.
  /// @throws ChildProcessError if the child ends, the time is up, or the line is too long
  std::string exchange(std::string_view text, const LineLimits& limits);

  /// Sends a last text, closes the input and waits for the end of the child.
  /// @throws ChildProcessError if the child writes anything more, does not end, or ends with an
  ///     error
  void finish(std::string_view text, double seconds);

  /// Returns the last lines written to stderr, at most 1000 bytes, without control characters.
  std::string stderr_tail() const;

 private:
  using Instant = std::chrono::steady_clock::time_point;

  void poll_pipes(Instant deadline, std::size_t max_received);
  void write_available();
  bool read_stderr();
  bool has_ended() const;
  std::string wait_for_exit(Instant deadline);
  int kill_and_reap();

  std::function<void()> waiting_;
  pid_t pid_ = -1;  // -1: no process to kill_and_reap
  Descriptor in_, out_, err_;
  std::string_view unsent_;
  std::string received_;     // not yet returned
  std::string stderr_text_;  // last bytes of stderr
};

}  // namespace abbe::sim::compensation
