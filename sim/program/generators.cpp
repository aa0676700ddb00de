#include "sim/program/generators.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/inverse_kinematics.h"

namespace abbe::sim::program {

namespace {

using kinematics::AxisVector;
using kinematics::Motion;
using kinematics::Reachability;

/// Writes passes as NC text and counts the poses that the machine cannot reach.
class MillingTextWriter {
 public:
  MillingTextWriter(const MillingTextOptions& options, const GeneratorContext& context,
                    double safe_z)
      : options_(options),
        context_(context),
        is_five_axis_(has_rotary_axes(context.control)),
        safe_z_(safe_z) {
    axes_ = AxisVector::Zero(context.control.size());
    // Rounded to 1e-6 mm/min: a feed of 1000 mm/min, converted from mm/s, is then written as 1000.
    feed_ = std::round(options.feed * 60.0 * 1e6) / 1e6;
  }

  void write_header();
  void pass(const Pass& pass);
  MillingProgram program();

 private:
  Reachability reach(const CutterPose& pose);
  void record_unreached(const CutterPose& pose, Reachability why);
  AxisVector axis_words(const Eigen::Vector3d& tip_w) const;
  void rapid(const Eigen::Vector3d& tip_w) {
    items_.push_back(NcMove{true, axis_words(tip_w), 0.0});
  }
  void cut(const Eigen::Vector3d& tip_w) {
    items_.push_back(NcMove{false, axis_words(tip_w), feed_});
  }
  Eigen::Vector3d above(const Eigen::Vector3d& tip_w) const {
    return {tip_w.x(), tip_w.y(), safe_z_};
  }
  Eigen::Vector3d clearance_point(const CutterPose& pose) const {
    return pose.tip_w + options_.clearance * pose.retract_w;
  }
  void enter(const CutterPose& pose);
  void leave(const CutterPose& pose);

