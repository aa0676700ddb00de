#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/program/generators.h"
#include "sim/program/program_writers.h"

namespace abbe::sim::program {

namespace {

using Eigen::Vector2d;
using kinematics::AxisVector;
using Segment = cutting::RevolvedProfile::ProfileSegment;

// The same limit as on the points of a milling program.
constexpr double max_rows = 2e7;

/// Height of the nose centre at a radius.
struct NoseHeight {
  double z = 0.0;
  double slope = 0.0;        ///< dz/dr
  int touched_feature = -1;  ///< index of the touched segment or corner of the profile
};

/// The curve of nose centres at which the nose touches the profile without gouging it: the upper
/// envelope of the offset curves of all segments and corners.
class OffsetCurve {
 public:
  OffsetCurve(std::vector<Segment> segments, double nose_radius) : nose_radius_(nose_radius) {
    for (const Segment& segment : segments) {
      segments_.push_back(segment);
      segments_.push_back({Vector2d(-segment.to.x(), segment.to.y()),
                           Vector2d(-segment.from.x(), segment.from.y()),
                           segment.arc_radius});  // the other half of the section
    }
  }

  std::optional<NoseHeight> at(double r) const;

 private:
  std::optional<NoseHeight> on_line(const Segment& segment, double r) const;
  std::optional<NoseHeight> on_arc(const Segment& segment, double r) const;
  std::optional<NoseHeight> on_corner(const Vector2d& corner, double r) const;

  std::vector<Segment> segments_;
  double nose_radius_;
};

std::optional<NoseHeight> OffsetCurve::on_line(const Segment& segment, double r) const {
  const Vector2d chord = segment.to - segment.from;
  const double length = chord.norm();
  // A vertical segment has no single height at a radius; its corners represent it.
  if (!(chord.x() > 1e-12 * length)) return std::nullopt;
  const Vector2d out(-chord.y() / length, chord.x() / length);
  const double t = (r - segment.from.x() - nose_radius_ * out.x()) / chord.x();
  if (t < 0.0 || t > 1.0) return std::nullopt;
  return NoseHeight{segment.from.y() + t * chord.y() + nose_radius_ * out.y(),
                    chord.y() / chord.x()};
}

std::optional<NoseHeight> OffsetCurve::on_arc(const Segment& segment, double r) const {
  const bool convex = segment.arc_radius > 0.0;
  const double rho = std::abs(segment.arc_radius);
  const double offset = convex ? rho + nose_radius_ : rho - nose_radius_;
  const Vector2d chord = segment.to - segment.from, middle = 0.5 * (segment.from + segment.to);
  const Vector2d left = Vector2d(-chord.y(), chord.x()).normalized();
  const double centre_distance = std::sqrt(std::max(0.0, rho * rho - 0.25 * chord.squaredNorm()));
  // The sign of the radius gives the side on which the centre of the arc lies.
  const Vector2d centre = middle + (convex ? -centre_distance : centre_distance) * left;
  const double across = r - centre.x();
  // A nose larger than a concave radius does not fit: it touches the corners instead.
  if (offset <= 0.0 || std::abs(across) >= offset) return std::nullopt;
  const double up = (convex ? 1.0 : -1.0) * std::sqrt(offset * offset - across * across);
  const Vector2d foot = centre + rho / offset * Vector2d(across, up);
  const double bulge = (convex ? 1.0 : -1.0) * (foot - middle).dot(left);
  // The foot must lie on the bulging side of the chord, i.e. on the segment itself.
  if (bulge < 0.0) return std::nullopt;
  return NoseHeight{centre.y() + up, -across / up};
}

std::optional<NoseHeight> OffsetCurve::on_corner(const Vector2d& corner, double r) const {
  const double across = r - corner.x();
  if (std::abs(across) >= nose_radius_) return std::nullopt;
  const double up = std::sqrt(nose_radius_ * nose_radius_ - across * across);
  return NoseHeight{corner.y() + up, -across / up};
}

// Only the highest of all offset curves at a radius is free of gouging.
std::optional<NoseHeight> OffsetCurve::at(double r) const {
  std::optional<NoseHeight> highest;
  const auto keep_higher = [&](std::optional<NoseHeight> height, int touched_feature) {
    if (!height || (highest && height->z <= highest->z)) return;
    highest = height;
    highest->touched_feature = touched_feature;
  };
  for (int i = 0; i < int(segments_.size()); ++i) {
    const Segment& segment = segments_[std::size_t(i)];
    keep_higher(segment.arc_radius == 0.0 ? on_line(segment, r) : on_arc(segment, r), 3 * i);
    keep_higher(on_corner(segment.from, r), 3 * i + 1);
    keep_higher(on_corner(segment.to, r), 3 * i + 2);
  }
  return highest;
}

/// Extends the profile along its tangent beyond the rim, where the cut begins.
std::vector<Segment> add_run_in(std::vector<Segment> segments, double length) {
  const Segment rim_segment = segments.back();
  Vector2d tangent = (rim_segment.to - rim_segment.from).normalized();
  // The tangent at the end of an arc is the chord rotated by half the sweep.
  if (rim_segment.arc_radius != 0.0) {
    const double half_sweep = std::asin(std::clamp(
        (rim_segment.to - rim_segment.from).norm() / (2 * rim_segment.arc_radius), -1.0, 1.0));
    tangent = Eigen::Rotation2Dd(-half_sweep) * tangent;
  }
  if (tangent.x() > 1e-6)
    segments.push_back({rim_segment.to, rim_segment.to + length / tangent.x() * tangent, 0.0});
  return segments;
}

/// The spindle and the two slides of a turning machine, in the meridian half-plane of the part.
struct Lathe {
  int spindle = 0, radial_joint = -1, axial_joint = -1;
  double side =
      1.0;  ///< +1 or -1: side of the spindle axis on which the nose lies if all axes are at zero
  Eigen::Matrix2d slides_of_nose =
      Eigen::Matrix2d::Identity();  ///< (radial, axial) slide positions of a nose centre (r, z)
  Vector2d nose_at_zero = Vector2d::Zero();  ///< nose centre if all axes are at zero, (r signed, z)
  Eigen::Matrix2d tool_of_part =
      Eigen::Matrix2d::Identity();  ///< (x, z) of frame t of a direction (r signed, z)

