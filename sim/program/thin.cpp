#include "sim/program/thin.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "kinematics/units.h"
#include "sim/program/pvt.h"

namespace abbe::sim::program {
namespace {

using Eigen::Vector2d;
using kinematics::AxisVector;
using kinematics::Motion;
using Points = std::vector<CorrectedPoint>;

// Beyond it an arc's middle would hang on a centre that words place badly, and full circles would
// not be distinguished from nothing.
constexpr double most_sweep = 0.9 * pi;
constexpr double least_radius_words = 50.0;
constexpr double least_chord_words = 20.0;

void check_dense(const Path& path, std::span<const Points> dense) {
  if (dense.size() != path.blocks.size())
    throw std::invalid_argument("expected one list of corrected points for every block");
  for (std::size_t i = 0; i < dense.size(); ++i) {
    if (dense[i].empty()) continue;
    double last = 0.0;
    for (const CorrectedPoint& point : dense[i]) {
      if (!(point.u >= last && point.u <= 1.0) || point.at.size() != path.blocks[i].end.size() ||
          !point.at.allFinite())
        throw std::invalid_argument(
            fmt::format("expected u that never falls and finite axes in block {}", i));
      last = point.u;
    }
    if (dense[i].size() < 2 || dense[i].front().u != 0.0 || last != 1.0)
      throw std::invalid_argument(
          fmt::format("expected corrected points from u = 0 to u = 1 in block {}", i));
  }
}

/// How far a point of the tool is off where the axes are off.
class Measure {
 public:
  Measure(const std::vector<ControlledAxis>& axes, const AxisVector& lever)
      : slide_(AxisVector::Zero(Eigen::Index(axes.size()))), lever_(slide_) {
    for (std::size_t j = 0; j < axes.size(); ++j) {
      if (axes[j].motion == Motion::Linear) slide_[int(j)] = 1.0;
      if (axes[j].motion == Motion::Rotary && lever.size() > 0) lever_[int(j)] = lever[int(j)];
    }
  }
  double operator()(const AxisVector& off) const {
    return off.cwiseProduct(slide_).norm() + off.cwiseAbs().dot(lever_);
  }

 private:
  AxisVector slide_;
  AxisVector lever_;
};

/// The last of first .. last that `fits` all the way, tried in growing strides; `first` is taken.
template <class Fits>
std::size_t farthest(std::size_t first, std::size_t last, const Fits& fits) {
  std::size_t good = first, bad = last + 1;
  for (std::size_t stride = 1; good < last && bad > last; stride *= 2) {
    const std::size_t next = std::min(last, good + stride);
    if (fits(next))
      good = next;
    else
      bad = next;
  }
  while (bad <= last && bad - good > 1) {
    const std::size_t middle = good + (bad - good) / 2;
    (fits(middle) ? good : bad) = middle;
  }
  return good;
}

AxisVector on_line(const CorrectedPoint& a, const CorrectedPoint& b, double u) {
  return a.at + (u - a.u) / (b.u - a.u) * (b.at - a.at);
}

Vector2d in_plane(const Arc& arc, const AxisVector& q) { return {q[arc.first], q[arc.second]}; }

/// The circle through two corrected points of an arc whose centre lies nearest to the arc's own,
/// moved as they are; none where it would not survive the rounding of its words.
std::optional<Arc> arc_between(const Arc& arc, const CorrectedPoint& a, const CorrectedPoint& b,
                               double word_mm) {
  const double sweep = arc.sweep * (b.u - a.u);
  const Vector2d start = in_plane(arc, a.at), end = in_plane(arc, b.at), chord = end - start;
  if (std::abs(sweep) > most_sweep || chord.norm() < least_chord_words * word_mm)
    return std::nullopt;
  const Vector2d moved = arc.centre + 0.5 * (start - position(arc, a.u) + end - position(arc, b.u));
  const Vector2d along = chord.normalized();
  Arc between = arc_through(
      {start, end, moved + along * along.dot(0.5 * (start + end) - moved), arc.sweep < 0.0});
  between.first = arc.first;
  between.second = arc.second;
  if (between.radius < least_radius_words * word_mm || std::abs(between.sweep) > pi)
    return std::nullopt;
  return between;
}

/// Thins the points of one block of lines or an arc.
class BlockThinner {
 public:
  /// @param arc  if the block is one
  BlockThinner(const Points& dense, const Arc* arc, const Measure& measure,
               const ThinOptions& options)
      : dense_(dense), arc_(arc), measure_(measure), options_(options) {}

