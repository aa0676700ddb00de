#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/part/compensated_sum.h"
#include "cutting/stock/engagement.h"
#include "cutting/surface/nose_cut.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// 400 MB for the radii alone
constexpr double max_nodes = 50e6;

double frustum(double a, double b, double height) {
  return std::numbers::pi / 3.0 * height * (a * a + a * b + b * b);
}

/// Returns the volume between nodes from and to, mm^3.
double volume(const TurnedStock& stock, Index from, Index to) {
  Sum sum;
  for (Index i = from; i < to; ++i)
    sum.add(frustum(stock.radius[i], stock.radius[i + 1], stock.spacing));
  return sum.value();
}

double last_place(const TurnedStock& stock) {
  return stock.first + stock.spacing * double(stock.radius.size() - 1);
}

/// Returns the radius at a position within the stock.
double radius_at(const TurnedStock& stock, double x) {
  const double u = (x - stock.first) / stock.spacing;
  const Index i = std::clamp<Index>(Index(u), 0, std::max<Index>(0, stock.radius.size() - 2));
  const Index next = std::min(i + 1, stock.radius.size() - 1);
  return stock.radius[i] + (u - double(i)) * (stock.radius[next] - stock.radius[i]);
}

void check(const Eigen::Isometry3d& T_slow) {
  if (!T_slow.matrix().allFinite())
    throw std::invalid_argument("turned stock: expected a finite pose");
}

double edge_radius(const Nose& nose, double psi) {
  double radius = nose.radius;
  for (const NoseWave& wave : nose.waves)
    radius += wave.amplitude * std::cos(wave.order * psi + wave.phase);
  return radius;
}

/// A pose over a turned stock: converts points of the rake plane to position along the spindle line
/// and radius.
class Meridian {
 public:
  Meridian(const TurnedStock& stock, const Eigen::Isometry3d& T_slow)
      : stock_(stock), T_(T_slow), centre_(T_slow.translation() - stock.point_w) {}

  /// Returns (position, radius) of a point (x, z) of frame t.
  Vector2d at(const Vector2d& point_t) const {
    const Vector3d p = centre_ + T_.linear() * Vector3d(point_t.x(), 0.0, point_t.y());
    const double along = p.dot(stock_.direction_w);
    return {along, (p - along * stock_.direction_w).norm()};
  }

  /// Returns the depth of a point in material: below the profile and between its ends.
  double signed_depth(const Vector2d& place) const {
    const double last = last_place(stock_);
    const double x = std::clamp(place.x(), stock_.first, last);
    return std::min({radius_at(stock_, x) - place.y(), place.x() - stock_.first, last - place.x()});
  }

  /// Returns the length of material from a point of the edge towards another point that is `most`
  /// mm away in the tool, until the path leaves it.
  double material(const Vector2d& edge, const Vector2d& towards, double most) const {
    if (!(signed_depth(edge) > 0.0)) return 0.0;
    const Vector2d way = (towards - edge) / most;
    // Node by node, because the profile is linear between nodes.
    double passed = 0.0;
    for (double s = 0.0; s < most;) {
      const double next = std::min(most, next_node(edge, way, s));
      if (const double left = signed_depth(edge + next * way); left <= 0.0)
        return leaves(edge, way, s, next);
      passed = next;
      s = next;
    }
    return passed;
  }

 private:
  /// Returns the position at which the path comes to the next node of the stock after s.
  double next_node(const Vector2d& edge, const Vector2d& way, double s) const {
    const double h = stock_.spacing;
    if (std::abs(way.x()) < 1e-12) return infinity;
    const double u = (edge.x() + s * way.x() - stock_.first) / h;
    const double node = way.x() > 0.0 ? std::floor(u + 1e-9) + 1.0 : std::ceil(u - 1e-9) - 1.0;
    return (stock_.first + node * h - edge.x()) / way.x();
  }

  /// Returns the position at which the path leaves the material. The profile is straight between
  /// nodes, so the depth is linear there except at the ends of the stock, and the secant mostly
  /// hits at once.
  double leaves(const Vector2d& edge, const Vector2d& way, double in, double out) const {
    for (int i = 0; i < 60 && out - in > 1e-13; ++i) {
      const double a = signed_depth(edge + in * way);
      const double b = signed_depth(edge + out * way);
      double next = a > b ? in + (out - in) * a / (a - b) : 0.5 * (in + out);
      if (i % 3 == 2 || !(next > in && next < out)) next = 0.5 * (in + out);
      const double here = signed_depth(edge + next * way);
      if (here == 0.0) return next;
      (here > 0.0 ? in : out) = next;
    }
    return out;
  }

