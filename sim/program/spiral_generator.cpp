#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/program/generators.h"
#include "sim/program/pvt.h"

namespace abbe::sim::program {

namespace {

using Eigen::Vector2d;
using kinematics::AxisVector;
using Piece = cutting::RevolvedProfile::Piece;

// The same limit as for the points of a milling program.
constexpr double most_rows = 2e7;

/// Height of the nose centre above a radius.
struct Height {
  double z = 0.0;
  double slope = 0.0;  ///< dz/dr
  int touched = -1;    ///< index of the touched segment or corner of the profile
};

/// The curve of nose centres at which the nose touches the profile and gouges it nowhere: the upper
/// envelope of the offsets of all segments and corners.
class OffsetCurve {
 public:
  OffsetCurve(std::vector<Piece> pieces, double nose_radius) : a_(nose_radius) {
    for (const Piece& piece : pieces) {
      pieces_.push_back(piece);
      pieces_.push_back({Vector2d(-piece.to.x(), piece.to.y()),
                         Vector2d(-piece.from.x(), piece.from.y()),
                         piece.arc_radius});  // the other half of the section
    }
  }

  std::optional<Height> at(double r) const;

 private:
  std::optional<Height> on_line(const Piece& piece, double r) const;
  std::optional<Height> on_arc(const Piece& piece, double r) const;
  std::optional<Height> on_corner(const Vector2d& corner, double r) const;

  std::vector<Piece> pieces_;
  double a_;
};

std::optional<Height> OffsetCurve::on_line(const Piece& piece, double r) const {
  const Vector2d way = piece.to - piece.from;
  const double length = way.norm();
  // Vertical segments have no height over a radius; their corners represent them.
  if (!(way.x() > 1e-12 * length)) return std::nullopt;
  const Vector2d out(-way.y() / length, way.x() / length);
  const double t = (r - piece.from.x() - a_ * out.x()) / way.x();
  if (t < 0.0 || t > 1.0) return std::nullopt;
  return Height{piece.from.y() + t * way.y() + a_ * out.y(), way.y() / way.x()};
}

std::optional<Height> OffsetCurve::on_arc(const Piece& piece, double r) const {
  const bool convex = piece.arc_radius > 0.0;
  const double rho = std::abs(piece.arc_radius);
  const double offset = convex ? rho + a_ : rho - a_;
  const Vector2d way = piece.to - piece.from, middle = 0.5 * (piece.from + piece.to);
  const Vector2d left = Vector2d(-way.y(), way.x()).normalized();
  const double sagitta_side = std::sqrt(std::max(0.0, rho * rho - 0.25 * way.squaredNorm()));
  // Centre of the segment's arc, on the side given by the sign of its radius.
  const Vector2d centre = middle + (convex ? -sagitta_side : sagitta_side) * left;
  const double across = r - centre.x();
  // A nose that is larger than a concave radius does not fit; its corners then carry the nose.
  if (offset <= 0.0 || std::abs(across) >= offset) return std::nullopt;
  const double up = (convex ? 1.0 : -1.0) * std::sqrt(offset * offset - across * across);
  const Vector2d foot = centre + rho / offset * Vector2d(across, up);
  const double bulge = (convex ? 1.0 : -1.0) * (foot - middle).dot(left);
  // The foot must lie on the bulging side of the chord, i.e. on the segment itself.
  if (bulge < 0.0) return std::nullopt;
  return Height{centre.y() + up, -across / up};
}

std::optional<Height> OffsetCurve::on_corner(const Vector2d& corner, double r) const {
  const double across = r - corner.x();
  if (std::abs(across) >= a_) return std::nullopt;
  const double up = std::sqrt(a_ * a_ - across * across);
  return Height{corner.y() + up, -across / up};
}

// The highest of all offsets above a radius is free of gouging.
std::optional<Height> OffsetCurve::at(double r) const {
  std::optional<Height> highest;
  const auto take = [&](std::optional<Height> height, int touched) {
    if (!height || (highest && height->z <= highest->z)) return;
    highest = height;
    highest->touched = touched;
  };
  for (int i = 0; i < int(pieces_.size()); ++i) {
    const Piece& piece = pieces_[std::size_t(i)];
    take(piece.arc_radius == 0.0 ? on_line(piece, r) : on_arc(piece, r), 3 * i);
    take(on_corner(piece.from, r), 3 * i + 1);
    take(on_corner(piece.to, r), 3 * i + 2);
  }
  return highest;
}

/// The profile extended along its tangent beyond the rim, where the cut begins.
std::vector<Piece> add_run_in(std::vector<Piece> pieces, double length) {
  const Piece last = pieces.back();
  Vector2d tangent = (last.to - last.from).normalized();
  // The tangent at the end of an arc is the chord rotated by half the sweep.
  if (last.arc_radius != 0.0) {
    const double half =
        std::asin(std::clamp((last.to - last.from).norm() / (2 * last.arc_radius), -1.0, 1.0));
    tangent = Eigen::Rotation2Dd(-half) * tangent;
  }
  if (tangent.x() > 1e-6)
    pieces.push_back({last.to, last.to + length / tangent.x() * tangent, 0.0});
  return pieces;
}

/// The two slides of a turning machine in the half plane of the part.
struct Lathe {
  int spindle = 0, radial = -1, axial = -1;
  double side = 1.0;  ///< side of the axis on which the tool is at zero
  Eigen::Matrix2d slides_of =
      Eigen::Matrix2d::Identity();   ///< (radial, axial) slide positions of a nose centre (r, z)
  Vector2d home = Vector2d::Zero();  ///< nose centre at zero, (r signed, z)
  Eigen::Matrix2d tool_of =
      Eigen::Matrix2d::Identity();  ///< (x, z) of frame t of a direction (r signed, z)