  Vector2d positions(double r, double z) const {
    return slides_of_nose * (Vector2d(side * r, z) - nose_at_zero);
  }
  Vector2d rates(double r, double z) const { return slides_of_nose * Vector2d(side * r, z); }
};

/// Finds the spindle and the two slides of a turning machine, and their directions in the part
/// frame.
Lathe find_lathe(const GeneratorContext& context) {
  const kinematics::Chain& chain = context.control;
  const auto spindle = chain.find('S');
  if (!spindle || chain.joints()[std::size_t(*spindle)].motion != kinematics::Motion::Rotary)
    throw std::invalid_argument("expected a machine whose spindle S turns the workpiece");
  const AxisVector zero = AxisVector::Zero(chain.size());
  const auto tip_m = [&](const AxisVector& q) {
    return Eigen::Vector3d(context.T_wm.inverse() * chain.tool_in_workpiece(q).translation());
  };
  const Eigen::Vector3d tip_at_zero = tip_m(zero);
  Lathe lathe;
  lathe.spindle = *spindle;
  Eigen::Vector3d radial_step = Eigen::Vector3d::Zero(), axial_step = Eigen::Vector3d::Zero();
  for (int j = 0; j < chain.size(); ++j) {
    if (chain.joints()[std::size_t(j)].motion != kinematics::Motion::Linear) continue;
    AxisVector q = zero;
    q[j] = 1.0;
    const Eigen::Vector3d displacement = tip_m(q) - tip_at_zero;
    // 0.7 is cos 45 deg: a slide belongs to the direction to which it is closer than 45 deg.
    if (std::abs(displacement.z()) > std::max(0.7, std::abs(axial_step.z())))
      axial_step = displacement, lathe.axial_joint = j;
    if (displacement.head<2>().norm() > std::max(0.7, radial_step.head<2>().norm()))
      radial_step = displacement, lathe.radial_joint = j;
  }
  if (lathe.axial_joint < 0 || lathe.radial_joint < 0 || lathe.axial_joint == lathe.radial_joint)
    throw std::invalid_argument("expected one linear axis along the spindle and one across it");
  const Vector2d across = radial_step.head<2>().normalized();
  Eigen::Matrix2d displacements;
  displacements << across.dot(radial_step.head<2>()), across.dot(axial_step.head<2>()),
      radial_step.z(), axial_step.z();
  lathe.slides_of_nose = displacements.inverse();
  lathe.nose_at_zero = {across.dot(tip_at_zero.head<2>()), tip_at_zero.z()};
  lathe.side = lathe.nose_at_zero.x() < 0 ? -1.0 : 1.0;
  const Eigen::Matrix3d R_tm =
      (context.T_wm.inverse() * chain.tool_in_workpiece(zero)).linear().transpose();
  const Eigen::Vector3d out(across.x(), across.y(), 0.0);
  lathe.tool_of_part << R_tm.row(0).dot(out), R_tm(0, 2), R_tm.row(2).dot(out), R_tm(2, 2);
  return lathe;
}

/// The radius of the nose centre over time: it falls at a constant rate and then stays constant for
/// one revolution.
struct RadialFeed {
  double start_radius = 0.0, final_radius = 0.0, rate = 0.0;  ///< mm, mm, mm/s
  double arrival_s = 0.0, end_s = 0.0, blend_s = 0.0;

