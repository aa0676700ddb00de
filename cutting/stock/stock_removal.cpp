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

namespace {

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

/// Returns the unit vector of v's component normal to the axis. The difference of two nearly equal
/// axes is mostly rounding and need not be normal to them.
Vector3d normal_to_axis(const Vector3d& direction, const Vector3d& axis) {
  return (direction - direction.dot(axis) * axis).normalized();
}

ToolPath::ToolPath(const Stock& stock, const StockMove& move) {
  const Eigen::Isometry3d T_kw = stock.T_wk.inverse();
  const Eigen::Isometry3d start = T_kw * move.from_T_wt, end = T_kw * move.to_T_wt;
  tip_ = start.translation() - stock.origin_k;
  step_ = end.translation() - start.translation();
  const Vector3d axis = start.linear().col(2).normalized();
  const Vector3d end_axis = end.linear().col(2).normalized();
  if (!tip_.allFinite() || !step_.allFinite() || !axis.allFinite() || !end_axis.allFinite())
    throw std::invalid_argument("stock move: expected finite poses");
  const Vector3d turn_direction = end_axis - end_axis.dot(axis) * axis;
  const double sine = turn_direction.norm();
  // Below 1e-12 rad the difference is rounding of an axis that does not turn.
  angle_ = sine < 1e-12 ? 0.0 : std::atan2(sine, end_axis.dot(axis));
  if (end_axis.dot(axis) < 0.0 && std::numbers::pi - std::atan2(sine, end_axis.dot(axis)) < 1e-9)
    throw std::invalid_argument("stock move: expected an axis that turns by less than 180 degrees");
  R_.row(2) = axis;
  R_.row(0) = angle_ > 0.0 ? normal_to_axis(turn_direction / sine, axis) : axis.unitOrthogonal();
  R_.row(1) = axis.cross(Vector3d(R_.row(0)));
}

ToolPose ToolPath::at(double t) const {
  const double sine = std::sin(t * angle_), cosine = std::cos(t * angle_);
  ToolPose pose{tip_ + t * step_, R_};
  pose.R.row(0) = cosine * R_.row(0) - sine * R_.row(2);
  pose.R.row(2) = sine * R_.row(0) + cosine * R_.row(2);
  return pose;
}

constexpr double max_part_sag = 1e-3;   // mm, deviation of a part of a move from a translation
constexpr double max_twist = 5e-4;      // mm, the same along one line
constexpr double end_tolerance = 1e-3;  // mm; the next iteration moves the end by a hundredth of it
constexpr double min_crash_length = 1e-6;  // mm of a line
constexpr double max_parts = 1e5;          // of a move

/// Returns a cutter that encloses the cutter with a margin; its tip is lower by the margin.
Cutter enlarged(const Cutter& cutter, double margin) {
  const double corner = cutter.corner_radius > 0.0 ? cutter.corner_radius + margin : 0.0;
  return {cutter.radius + margin, corner, cutter.flank_length + margin};
}

/// A line of the stock in the frame of the tool, at the start and at the end of a part of a move:
/// points p + s d, which move on straight lines in between.
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

/// Returns the interval for a line whose points all move like the point at `s`; exact for that
/// point.
SweepInterval translated_line_interval(const Cutter& cutter, const RuledLine& ruled, double s) {
  SweepInterval result =
      CutterSweep(cutter, ruled.travel(s)).interval(ruled.start(s), ruled.direction());
  result.in += s;
  result.out += s;
  return result;
}

/// Returns the core of a tool whose contact is a crash; empty for a form cutter that may cut.
InsetCutter crash_core(const Cutter& cutter, bool may_not_cut) {
  return may_not_cut || !cutter.outline ? inset_cutter(cutter, rubbing) : InsetCutter{};
}

/// Removal of one tool section's sweep from single lines.
class LineCutter {
 public:
  enum class ToolSection { Cutter, Shank };  // the shank meets the material its cutter left

  /// @param cutter  convex, a part of `whole`
  /// @param core    of `whole`, from `crash_core`
  LineCutter(const Cutter& cutter, const InsetCutter& core, const StockMove& move,
             ToolSection section)
      : cutter_(cutter),
        line_(move.line),
        may_not_cut_(move.rapid || section == ToolSection::Shank),
        core_(core),
        core_parts_(convex_parts(core.cutter)) {}

  void set_checks_shank(bool checks) { checks_shank_ = checks && !cutter_.outline; }
  const Cutter& cutter() const { return cutter_; }