  const TurnedStock& stock_;
  const Eigen::Isometry3d& T_;
  Vector3d centre_;
};

/// The edge of a nose over a stock, by the angle psi.
class EdgeInStock {
 public:
  EdgeInStock(const TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& T_slow)
      : nose_(nose), meridian_(stock, T_slow) {}

  double signed_depth(double psi) const { return meridian_.signed_depth(point(psi)); }

  /// Returns the chip thickness: the material between the edge and the profile, from the edge
  /// towards the centre of the nose, at most to the centre.
  double chip(double psi) const {
    const double most = edge_radius(nose_, psi);
    return meridian_.material(point(psi), meridian_.at(Vector2d::Zero()), most);
  }

 private:
  Vector2d point(double psi) const {
    return meridian_.at(edge_radius(nose_, psi) * Vector2d(std::cos(psi), std::sin(psi)));
  }

  const Nose& nose_;
  Meridian meridian_;
};

/// A piece of an insert's edge over a stock, by the fraction of its length.
class PieceInStock {
 public:
  PieceInStock(const TurnedStock& stock, const EdgeProfile& profile, const OutlinePiece& piece,
               const Eigen::Isometry3d& T_slow)
      : profile_(profile),
        piece_(piece),
        angle_(std::acos(std::clamp(piece.normal_from.dot(piece.normal_to), -1.0, 1.0))),
        meridian_(stock, T_slow) {}

  double length() const {
    return piece_.is_arc ? piece_.radius * angle_ : (piece_.to - piece_.from).norm();
  }
  Vector2d at(double share) const {
    if (!piece_.is_arc) return piece_.from + share * (piece_.to - piece_.from);
    return piece_.from + piece_.radius * (normal(share) - piece_.normal_from);
  }
  double signed_depth(double share) const {
    return meridian_.signed_depth(meridian_.at(at(share)));
  }

  /// Returns the chip thickness: the material normal to the edge, at most to the other side of the
  /// insert.
  double chip(double share) const {
    const Vector2d edge = at(share), inward = -normal(share);
    const std::optional<Chord> across = chord(profile_, edge, inward);
    if (!across || !(across->end > 0.0)) return 0.0;
    return meridian_.material(meridian_.at(edge), meridian_.at(edge + across->end * inward),
                              across->end);
  }

 private:
  Vector2d normal(double share) const {
    return Eigen::Rotation2Dd(share * angle_) * piece_.normal_from;
  }

  const EdgeProfile& profile_;
  const OutlinePiece& piece_;
  double angle_;  // rad, of an arc
  Meridian meridian_;
};

/// Returns the point between one outside and one inside at which the edge crosses the profile.
template <class Edge>
double end_of_cut(const Edge& edge, double outside, double inside) {
  for (int i = 0; i < 60 && std::abs(inside - outside) > 1e-13; ++i) {
    const double middle = 0.5 * (outside + inside);
    (edge.signed_depth(middle) > 0.0 ? inside : outside) = middle;
  }
  return inside;
}

/// Appends the engaged parts of a piece, in at most `most` parts, or as many as the stock has nodes
/// for.
void append_engaged(const PieceInStock& piece, double spacing, int most,
                    std::vector<EngagedEdge>& engaged) {
  // a short arc still gets eight parts, so that its normal varies little within one
  constexpr int least = 8;
  const double length = piece.length();
  if (!(length > 0.0)) return;
  const int parts =
      int(std::clamp(std::ceil(0.5 * length / spacing), 1.0 * least, 1.0 * std::max(least, most)));
  double before = piece.signed_depth(0.0);
  for (int i = 0; i < parts; ++i) {
    double from = double(i) / parts, to = double(i + 1) / parts;
    const double after = piece.signed_depth(to);
    if (before > 0.0 || after > 0.0) {
      if (before <= 0.0) from = end_of_cut(piece, from, to);
      if (after <= 0.0) to = end_of_cut(piece, to, from);
      const double middle = 0.5 * (from + to);
      const Vector2d at = piece.at(middle);
      if (to > from)
        engaged.push_back({std::atan2(at.y(), at.x()), (to - from) * length, piece.chip(middle)});
    }
    before = after;
  }
}