  double radius(double t) const { return t < arrival_s ? start_radius - rate * t : final_radius; }
  double radius_rate(double t) const { return t < arrival_s ? -rate : 0.0; }
};

RadialFeed radial_feed(const Spiral& spiral, double rim) {
  RadialFeed feed;
  feed.start_radius = rim + spiral.start_beyond_rim;
  feed.final_radius = spiral.end_radius;
  feed.rate = spiral.feed_per_revolution * spiral.spindle_speed / (2 * std::numbers::pi);
  feed.arrival_s = (feed.start_radius - feed.final_radius) / feed.rate;
  feed.end_s = feed.arrival_s + 2 * std::numbers::pi / spiral.spindle_speed;
  // At most 1 ms, and less than half an interval so that blends do not overlap.
  feed.blend_s = std::min(0.25 * spiral.interval, 1e-3);
  return feed;
}

/// Returns the times of the rows: every interval, and two close to each change of the touched
/// segment and to the arrival, because a single cubic would round the corner there.
std::vector<double> row_times(const RadialFeed& feed, const OffsetCurve& curve, double interval) {
  std::vector<double> corner_times{feed.arrival_s};
  const auto touched_feature = [&](double t) {
    const auto height = curve.at(feed.radius(t));
    return height ? height->touched_feature : -1;
  };
  const int n = int(std::ceil(feed.end_s / interval));
  for (int k = 0; k < n; ++k) {
    double a = k * interval, b = std::min((k + 1) * interval, feed.end_s);
    const int feature_at_a = touched_feature(a);
    if (feature_at_a == touched_feature(b)) continue;
    // Bisection down to the spacing of doubles.
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (a + b);
      (touched_feature(middle) == feature_at_a ? a : b) = middle;
    }
    corner_times.push_back(b);
  }
  std::vector<double> times;
  for (int k = 0; k <= n; ++k) {
    const double t = std::min(k * interval, feed.end_s);
    // A regular row this close to a corner would interfere with the pair of rows around it.
    const bool is_near_corner =
        std::any_of(corner_times.begin(), corner_times.end(),
                    [&](double corner) { return std::abs(t - corner) <= 1.5 * feed.blend_s; });
    if (!is_near_corner) times.push_back(t);
  }
  for (const double corner : corner_times)
    for (const double t : {corner - feed.blend_s, corner + feed.blend_s})
      if (t > 0.0 && t < feed.end_s) times.push_back(t);
  times.push_back(0.0);
  times.push_back(feed.end_s);
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end(),
                          // Rows of two corners may nearly coincide.
                          [&](double a, double b) { return b - a < 0.1 * feed.blend_s; }),
              times.end());
  return times;
}

