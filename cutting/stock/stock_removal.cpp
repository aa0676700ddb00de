#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "cutting/stock/stock.h"
#include "cutting/stock/swept_cutter.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector3d;

/// The tool at an instant: the rows of R are its axes in the grid frame, z to the spindle.
struct ToolPose {
  Eigen::Vector3d tip;  // mm, from the grid's origin
  Eigen::Matrix3d R;

  Eigen::Vector3d axis() const { return R.row(2); }
};

/// A move in the grid frame: the tip on a line, the axis on a great circle about `R.row(1)`.
class ToolPath {
 public:
  /// @throws std::invalid_argument unless the poses are finite and the axis turns by less than half
  ///         a turn
  ToolPath(const Stock& stock, const StockMove& move);

  double angle() const { return angle_; }
  double length() const { return step_.norm(); }

  /// Returns the pose at t of the move, 0 .. 1.
  ToolPose at(double t) const;

 private:
  Eigen::Vector3d tip_, step_;
  Eigen::Matrix3d R_;
  double angle_;
};

namespace {

/// Returns v made normal to the axis. The difference of two nearly equal axes is mostly rounding
/// and need not be normal to them.
Vector3d across_axis(const Vector3d& v, const Vector3d& axis) {
  return (v - v.dot(axis) * axis).normalized();
}

}  // namespace

ToolPath::ToolPath(const Stock& stock, const StockMove& move) {
  const Eigen::Isometry3d T_kw = stock.T_wk.inverse();
  const Eigen::Isometry3d from = T_kw * move.from_T_wt, to = T_kw * move.to_T_wt;
  tip_ = from.translation() - stock.origin_k;
  step_ = to.translation() - from.translation();
  const Vector3d axis = from.linear().col(2).normalized();
  const Vector3d target = to.linear().col(2).normalized();
  if (!tip_.allFinite() || !step_.allFinite() || !axis.allFinite() || !target.allFinite())
    throw std::invalid_argument("stock move: expected finite poses");
  const Vector3d across = target - target.dot(axis) * axis;
  const double sine = across.norm();
  // 1e-12 rad: rounding of an axis that stands still
  angle_ = sine < 1e-12 ? 0.0 : std::atan2(sine, target.dot(axis));
  if (target.dot(axis) < 0.0 && std::numbers::pi - std::atan2(sine, target.dot(axis)) < 1e-9)
    throw std::invalid_argument("stock move: expected an axis that turns by less than half a turn");
  R_.row(2) = axis;
  R_.row(0) = angle_ > 0.0 ? across_axis(across / sine, axis) : axis.unitOrthogonal();
  R_.row(1) = axis.cross(Vector3d(R_.row(0)));
}

ToolPose ToolPath::at(double t) const {
  const double sine = std::sin(t * angle_), cosine = std::cos(t * angle_);
  ToolPose pose{tip_ + t * step_, R_};
  pose.R.row(0) = cosine * R_.row(0) - sine * R_.row(2);
  pose.R.row(2) = sine * R_.row(0) + cosine * R_.row(2);
  return pose;
}

namespace {

constexpr double part_sag = 1e-3;      // mm, deviation of a part of a move from a translation
constexpr double frozen_twist = 5e-4;  // mm, the same along one line
constexpr double settled_end = 1e-3;   // mm; the next end would move by a hundredth of it
constexpr double crash_length = 1e-6;  // mm of a line
constexpr double max_parts = 1e5;      // of a move

/// Returns a cutter that contains the cutter with a margin around it; its tip is lower by the
/// margin.
Cutter grown(const Cutter& cutter, double margin) {
  const double corner = cutter.corner_radius > 0.0 ? cutter.corner_radius + margin : 0.0;
  return {cutter.radius + margin, corner, cutter.flank_length + margin};
}

/// A line in the frame of the tool at the start and at the end of a part: points p + s d that move
/// on straight lines in between.
struct RuledLine {
  Vector3d p0, d0, p1, d1;