std::vector<EngagedEdge> engaged_profile(const TurnedStock& stock, const EdgeProfile& profile,
                                         const Eigen::Isometry3d& T_slow, int pieces) {
  std::vector<EngagedEdge> engaged;
  for (const OutlinePiece& piece : profile.pieces)
    append_engaged({stock, profile, piece, T_slow}, stock.spacing, pieces, engaged);
  return engaged;
}

void check_profile(const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile, double spacing) {
  if (!(std::isfinite(spacing) && spacing > 0.0))
    throw std::invalid_argument(
        fmt::format("turned stock: expected a spacing above 0 mm, seen {}", spacing));
  if (profile.rows() < 2 || !profile.allFinite())
    throw std::invalid_argument("turned stock: expected two or more finite corners");
  for (Index i = 0; i < profile.rows(); ++i) {
    if (profile(i, 1) < 0.0)
      throw std::invalid_argument(
          fmt::format("turned stock: expected radii of 0 mm or more, seen {}", profile(i, 1)));
    if (i > 0 && profile(i, 0) < profile(i - 1, 0))
      throw std::invalid_argument(
          fmt::format("turned stock: expected corners in rising order, seen {} after {}",
                      profile(i, 0), profile(i - 1, 0)));
  }
  const double length = profile(profile.rows() - 1, 0) - profile(0, 0);
  if (!(length > 0.0)) throw std::invalid_argument("turned stock: expected a length above 0 mm");
  if (length / spacing > max_nodes)
    throw std::length_error(fmt::format(
        "turned stock of {:.0f} nodes would take {:.0f} MiB, more than the {:.0f} allowed",
        length / spacing, length / spacing * sizeof(double) / 1048576.0,
        max_nodes * sizeof(double) / 1048576.0));
}

}  // namespace

double volume(const TurnedStock& stock) {
  return volume(stock, 0, std::max<Index>(0, stock.radius.size() - 1));
}

TurnedStock make_turned_stock(const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile_mm,
                              double spacing, const Vector3d& point_w,
                              const Vector3d& direction_w) {
  check_profile(profile_mm, spacing);
  if (!point_w.allFinite() || std::abs(direction_w.norm() - 1.0) > 1e-9)
    throw std::invalid_argument("turned stock: expected a finite point and a unit direction");
  const Index corners = profile_mm.rows();
  const double length = profile_mm(corners - 1, 0) - profile_mm(0, 0);
  const Index pieces = std::max<Index>(1, Index(std::ceil(length / spacing - 1e-9)));
  TurnedStock stock{
      point_w, direction_w.normalized(), profile_mm(0, 0), length / double(pieces), {}, {}};
  stock.radius.resize(pieces + 1);
  stock.line.assign(std::size_t(pieces) + 1, 0);
  Index corner = 0;
  for (Index i = 0; i <= pieces; ++i) {
    const double x = stock.first + stock.spacing * double(i);
    while (corner + 2 < corners && profile_mm(corner + 1, 0) < x) ++corner;
    const double from = profile_mm(corner, 0), to = profile_mm(corner + 1, 0);
    const double part = to > from ? std::clamp((x - from) / (to - from), 0.0, 1.0) : 1.0;
    stock.radius[i] =
        profile_mm(corner, 1) + part * (profile_mm(corner + 1, 1) - profile_mm(corner, 1));
  }
  return stock;
}