  /// Cuts a line in a part of the move in which the axis does not turn: all lines share one sweep.
  void cut(DexelLine& line, const CutterSweep& sweep, const RuledLine& ruled) {
    ++removed.lines;
    const SweepInterval interval = sweep.interval(ruled.p0, ruled.d0);
    if (!interval.is_empty()) remove_interval(line, interval.in, interval.out, ruled);
  }

  /// Cuts a line in a part in which the axis turns. If the motions of the line's points differ by
  /// more than `max_twist`, iterates the ends of the interval, or halves the part at most 12 times.
  void cut(DexelLine& line, const RuledLine& ruled, int halvings = 12) {
    if (line.empty()) return;
    if (halvings == 12) ++removed.lines;
    double lo = line.runs().front().low, hi = line.runs().back().high;
    const Vector3d d = ruled.direction();
    const Vector3d centre = 0.5 * (ruled.p0 + ruled.p1) - Vector3d(0, 0, cutter_.corner_radius);
    const double nearest_s = std::clamp(-centre.dot(d) / d.squaredNorm(), lo, hi);
    const double margin =
        0.5 * (ruled.d1 - ruled.d0).norm() * std::max(hi - nearest_s, nearest_s - lo);
    if (margin <= max_twist || halvings == 0) {
      const SweepInterval interval = translated_line_interval(cutter_, ruled, nearest_s);
      if (!interval.is_empty()) remove_interval(line, interval.in, interval.out, ruled);
      return;
    }
    if (!limit_to_reach(ruled, nearest_s, margin, lo, hi)) return;
    if (const auto interval = settled_interval(ruled, std::clamp(nearest_s, lo, hi), lo, hi))
      return remove_interval(line, interval->in, interval->out, ruled);
    cut(line, first_half(ruled), halvings - 1);
    cut(line, second_half(ruled), halvings - 1);
  }

  RemovalResult removed;
  double removed_length = 0.0;  // mm of lines

 private:
  /// Shortens lo .. hi to the range that the cutter may reach. Returns false if it reaches nothing.
  bool limit_to_reach(const RuledLine& ruled, double nearest_s, double margin, double& lo,
                      double& hi) const {
    RuledLine lowered_line = ruled;
    lowered_line.p0.z() += margin;
    lowered_line.p1.z() += margin;
    const SweepInterval outer_interval =
        translated_line_interval(enlarged(cutter_, margin), lowered_line, nearest_s);
    if (outer_interval.is_empty()) return false;
    lo = std::max(lo, outer_interval.in);
    hi = std::min(hi, outer_interval.out);
    return lo <= hi;
  }

  /// Returns the interval that is accurate at one end: iterates with the travel of the previous
  /// end.
  std::optional<SweepInterval> settled_end_interval(const RuledLine& ruled, double s, bool is_upper,
                                                    double lo, double hi) const {
    for (int i = 0; i < 4; ++i) {
      const SweepInterval interval = translated_line_interval(cutter_, ruled, s);
      if (interval.is_empty()) return std::nullopt;
      const double end = std::clamp(is_upper ? interval.out : interval.in, lo, hi);
      if (std::abs(end - s) <= end_tolerance) return interval;
      s = end;
    }
    return std::nullopt;
  }

  /// Returns the interval that is accurate at both ends, or nothing if the sweep may have a dent
  /// between them.
  std::optional<SweepInterval> settled_interval(const RuledLine& ruled, double nearest_s, double lo,
                                                double hi) const {
    const SweepInterval approximate = translated_line_interval(cutter_, ruled, nearest_s);
    if (approximate.is_empty()) return std::nullopt;
    const auto low = settled_end_interval(ruled, std::clamp(approximate.in, lo, hi), false, lo, hi);
    if (!low) return std::nullopt;
    const auto high =
        settled_end_interval(ruled, std::clamp(approximate.out, lo, hi), true, lo, hi);
    if (!high) return std::nullopt;
    const SweepInterval combined{low->in, high->out, low->t_in, high->t_out};
    if (combined.is_empty()) return std::nullopt;
    const double begin = std::max(combined.in, lo), to = std::min(combined.out, hi);
    const double twist = (ruled.d1 - ruled.d0).norm();
    const double dent =
        0.25 * twist * std::max(0.0, to - begin) * std::abs(combined.t_in - combined.t_out);
    if (dent <= max_twist) return combined;
    // If the tools at the instants of both ends overlap, there is no dent between them.
    if (standing_interval(ruled, combined.t_in).out >= standing_interval(ruled, combined.t_out).in)
      return combined;
    return std::nullopt;
  }

