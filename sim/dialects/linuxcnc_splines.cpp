#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/dialects/linuxcnc_machine.h"

namespace abbe::sim::dialects::linuxcnc {

using Eigen::Vector2d;

namespace {

constexpr double chord = 1e-4;       // mm, of a spline from its chords
constexpr double most_chords = 1e6;  // of one spline
constexpr int most_halvings = 16;
constexpr std::size_t most_poles = 10000;

/// A rational B-spline with the knots of its poles spaced evenly, its ends clamped.
struct Spline {
  std::vector<Eigen::Vector3d> poles;  ///< x w, y w, w
  std::vector<double> knots;
  int order = 3;

  Vector2d at(double u) const {
    const int degree = order - 1, n = int(poles.size());
    int span = degree;
    while (span < n - 1 && u >= knots[std::size_t(span + 1)]) ++span;
    std::vector<Eigen::Vector3d> d(poles.begin() + span - degree, poles.begin() + span + 1);
    for (int r = 1; r <= degree; ++r)
      for (int j = degree; j >= r; --j) {
        const double low = knots[std::size_t(span - degree + j)];
        const double high = knots[std::size_t(span + 1 + j - r)];
        const double a = (u - low) / (high - low);
        d[std::size_t(j)] = (1 - a) * d[std::size_t(j - 1)] + a * d[std::size_t(j)];
      }
    const Eigen::Vector3d& p = d[std::size_t(degree)];
    return {p.x() / p.z(), p.y() / p.z()};
  }
};

double off_chord(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const Vector2d way = b - a;
  const double length = way.squaredNorm();
  const double t = length > 0 ? std::clamp((p - a).dot(way) / length, 0.0, 1.0) : 0.0;
  return (p - a - t * way).norm();
}

/// Halves a stretch until its quarters lie on its chord.
void refine(const Spline& spline, double from, double to, int halvings,
            std::vector<Vector2d>& points) {
  const Vector2d a = spline.at(from), b = spline.at(to);
  double off = 0.0;
  for (const double part : {0.25, 0.5, 0.75})
    off = std::max(off, off_chord(spline.at(from + part * (to - from)), a, b));
  const bool enough = double(points.size()) > most_chords;  // refused when all is there
  if ((halvings >= 2 && off <= 0.5 * chord) || halvings == most_halvings || enough) {
    points.push_back(b);
    return;
  }
  const double middle = 0.5 * (from + to);
  refine(spline, from, middle, halvings + 1, points);
  refine(spline, middle, to, halvings + 1, points);
}

/// Chords of a cubic Bezier curve: n of them err by at most |B''| / 8 n^2.
std::vector<Vector2d> bezier_points(const std::array<Vector2d, 4>& p) {
  const double bend =
      6 * std::max((p[0] - 2 * p[1] + p[2]).norm(), (p[1] - 2 * p[2] + p[3]).norm());
  const int n = int(std::clamp(std::ceil(std::sqrt(bend / (8 * chord))), 1.0, most_chords));
  std::vector<Vector2d> points;
  for (int i = 1; i <= n; ++i) {
    const double u = double(i) / n, v = 1 - u;
    points.push_back(v * v * v * p[0] + 3 * v * v * u * p[1] + 3 * v * u * u * p[2] +
                     u * u * u * p[3]);
  }
  return points;
}

std::vector<Vector2d> nurbs_points(std::vector<Eigen::Vector3d> poles, int order) {
  Spline spline{std::move(poles), {}, order};
  const int n = int(spline.poles.size());
  for (int i = 0; i < n + order; ++i)
    spline.knots.push_back(std::clamp(double(i - order + 1), 0.0, double(n - order + 1)));
  std::vector<Vector2d> points;
  for (int i = 0; i < n - order + 1; ++i) refine(spline, i, i + 1, 0, points);
  return points;
}

}  // namespace

/// G5 G5.1 G5.2 G5.3, in X Y.
void Machine::spline(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.on()) refuse(cause, "G40 before a spline");
  if (plane_ != 170) refuse(cause, "G17 before a spline");
  const int x = joint(0), y = joint(1);
  if (x < 0 || y < 0) refuse(cause, "a machine with X and Y beside a spline");
  for (int k = 2; k < 9; ++k)
    if (const NcWord& word = block[axis_letters[std::size_t(k)]])
      refuse(word, "X and Y alone beside a spline");
  AxisVector at = canon_.programmed();
  const Vector2d start(at[x], at[y]);
  const auto word = [&](char letter) { return block[letter].value * unit(); };
  Vector2d end = start;
  if (block['X']) end.x() = axis_word(0, block['X']) + (incremental_ ? start.x() : 0.0);
  if (block['Y']) end.y() = axis_word(1, block['Y']) + (incremental_ ? start.y() : 0.0);
  std::vector<Vector2d> points;
  if (motion_ == 50) {
    if (!block['P'] || !block['Q']) refuse(cause, "P and Q beside G5", "none");
    if (!block['I'] != !block['J']) refuse(cause, "both I and J beside G5, or none", "one");
    if (!block['I'] && !spline_arm_) refuse(cause, "I and J in the first G5", "none");
    const Vector2d arm = block['I'] ? Vector2d(word('I'), word('J')) : Vector2d(-*spline_arm_);
    spline_arm_ = Vector2d(word('P'), word('Q'));
    points = bezier_points({start, start + arm, end + *spline_arm_, end});
  } else if (motion_ == 51) {
    if (!block['I'] || !block['J']) refuse(cause, "both I and J beside G5.1");
    const Vector2d middle = start + Vector2d(word('I'), word('J'));
    points = bezier_points(
        {start, start + 2.0 / 3 * (middle - start), end + 2.0 / 3 * (middle - end), end});
  } else if (motion_ == 52) {
    if (incremental_) refuse(cause, "G90 beside G5.2");
    if (const NcWord& l = block['L']) order_ = whole_word(l, 20);
    if (order_ < 2) refuse(block['L'], "an order of 2 to 20 after L");
    const NcWord& p = block['P'];
    if (!p || !(p.value > 0)) refuse(p ? Cause(p) : cause, "P (weight) above zero beside G5.2");
    if (poles_.size() == most_poles) refuse(cause, "at most 10000 poles of a spline", "more");
    poles_.push_back({end.x(), end.y(), p.value});
    return;
  } else {
    if (int(poles_.size()) < order_)
      refuse(cause, fmt::format("{} poles or more before G5.3", order_),
             fmt::format("{}", poles_.size()));
    std::vector<Eigen::Vector3d> poles;
    for (const Pole& pole : poles_)
      poles.emplace_back(pole.x * pole.weight, pole.y * pole.weight, pole.weight);
    points.emplace_back(poles_.front().x, poles_.front().y);
    for (const Vector2d& point : nurbs_points(std::move(poles), order_)) points.push_back(point);
    poles_.clear();
    motion_ = -1;
  }
  if (double(points.size()) > most_chords)
    refuse(cause, fmt::format("at most {:.0f} chords of a spline", most_chords), "more");
  run_.check_moves(double(points.size()), cause);
  for (const Vector2d& point : points) {
    at[x] = point.x();
    at[y] = point.y();
    go(at, false);
  }
}

}  // namespace abbe::sim::dialects::linuxcnc
