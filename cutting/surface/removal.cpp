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

constexpr double max_part_turn = 0.05;  // rad; the header states what a larger turn may miss

template <class Use>
void each_removal(const Cutter& cutter, const CutterMotion& motion, const Ray& ray, double limit,
                  const Use& use) {
  require(!is_hollow(cutter), "removal: expected a convex cutter, seen a hollow one");
  const int samples = int(motion.tip.rows());
  const int moves = samples == 1 ? 1 : samples - 1;
  for (int move = 0; move < moves; ++move) {
    const int parts = parts_of(motion, move);
    for (int part = 0; part < parts; ++part)
      if (const auto entry = first_entry(cutter, part_of(motion, move, part, parts), ray, limit))
        use(Removal{entry->s, entry->t, move, part});
  }
}

}  // namespace

int parts_of(const CutterMotion& motion, int move) {
  const int next = std::min<int>(move + 1, int(motion.tip.rows()) - 1);
  const double chord2 = (motion.axis.row(next) - motion.axis.row(move)).squaredNorm();
  // The chord is below the angle by 1e-4 here. 1 % off its square avoids the arc sine for almost
  // all moves without missing a turn.
  if (chord2 < 0.99 * max_part_turn * max_part_turn) return 1;
  return 1 + int(2 * std::asin(std::min(1.0, 0.5 * std::sqrt(chord2))) / max_part_turn);
}

Move part_of(const CutterMotion& motion, int move, int part, int parts) {
  Move whole = move_after(motion, move);
  if (parts > 1) {
    whole.from = double(part) / parts;
    whole.to = double(part + 1) / parts;
  }
  return whole;
}

Move part_of(const CutterMotion& motion, int move, int part) {
  return part_of(motion, move, part, parts_of(motion, move));
}

std::optional<Removal> first_of_every_move(const Cutter& cutter, const CutterMotion& motion,
                                           const Ray& ray) {
  std::optional<Removal> best;
  each_removal(cutter, motion, ray, ray.band, [&](const Removal& removal) {
    if (!best || removal.s < best->s) best = removal;
  });
  return best;
}

std::vector<Removal> every_move_within(const Cutter& cutter, const CutterMotion& motion,
                                       const Ray& ray, double reach) {
  std::vector<Removal> found;
  const std::optional<Removal> first = first_of_every_move(cutter, motion, ray);
  if (!first || first->s <= -ray.band) return found;
  each_removal(cutter, motion, ray, std::min(first->s + reach, ray.band),
               [&](const Removal& removal) { found.push_back(removal); });
  return found;
}

namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double rim_width = 1e-7;   // mm; a contact this near to a sharp rim is on it
constexpr double min_cosine = 1e-6;  // of the angle between the skin's normal and that of the
                                     // design

/// The interval of samples that contains an instant, and the fraction of it that has passed.
struct Instant {
  int interval;
  double u;
};

Instant instant_of(const Eigen::VectorXd& time_s, double at) {
  const double* begin = time_s.data();
  const Index after = std::lower_bound(begin, begin + time_s.size(), at) - begin;
  const Index interval = std::clamp<Index>(after - 1, 0, std::max<Index>(0, time_s.size() - 2));
  const Index next = std::min<Index>(interval + 1, time_s.size() - 1);
  const double span = time_s[next] - time_s[interval];
  return {int(interval), span > 0.0 ? (at - time_s[interval]) / span : 0.0};
}

/// Returns true if a point of the half plane through the axis lies on a sharp rim of the cutter.
bool is_on_rim(const Cutter& cutter, const Eigen::Vector2d& place) {
  if (!cutter.outline)
    return cutter.corner_radius == 0.0 && std::abs(place.y()) < rim_width &&
           std::abs(place.x() - cutter.radius) < rim_width;
  return std::ranges::any_of(cutter.outline->pieces, [&](const OutlinePiece& piece) {
    return piece.is_arc && piece.radius == 0.0 &&
           (place - piece.from).cwiseAbs().maxCoeff() < rim_width;
  });
}

/// Returns the normal of the cutter's skin at a contact. On a sharp rim it is that of the surface
/// that the rim sweeps with the feed; nothing if the rim moves along itself.
std::optional<Vector3d> skin_normal(const Cutter& cutter, const Position& at, const Vector3d& feed,
                                    const Vector3d& contact) {
  const Vector3d from = contact - at.tip;
  const double height = from.dot(at.axis);
  const Vector3d across = from - height * at.axis;
  const double radial = across.norm();
  const Vector3d outward = radial > 0.0 ? Vector3d(across / radial) : Vector3d::Zero();
  const double corner = cutter.corner_radius, ring = cutter.radius - corner;
  if (is_on_rim(cutter, {radial, height})) {
    const Vector3d swept = at.axis.cross(outward).cross(feed);
    return swept.norm() > 1e-6 * feed.norm() ? std::optional(swept) : std::nullopt;
  }
  if (cutter.outline) {
    const Eigen::Vector2d n = distance(*cutter.outline, {radial, height}).gradient;
    return n.x() * outward + n.y() * at.axis;
  }
  if (height >= corner) return outward;
  if (radial <= ring) return -at.axis;
  return Vector3d(contact - (at.tip + corner * at.axis + ring * outward));
}