std::vector<EngagedEdge> engagement(const TurnedStock& stock, const Nose& nose,
                                    const Eigen::Isometry3d& T_slow, int pieces) {
  check(T_slow);
  const NoseEdge valid(nose);
  if (pieces < 3) throw std::invalid_argument("nose edge: expected 3 or more pieces");
  std::vector<EngagedEdge> result;
  if (stock.radius.size() < 2) return result;
  if (nose.profile) return engaged_profile(stock, *nose.profile, T_slow, pieces);
  const EdgeInStock edge(stock, nose, T_slow);
  const double step = 2.0 * std::numbers::pi / pieces;
  double before = edge.signed_depth(0.0);
  for (int i = 0; i < pieces; ++i) {
    double from = i * step, to = (i + 1) * step;
    const double after = edge.signed_depth(i + 1 < pieces ? to : 0.0);
    if (before > 0.0 || after > 0.0) {
      if (before <= 0.0) from = end_of_cut(edge, from, to);
      if (after <= 0.0) to = end_of_cut(edge, to, from);
      const double psi = 0.5 * (from + to);
      const double length = (to - from) * edge_radius(nose, psi);
      if (length > 0.0) result.push_back({psi, length, edge.chip(psi)});
    }
    before = after;
  }
  return result;
}

namespace {

/// The motion between two slow poses, and the lowest point of the edge over a position of the
/// stock.
class Revolution {
 public:
  Revolution(const TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& from,
             const Eigen::Isometry3d& to)
      : stock_(stock),
        edge_(nose),
        start_(from.translation() - stock.point_w),
        step_(to.translation() - from.translation()),
        from_(from.linear()),
        to_(to.linear()),
        stands_((from.linear() - to.linear()).norm() < 1e-12),
        x_(from.linear().col(0)),
        z_(from.linear().col(2)),
        ahead_(reach_along(stock.direction_w)),
        behind_(reach_along(-stock.direction_w)) {
    if (!stands_ || !edge_.has_profile()) return;
    const Vector3d out = start_ - start_.dot(stock.direction_w) * stock.direction_w;
    if (!(out.norm() > edge_.outer_radius() + step_.norm())) return;
    const Vector3d down = -out.normalized();
    const Vector2d tip = extreme_point(edge_.profile(), {x_.dot(down), z_.dot(down)});
    tip_along_ = (tip.x() * x_ + tip.y() * z_).dot(stock.direction_w);
  }

  /// Returns the range along the spindle line that the nose passes, mm.
  std::pair<double, double> extent() const {
    const double a = start_.dot(stock_.direction_w), b = a + step_.dot(stock_.direction_w);
    return {std::min(a, b) - behind_, std::max(a, b) + ahead_};
  }

  /// Returns true if the edge certainly stays above a radius at a position. The nearer its tip
  /// passes, the lower a convex edge comes, except for the descent of the whole edge in the
  /// meantime.
  bool stays_above(double radius, double x) const {
    if (!tip_along_) return false;
    const double speed = step_.dot(stock_.direction_w);
    const double ahead = x - start_.dot(stock_.direction_w) - *tip_along_;
    const double nearest = std::abs(speed) > 1e-12 ? std::clamp(ahead / speed, 0.0, 1.0) : 0.0;
    return lowest(x, nearest) - step_.norm() > radius;
  }

  /// Returns the lowest radius at a position over the revolution; infinity if the edge does not
  /// reach it. For a convex edge the lowest point falls, then rises with time, so a golden section
  /// search finds the minimum.
  double lowest(double x) const {
    const double speed = step_.dot(stock_.direction_w);
    const double ahead = x - start_.dot(stock_.direction_w);
    double a = 0.0, b = 1.0;
    if (std::abs(speed) > 1e-12) {
      const double t0 = (ahead - ahead_) / speed;
      const double t1 = (ahead + behind_) / speed;
      a = std::max(a, std::min(t0, t1));
      b = std::min(b, std::max(t0, t1));
    }
    if (a > b) return infinity;
    return least(x, a, b);
  }

 private:
  /// Returns the reach of the edge from its centre along the spindle line at any time, mm.
  double reach_along(const Vector3d& direction) const {
    const double reach = edge_.reach({x_.dot(direction), z_.dot(direction)});
    if (stands_ || !edge_.has_profile()) return reach;
    return reach + (to_ - from_).norm() * edge_.outer_radius();
  }