  Vector3d direction() const { return 0.5 * (d0 + d1); }
  Vector3d travel(double s) const { return p0 - p1 + s * (d0 - d1); }
  Vector3d start(double s) const { return p0 + s * d0; }
};

RuledLine first_half(const RuledLine& r) {
  return {r.p0, r.d0, 0.5 * (r.p0 + r.p1), 0.5 * (r.d0 + r.d1)};
}
RuledLine second_half(const RuledLine& r) {
  return {0.5 * (r.p0 + r.p1), 0.5 * (r.d0 + r.d1), r.p1, r.d1};
}

/// Returns the interval for a line of which every point moves as the point `s` does; exact there.
SweepInterval interval_of_fixed_line(const Cutter& cutter, const RuledLine& ruled, double s) {
  SweepInterval found =
      CutterSweep(cutter, ruled.travel(s)).along(ruled.start(s), ruled.direction());
  found.in += s;
  found.out += s;
  return found;
}

/// Returns the core whose contact is a crash; of a form cutter only where it must not cut.
InsetCutter crash_core(const Cutter& cutter, bool may_not_cut) {
  return may_not_cut || !cutter.outline ? shrunk(cutter, rubbing) : InsetCutter{};
}

/// The effect of a move on single lines.
class Cut {
 public:
  enum class Of { Cutter, Shank };  // a shank meets what its cutter has left

  /// @param cutter  convex, a part of `whole`
  /// @param core    of `whole`, from `crash_core`
  Cut(const Cutter& cutter, const InsetCutter& core, const StockMove& move, Of of)
      : cutter_(cutter),
        line_(move.line),
        may_not_cut_(move.rapid || of == Of::Shank),
        core_(core),
        core_parts_(convex_parts(core.cutter)) {}

  void minds_shank(bool minds) { minds_shank_ = minds && !cutter_.outline; }
  const Cutter& cutter() const { return cutter_; }

  /// Cuts a line in a part of the move in which the axis stands: all lines meet the same sweep.
  void along(DexelLine& line, const CutterSweep& sweep, const RuledLine& ruled) {
    ++removed.lines;
    const SweepInterval in = sweep.along(ruled.p0, ruled.d0);
    if (!in.is_empty()) take(line, in.in, in.out, ruled);
  }

  /// Cuts a line in a part in which the axis turns. If the motion of its points differs by more
  /// than `frozen_twist`, the interval is settled by iteration or the part is halved, at most 12
  /// times.
  void along(DexelLine& line, const RuledLine& ruled, int halvings = 12) {
    if (line.empty()) return;
    if (halvings == 12) ++removed.lines;
    double lo = line.runs().front().low, hi = line.runs().back().high;
    const Vector3d d = ruled.direction();
    const Vector3d middle = 0.5 * (ruled.p0 + ruled.p1) - Vector3d(0, 0, cutter_.corner_radius);
    const double nearest = std::clamp(-middle.dot(d) / d.squaredNorm(), lo, hi);
    const double margin = 0.5 * (ruled.d1 - ruled.d0).norm() * std::max(hi - nearest, nearest - lo);
    if (margin <= frozen_twist || halvings == 0) {
      const SweepInterval in = interval_of_fixed_line(cutter_, ruled, nearest);
      if (!in.is_empty()) take(line, in.in, in.out, ruled);
      return;
    }
    if (!within_reach(ruled, nearest, margin, lo, hi)) return;
    if (const auto in = settled(ruled, std::clamp(nearest, lo, hi), lo, hi))
      return take(line, in->in, in->out, ruled);
    along(line, first_half(ruled), halvings - 1);
    along(line, second_half(ruled), halvings - 1);
  }

  RemovalResult removed;
  double taken = 0.0;  // mm of lines

 private:
  /// Shortens lo .. hi to what the cutter may reach; returns false if that is nothing.
  bool within_reach(const RuledLine& ruled, double nearest, double margin, double& lo,
                    double& hi) const {
    RuledLine lowered = ruled;
    lowered.p0.z() += margin;
    lowered.p1.z() += margin;
    const SweepInterval outer = interval_of_fixed_line(grown(cutter_, margin), lowered, nearest);
    if (outer.is_empty()) return false;
    lo = std::max(lo, outer.in);
    hi = std::min(hi, outer.out);
    return lo <= hi;
  }