  Points run() {
    Points kept;
    std::size_t last = 0;  // before the next jump
    for (std::size_t from = 0;;) {
      std::size_t next = from + 1;
      while (next < dense_.size() && is_near(from, next)) ++next;
      if (next == dense_.size()) return kept;
      if (dense_[next].u == dense_[from].u) {
        kept.push_back(line_to(next));
        from = next;
      } else {
        last = std::max(last, next);
        while (last + 1 < dense_.size() && !is_jump(last)) ++last;
        from = piece(from, {next, last}, kept);
      }
    }
  }

 private:
  /// Points that a piece may reach.
  struct Range {
    std::size_t first = 0, last = 0;
  };

  /// At the same instant and place.
  bool is_near(std::size_t from, std::size_t k) const {
    return dense_[k].u == dense_[from].u &&
           measure_(dense_[k].at - dense_[from].at) <= options_.tolerance;
  }
  bool is_jump(std::size_t k) const { return dense_[k + 1].u == dense_[k].u && !is_near(k, k + 1); }
  CorrectedPoint line_to(std::size_t k) const { return {dense_[k].u, dense_[k].at, {}, {}}; }

  bool line_fits(std::size_t from, std::size_t to) const {
    for (std::size_t k = from + 1; k < to; ++k)
      if (measure_(dense_[k].at - on_line(dense_[from], dense_[to], dense_[k].u)) >
          options_.tolerance)
        return false;
    return true;
  }

  bool arc_fits(std::size_t from, std::size_t to) const {
    const CorrectedPoint &a = dense_[from], &b = dense_[to];
    const auto arc = arc_between(*arc_, a, b, options_.word_mm);
    if (!arc) return false;
    for (std::size_t k = from + 1; k < to; ++k) {
      AxisVector q = on_line(a, b, dense_[k].u);
      const Vector2d p = position(*arc, (dense_[k].u - a.u) / (b.u - a.u));
      q[arc->first] = p.x();
      q[arc->second] = p.y();
      if (measure_(dense_[k].at - q) > options_.tolerance) return false;
    }
    return true;
  }

  /// Where an arc may end, so that none is longer than it may be and all are about as long.
  std::size_t last_of_arc(std::size_t from, std::size_t last) const {
    const double parts = std::ceil(std::abs(arc_->sweep) / most_sweep);
    std::size_t end = from + 1;
    while (end < last && dense_[end].u < dense_[from].u + 1.0 / parts - 1e-9) ++end;
    return end;
  }

  std::size_t piece(std::size_t from, Range range, Points& kept) const {
    const std::size_t line =
        farthest(range.first, range.last, [&](std::size_t to) { return line_fits(from, to); });
    const std::size_t end = arc_ == nullptr ? line : last_of_arc(from, range.last);
    // An arc too short to be one says nothing about longer ones: look beyond the line.
    const std::size_t round =
        line < end ? farthest(line, end, [&](std::size_t to) { return arc_fits(from, to); }) : line;
    kept.push_back(line_to(round));
    if (round > line)
      kept.back().centre =
          arc_between(*arc_, dense_[from], dense_[round], options_.word_mm)->centre;
    return round;
  }