  SweepInterval standing_interval(const RuledLine& ruled, double t) const {
    return CutterSweep(cutter_, Vector3d::Zero())
        .interval(ruled.p0 + t * (ruled.p1 - ruled.p0), ruled.d0 + t * (ruled.d1 - ruled.d0));
  }

  void remove_interval(DexelLine& line, double low, double high, const RuledLine& ruled) {
    bool crashed = false;
    if (may_not_cut_ || checks_shank_) {
      const double begin = std::max(low, line.runs().front().low);
      const double to = std::min(high, line.runs().back().high);
      crashed = (may_not_cut_ || reaches_shank(ruled, begin, to)) &&
                line.length(begin, to) > min_crash_length &&
                crashes(line, ruled, 0.5 * (begin + to));
    }
    removed_length += line.cut(low, high, crashed ? -std::max(1, std::abs(line_)) : line_);
    removed.crashed = removed.crashed || crashed;
  }

  bool reaches_shank(const RuledLine& ruled, double begin, double to) const {
    const double start = ruled.p0.z() + std::max(begin * ruled.d0.z(), to * ruled.d0.z());
    const double end = ruled.p1.z() + std::max(begin * ruled.d1.z(), to * ruled.d1.z());
    return std::max(start, end) > cutter_.flank_length;
  }

  bool crashes(const DexelLine& line, const RuledLine& ruled, double s) const {
    const Vector3d point = ruled.start(s), direction = ruled.direction();
    const Vector3d travel = ruled.travel(s);
    const auto material_length = [&](const SweepInterval& interval) {
      return interval.is_empty() ? 0.0 : line.length(s + interval.in, s + interval.out);
    };
    const auto sweep = [&](const Cutter& cutter, double base) {
      return CutterSweep(cutter, travel).interval(point - Vector3d(0, 0, base), direction);
    };
    const auto meets_core = [&](const Cutter& part) {
      return material_length(sweep(part, core_.raised)) > min_crash_length;
    };
    if (may_not_cut_ && std::ranges::any_of(core_parts_, meets_core)) return true;
    if (!checks_shank_) return false;
    const Cutter shank{core_.cutter.radius, 0.0, 0.0};
    const SweepInterval shank_interval = sweep(shank, cutter_.flank_length + core_.raised);
    const double length = material_length(shank_interval);
    if (length <= min_crash_length || travel.z() >= 0.0) return length > min_crash_length;
    // Material that passed the upper end of the flank on its way down the tool was cut before.
    const SweepInterval flank_interval = disc_sweep_interval(
        cutter_.radius, cutter_.flank_length + core_.raised, travel, point, direction);
    if (flank_interval.is_empty()) return true;
    const double lo = std::max(shank_interval.in, flank_interval.in);
    const double hi = std::min(shank_interval.out, flank_interval.out);
    const double cut_length = lo < hi ? line.length(s + lo, s + hi) : 0.0;
    return length - cut_length > min_crash_length;
  }

  const Cutter& cutter_;
  int line_;
  bool may_not_cut_;
  InsetCutter core_;
  std::vector<Cutter> core_parts_;
  bool checks_shank_ = false;
};

// Lines under the sweep.

struct CoordinateRange {
  double lo = infinity, hi = -infinity;
  void add(double x) { lo = std::min(lo, x), hi = std::max(hi, x); }
  void add(const CoordinateRange& r) { lo = std::min(lo, r.lo), hi = std::max(hi, r.hi); }
};

/// The area covered by a disc that moves along all segments between four points of the plane.
class MovedDiscs {
 public:
  MovedDiscs(const std::array<Eigen::Vector2d, 4>& centres, double radius)
      : centres_(centres), radius_(radius) {
    for (std::size_t i = 0; i < centres.size(); ++i)
      for (std::size_t k = i + 1; k < centres.size(); ++k) add_sides(centres[i], centres[k]);
  }