  Vector2d positions(double r, double z) const {
    return slides_of * (Vector2d(side * r, z) - home);
  }
  Vector2d rates(double r, double z) const { return slides_of * Vector2d(side * r, z); }
};

Lathe lathe(const GeneratorContext& context) {
  const kinematics::Chain& chain = context.control;
  const auto spindle = chain.find('S');
  if (!spindle || chain.joints()[std::size_t(*spindle)].motion != kinematics::Motion::Rotary)
    throw std::invalid_argument("expected a machine whose spindle S turns the workpiece");
  const AxisVector zero = AxisVector::Zero(chain.size());
  const auto tip_m = [&](const AxisVector& q) {
    return Eigen::Vector3d(context.T_wm.inverse() * chain.tool_in_workpiece(q).translation());
  };
  const Eigen::Vector3d home = tip_m(zero);
  Lathe lathe;
  lathe.spindle = *spindle;
  Eigen::Vector3d radial = Eigen::Vector3d::Zero(), axial = Eigen::Vector3d::Zero();
  for (int j = 0; j < chain.size(); ++j) {
    if (chain.joints()[std::size_t(j)].motion != kinematics::Motion::Linear) continue;
    AxisVector q = zero;
    q[j] = 1.0;
    const Eigen::Vector3d way = tip_m(q) - home;
    // 0.7 of a unit step: a slide belongs to the direction to which it is closer than 45 deg.
    if (std::abs(way.z()) > std::max(0.7, std::abs(axial.z()))) axial = way, lathe.axial = j;
    if (way.head<2>().norm() > std::max(0.7, radial.head<2>().norm()))
      radial = way, lathe.radial = j;
  }
  if (lathe.axial < 0 || lathe.radial < 0 || lathe.axial == lathe.radial)
    throw std::invalid_argument("expected one slide along the spindle and one across it");
  const Vector2d across = radial.head<2>().normalized();
  Eigen::Matrix2d ways;
  ways << across.dot(radial.head<2>()), across.dot(axial.head<2>()), radial.z(), axial.z();
  lathe.slides_of = ways.inverse();
  lathe.home = {across.dot(home.head<2>()), home.z()};
  lathe.side = lathe.home.x() < 0 ? -1.0 : 1.0;
  const Eigen::Matrix3d R_tm =
      (context.T_wm.inverse() * chain.tool_in_workpiece(zero)).linear().transpose();
  const Eigen::Vector3d out(across.x(), across.y(), 0.0);
  lathe.tool_of << R_tm.row(0).dot(out), R_tm(0, 2), R_tm.row(2).dot(out), R_tm(2, 2);
  return lathe;
}

/// The cut over time: the radius falls at a constant rate, then rests for one revolution.
struct Course {
  double r0 = 0.0, end = 0.0, rate = 0.0;  ///< mm, mm, mm/s
  double arrival_s = 0.0, end_s = 0.0, blend_s = 0.0;

