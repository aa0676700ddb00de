#include "sim/files/progress.h"

#include <algorithm>
#include <csignal>
#include <cstdio>

#include <unistd.h>

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "sim/files/terminal.h"

namespace abbe::sim {
namespace {

volatile std::sig_atomic_t interrupted = 0;

extern "C" void on_interrupt(int) {
  if (interrupted != 0) ::_exit(130);
  interrupted = 1;
}

}  // namespace

void watch_interrupts() {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
}

void stop_if_interrupted() {
  if (interrupted != 0) throw Interrupted();
}

ProgressLine::ProgressLine(int parts)
    : parts_(std::max(1, parts)), terminal_(::isatty(STDERR_FILENO) != 0) {}

ProgressLine::~ProgressLine() {
  if (terminal_) std::fputs("\r\x1b[K", stderr);
}

void ProgressLine::draw(const std::string& text) {
  std::fputs(("\r\x1b[K" + escaped(text)).c_str(), stderr);
  std::fflush(stderr);
}

void ProgressLine::begin(const std::string& part) {
  if (interrupted != 0) throw Interrupted();
  const std::lock_guard lock(mutex_);
  ++done_;
  part_ = part;
  if (!terminal_) print(stderr, "[{}/{}] {}\n", done_ + 1, parts_, part_);
}

void ProgressLine::report(const std::string& stage, double fraction) {
  if (interrupted != 0) throw Interrupted();
  if (fraction < 0.0) {
    const std::lock_guard lock(mutex_);
    if (terminal_) draw("");
    print(stderr, "{}\n", stage);
    return;
  }
  if (!terminal_) return;
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double done = (std::max(0, done_) + std::clamp(fraction, 0.0, 1.0)) / parts_;
  const double spent = std::chrono::duration<double>(now - start_).count();
  const std::string left =
      done > 0.02 ? fmt::format(", {:.0f} s left", spent * (1.0 - done) / done) : std::string();
  draw(fmt::format("[{}/{}] {}: {} {:.0f} %{}", done_ + 1, parts_, part_, stage, 100.0 * fraction,
                   left));
}

}  // namespace abbe::sim