/// Returns the rows of the spiral: positions and velocities of the axes at the times of
/// `row_times`.
std::vector<PvtRow> spiral_rows(const Spiral& spiral, const OffsetCurve& curve,
                                const RadialFeed& feed, const Lathe& lathe, int joint_count) {
  std::vector<PvtRow> rows;
  for (const double t : row_times(feed, curve, spiral.interval)) {
    const double r = feed.radius(t), dr = feed.radius_rate(t);
    const auto height = curve.at(r);
    if (!height)
      throw std::invalid_argument(
          fmt::format("expected a design under the nose at radius {} mm", r));
    PvtRow row{t, AxisVector::Zero(joint_count), AxisVector::Zero(joint_count)};
    const Vector2d slide_position = lathe.positions(r, height->z),
                   slide_velocity = lathe.rates(dr, height->slope * dr);
    row.position[lathe.radial_joint] = slide_position.x();
    row.position[lathe.axial_joint] = slide_position.y();
    row.position[lathe.spindle] = spiral.spindle_speed * t;
    row.velocity[lathe.radial_joint] = slide_velocity.x();
    row.velocity[lathe.axial_joint] = slide_velocity.y();
    row.velocity[lathe.spindle] = spiral.spindle_speed;
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Returns NC text with a line from each row to the next under G93, so that each line takes the
/// time between its rows.
std::string nc_text(const Spiral& spiral, const std::vector<PvtRow>& rows, const Lathe& lathe,
                    const GeneratorContext& context) {
  const std::vector<ControlledAxis> axes = controlled_axes(context.control);
  // One millimetre above the start, along the spindle axis.
  const Vector2d lift = lathe.rates(0.0, 1.0);
  AxisVector lifted_position = rows.front().position;
  lifted_position[lathe.radial_joint] += lift.x();
  lifted_position[lathe.axial_joint] += lift.y();
  std::vector<NcItem> items{
      std::string("(facing along a spiral)"), std::string("G21 G90 G54 G49 G93"),
      fmt::format("S{} M3", nc_number(spiral.spindle_speed * 30 / std::numbers::pi, 9)),
      NcMove{true, lifted_position, 0.0}, NcMove{true, rows.front().position, 0.0}};
  for (std::size_t i = 1; i < rows.size(); ++i)
    items.push_back(NcMove{false, rows[i].position, 60.0 / (rows[i].time_s - rows[i - 1].time_s)});
  items.push_back(NcMove{true, lifted_position, 0.0});
  items.push_back(std::string("M5"));
  items.push_back(std::string("M2"));
  return write_nc(items, axes, {.format = spiral.format, .inverse_time = true});
}

void check_spiral(const Spiral& spiral, double rim) {
  const bool are_sizes_valid = spiral.spindle_speed > 0 && spiral.feed_per_revolution > 0 &&
                               spiral.interval > 0 && spiral.start_beyond_rim >= 0 &&
                               spiral.end_radius >= 0;
  if (!are_sizes_valid)
    throw std::invalid_argument("expected positive speed, feed and interval of the spiral");
  if (!(spiral.end_radius < rim + spiral.start_beyond_rim))
    throw std::invalid_argument("expected an end radius inside the rim");
  const double seconds = (rim + spiral.start_beyond_rim) / spiral.feed_per_revolution * 2 *
                         std::numbers::pi / spiral.spindle_speed;
  if (!(seconds / spiral.interval < max_rows))
    throw std::invalid_argument("expected at most 2e7 rows");
}

/// Checks that no point of the edge reaches beyond the nose circle towards the design, because the
/// path follows the circle alone. Throws std::invalid_argument.
void check_edge(const cutting::EdgeProfile& profile, const OffsetCurve& curve, const Lathe& lathe,
                double rim) {
  constexpr int check_points = 2000;
  for (int i = 0; i <= check_points; ++i) {
    const double r = rim * i / check_points;
    const std::optional<NoseHeight> height = curve.at(r);
    if (!height) continue;  // reported by `spiral_rows` if it is needed
    const Vector2d down = Vector2d(lathe.side * height->slope, -1.0).normalized();
    const Vector2d down_t = lathe.tool_of_part * down;
    const double overhang = down_t.dot(cutting::extreme_point(profile, down_t)) - profile.radius;
    // 1e-6 mm: one nanometre, the numerical floor of the residual map.
    if (overhang > 1e-6)
      throw std::invalid_argument(
          fmt::format("expected an insert that touches with its nose, seen an edge that extends "
                      "{:.3g} mm beyond it where the design slopes by {:.3g} at radius {:.3g} mm",
                      overhang, height->slope, r));
  }
}

}  // namespace

std::string generate_spiral(const Spiral& spiral, const cutting::Primitive& design,
                            const cutting::Nose& nose, const GeneratorContext& context) {
  const std::vector<Segment> segments = cutting::profile(design).profile_segments;
  if (segments.empty()) throw std::invalid_argument("expected a design with a profile");
  const double rim = segments.back().to.x();
  check_spiral(spiral, rim);
  const OffsetCurve curve(add_run_in(segments, spiral.start_beyond_rim + 2 * nose.radius),
                          nose.radius);
  const Lathe lathe = find_lathe(context);
  if (nose.profile) check_edge(*nose.profile, curve, lathe, rim);
  const std::vector<PvtRow> pvt_rows =
      spiral_rows(spiral, curve, radial_feed(spiral, rim), lathe, context.control.size());
  if (spiral.write_nc) return nc_text(spiral, pvt_rows, lathe, context);
  const std::vector<ControlledAxis> axes = controlled_axes(context.control);
  const int columns[] = {lathe.radial_joint, lathe.axial_joint, lathe.spindle};
  return write_pvt(pvt_rows, axes, columns);
}

}  // namespace abbe::sim::program