  const MillingTextOptions& options_;
  const GeneratorContext& context_;
  const bool is_five_axis_;
  const double safe_z_;
  double feed_ = 0.0;
  AxisVector axes_;  ///< at the last pose reached; start of the next inverse kinematics
  /// Position of the tip, clear of the part, between passes; empty before the first pass.
  std::optional<Eigen::Vector3d> rest_point_w_;
  bool has_cut_ = false;
  std::vector<NcItem> items_;
  UnreachedPoints unreached_;
};

Reachability MillingTextWriter::reach(const CutterPose& pose) {
  const auto result = kinematics::inverse(context_.control, {pose.tip_w, pose.direction_w}, axes_);
  if (!result.branches.empty()) axes_ = result.branches.front();
  return result.reach;
}

// Only the first unreached pose is recorded in full, for the message.
void MillingTextWriter::record_unreached(const CutterPose& pose, Reachability why) {
  if (options_.must_reach_all)
    throw std::invalid_argument(fmt::format(
        "a pass with a pose out of reach, at ({:.3f}, {:.3f}, {:.3f}) mm in the workpiece frame",
        pose.tip_w.x(), pose.tip_w.y(), pose.tip_w.z()));
  if (unreached_.points++ > 0) return;
  unreached_.first_pass = unreached_.all_passes;
  unreached_.why = why;
  unreached_.tip_w = pose.tip_w;
}

AxisVector MillingTextWriter::axis_words(const Eigen::Vector3d& tip_w) const {
  AxisVector q = axes_;
  // With rotary axes G43.4 is in force, so the words are tip coordinates.
  if (is_five_axis_) {
    q[*context_.control.find('X')] = tip_w.x();
    q[*context_.control.find('Y')] = tip_w.y();
    q[*context_.control.find('Z')] = tip_w.z();
    return q;
  }
  const auto slides = kinematics::solve_slides(context_.control, q, tip_w);
  if (!slides) throw std::invalid_argument("expected a machine with three independent slides");
  return *slides;
}

void MillingTextWriter::write_header() {
  items_.push_back("(" + options_.title + ")");
  items_.push_back("G17 G21 G90 G94 G54");
  items_.push_back(is_five_axis_ ? fmt::format("G43.4 H{}", context_.h_number) : "G49");
  items_.push_back(fmt::format("S{} M3", nc_number(options_.speed_rpm, 3)));
}

/// Moves to the clearance point of a pose and on to its tip. `reach` must have computed its axes.
void MillingTextWriter::enter(const CutterPose& pose) {
  const Eigen::Vector3d clearance = clearance_point(pose);
  const bool is_near =
      rest_point_w_ && (*rest_point_w_ - clearance).norm() <= options_.max_link_distance;
  // The first move lifts Z alone, because the position of the machine is unknown.
  if (!rest_point_w_)
    items_.push_back(
        fmt::format("G0 Z{}", nc_number(axis_words(above(clearance))[*context_.control.find('Z')],
                                        options_.format.decimals_mm)));
  if (!is_near) rapid(above(clearance));
  rapid(clearance);
  cut(pose.tip_w);
}

void MillingTextWriter::leave(const CutterPose& pose) {
  rest_point_w_ = clearance_point(pose);
  rapid(*rest_point_w_);
}

void MillingTextWriter::pass(const Pass& pass) {
  const CutterPose* last_pose = nullptr;
  ++unreached_.all_passes;
  unreached_.all_points += int(pass.size());
  int reached_points = 0;
  for (const CutterPose& pose : pass) {
    const AxisVector axes_before = axes_;
    const Reachability pose_reach = reach(pose);
    if (pose_reach == Reachability::OutOfLimits || pose_reach == Reachability::Unreachable) {
      record_unreached(pose, pose_reach);
      if (last_pose) leave(*last_pose);
      last_pose = nullptr;
      continue;
    }
    ++reached_points;
    if (last_pose) {
      cut(pose.tip_w);
    } else {
      // The retraction from the previous pass keeps the rotary axes of that pass.
      const AxisVector axes_reached = axes_;
      const bool is_far = rest_point_w_ && (*rest_point_w_ - clearance_point(pose)).norm() >
                                               options_.max_link_distance;
      axes_ = axes_before;
      if (is_far) rapid(above(*rest_point_w_));
      axes_ = axes_reached;
      enter(pose);
    }
    has_cut_ = true;
    last_pose = &pose;
  }
  if (last_pose) leave(*last_pose);
  if (reached_points == 0) ++unreached_.passes;
  if (reached_points > 0 && reached_points < int(pass.size())) ++unreached_.broken_passes;
}

MillingProgram MillingTextWriter::program() {
  if (!has_cut_) throw NoReachablePose(unreached_);
  // The last move ends above the part.
  rapid(above(*rest_point_w_));
  items_.push_back("M5");
  items_.push_back("M2");
  const std::vector<ControlledAxis> axes = controlled_axes(context_.control);
  return {write_nc(items_, axes, {.format = options_.format, .inverse_time = false}), unreached_};
}

}  // namespace

bool has_rotary_axes(const kinematics::Chain& chain) {
  return std::any_of(chain.joints().begin(), chain.joints().end(),
                     [](const kinematics::Joint& joint) {
                       return joint.motion == Motion::Rotary && joint.name != 'S';
                     });
}

MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GeneratorContext& context) {
  for (const char letter : {'X', 'Y', 'Z'})
    if (!context.control.find(letter))
      throw std::invalid_argument("expected a machine with the axes X Y Z");
  double max_tip_z = -std::numeric_limits<double>::infinity();
  for (const Pass& pass : passes)
    for (const CutterPose& pose : pass) max_tip_z = std::max(max_tip_z, pose.tip_w.z());
  // The rim of a tilted cutter reaches below its tip by up to its radius; a second radius is
  // margin.
  MillingTextWriter writer(options, context,
                           max_tip_z + options.clearance + 2 * options.cutter_radius);
  writer.write_header();
  for (const Pass& pass : passes) writer.pass(pass);
  return writer.program();
}

namespace {

/// A section of the design by a vertical plane parallel to x or y of the part frame.
struct Section {
  const ContactField& design;
  int axis = 0;                      ///< 0: along x; 1: along y
  double constant_coordinate = 0.0;  ///< mm, the constant coordinate

