#include "cutting/surface/removal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/surface/cutter_entry.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

namespace {

constexpr double max_part_angle = 0.05;  // rad; the header states what a larger turn may miss

}  // namespace

int move_part_count(const CutterMotion& motion, int move) {
  const int next = std::min<int>(move + 1, int(motion.tip.rows()) - 1);
  const double squared_chord = (motion.axis.row(next) - motion.axis.row(move)).squaredNorm();
  // At this angle the chord is 1e-4 shorter than the arc. The margin of 1 % of its square avoids
  // the arc sine for almost all moves and misses no turn.
  if (squared_chord < 0.99 * max_part_angle * max_part_angle) return 1;
  return 1 + int(2 * std::asin(std::min(1.0, 0.5 * std::sqrt(squared_chord))) / max_part_angle);
}

Move move_part(const CutterMotion& motion, int move, int part, int parts) {
  Move result = move_after(motion, move);
  if (parts > 1) {
    result.from = double(part) / parts;
    result.to = double(part + 1) / parts;
  }
  return result;
}

Move move_part(const CutterMotion& motion, int move, int part) {
  return move_part(motion, move, part, move_part_count(motion, move));
}

namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double rim_width = 1e-7;   // mm; a contact this near to a sharp rim is on it
constexpr double min_cosine = 1e-6;  // of the angle between the normals of skin and design

/// The interval between samples that contains an instant, and the fraction of it that has passed.
struct Instant {
  int interval;
  double u;
};

Instant locate_instant(const Eigen::VectorXd& time_s, double time) {
  const double* times = time_s.data();
  const Index upper = std::lower_bound(times, times + time_s.size(), time) - times;
  const Index interval = std::clamp<Index>(upper - 1, 0, std::max<Index>(0, time_s.size() - 2));
  const Index next = std::min<Index>(interval + 1, time_s.size() - 1);
  const double duration = time_s[next] - time_s[interval];
  return {int(interval), duration > 0.0 ? (time - time_s[interval]) / duration : 0.0};
}

/// Returns true if a point of the half plane through the axis lies on a sharp rim of the cutter.
bool is_on_rim(const Cutter& cutter, const Eigen::Vector2d& point) {
  if (!cutter.outline)
    return cutter.corner_radius == 0.0 && std::abs(point.y()) < rim_width &&
           std::abs(point.x() - cutter.radius) < rim_width;
  return std::ranges::any_of(cutter.outline->segments, [&](const OutlineSegment& segment) {
    return segment.is_arc && segment.radius == 0.0 &&
           (point - segment.from).cwiseAbs().maxCoeff() < rim_width;
  });
}

/// Returns the normal of the cutter's skin at a contact. On a sharp rim it is the normal of the
/// surface that the rim sweeps with the feed, or nothing if the rim moves along itself.
std::optional<Vector3d> skin_normal(const Cutter& cutter, const CutterPose& pose,
                                    const Vector3d& feed, const Vector3d& contact) {
  const Vector3d contact_from_tip = contact - pose.tip;
  const double height = contact_from_tip.dot(pose.axis);
  const Vector3d radial_vector = contact_from_tip - height * pose.axis;
  const double axis_distance = radial_vector.norm();
  const Vector3d outward =
      axis_distance > 0.0 ? Vector3d(radial_vector / axis_distance) : Vector3d::Zero();
  const double corner = cutter.corner_radius, ring_radius = cutter.radius - corner;
  if (is_on_rim(cutter, {axis_distance, height})) {
    const Vector3d swept = pose.axis.cross(outward).cross(feed);
    return swept.norm() > 1e-6 * feed.norm() ? std::optional(swept) : std::nullopt;
  }
  if (cutter.outline) {
    const Eigen::Vector2d n = distance(*cutter.outline, {axis_distance, height}).gradient;
    return n.x() * outward + n.y() * pose.axis;
  }
  if (height >= corner) return outward;
  if (axis_distance <= ring_radius) return -pose.axis;
  return Vector3d(contact - (pose.tip + corner * pose.axis + ring_radius * outward));
}

/// Returns the normal of an insert's edge, in the rake plane, at the point nearest to a contact.
/// @param R            rotation of frame t
/// @param from_origin  contact relative to the origin of frame t
Vector3d edge_normal(const EdgeProfile& profile, const Eigen::Matrix3d& R,
                     const Vector3d& from_origin) {
  const Eigen::Vector2d point(R.col(0).dot(from_origin), R.col(2).dot(from_origin));
  const Eigen::Vector2d outward = distance(profile.segments, point).gradient;
  return outward.x() * R.col(0) + outward.y() * R.col(2);
}