  /// Returns the interval for one end, iterating with the travel of the end found before.
  std::optional<SweepInterval> settled_end_at(const RuledLine& ruled, double s, bool upper,
                                              double lo, double hi) const {
    for (int i = 0; i < 4; ++i) {
      const SweepInterval in = interval_of_fixed_line(cutter_, ruled, s);
      if (in.is_empty()) return std::nullopt;
      const double end = std::clamp(upper ? in.out : in.in, lo, hi);
      if (std::abs(end - s) <= settled_end) return in;
      s = end;
    }
    return std::nullopt;
  }

  /// Returns the interval of both ends if nothing between them can be missed.
  std::optional<SweepInterval> settled(const RuledLine& ruled, double nearest, double lo,
                                       double hi) const {
    const SweepInterval rough = interval_of_fixed_line(cutter_, ruled, nearest);
    if (rough.is_empty()) return std::nullopt;
    const auto low = settled_end_at(ruled, std::clamp(rough.in, lo, hi), false, lo, hi);
    if (!low) return std::nullopt;
    const auto high = settled_end_at(ruled, std::clamp(rough.out, lo, hi), true, lo, hi);
    if (!high) return std::nullopt;
    const SweepInterval both{low->in, high->out, low->t_in, high->t_out};
    if (both.is_empty()) return std::nullopt;
    const double from = std::max(both.in, lo), to = std::min(both.out, hi);
    const double twist = (ruled.d1 - ruled.d0).norm();
    const double dent = 0.25 * twist * std::max(0.0, to - from) * std::abs(both.t_in - both.t_out);
    if (dent <= frozen_twist) return both;
    // If the standing tools at the times of both ends overlap, there is no dent between them.
    if (standing(ruled, both.t_in).out >= standing(ruled, both.t_out).in) return both;
    return std::nullopt;
  }

  SweepInterval standing(const RuledLine& ruled, double t) const {
    return CutterSweep(cutter_, Vector3d::Zero())
        .along(ruled.p0 + t * (ruled.p1 - ruled.p0), ruled.d0 + t * (ruled.d1 - ruled.d0));
  }

  void take(DexelLine& line, double low, double high, const RuledLine& ruled) {
    bool crashed = false;
    if (may_not_cut_ || minds_shank_) {
      const double from = std::max(low, line.runs().front().low);
      const double to = std::min(high, line.runs().back().high);
      crashed = (may_not_cut_ || reaches_shank(ruled, from, to)) &&
                line.length(from, to) > crash_length && crashes(line, ruled, 0.5 * (from + to));
    }
    taken += line.take(low, high, crashed ? -std::max(1, std::abs(line_)) : line_);
    removed.crashed = removed.crashed || crashed;
  }

  bool reaches_shank(const RuledLine& ruled, double from, double to) const {
    const double start = ruled.p0.z() + std::max(from * ruled.d0.z(), to * ruled.d0.z());
    const double end = ruled.p1.z() + std::max(from * ruled.d1.z(), to * ruled.d1.z());
    return std::max(start, end) > cutter_.flank_length;
  }