  /// Returns the range covered in the row at height v.
  CoordinateRange row(double v) const {
    CoordinateRange range;
    for (const Eigen::Vector2d& c : centres_) {
      const double squared_half_width = radius_ * radius_ - (v - c.y()) * (v - c.y());
      if (squared_half_width < 0.0) continue;
      const double half_width = std::sqrt(squared_half_width);
      range.add(c.x() - half_width);
      range.add(c.x() + half_width);
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

/// A body that contains the sweep of a part of a move: a ball moved over the parallelogram between
/// the corner centres and the axis up to the end of the grid, and a box that fits its bottom
/// closely. Every point of the cutter departs from the chord between its ends by arm angle^2 / 8,
/// and its height over a point of the grid by as much plus angle length / 4: that is `sag`. The
/// sweep as computed departs from the true one by the same and by `max_twist`; the rest of the
/// slack, 1e-6 mm, covers rounding, which is 1e-12 at 1 m.
class Footprint {
 public:
  Footprint(const Stock& stock, const Cutter& cutter, const ToolPose& a, const ToolPose& b,
            double angle)
      : stock_(stock), radius_(cutter.radius) {
    const ToolPose* const poses[2] = {&a, &b};
    double max_height = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      Vector3d p;
      for (int k = 0; k < 3; ++k)
        p[k] = (corner >> k & 1) != 0 ? (stock.nodes[std::size_t(k)] - 1) * stock.spacing : 0.0;
      for (const ToolPose* pose : poses)
        max_height = std::max(max_height, (p - pose->tip).dot(pose->axis()));
    }
    const double sag =
        0.125 * angle * (angle * (max_height + cutter.radius) + 2.0 * (b.tip - a.tip).norm());
    max_height += sag;
    height_ = max_height;
    const double slack = 2.0 * sag + max_twist + 1e-6;
    radius_ += slack;
    for (int k = 0; k < 2; ++k) {
      const Vector3d base = poses[k]->tip + cutter.corner_radius * poses[k]->axis();
      corners_[2 * k] = base;
      corners_[2 * k + 1] = base + max_height * poses[k]->axis();
      for (int axis = 0; axis < 3; ++axis) {
        box_[axis].add(reach(cutter, *poses[k], axis, 1.0) + slack);
        box_[axis].add(-reach(cutter, *poses[k], axis, -1.0) - slack);
      }
    }
  }

  double height() const { return height_; }

  /// Returns the range of line numbers along `axis` that the sweep may meet.
  std::pair<int, int> lines(int axis, CoordinateRange range) const {
    range.lo = std::max(range.lo, box_[axis].lo);
    range.hi = std::min(range.hi, box_[axis].hi);
    const double last = stock_.nodes[std::size_t(axis)] - 1;
    const double first = std::max(0.0, std::ceil(range.lo / stock_.spacing));
    const double to = std::min(last, std::floor(range.hi / stock_.spacing));
    return first <= to ? std::pair{int(first), int(to)} : std::pair{0, -1};
  }
  std::pair<int, int> rows(int axis) const { return lines(axis, {-infinity, infinity}); }

  /// Returns the discs in the plane of two directions of the grid.
  MovedDiscs row_discs(int along_row, int across) const {
    std::array<Eigen::Vector2d, 4> centres;
    for (std::size_t i = 0; i < centres.size(); ++i)
      centres[i] = {corners_[i][along_row], corners_[i][across]};
    return {centres, radius_};
  }

  const CoordinateRange& extent(int axis) const { return box_[axis]; }

 private:
  /// Returns the coordinate of the tool's farthest point in a direction of the grid, times the
  /// sign.
  static double reach(const Cutter& cutter, const ToolPose& pose, int axis, double sign) {
    const Vector3d u = pose.axis();
    const double cosine = sign * u[axis];
    if (cosine > 1e-12) return infinity;
    const double r = cutter.corner_radius;
    const double sine = std::hypot(u[(axis + 1) % 3], u[(axis + 2) % 3]);
    return sign * pose.tip[axis] + r * (1.0 + cosine) + (cutter.radius - r) * sine;
  }

  const Stock& stock_;
  double radius_;
  double height_;
  Vector3d corners_[4];
  CoordinateRange box_[3];
};

/// The alternative to Footprint that selects every line of every field.
class EveryLine {
 public:
  explicit EveryLine(const Stock& stock) : stock_(stock) {}

  std::pair<int, int> lines(int axis, const CoordinateRange&) const { return rows(axis); }
  std::pair<int, int> rows(int axis) const { return {0, stock_.nodes[std::size_t(axis)] - 1}; }
  struct Everything {
    CoordinateRange row(double) const { return {}; }
  };
  Everything row_discs(int, int) const { return {}; }
  CoordinateRange extent(int) const { return {-infinity, infinity}; }

 private:
  const Stock& stock_;
};

template <class Region>
void sweep_field(DexelField& field, const Region& region, double spacing, const ToolPose& a,
                 const ToolPose& b, bool is_turning, LineCutter& line_cutter) {
  const int along = field.along, first = (along + 1) % 3, second = (along + 2) % 3;
  const CoordinateRange extent = region.extent(along);
  RuledLine ruled;
  ruled.d0 = a.R.col(along);
  ruled.d1 = b.R.col(along);
  const CutterSweep sweep(line_cutter.cutter(), a.R * (b.tip - a.tip));
  const auto discs = region.row_discs(first, second);
  const auto [row_from, row_to] = region.rows(second);
  for (int j = row_from; j <= row_to; ++j) {
    const auto [from, to] = region.lines(first, discs.row(j * spacing));
    for (int i = from; i <= to; ++i) {
      DexelLine& line = field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)];
      if (line.empty() || line.runs().front().low > extent.hi ||
          line.runs().back().high < extent.lo)
        continue;
      Vector3d point = Vector3d::Zero();
      point[first] = i * spacing;
      point[second] = j * spacing;
      ruled.p0 = a.R * (point - a.tip);
      ruled.p1 = b.R * (point - b.tip);
      if (is_turning)
        line_cutter.cut(line, ruled);
      else
        line_cutter.cut(line, sweep, ruled);
    }
  }
}

/// Removes the sweep of one tool section from the stock.
/// @param base  mm, height of the section's tip above the tip of the tool
void sweep(Stock& stock, const ToolPath& path, int parts, double base, DexelSelection dexels,
           LineCutter& line_cutter) {
  const auto pose = [&](double t) {
    ToolPose tool_pose = path.at(t);
    if (base > 0.0) tool_pose.tip += base * tool_pose.axis();
    return tool_pose;
  };
  const Cutter& cutter = line_cutter.cutter();
  for (int i = 0; i < parts; ++i) {
    const ToolPose a = pose(double(i) / parts), b = pose(double(i + 1) / parts);
    const Footprint footprint(stock, cutter, a, b, path.angle() / parts);
    line_cutter.set_checks_shank(footprint.height() > cutter.flank_length);
    const bool is_turning = path.angle() > 0.0;
    for (DexelField& field : stock.fields)
      if (dexels == DexelSelection::All)
        sweep_field(field, EveryLine(stock), stock.spacing, a, b, is_turning, line_cutter);
      else if (footprint.height() > 0.0)
        sweep_field(field, footprint, stock.spacing, a, b, is_turning, line_cutter);
  }
  line_cutter.removed.volume =
      line_cutter.removed_length * stock.spacing * stock.spacing / double(stock.fields.size());
}

}  // namespace