  std::optional<cutting::Contact> at(double a) const {
    return axis == 0 ? design(a, constant_coordinate) : design(constant_coordinate, a);
  }
  /// Returns the change of the coordinate per arc length; 1 where there is no design.
  double rate(double a) const {
    const auto contact = at(a);
    if (!contact) return 1.0;
    const double across = contact->normal[axis], up = contact->normal.z();
    return up / std::sqrt(across * across + up * up);
  }
  /// Returns the coordinate after an arc length, by the classical fourth-order Runge-Kutta method:
  /// with steps of h on a radius rho the error is below (h/rho)^4 of the length.
  double advance(double from, double length, int steps) const {
    const double h = length / steps;
    double a = from;
    for (int i = 0; i < steps; ++i) {
      const double k1 = rate(a), k2 = rate(a + 0.5 * h * k1), k3 = rate(a + 0.5 * h * k2),
                   k4 = rate(a + h * k3);
      a += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return a;
  }
  /// Returns the last coordinate with design between `inside` and `outside`. 60 bisections reduce
  /// any interval to the spacing of doubles.
  double rim(double inside, double outside) const {
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (inside + outside);
      (at(middle) ? inside : outside) = middle;
    }
    return inside;
  }
};

/// Returns the y coordinates of the passes, equally spaced on the design from the middle outwards.
std::vector<double> pass_positions(const Raster& raster, const Section& section, double lower,
                                   double upper) {
  // A step over is usually a small fraction of the radius: (1/8)^4 reduces the error by 4000.
  constexpr int steps = 8;
  const double middle = 0.5 * (lower + upper);
  std::vector<double> y{middle};
  for (const double sign : {1.0, -1.0}) {
    double position = middle;
    while (true) {
      const double next = section.advance(position, sign * raster.step_over, steps);
      const bool is_vertical =
          std::abs(next - position) < 1e-6 * raster.step_over;  // the design is vertical here
      if (is_vertical || next > upper + 1e-9 || next < lower - 1e-9) break;
      y.push_back(position = next);
    }
  }
  std::sort(y.begin(), y.end());
  return y;
}

struct Interval {
  double from = 0.0, to = 0.0;
};

/// Returns the intervals in which the section runs over the design. May miss a gap narrower than
/// `step`.
std::vector<Interval> find_intervals(const Section& section, double lower, double upper,
                                     double step) {
  std::vector<Interval> intervals;
  const int n = std::max(1, int(std::ceil((upper - lower) / step)));
  bool inside = false;
  double interval_start = lower, previous = lower;
  for (int i = 0; i <= n; ++i) {
    const double a = i == n ? upper : lower + (upper - lower) * i / n;
    const bool has_design = section.at(a).has_value();
    if (has_design && !inside) interval_start = i == 0 ? a : section.rim(a, previous);
    if (!has_design && inside) intervals.push_back({interval_start, section.rim(previous, a)});
    inside = has_design;
    previous = a;
  }
  if (inside) intervals.push_back({interval_start, upper});
  return intervals;
}

/// Returns coordinates at equal arc lengths over an interval, including both ends.
std::vector<double> points_along(const Section& section, const Interval& interval, double step) {
  std::vector<double> x{interval.from};
  while (true) {
    const double next = section.advance(x.back(), step, 2);
    // A last step of less than a millionth is rounding, not a point.
    if (!(next < interval.to) || next - x.back() < 1e-6 * step) break;
    x.push_back(next);
  }
  if (interval.to - x.back() > 1e-6 * step) x.push_back(interval.to);
  return x;
}

/// Returns the pose of the cutter at a contact: its axis leans from the normal by `lead` towards
/// the feed and by `tilt` about it.
CutterPose raster_pose(const Raster& raster, const cutting::Cutter& cutter,
                       const cutting::Contact& contact, const Eigen::Vector3d& feed,
                       const std::optional<Eigen::Vector3d>& fixed_axis) {
  const Eigen::Vector3d& n = contact.normal;
  Eigen::Vector3d u = std::cos(raster.lead) * n + std::sin(raster.lead) * feed;
  u = Eigen::AngleAxisd(raster.tilt, feed) * u;
  if (fixed_axis) u = *fixed_axis;
  u.normalize();
  const Eigen::Vector3d inward = n - n.dot(u) * u;
  const double sine = inward.norm();
  if (cutter.outline) {
    const Eigen::Vector2d contact_offset = cutting::support_point(*cutter.outline, -n.dot(u), sine);
    Eigen::Vector3d tip = contact.point - contact_offset.y() * u;
    // An upright axis has no inward direction: the tip is then below the contact point.
    if (sine > 1e-12) tip += contact_offset.x() * (inward / sine);
    return {tip, u, u};
  }
  const double r = cutter.corner_radius;
  Eigen::Vector3d tip = contact.point + r * (n - u);
  // With the flat on the surface every point of it touches; the tip is placed on the contact.
  if (sine > 1e-12) tip += (cutter.radius - r) * (inward / sine);
  return {tip, u, u};
}

/// Returns the poses of a pass at the coordinates x of a section.
Pass raster_pass(const Raster& raster, const cutting::Cutter& cutter, const Section& section,
                 std::vector<double> x, const std::optional<Eigen::Vector3d>& fixed_axis,
                 bool backwards) {
  if (backwards) std::reverse(x.begin(), x.end());
  Pass pass;
  for (const double a : x) {
    const auto contact = section.at(a);
    if (!contact) continue;
    const Eigen::Vector3d& n = contact->normal;
    const Eigen::Vector3d along = Eigen::Vector3d(n.z(), 0.0, -n.x()).normalized();
    pass.push_back(raster_pose(raster, cutter, *contact,
                               backwards ? Eigen::Vector3d(-along) : along, fixed_axis));
  }
  return pass;
}

void check(const Raster& raster, const cutting::Cutter& cutter, const GeneratorContext& context) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value))
      throw std::invalid_argument(fmt::format("expected {} greater than 0", name));
  };
  positive(raster.step_over, "step_over");
  positive(raster.step, "step");
  positive(raster.feed, "feed");
  positive(raster.clearance, "clearance");
  positive(cutter.radius, "the radius of the cutter");
  // 1.6 rad is just above 90 deg; the message states the intent.
  if (!(std::abs(raster.lead) < 1.6) || !(std::abs(raster.tilt) < 1.6))
    throw std::invalid_argument("expected lead and tilt below 90 deg");
  const Eigen::Vector2d range = context.upper - context.lower;
  if (!(range.minCoeff() >= 0.0) || !range.allFinite())
    throw std::invalid_argument("expected a range with its lower corner below the upper");
  if ((range.x() / raster.step + 1) * (range.y() / raster.step_over + 1) > max_points)
    throw std::invalid_argument("expected at most 2e7 points in a program");
  if (!has_rotary_axes(context.control) && (raster.lead != 0.0 || raster.tilt != 0.0))
    throw std::invalid_argument("expected lead = tilt = 0 on a machine without rotary axes");
}

}  // namespace