  double radius(double t) const { return t < arrival_s ? r0 - rate * t : end; }
  double radius_rate(double t) const { return t < arrival_s ? -rate : 0.0; }
};

Course course(const Spiral& spiral, double rim) {
  Course course;
  course.r0 = rim + spiral.start_beyond_rim;
  course.end = spiral.end_radius;
  course.rate = spiral.feed_per_revolution * spiral.spindle_speed / (2 * std::numbers::pi);
  course.arrival_s = (course.r0 - course.end) / course.rate;
  course.end_s = course.arrival_s + 2 * std::numbers::pi / spiral.spindle_speed;
  // At most 1 ms, and less than half an interval so that blends do not overlap.
  course.blend_s = std::min(0.25 * spiral.interval, 1e-3);
  return course;
}

/// Times of the rows: every interval, and close to each change of the touched segment and to the
/// arrival, where a cubic alone would round the corner.
std::vector<double> instants(const Course& course, const OffsetCurve& curve, double interval) {
  std::vector<double> corners{course.arrival_s};
  const auto touched = [&](double t) {
    const auto height = curve.at(course.radius(t));
    return height ? height->touched : -1;
  };
  const int n = int(std::ceil(course.end_s / interval));
  for (int k = 0; k < n; ++k) {
    double a = k * interval, b = std::min((k + 1) * interval, course.end_s);
    const int at_a = touched(a);
    if (at_a == touched(b)) continue;
    // Bisection down to the spacing of doubles.
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (a + b);
      (touched(middle) == at_a ? a : b) = middle;
    }
    corners.push_back(b);
  }
  std::vector<double> times;
  for (int k = 0; k <= n; ++k) {
    const double t = std::min(k * interval, course.end_s);
    // Regular rows this close to a corner would disturb the pair of rows beside it.
    const bool near = std::any_of(corners.begin(), corners.end(), [&](double corner) {
      return std::abs(t - corner) <= 1.5 * course.blend_s;
    });
    if (!near) times.push_back(t);
  }
  for (const double corner : corners)
    for (const double t : {corner - course.blend_s, corner + course.blend_s})
      if (t > 0.0 && t < course.end_s) times.push_back(t);
  times.push_back(0.0);
  times.push_back(course.end_s);
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end(),
                          // Two corners may ask for the same row.
                          [&](double a, double b) { return b - a < 0.1 * course.blend_s; }),
              times.end());
  return times;
}

