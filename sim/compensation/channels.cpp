#include "sim/compensation/channels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double longest_course = 2e8;
constexpr double largest_count = 1e15;  // whole numbers and halves are still distinct

void channel_expects(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("a channel expects " + what);
}

bool positive(double value) { return value > 0.0 && std::isfinite(value); }
bool not_negative(double value) { return value >= 0.0 && std::isfinite(value); }

double rounded(double value, double increment) {
  if (increment == 0.0) return value;
  const double whole = std::round(value / increment);
  return std::abs(whole) < largest_count ? whole * increment : value;
}

/// Number of the first cycle that does not begin before an instant.
long cycles_until(double end_s, double start_s, double cycle_s) {
  const double cycles = std::ceil((end_s - start_s) / cycle_s);
  channel_expects(cycles <= longest_course, "at most 2e8 cycles in a course");
  return long(cycles);
}

/// Value at the begin of every cycle, changed by `shaped`, held from a delay later on.
template <typename Shaped>
Course held(const Course& wanted, double cycle_s, double delay_s, const Shaped& shaped) {
  validate(wanted, "channel");
  channel_expects(positive(cycle_s), "a cycle above 0");
  channel_expects(not_negative(delay_s), "a delay that is not negative");
  const double start_s = wanted.time_s[0];
  const long cycles = cycles_until(wanted.time_s[wanted.time_s.size() - 1], start_s, cycle_s);
  CourseWalk walk(wanted);
  VectorXd now = shaped(wanted.value.row(0).transpose());
  Knots knots(now.size());
  knots.add(start_s, now);
  for (long k = 0; k <= cycles; ++k) {
    const double read_s = start_s + double(k) * cycle_s;
    const VectorXd next = shaped(walk.at(read_s));
    if (next == now) continue;
    knots.add(read_s + delay_s, now);
    knots.add(read_s + delay_s, next);
    now = next;
  }
  return knots.course();
}

/// On the way to a target at a rate, column by column.
struct Approach {
  double start_s;
  double rate;
  VectorXd from, target, arrival_s;

  VectorXd at(double time_s) const {
    const VectorXd reached = rate * (time_s - start_s) * (target - from).cwiseSign();
    return (arrival_s.array() <= time_s).select(target, from + reached);
  }
};

/// Follows steps at a rate, each column by itself.
Course ramped(const Course& steps, double rate) {
  const Index n = steps.time_s.size();
  VectorXd now = steps.value.row(0).transpose();
  Knots knots(now.size());
  knots.add(steps.time_s[0], now);
  for (Index i = 0; i < n; ++i) {
    const double start_s = steps.time_s[i];
    const double end_s = i + 1 < n ? steps.time_s[i + 1] : std::numeric_limits<double>::infinity();
    if (end_s == start_s) continue;
    Approach approach{start_s, rate, now, steps.value.row(i).transpose(), {}};
    approach.arrival_s = start_s + ((approach.target - now).cwiseAbs() / rate).array();
    std::vector<double> arrivals;
    for (Index j = 0; j < now.size(); ++j)
      if (approach.target[j] != now[j] && approach.arrival_s[j] < end_s)
        arrivals.push_back(approach.arrival_s[j]);
    std::sort(arrivals.begin(), arrivals.end());
    arrivals.erase(std::unique(arrivals.begin(), arrivals.end()), arrivals.end());
    for (const double arrival_s : arrivals) knots.add(arrival_s, approach.at(arrival_s));
    if (i + 1 == n) break;
    now = approach.at(end_s);
    knots.add(end_s, now);
  }
  return knots.course();
}

}  // namespace

Course through(const Course& wanted, const OpenControl& open) {
  return held(wanted, open.cycle_s, open.delay_s, [](const VectorXd& row) { return row; });
}

Course through(const Course& wanted, const OriginShift& origin,
               std::span<const kinematics::Joint> joints) {
  channel_expects(Index(joints.size()) == wanted.value.cols(), "a joint for each column");
  channel_expects(not_negative(origin.increment), "an increment that is not negative");
  channel_expects(not_negative(origin.rate), "a rate that is not negative");
  const Course steps = held(wanted, origin.cycle_s, origin.delay_s, [&](VectorXd row) {
    for (Index j = 0; j < row.size(); ++j) {
      const bool slide = joints[std::size_t(j)].motion == kinematics::Motion::Linear;
      row[j] = slide ? rounded(row[j], origin.increment) : 0.0;
    }
    return row;
  });
  return origin.rate > 0.0 ? ramped(steps, origin.rate) : steps;
}

Course through(const Course& wanted_t, const Piezo& piezo) {
  channel_expects(wanted_t.value.cols() == 3, "three columns for a piezo");
  channel_expects(std::abs(piezo.direction_t.norm() - 1.0) <= 1e-9,
                  "a unit direction of the piezo");
  channel_expects(positive(piezo.range), "a range of the piezo above 0");
  channel_expects(not_negative(piezo.resolution), "a resolution that is not negative");
  const Course along{wanted_t.time_s, wanted_t.value * piezo.direction_t};
  const double most = 0.5 * piezo.range;
  const Course set_points = held(along, piezo.cycle_s, 0.0, [&](VectorXd row) {
    row[0] = std::clamp(rounded(row[0], piezo.resolution), -most, most);
    return row;
  });
  return followed_by(set_points, piezo.loop);
}

double yielding(const Piezo& piezo, double force_along) {
  channel_expects(positive(piezo.stiffness), "a stiffness of the piezo above 0");
  return force_along / piezo.stiffness;
}

}  // namespace abbe::sim::compensation