MillingProgram generate_raster(const Raster& raster, const ContactField& design,
                               const cutting::Cutter& cutter, const GeneratorContext& context) {
  check(raster, cutter, context);
  std::optional<Eigen::Vector3d> fixed_axis;  // in the part frame
  if (!has_rotary_axes(context.control)) {
    const auto zero = kinematics::AxisVector(kinematics::AxisVector::Zero(context.control.size()));
    fixed_axis =
        context.T_wm.linear().transpose() * context.control.tool_in_workpiece(zero).linear().col(2);
  }
  // The section x = 0 if the range contains it, else the nearest one.
  const double x_section = std::clamp(0.0, context.lower.x(), context.upper.x());
  const std::vector<double> y =
      pass_positions(raster, {design, 1, x_section}, context.lower.y(), context.upper.y());
  std::vector<Pass> passes;
  bool backwards = false;
  for (const double pass_y : y) {
    const Section section{design, 0, pass_y};
    std::vector<Interval> intervals =
        find_intervals(section, context.lower.x(), context.upper.x(), raster.step);
    if (backwards) std::reverse(intervals.begin(), intervals.end());
    for (const Interval& interval : intervals) {
      Pass pass = raster_pass(raster, cutter, section, points_along(section, interval, raster.step),
                              fixed_axis, backwards);
      for (CutterPose& p : pass) {
        p.tip_w = context.T_wm * p.tip_w;
        p.direction_w = context.T_wm.linear() * p.direction_w;
        p.retract_w = context.T_wm.linear() * p.retract_w;
      }
      if (!pass.empty()) passes.push_back(std::move(pass));
    }
    if (raster.zigzag) backwards = !backwards;
  }
  if (passes.empty())
    throw std::invalid_argument("expected part of the design within the range of the raster");
  return milling_text(passes,
                      {.title = "raster finishing",
                       .feed = raster.feed,
                       .clearance = raster.clearance,
                       .speed_rpm = raster.speed_rpm,
                       .cutter_radius = cutter.radius,
                       // Zigzag passes end next to the start of the next, so up to four steps over
                       // are linked at clearance.
                       .max_link_distance = raster.zigzag ? 4 * raster.step_over : 0.0,
                       .must_reach_all = false,
                       .format = raster.format},
                      context);
}

