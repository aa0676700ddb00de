#pragma once

#include <map>
#include <string>
#include <vector>

namespace abbe::sim {

/// A stage of work to come.
struct Stage {
  std::string part;      ///< to which it belongs, such as a case
  std::string kind;      ///< what it does, as it reports itself; stages of one kind cost alike
  double seconds = 0.0;  ///< predicted, on a computer of about this speed
};

/// How long planned stages will still take. Predictions say how the stages compare; how fast this
/// computer does each kind of work is learned from the stages that are over and from the one that
/// runs. Knows no clock: times are handed in, s, and rise.
class TimeLeft {
 public:
  explicit TimeLeft(std::vector<Stage> plan, double now_s = 0.0);

  /// From now on these stages follow the one that runs; what was learned stays.
  void replan(std::vector<Stage> rest);
  /// The stage that runs is over, and the next one of that part begins; those between are left out.
  void begin(const std::string& part, double now_s);
  /// A stage of the part that runs has come so far; one of another kind is over with its first
  /// report. A kind that is not planned counts for the stage that runs.
  void report(const std::string& kind, double fraction, double now_s);

  /// Number of the part that runs, from 1, and of all; stages of one part stand together.
  int part() const { return parts_until(running_ + 1); }
  int parts() const { return parts_until(plan_.size()); }

  double left_s(double now_s) const;
  /// Of all the work, by the predictions as they are now.
  double done(double now_s) const;

 private:
  /// What work of one kind took, and what was predicted for it.
  struct Measured {
    double took = 0.0, predicted = 0.0;
  };
  int parts_until(std::size_t stages) const;
  void move_to(std::size_t stage, double now_s);
  Measured of_running(double now_s) const;
  double predicted(const Stage& stage, double now_s) const;
  double left_of_running(double now_s) const;

  std::vector<Stage> plan_;
  std::size_t running_ = 0;
  double start_s_, begun_s_;
  double fraction_ = 0.0;
  std::map<std::string, Measured> measured_;
};

/// "12 s", "3 min", "2 h 10 min"
std::string duration_text(double seconds);

}  // namespace abbe::sim