  const Points& dense_;
  const Arc* arc_;
  const Measure& measure_;
  const ThinOptions& options_;
};

/// A place in a path.
struct LinePoint {
  std::size_t block = 0;
  double u = 0.0;
};

/// Corrections of cubics, as rows at their times.
struct Changes {
  std::vector<LinePoint> places;
  std::vector<PvtRow> rows;
};

/// Of points at one instant the last within a block counts, but a block starts where the one before
/// ended.
Changes changes(const Path& path, std::span<const Points> dense) {
  Changes all;
  for (std::size_t i = 0; i < dense.size(); ++i) {
    const Block& block = path.blocks[i];
    const auto add = [&](double u, const AxisVector& at) {
      const double time_s =
          u == 1.0 ? block.end_s : block.start_s + u * (block.end_s - block.start_s);
      const AxisVector by = at - position(path, block, u);
      if (all.rows.empty() || time_s > all.rows.back().time_s) {
        all.places.push_back({i, u});
        all.rows.push_back({time_s, by, {}});
      } else if (all.places.back().block == i) {
        all.rows.back().position = by;
      }
    };
    if (dense[i].empty() && i == 0) add(0.0, block.start);
    for (const CorrectedPoint& point : dense[i]) add(point.u, point.at);
    if (dense[i].empty()) add(1.0, block.end);
  }
  const std::vector<AxisVector> velocities = rates(all.rows);
  for (std::size_t k = 0; k < velocities.size(); ++k) all.rows[k].velocity = velocities[k];
  return all;
}

/// The correction that the cubic between two rows brings at an instant between them. The nominal
/// part of a cubic that is cut up stays the same cubic.
AxisVector on_cubic(const PvtRow& a, const PvtRow& b, double time_s) {
  const double duration = b.time_s - a.time_s, u = (time_s - a.time_s) / duration;
  const AxisVector way = b.position - a.position;
  return a.position + u * way +
         u * (1 - u) *
             ((1 - u) * (duration * a.velocity - way) - u * (duration * b.velocity - way));
}

CorrectedPath thinned_cubics(const Path& path, std::span<const Points> dense,
                             const Measure& measure, double tolerance) {
  CorrectedPath kept(dense.size());
  const auto [places, rows] = changes(path, dense);
  const auto keep = [&, &places = places, &rows = rows](std::size_t k) {
    const auto [block, u] = places[k];
    kept[block].push_back(
        {u, position(path, path.blocks[block], u) + rows[k].position, {}, rows[k].velocity});
  };
  const auto fits = [&, &rows = rows](std::size_t from, std::size_t to) {
    for (std::size_t k = from + 1; k < to; ++k)
      if (measure(rows[k].position - on_cubic(rows[from], rows[to], rows[k].time_s)) > tolerance)
        return false;
    return true;
  };
  keep(0);
  std::size_t end = 0;
  for (std::size_t from = 0; from + 1 < rows.size();) {
    if (end <= from) end = from + 1;
    while (places[end].u < 1.0) ++end;
    from = farthest(from + 1, end, [&](std::size_t to) { return fits(from, to); });
    keep(from);
  }
  return kept;
}

}  // namespace

CorrectedPath thinned(const Path& path, std::span<const Points> dense, const NcOptions& control,
                      const ThinOptions& options) {
  check_dense(path, dense);
  if (!(options.tolerance >= 0.0) || !(options.word_mm >= 0.0))
    throw std::invalid_argument("expected a tolerance and words of at least zero");
  const std::array<Measure, 2> measures = {Measure(control.axes, options.lever[0]),
                                           Measure(control.axes, options.lever[1])};
  const auto is_cubic = [](const Block& block) {
    return block.interpolation == Interpolation::Cubic;
  };
  if (!path.blocks.empty() && std::all_of(path.blocks.begin(), path.blocks.end(), is_cubic))
    return thinned_cubics(path, dense, measures[0], options.tolerance);
  CorrectedPath kept(dense.size());
  std::optional<AxisVector>
      stands;  // where the block before left the tool, in the same coordinates
  for (std::size_t i = 0; i < dense.size(); ++i) {
    const Block& block = path.blocks[i];
    if (i == 0) stands = block.start;
    if (i > 0 && path.blocks[i - 1].coordinates != block.coordinates) stands.reset();
    if (dense[i].empty()) {
      if (block.interpolation != Interpolation::Dwell) stands = block.end;
      continue;
    }
    if (block.interpolation == Interpolation::Rapid) {
      kept[i] = {dense[i].back()};
    } else {
      Points points = dense[i];
      if (stands) points.insert(points.begin(), {0.0, *stands, {}, {}});
      const bool is_arc =
          block.interpolation == Interpolation::Arc && path.arcs[block.shape].turned < 0;
      kept[i] = BlockThinner(points, is_arc ? &path.arcs[block.shape] : nullptr,
                             measures[std::size_t(block.coordinates)], options)
                    .run();
      // Between axes and tip the place is taken up again.
      if (!stands && kept[i].front().u > 0.0) kept[i].insert(kept[i].begin(), dense[i].front());
    }
    stands = dense[i].back().at;
  }
  return kept;
}

}  // namespace abbe::sim::program