std::vector<PvtRow> rows(const Spiral& spiral, const OffsetCurve& curve, const Course& course,
                         const Lathe& lathe, int size) {
  std::vector<PvtRow> rows;
  for (const double t : instants(course, curve, spiral.interval)) {
    const double r = course.radius(t), dr = course.radius_rate(t);
    const auto height = curve.at(r);
    if (!height)
      throw std::invalid_argument(
          fmt::format("expected a design under the nose at radius {} mm", r));
    PvtRow row{t, AxisVector::Zero(size), AxisVector::Zero(size)};
    const Vector2d at = lathe.positions(r, height->z), rate = lathe.rates(dr, height->slope * dr);
    row.position[lathe.radial] = at.x();
    row.position[lathe.axial] = at.y();
    row.position[lathe.spindle] = spiral.spindle_speed * t;
    row.velocity[lathe.radial] = rate.x();
    row.velocity[lathe.axial] = rate.y();
    row.velocity[lathe.spindle] = spiral.spindle_speed;
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Lines from row to row under G93, so that each takes the time of its row.
std::string nc_text(const Spiral& spiral, const std::vector<PvtRow>& rows, const Lathe& lathe,
                    const GeneratorContext& context) {
  const std::vector<ControlledAxis> axes = controlled_axes(context.control);
  // One millimetre above the start, along the spindle axis.
  const Vector2d lift = lathe.rates(0.0, 1.0);
  AxisVector above = rows.front().position;
  above[lathe.radial] += lift.x();
  above[lathe.axial] += lift.y();
  std::vector<NcItem> items{
      std::string("(facing by a spiral)"), std::string("G21 G90 G54 G49 G93"),
      fmt::format("S{} M3", nc_number(spiral.spindle_speed * 30 / std::numbers::pi, 9)),
      NcMove{true, above, 0.0}, NcMove{true, rows.front().position, 0.0}};
  for (std::size_t i = 1; i < rows.size(); ++i)
    items.push_back(NcMove{false, rows[i].position, 60.0 / (rows[i].time_s - rows[i - 1].time_s)});
  items.push_back(NcMove{true, above, 0.0});
  items.push_back(std::string("M5"));
  items.push_back(std::string("M2"));
  return write_nc(items, axes, {.format = spiral.format, .inverse_time = true});
}

void check(const Spiral& spiral, double rim) {
  const bool sizes = spiral.spindle_speed > 0 && spiral.feed_per_revolution > 0 &&
                     spiral.interval > 0 && spiral.start_beyond_rim >= 0 && spiral.end_radius >= 0;
  if (!sizes)
    throw std::invalid_argument("expected positive speed, feed and interval of the spiral");
  if (!(spiral.end_radius < rim + spiral.start_beyond_rim))
    throw std::invalid_argument("expected an end radius inside the rim");
  const double seconds = (rim + spiral.start_beyond_rim) / spiral.feed_per_revolution * 2 *
                         std::numbers::pi / spiral.spindle_speed;
  if (!(seconds / spiral.interval < most_rows))
    throw std::invalid_argument("expected at most 2e7 rows");
}

/// Only the nose circle is followed, so it must be what touches: nowhere may the edge reach beyond
/// its circle towards the design.
void check_edge(const cutting::EdgeProfile& profile, const OffsetCurve& curve, const Lathe& lathe,
                double rim) {
  constexpr int places = 2000;
  for (int i = 0; i <= places; ++i) {
    const double r = rim * i / places;
    const std::optional<Height> height = curve.at(r);
    if (!height) continue;  // reported by `rows` when it is needed
    const Vector2d down = Vector2d(lathe.side * height->slope, -1.0).normalized();
    const Vector2d way = lathe.tool_of * down;
    const double beyond = way.dot(cutting::extreme_point(profile, way)) - profile.radius;
    // 1e-6 mm: one nanometre, the numerical floor of the residual map.
    if (beyond > 1e-6)
      throw std::invalid_argument(fmt::format(
          "expected an insert that touches with its nose, seen an edge that reaches {:.3g} mm "
          "beyond it where the design slopes by {:.3g} at radius {:.3g} mm",
          beyond, height->slope, r));
  }
}

}  // namespace

std::string generate_spiral(const Spiral& spiral, const cutting::Primitive& design,
                            const cutting::Nose& nose, const GeneratorContext& context) {
  const std::vector<Piece> pieces = cutting::profile(design).pieces;
  if (pieces.empty()) throw std::invalid_argument("expected a design with a profile");
  const double rim = pieces.back().to.x();
  check(spiral, rim);
  const OffsetCurve curve(add_run_in(pieces, spiral.start_beyond_rim + 2 * nose.radius),
                          nose.radius);
  const Lathe lathe = program::lathe(context);
  if (nose.profile) check_edge(*nose.profile, curve, lathe, rim);
  const std::vector<PvtRow> cut =
      rows(spiral, curve, course(spiral, rim), lathe, context.control.size());
  if (spiral.write_nc) return nc_text(spiral, cut, lathe, context);
  const std::vector<ControlledAxis> axes = controlled_axes(context.control);
  const int columns[] = {lathe.radial, lathe.axial, lathe.spindle};
  return write_pvt(cut, axes, columns);
}

}  // namespace abbe::sim::program