  double least(double x, double a, double b) const {
    const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
    const double speed = step_.dot(stock_.direction_w);
    // position of the centre when half of the edge has passed
    const double middle = x - 0.5 * (ahead_ - behind_);
    const double beside = (middle - start_.dot(stock_.direction_w)) / (speed != 0.0 ? speed : 1.0);
    double best = std::min(lowest(x, a), lowest(x, b));
    double c = b - golden * (b - a), d = a + golden * (b - a);
    double at_c = lowest(x, c), at_d = lowest(x, d);
    // At the bottom of a round edge the value is flat: 2e-5 of the nose radius in time is 2e-10 of
    // it in value. Corners are not flat.
    const double close = (edge_.has_profile() ? 1e-10 : 2e-5) * edge_.outer_radius();
    for (int i = 0; i < 60 && (b - a) * step_.norm() > close; ++i) {
      best = std::min({best, at_c, at_d});
      const bool neither = at_c == infinity && at_d == infinity;
      if (neither ? beside < 0.5 * (a + b) : at_c <= at_d) {
        b = d;
        d = c;
        at_d = at_c;
        c = b - golden * (b - a);
        at_c = lowest(x, c);
      } else {
        a = c;
        c = d;
        at_c = at_d;
        d = a + golden * (b - a);
        at_d = lowest(x, d);
      }
    }
    return std::min({best, at_c, at_d});
  }

  double lowest(double x, double t) const {
    if (stands_) return lowest(x, start_ + t * step_, x_, z_);
    const Eigen::Matrix3d R = Eigen::Quaterniond(from_).slerp(t, Eigen::Quaterniond(to_)).matrix();
    return lowest(x, start_ + t * step_, R.col(0), R.col(2));
  }

  /// Returns the lowest point within the edge of the line in which the rake plane meets the plane
  /// normal to the spindle line at x.
  double lowest(double x, const Vector3d& centre, const Vector3d& ex, const Vector3d& ez) const {
    const Vector3d& along = stock_.direction_w;
    const Vector2d rise(ex.dot(along), ez.dot(along));  // of x over the rake plane
    const double steep = rise.squaredNorm();
    if (steep < 1e-12) return infinity;  // the rake plane is normal to the spindle line
    const Vector2d point = (x - centre.dot(along)) / steep * rise;
    const Vector2d way = Vector2d(-rise.y(), rise.x()) / std::sqrt(steep);
    const Vector3d p = centre + point.x() * ex + point.y() * ez;
    const Vector3d out = p - p.dot(along) * along;
    const Vector3d d = way.x() * ex + way.y() * ez;
    const double reach =
        std::sqrt(std::max(0.0, edge_.outer_radius() * edge_.outer_radius() - point.squaredNorm()));
    const auto in = edge_.entry(point, way, -reach);
    const auto back = edge_.entry(point, -way, -reach);
    if (!in || !back || *in > -*back) return infinity;
    const double s = std::clamp(-out.dot(d), *in, -*back);
    return (out + s * d).norm();
  }

  const TurnedStock& stock_;
  NoseEdge edge_;
  Vector3d start_, step_;
  Eigen::Matrix3d from_, to_;
  bool stands_;
  Vector3d x_, z_;
  double ahead_, behind_;  // mm, reach along the spindle line and against it
  std::optional<double>
      tip_along_;  // mm, of the lowest point, for an insert on one side of the line
};

}  // namespace

double remove(TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& from_T_slow,
              const Eigen::Isometry3d& to_T_slow, std::int32_t line) {
  check(from_T_slow);
  check(to_T_slow);
  if (stock.radius.size() < 2) return 0.0;
  const Revolution revolution(stock, nose, from_T_slow, to_T_slow);
  const auto [low, high] = revolution.extent();
  const double last = double(stock.radius.size() - 1);
  const double first_node = std::max(0.0, std::ceil((low - stock.first) / stock.spacing));
  const double last_node = std::min(last, std::floor((high - stock.first) / stock.spacing));
  if (first_node > last_node) return 0.0;
  const Index from = Index(first_node), to = Index(last_node);
  const Index begin = std::max<Index>(0, from - 1), end = std::min<Index>(Index(last), to + 1);
  const double before = volume(stock, begin, end);
  for (Index i = from; i <= to; ++i) {
    const double x = stock.first + stock.spacing * double(i);
    if (revolution.stays_above(stock.radius[i], x)) continue;
    const double lowest = revolution.lowest(x);
    if (!(lowest < stock.radius[i])) continue;
    stock.radius[i] = lowest;
    stock.line[std::size_t(i)] = line;
  }
  return before - volume(stock, begin, end);
}

}  // namespace abbe::cutting