RemovalResult remove(Stock& stock, const Cutter& cutter, const StockMove& move,
                     DexelSelection dexels) {
  check_cutter(cutter);
  const ToolPath path(stock, move);
  const double max_radius = cutter.flank_length + cutter.radius;
  // Maximum deviation of the sweep from a translation, which falls with the square of the number of
  // parts.
  const double max_deviation =
      0.125 * path.angle() * (path.angle() * max_radius + 2.0 * path.length());
  const double count = std::sqrt(max_deviation / max_part_sag);
  if (!(count < max_parts))
    throw std::invalid_argument(
        fmt::format("stock move: expected a move that splits into at most {} straight segments, "
                    "seen {:.3g} ({:.3g} mm, axis turning by {:.3g} rad)",
                    max_parts, count, path.length(), path.angle()));
  const int parts = 1 + int(count);
  const std::vector<Cutter> convex_cutters = convex_parts(cutter);
  std::vector<LineCutter> line_cutters;
  const InsetCutter core = crash_core(cutter, move.rapid);
  for (const Cutter& part : convex_cutters)
    line_cutters.emplace_back(part, core, move, LineCutter::ToolSection::Cutter);
  const Cutter shank{shank_radius(cutter), 0.0, 0.0};
  LineCutter shank_cutter(shank, crash_core(shank, true), move, LineCutter::ToolSection::Shank);
  const auto sweep_cutter = [&] {
    for (LineCutter& line_cutter : line_cutters)
      sweep(stock, path, parts, 0.0, dexels, line_cutter);
  };
  const auto sweep_shank = [&] {
    sweep(stock, path, parts, cutter.flank_length, dexels, shank_cutter);
  };
  if (!cutter.outline) {
    sweep_cutter();
    return line_cutters.front().removed;
  }
  // In the frame of a rising tool the material moves down, so the shank meets it first.
  if (path.at(0.0).axis().dot(path.at(1.0).tip - path.at(0.0).tip) > 0.0) {
    sweep_shank();
    sweep_cutter();
  } else {
    sweep_cutter();
    sweep_shank();
  }
  RemovalResult removed = shank_cutter.removed;
  for (const LineCutter& line_cutter : line_cutters) {
    removed.volume += line_cutter.removed.volume;
    removed.crashed = removed.crashed || line_cutter.removed.crashed;
    removed.lines += line_cutter.removed.lines;
  }
  return removed;
}

}  // namespace abbe::cutting
