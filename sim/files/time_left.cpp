#include "sim/files/time_left.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

namespace abbe::sim {
namespace {

constexpr double trust_in_plan_s = 0.5;  // of the computer's speed, before anything is measured
constexpr double own_kind = 0.1;         // of a stage: what other kinds say of its own
constexpr double known_by_itself = 0.3;  // of a stage that is over, from where it says its own time
constexpr double worth_learning = 0.02;  // of a stage, before which it says nothing of its kind

}  // namespace

TimeLeft::TimeLeft(std::vector<Stage> plan, double now_s)
    : plan_(std::move(plan)), start_s_(now_s), begun_s_(now_s) {
  if (plan_.empty()) plan_.push_back({});
}

void TimeLeft::replan(std::vector<Stage> rest) {
  plan_.erase(plan_.begin() + std::ptrdiff_t(running_) + 1, plan_.end());
  std::move(rest.begin(), rest.end(), std::back_inserter(plan_));
}

int TimeLeft::parts_until(std::size_t stages) const {
  int parts = 0;
  for (std::size_t i = 0; i < stages; ++i) parts += i == 0 || plan_[i].part != plan_[i - 1].part;
  return parts;
}

void TimeLeft::move_to(std::size_t stage, double now_s) {
  Measured& kind = measured_[plan_[running_].kind];
  kind.took += now_s - begun_s_;
  kind.predicted += plan_[running_].seconds;
  running_ = stage;
  begun_s_ = now_s;
  fraction_ = 0.0;
}

void TimeLeft::begin(const std::string& part, double now_s) {
  for (std::size_t i = running_ + 1; i < plan_.size(); ++i)
    if (plan_[i].part == part && plan_[i - 1].part != part) return move_to(i, now_s);
}

void TimeLeft::report(const std::string& kind, double fraction, double now_s) {
  const std::string& part = plan_[running_].part;
  if (plan_[running_].kind != kind)
    for (std::size_t i = running_ + 1; i < plan_.size() && plan_[i].part == part; ++i)
      if (plan_[i].kind == kind) {
        move_to(i, now_s);
        break;
      }
  if (plan_[running_].kind == kind) fraction_ = std::clamp(fraction, fraction_, 1.0);
}

TimeLeft::Measured TimeLeft::of_running(double now_s) const {
  if (fraction_ < worth_learning) return {};
  return {now_s - begun_s_, fraction_ * plan_[running_].seconds};
}

/// By its own kind as far as that was seen, by the speed of everything else for the rest.
double TimeLeft::predicted(const Stage& stage, double now_s) const {
  Measured all{trust_in_plan_s, trust_in_plan_s}, own;
  const auto add = [&](const std::string& kind, const Measured& one) {
    all.took += one.took;
    all.predicted += one.predicted;
    if (kind != stage.kind) return;
    own.took += one.took;
    own.predicted += one.predicted;
  };
  for (const auto& [kind, one] : measured_) add(kind, one);
  add(plan_[running_].kind, of_running(now_s));
  const double weight = own_kind * stage.seconds, speed = all.took / all.predicted;
  const double total = own.predicted + weight;
  return total > 0.0 ? stage.seconds * (own.took + weight * speed) / total : 0.0;
}

double TimeLeft::left_of_running(double now_s) const {
  const double elapsed = now_s - begun_s_;
  const double planned = predicted(plan_[running_], now_s);
  // a stage that says nothing and is overdue takes a little longer than it has
  if (fraction_ <= 0.0) return std::max(planned - elapsed, 0.1 * std::min(planned, elapsed));
  const double by_itself = elapsed * (1.0 - fraction_) / fraction_;
  const double weight = std::min(1.0, fraction_ / known_by_itself);
  return weight * by_itself + (1.0 - weight) * (1.0 - fraction_) * planned;
}

double TimeLeft::left_s(double now_s) const {
  double left = left_of_running(now_s);
  for (std::size_t i = running_ + 1; i < plan_.size(); ++i) left += predicted(plan_[i], now_s);
  return left;
}

double TimeLeft::done(double now_s) const {
  const double spent = now_s - start_s_, left = left_s(now_s);
  return spent + left > 0.0 ? spent / (spent + left) : 0.0;
}

std::string duration_text(double seconds) {
  const auto whole = [](double value) { return std::lround(std::max(0.0, value)); };
  if (whole(seconds) < 90) return fmt::format("{} s", whole(seconds));
  const long minutes = whole(seconds / 60.0);
  if (minutes < 90) return fmt::format("{} min", minutes);
  return fmt::format("{} h {} min", minutes / 60, minutes % 60);
}

}  // namespace abbe::sim
