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

namespace abbe::sim::compensation {

/// A program that did not do what was expected of it: "expected ..., seen ...".
struct ChildProcessError : std::runtime_error {
  using std::runtime_error::runtime_error;
  ChildProcessError(const std::string& expected, const std::string& seen);
};

/// How long to wait for a line and how much of it to hold.
struct LineLimits {
  double seconds = 10.0;
  std::size_t longest = 65536;  ///< bytes
};

/// An open file that closes itself.
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

/// A program at the other end of three pipes, in a process group of its own. It inherits the
/// environment and the working directory, and no open file. Linux.
class ChildProcess {
 public:
  /// Starts it.
  /// @param command  program, found on the PATH unless it has a slash, and its arguments
  /// @param extra    "NAME=value" of the environment, besides our own
  /// @throws ChildFault if it cannot be started
  /// @param waiting  called again and again while we wait; may throw, then the child is killed
  explicit ChildProcess(const std::vector<std::string>& command,
                        const std::vector<std::string>& extra = {},
                        std::function<void()> waiting = {});
  /// Kills what is left of its group.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Sends a text and waits for one line, given without its end; what it says beside is kept for
  /// the next. Never holds much more than the limit.
  /// @throws ChildFault if it ends, or the time, or says too much
  std::string exchange(std::string_view text, const LineLimits& limits);

  /// Sends a last text, closes its input and waits for its end.
  /// @throws ChildFault if it says anything more, does not end, or ends badly
  void finish(std::string_view text, double seconds);

  /// The last lines that it wrote to stderr, at most 1000 bytes, without control characters.
  std::string stderr_tail() const;

 private:
  using Instant = std::chrono::steady_clock::time_point;

  void poll_pipes(Instant deadline, std::size_t max_heard);
  void write_some();
  bool read_err();
  bool has_ended() const;
  std::string wait_for_exit(Instant deadline);
  int reap();

  std::function<void()> waiting_;
  pid_t pid_ = -1;  // -1 when there is none to reap
  Descriptor in_, out_, err_;
  std::string_view unsent_;
  std::string received_;  // not yet handed on
  std::string said_;      // on stderr, the end of it
};

}  // namespace abbe::sim::compensation