/// Returns the normal of an insert's edge in the rake plane, at the edge point nearest to a
/// contact.
/// @param R     rotation of frame t
/// @param from  contact relative to its origin
Vector3d outward_of(const EdgeProfile& profile, const Eigen::Matrix3d& R, const Vector3d& from) {
  const Eigen::Vector2d place(R.col(0).dot(from), R.col(2).dot(from));
  const Eigen::Vector2d outward = distance(profile.pieces, place).gradient;
  return outward.x() * R.col(0) + outward.y() * R.col(2);
}

/// Returns the gradient, scaled so that gradient . normal = 1; NaN if the skin is seen edge-on.
Vector3d gradient_of(const std::optional<Vector3d>& skin, const Vector3d& normal) {
  const double facing = skin ? std::abs(skin->dot(normal)) : 0.0;
  if (!(facing > min_cosine * (skin ? skin->norm() : 1.0)))
    return Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return *skin / skin->dot(normal);
}

/// Computes gradient and travel of all cut vertices by `of_vertex(v, contact)`.
template <class OfVertex>
PassGradients each_contact(const Design& design, const Surface& surface,
                           const OfVertex& of_vertex) {
  const Index n = design.vertices.rows();
  require(surface.residual.size() == n && design.normals.rows() == n,
          "contacts: the surface is not that of the design");
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  PassGradients contacts{Points::Constant(n, 3, nan), Eigen::VectorXd::Constant(n, nan)};
  tbb::parallel_for(tbb::blocked_range<Index>(0, n, 1024), [&](const auto& range) {
    for (Index v = range.begin(); v < range.end(); ++v) {
      if (surface.status[std::size_t(v)] != VertexStatus::Cut) continue;
      const Vector3d contact =
          (design.vertices.row(v) + surface.residual[v] * design.normals.row(v));
      const auto [gradient, travel] = of_vertex(v, contact);
      contacts.gradient.row(v) = gradient;
      contacts.travel[v] = travel;
    }
  });
  return contacts;
}

}  // namespace

Eigen::VectorXd way_of(const CutterMotion& motion, double before) {
  const Index n = motion.tip.rows();
  Eigen::VectorXd way = Eigen::VectorXd::Constant(n, before);
  for (Index i = 1; i < n; ++i)
    way[i] = way[i - 1] + (motion.tip.row(i) - motion.tip.row(i - 1)).norm();
  return way;
}

PassGradients milled_gradients(const Design& design_w, const Surface& surface, const Cutter& cutter,
                               const CutterMotion& motion, double before) {
  check_cutter(cutter);
  const Index n = motion.tip.rows();
  const Eigen::VectorXd way = way_of(motion, before);
  return each_contact(design_w, surface, [&](Index v, const Vector3d& contact) {
    const auto [interval, u] = instant_of(motion.time_s, surface.cut_time_s[v]);
    const Move move = move_after(motion, interval);
    const Position at = position(move, u);
    const Vector3d turn = move.angle * move.axis.cross(move.side);
    const Vector3d feed = move.step + turn.cross(contact - at.tip);
    const Vector3d normal = design_w.normals.row(v);
    const Index next = std::min<Index>(interval + 1, n - 1);
    return std::pair(gradient_of(skin_normal(cutter, at, feed, contact), normal),
                     way[interval] + u * (way[next] - way[interval]));
  });
}

PassGradients turned_gradients(const Design& design_w, const Surface& surface, const Nose& nose,
                               const NoseMotion& motion) {
  const Vector3d line = motion.spindle_direction;
  return each_contact(design_w, surface, [&](Index v, const Vector3d& contact) {
    const auto [interval, u] = instant_of(motion.time_s, surface.cut_time_s[v]);
    const Index next = std::min<Index>(interval + 1, motion.time_s.size() - 1);
    const double angle =
        motion.spindle[interval] + u * (motion.spindle[next] - motion.spindle[interval]);
    const Eigen::Isometry3d &before = motion.T_slow[std::size_t(interval)],
                            &after = motion.T_slow[std::size_t(next)];
    const Eigen::AngleAxisd turn(angle, line);
    const Vector3d centre =
        motion.spindle_point +
        turn * ((1.0 - u) * before.translation() + u * after.translation() - motion.spindle_point);
    const Vector3d rake = turn * Vector3d(before.linear().col(1));
    const Vector3d arm =
        nose.profile
            ? outward_of(*nose.profile, turn * Eigen::Matrix3d(before.linear()), contact - centre)
            : Vector3d(contact - centre);
    const Vector3d around = line.cross(contact - motion.spindle_point);
    // The edge runs normal to the arm (of an insert: to its normal) within the rake plane, and the
    // work passes it around the spindle line; the skin contains both directions.
    const Vector3d skin = rake.cross(arm).cross(around);
    const Vector3d normal = design_w.normals.row(v);
    const std::optional<Vector3d> defined = skin.norm() > 0.0 ? std::optional(skin) : std::nullopt;
    return std::pair(gradient_of(defined, normal), std::abs(angle) * around.norm());
  });
}

}  // namespace abbe::cutting