  bool crashes(const DexelLine& line, const RuledLine& ruled, double s) const {
    const Vector3d point = ruled.start(s), direction = ruled.direction();
    const Vector3d travel = ruled.travel(s);
    const auto met = [&](const SweepInterval& in) {
      return in.is_empty() ? 0.0 : line.length(s + in.in, s + in.out);
    };
    const auto sweep = [&](const Cutter& cutter, double base) {
      return CutterSweep(cutter, travel).along(point - Vector3d(0, 0, base), direction);
    };
    const auto meets = [&](const Cutter& part) {
      return met(sweep(part, core_.raised)) > crash_length;
    };
    if (may_not_cut_ && std::ranges::any_of(core_parts_, meets)) return true;
    if (!minds_shank_) return false;
    const Cutter shank{core_.cutter.radius, 0.0, 0.0};
    const SweepInterval by_shank = sweep(shank, cutter_.flank_length + core_.raised);
    const double length = met(by_shank);
    if (length <= crash_length || travel.z() >= 0.0) return length > crash_length;
    // Material that passed the upper end of the flank on its way down the tool was cut before.
    const SweepInterval cut_before = disc_sweep_interval(
        cutter_.radius, cutter_.flank_length + core_.raised, travel, point, direction);
    if (cut_before.is_empty()) return true;
    const double lo = std::max(by_shank.in, cut_before.in);
    const double hi = std::min(by_shank.out, cut_before.out);
    const double before = lo < hi ? line.length(s + lo, s + hi) : 0.0;
    return length - before > crash_length;
  }

  const Cutter& cutter_;
  int line_;
  bool may_not_cut_;
  InsetCutter core_;
  std::vector<Cutter> core_parts_;
  bool minds_shank_ = false;
};

// Lines under the sweep.

struct Range {
  double lo = infinity, hi = -infinity;
  void add(double x) { lo = std::min(lo, x), hi = std::max(hi, x); }
  void add(const Range& r) { lo = std::min(lo, r.lo), hi = std::max(hi, r.hi); }
};

/// Discs moved along the segments between four points of the plane.
class MovedDiscs {
 public:
  MovedDiscs(const std::array<Eigen::Vector2d, 4>& centres, double radius)
      : centres_(centres), radius_(radius) {
    for (std::size_t i = 0; i < centres.size(); ++i)
      for (std::size_t k = i + 1; k < centres.size(); ++k) add_sides(centres[i], centres[k]);
  }

  /// Returns the range of a row at height v that they cover.
  Range row(double v) const {
    Range range;
    for (const Eigen::Vector2d& c : centres_) {
      const double square = radius_ * radius_ - (v - c.y()) * (v - c.y());
      if (square < 0.0) continue;
      const double half = std::sqrt(square);
      range.add(c.x() - half);
      range.add(c.x() + half);
    }
    for (std::size_t i = 0; i < side_count_; ++i) {
      const Side& side = sides_[i];
      if (v >= side.low && v <= side.high) range.add(side.x + (v - side.y) * side.slope);
    }
    return range;
  }

 private:
  struct Side {
    double x, y, slope, low, high;
  };

  void add_sides(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const Eigen::Vector2d ab = b - a;
    const double length = ab.norm();
    if (length < 1e-12 || std::abs(ab.y()) < 1e-12 * length) return;
    for (const double side : {-radius_, radius_}) {
      const Eigen::Vector2d c = a + side * Eigen::Vector2d(-ab.y(), ab.x()) / length;
      sides_[side_count_++] = {c.x(), c.y(), ab.x() / ab.y(), std::min(c.y(), c.y() + ab.y()),
                               std::max(c.y(), c.y() + ab.y())};
    }
  }

  std::array<Eigen::Vector2d, 4> centres_;
  double radius_;
  std::array<Side, 12> sides_;
  std::size_t side_count_ = 0;
};

/// A body that contains the sweep of a part: a ball moved over the parallelogram between the
/// centres of the corner and the axis up to the end of the grid; and a box that contains its bottom
/// closely. Every point of the cutter departs from the chord between its ends by arm angle^2 / 8,
/// and its height over a point of the grid by as much plus angle length / 4: that is `sag`. The
/// part as it is swept departs from the true one by the same and by `frozen_twist`; the rest of the
/// slack, 1e-6 mm, is for rounding, which is 1e-12 at 1 m.
class Footprint {
 public:
  Footprint(const Stock& stock, const Cutter& cutter, const ToolPose& a, const ToolPose& b,
            double angle)
      : stock_(stock), radius_(cutter.radius) {
    const ToolPose* const poses[2] = {&a, &b};
    double up = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      Vector3d p;
      for (int k = 0; k < 3; ++k)
        p[k] = (corner >> k & 1) != 0 ? (stock.nodes[std::size_t(k)] - 1) * stock.spacing : 0.0;
      for (const ToolPose* pose : poses) up = std::max(up, (p - pose->tip).dot(pose->axis()));
    }
    const double sag =
        0.125 * angle * (angle * (up + cutter.radius) + 2.0 * (b.tip - a.tip).norm());
    up += sag;
    height_ = up;
    const double slack = 2.0 * sag + frozen_twist + 1e-6;
    radius_ += slack;
    for (int k = 0; k < 2; ++k) {
      const Vector3d base = poses[k]->tip + cutter.corner_radius * poses[k]->axis();
      corners_[2 * k] = base;
      corners_[2 * k + 1] = base + up * poses[k]->axis();
      for (int axis = 0; axis < 3; ++axis) {
        box_[axis].add(reach(cutter, *poses[k], axis, 1.0) + slack);
        box_[axis].add(-reach(cutter, *poses[k], axis, -1.0) - slack);
      }
    }
  }