namespace {

// Steps beyond the full turn, which remove the mark of the entry.
constexpr int overlap_steps = 2;

/// Returns the pose in which the flank of the cutter lies along the generator of the cone at one
/// azimuth.
CutterPose flank_pose(const Flank& flank, const cutting::Cone& cone, const cutting::Cutter& cutter,
                      double azimuth) {
  const double c = std::cos(cone.half_apex_angle), s = std::sin(cone.half_apex_angle);
  const Eigen::Vector3d out(std::cos(azimuth), std::sin(azimuth), 0.0);
  const Eigen::Vector3d normal = c * out + s * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d generator = -s * out + c * Eigen::Vector3d::UnitZ();
  return {cone.base_radius * out - flank.tip_below * generator + cutter.radius * normal, generator,
          normal};
}

/// Returns the poses once around the cone. `sign` is the direction of rotation about its axis.
Pass flank_pass(const Flank& flank, const cutting::Cone& cone, const cutting::Cutter& cutter,
                const GeneratorContext& context, double start, double sign) {
  const int n = int(std::ceil(2 * std::numbers::pi * cone.base_radius / flank.step));
  Pass pass;
  for (int k = 0; k <= n + overlap_steps; ++k) {
    CutterPose p = flank_pose(flank, cone, cutter, start + sign * 2 * std::numbers::pi * k / n);
    pass.push_back({context.T_wm * p.tip_w, context.T_wm.linear() * p.direction_w,
                    context.T_wm.linear() * p.retract_w});
  }
  return pass;
}

void check(const Flank& flank, const cutting::Cone& cone, const cutting::Cutter& cutter) {
  const bool are_sizes_positive =
      flank.step > 0 && flank.feed > 0 && flank.clearance > 0 && cone.base_radius > 0 &&
      cutter.radius > 0 && cone.half_apex_angle > 0 && cone.half_apex_angle < std::numbers::pi / 2;
  if (cutter.outline)
    throw std::invalid_argument(
        "expected a cutter with a cylindrical flank: a ball, bull or flat end mill");
  if (!are_sizes_positive || !std::isfinite(flank.tip_below))
    throw std::invalid_argument(
        "expected positive sizes of the cone and the cutter, step, feed and clearance");
  if (2 * std::numbers::pi * cone.base_radius / flank.step > max_points)
    throw std::invalid_argument("expected at most 2e7 points in a program");
}

}  // namespace

std::string generate_flank(const Flank& flank, const cutting::Cone& cone,
                           const cutting::Cutter& cutter, const GeneratorContext& context) {
  check(flank, cone, cutter);
  const MillingTextOptions options{.title = "flank milling of a cone frustum",
                                   .feed = flank.feed,
                                   .clearance = flank.clearance,
                                   .speed_rpm = flank.speed_rpm,
                                   .cutter_radius = cutter.radius,
                                   .max_link_distance = 0.0,
                                   .must_reach_all = true,
                                   .format = flank.format};
  // A rotary axis with limited travel may still complete the turn from another start or in the
  // other direction. Climb milling is tried first.
  for (const double sign : {-1.0, 1.0})
    for (int quarter = 0; quarter < 4; ++quarter) try {
        return milling_text(
                   {flank_pass(flank, cone, cutter, context, quarter * std::numbers::pi / 2, sign)},
                   options, context)
            .text;
      } catch (const std::invalid_argument&) {
        if (sign > 0 && quarter == 3) throw;
      }
  throw std::logic_error("unreachable");
}

}  // namespace abbe::sim::program
