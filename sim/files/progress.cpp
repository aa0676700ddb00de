#include "sim/files/progress.h"

#include <algorithm>
#include <csignal>
#include <cstdio>

#include <semaphore.h>
#include <unistd.h>

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "sim/files/terminal.h"
#include "sim/files/unfinished_file.h"

namespace abbe::sim {
namespace {

volatile std::sig_atomic_t interrupted = 0;

constexpr double settled_s = 1.0;  // before that the time left is not worth a word
constexpr std::chrono::milliseconds tick(500), least_between(100);

/// Work that asks is over by then, files and all; no other one keeps a person waiting for more than
/// a second.
constexpr std::chrono::milliseconds time_to_stop(700);

::sem_t interruption;

extern "C" void on_interrupt(int) {
  if (interrupted != 0) ::_exit(130);
  interrupted = 1;
  ::sem_post(&interruption);
}

/// Ends the program if it has not stopped by itself: some of its work, and that of libraries, asks
/// nobody. No result suffers: a file has its name only once it is whole.
void end_after_interruption() {
  while (::sem_wait(&interruption) != 0) continue;
  std::this_thread::sleep_for(time_to_stop);
  remove_own_unfinished_files();
  print(stderr, "{}abbe: interrupted\n", Lines(::isatty(STDERR_FILENO) != 0 ? "\n" : ""));
  ::_exit(130);
}

}  // namespace

void watch_interrupts() {
  ::sem_init(&interruption, 0, 0);
  std::thread(end_after_interruption).detach();
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
}

void stop_if_interrupted() {
  if (interrupted != 0) throw Interrupted();
}

ProgressLine::ProgressLine(std::vector<Stage> plan, Progress instead)
    : time_left_(std::move(plan)),
      instead_(std::move(instead)),
      terminal_(!instead_ && ::isatty(STDERR_FILENO) != 0) {
  if (!terminal_) return;
  ticker_ = std::jthread([this](const std::stop_token& end) {
    std::unique_lock lock(mutex_);
    while (!ends_.wait_for(lock, end, tick, [&] { return end.stop_requested(); })) draw_state();
  });
}

ProgressLine::~ProgressLine() {
  if (!terminal_) return;
  ticker_ = {};
  std::fputs("\r\x1b[K", stderr);
}

double ProgressLine::now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

/// Of the whole, by the time that is spent and left.
double ProgressLine::share() const {
  const double spent = now_s(), left = time_left_.left_s(spent);
  return spent + left > 0.0 ? std::clamp(spent / (spent + left), 0.0, 1.0) : 0.0;
}

void ProgressLine::draw(const std::string& text) {
  std::fputs(("\r\x1b[K" + escaped(text)).c_str(), stderr);
  std::fflush(stderr);
}

void ProgressLine::replan(std::vector<Stage> rest) {
  const std::lock_guard lock(mutex_);
  time_left_.replan(std::move(rest));
}

void ProgressLine::begin(const std::string& part) {
  if (interrupted != 0) throw Interrupted();
  const std::lock_guard lock(mutex_);
  if (begun_) time_left_.begin(part, now_s());
  begun_ = true;
  part_ = part;
  stage_.clear();
  if (instead_)
    instead_(part_, share());
  else if (!terminal_)
    print(stderr, "[{}/{}] {}\n", time_left_.part(), time_left_.parts(), part_);
}

void ProgressLine::report(const std::string& stage, double fraction) {
  if (interrupted != 0) throw Interrupted();
  const std::lock_guard lock(mutex_);
  if (fraction < 0.0) {
    if (instead_) return instead_(stage, fraction);
    if (terminal_) draw("");
    print(stderr, "{}\n", stage);
    return;
  }
  time_left_.report(stage, fraction, now_s());
  const bool next = stage != stage_;
  stage_ = stage;
  fraction_ = fraction;
  if (instead_) return instead_(part_ + ": " + stage_, share());
  if (terminal_ && (next || std::chrono::steady_clock::now() - drawn_ >= least_between))
    draw_state();
}

void ProgressLine::draw_state() {
  if (!begun_ || stage_.empty()) return;
  drawn_ = std::chrono::steady_clock::now();
  const double spent = now_s();
  std::string text =
      fmt::format("[{}/{}] {}: {}", time_left_.part(), time_left_.parts(), part_, stage_);
  if (fraction_ > 0.0) text += fmt::format(" {:.0f} %", 100.0 * std::min(fraction_, 1.0));
  if (spent >= settled_s) text += ", " + duration_text(time_left_.left_s(spent)) + " left";
  draw(text);
}

Progress to(ProgressLine& line) {
  return [&line](const std::string& stage, double fraction) { line.report(stage, fraction); };
}

}  // namespace abbe::sim