  double height() const { return height_; }

  /// Returns the range of lines along `axis` that may be met.
  std::pair<int, int> lines(int axis, Range range) const {
    range.lo = std::max(range.lo, box_[axis].lo);
    range.hi = std::min(range.hi, box_[axis].hi);
    const double last = stock_.nodes[std::size_t(axis)] - 1;
    const double from = std::max(0.0, std::ceil(range.lo / stock_.spacing));
    const double to = std::min(last, std::floor(range.hi / stock_.spacing));
    return from <= to ? std::pair{int(from), int(to)} : std::pair{0, -1};
  }
  std::pair<int, int> rows(int axis) const { return lines(axis, {-infinity, infinity}); }

  /// Returns the discs seen in rows along one direction of the grid, by their coordinate along
  /// another.
  MovedDiscs seen(int along_row, int across) const {
    std::array<Eigen::Vector2d, 4> centres;
    for (std::size_t i = 0; i < centres.size(); ++i)
      centres[i] = {corners_[i][along_row], corners_[i][across]};
    return {centres, radius_};
  }

  const Range& extent(int axis) const { return box_[axis]; }

 private:
  /// Returns the farthest point of the standing tool in a direction of the grid.
  static double reach(const Cutter& cutter, const ToolPose& pose, int axis, double sense) {
    const Vector3d u = pose.axis();
    const double cosine = sense * u[axis];
    if (cosine > 1e-12) return infinity;
    const double r = cutter.corner_radius;
    const double sine = std::hypot(u[(axis + 1) % 3], u[(axis + 2) % 3]);
    return sense * pose.tip[axis] + r * (1.0 + cosine) + (cutter.radius - r) * sine;
  }

  const Stock& stock_;
  double radius_;
  double height_;
  Vector3d corners_[4];
  Range box_[3];
};

/// The alternative to Footprint that selects every line of every field.
class EveryLine {
 public:
  explicit EveryLine(const Stock& stock) : stock_(stock) {}

  std::pair<int, int> lines(int axis, const Range&) const { return rows(axis); }
  std::pair<int, int> rows(int axis) const { return {0, stock_.nodes[std::size_t(axis)] - 1}; }
  struct All {
    Range row(double) const { return {}; }
  };
  All seen(int, int) const { return {}; }
  Range extent(int) const { return {-infinity, infinity}; }

 private:
  const Stock& stock_;
};

template <class Places>
void sweep_field(DexelField& field, const Places& footprint, double spacing, const ToolPose& a,
                 const ToolPose& b, bool turns, Cut& cut) {
  const int along = field.along, first = (along + 1) % 3, second = (along + 2) % 3;
  const Range extent = footprint.extent(along);
  RuledLine ruled;
  ruled.d0 = a.R.col(along);
  ruled.d1 = b.R.col(along);
  const CutterSweep sweep(cut.cutter(), a.R * (b.tip - a.tip));
  const auto discs = footprint.seen(first, second);
  const auto [row_from, row_to] = footprint.rows(second);
  for (int j = row_from; j <= row_to; ++j) {
    const auto [from, to] = footprint.lines(first, discs.row(j * spacing));
    for (int i = from; i <= to; ++i) {
      DexelLine& line = field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)];
      if (line.empty() || line.runs().front().low > extent.hi ||
          line.runs().back().high < extent.lo)
        continue;
      Vector3d place = Vector3d::Zero();
      place[first] = i * spacing;
      place[second] = j * spacing;
      ruled.p0 = a.R * (place - a.tip);
      ruled.p1 = b.R * (place - b.tip);
      if (turns)
        cut.along(line, ruled);
      else
        cut.along(line, sweep, ruled);
    }
  }
}