/// Returns the skin's normal scaled so that gradient . normal = 1; NaN if the two are
/// perpendicular.
Vector3d scaled_gradient(const std::optional<Vector3d>& skin, const Vector3d& normal) {
  const double cosine = skin ? std::abs(skin->dot(normal)) : 0.0;
  if (!(cosine > min_cosine * (skin ? skin->norm() : 1.0)))
    return Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return *skin / skin->dot(normal);
}

/// Computes gradient and travel of every cut vertex in parallel by `vertex_model(v, contact)`.
template <class VertexModel>
PassGradients contact_gradients(const Design& design, const Surface& surface,
                                const VertexModel& vertex_model) {
  const Index vertex_count = design.vertices.rows();
  require(surface.residual.size() == vertex_count && design.normals.rows() == vertex_count,
          "gradients: the surface and the design differ in size");
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  PassGradients gradients{Points::Constant(vertex_count, 3, nan),
                          Eigen::VectorXd::Constant(vertex_count, nan)};
  tbb::parallel_for(tbb::blocked_range<Index>(0, vertex_count, 1024), [&](const auto& range) {
    for (Index v = range.begin(); v < range.end(); ++v) {
      if (surface.status[std::size_t(v)] != VertexStatus::Cut) continue;
      const Vector3d contact = design.vertices.row(v) + surface.residual[v] * design.normals.row(v);
      const auto [gradient, travel] = vertex_model(v, contact);
      gradients.gradient.row(v) = gradient;
      gradients.travel[v] = travel;
    }
  });
  return gradients;
}

}  // namespace

Eigen::VectorXd path_lengths(const CutterMotion& motion, double initial_length) {
  const Index samples = motion.tip.rows();
  Eigen::VectorXd lengths = Eigen::VectorXd::Constant(samples, initial_length);
  for (Index i = 1; i < samples; ++i)
    lengths[i] = lengths[i - 1] + (motion.tip.row(i) - motion.tip.row(i - 1)).norm();
  return lengths;
}

PassGradients milled_gradients(const Design& design_w, const Surface& surface, const Cutter& cutter,
                               const CutterMotion& motion, double initial_length) {
  check_cutter(cutter);
  const Index samples = motion.tip.rows();
  const Eigen::VectorXd path_length = path_lengths(motion, initial_length);
  return contact_gradients(design_w, surface, [&](Index v, const Vector3d& contact) {
    const auto [interval, u] = locate_instant(motion.time_s, surface.cut_time_s[v]);
    const Move move = move_after(motion, interval);
    const CutterPose pose = cutter_pose(move, u);
    const Vector3d rotation = move.angle * move.axis.cross(move.side);
    const Vector3d feed = move.step + rotation.cross(contact - pose.tip);
    const Vector3d normal = design_w.normals.row(v);
    const Index next = std::min<Index>(interval + 1, samples - 1);
    return std::pair(scaled_gradient(skin_normal(cutter, pose, feed, contact), normal),
                     path_length[interval] + u * (path_length[next] - path_length[interval]));
  });
}

PassGradients turned_gradients(const Design& design_w, const Surface& surface, const Nose& nose,
                               const NoseMotion& motion) {
  const Vector3d spindle_axis = motion.spindle_direction;
  return contact_gradients(design_w, surface, [&](Index v, const Vector3d& contact) {
    const auto [interval, u] = locate_instant(motion.time_s, surface.cut_time_s[v]);
    const Index next = std::min<Index>(interval + 1, motion.time_s.size() - 1);
    const double angle =
        motion.spindle[interval] + u * (motion.spindle[next] - motion.spindle[interval]);
    const Eigen::Isometry3d &start_pose = motion.T_without_spindle[std::size_t(interval)],
                            &end_pose = motion.T_without_spindle[std::size_t(next)];
    const Eigen::AngleAxisd rotation(angle, spindle_axis);
    const Vector3d centre =
        motion.spindle_point + rotation * ((1.0 - u) * start_pose.translation() +
                                           u * end_pose.translation() - motion.spindle_point);
    const Vector3d rake = rotation * Vector3d(start_pose.linear().col(1));
    const Vector3d edge_vector =
        nose.profile ? edge_normal(*nose.profile, rotation * Eigen::Matrix3d(start_pose.linear()),
                                   contact - centre)
                     : Vector3d(contact - centre);
    const Vector3d work_direction = spindle_axis.cross(contact - motion.spindle_point);
    // Within the rake plane the edge runs perpendicular to `edge_vector`, and the work passes it
    // about the spindle line; the skin contains both directions.
    const Vector3d skin = rake.cross(edge_vector).cross(work_direction);
    const Vector3d normal = design_w.normals.row(v);
    const std::optional<Vector3d> defined_skin =
        skin.norm() > 0.0 ? std::optional(skin) : std::nullopt;
    return std::pair(scaled_gradient(defined_skin, normal),
                     std::abs(angle) * work_direction.norm());
  });
}

}  // namespace abbe::cutting