/// Removes a cutter with the shank above its flank, or one of the two alone.
/// @param base  mm, height above the tip of the tool of the tip of what is removed
void sweep(Stock& stock, const ToolPath& path, int parts, double base, DexelSelection dexels,
           Cut& cut) {
  const auto pose = [&](double t) {
    ToolPose at = path.at(t);
    if (base > 0.0) at.tip += base * at.axis();
    return at;
  };
  const Cutter& cutter = cut.cutter();
  for (int i = 0; i < parts; ++i) {
    const ToolPose a = pose(double(i) / parts), b = pose(double(i + 1) / parts);
    const Footprint footprint(stock, cutter, a, b, path.angle() / parts);
    cut.minds_shank(footprint.height() > cutter.flank_length);
    const bool turns = path.angle() > 0.0;
    for (DexelField& field : stock.fields)
      if (dexels == DexelSelection::All)
        sweep_field(field, EveryLine(stock), stock.spacing, a, b, turns, cut);
      else if (footprint.height() > 0.0)
        sweep_field(field, footprint, stock.spacing, a, b, turns, cut);
  }
  cut.removed.volume = cut.taken * stock.spacing * stock.spacing / double(stock.fields.size());
}

}  // namespace

RemovalResult remove(Stock& stock, const Cutter& cutter, const StockMove& move,
                     DexelSelection dexels) {
  check_cutter(cutter);
  const ToolPath path(stock, move);
  const double arm = cutter.flank_length + cutter.radius;
  // largest deviation of the sweep from a translation, which falls with the square of the parts
  const double bow = 0.125 * path.angle() * (path.angle() * arm + 2.0 * path.length());
  const double count = std::sqrt(bow / part_sag);
  if (!(count < max_parts))
    throw std::invalid_argument(
        fmt::format("stock move: expected a turning axis whose move comes apart in at most {} "
                    "straight parts, seen {:.3g} ({:.3g} mm, turning by {:.3g} rad)",
                    max_parts, count, path.length(), path.angle()));
  const int parts = 1 + int(count);
  const std::vector<Cutter> convex = convex_parts(cutter);
  std::vector<Cut> cuts;
  const InsetCutter core = crash_core(cutter, move.rapid);
  for (const Cutter& part : convex) cuts.emplace_back(part, core, move, Cut::Of::Cutter);
  const Cutter shank{shank_radius(cutter), 0.0, 0.0};
  Cut by_shank(shank, crash_core(shank, true), move, Cut::Of::Shank);
  const auto take_cutter = [&] {
    for (Cut& cut : cuts) sweep(stock, path, parts, 0.0, dexels, cut);
  };
  const auto take_shank = [&] { sweep(stock, path, parts, cutter.flank_length, dexels, by_shank); };
  if (!cutter.outline) {
    take_cutter();
    return cuts.front().removed;
  }
  // In the frame of a rising tool the material comes down, so the shank meets it first.
  if (path.at(0.0).axis().dot(path.at(1.0).tip - path.at(0.0).tip) > 0.0) {
    take_shank();
    take_cutter();
  } else {
    take_cutter();
    take_shank();
  }
  RemovalResult removed = by_shank.removed;
  for (const Cut& cut : cuts) {
    removed.volume += cut.removed.volume;
    removed.crashed = removed.crashed || cut.removed.crashed;
    removed.lines += cut.removed.lines;
  }
  return removed;
}

}  // namespace abbe::cutting
