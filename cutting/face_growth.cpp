#include "cutting/face_growth.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Geometry>

#include "cutting/smooth_patches.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double least_lean = 0.866;   // cos 30 degrees, of a facet along its surface
constexpr double sliver = 10.0;        // tolerances: what is lower has no normal of its own
constexpr double growing_reach = 3.0;  // tolerances, while a surface is fitted to few facets yet
constexpr double tangent_angle = 2e-3;

/// Whether all but a few of the votes say yes; so it is where there are none.
struct Votes {
  int yes = 0, all = 0;
  void add(bool vote) {
    yes += vote;
    ++all;
  }
  bool nearly_all() const { return yes >= 0.9 * all; }
};

/// Whether a point lies on a line within a distance.
bool is_on(const Vector3d& p, const Vector3d& a, const Vector3d& b, double within) {
  const Vector3d along = b - a;
  return (p - a).cross(along).norm() <= within * along.norm();
}

/// How many points lie off a line.
std::vector<Vector3d> off_line(const std::vector<Vector3d>& points, const Vector3d& a,
                               const Vector3d& b, double within) {
  std::vector<Vector3d> off;
  for (const Vector3d& p : points)
    if (!is_on(p, a, b, within)) off.push_back(p);
  return off;
}

/// Whether all but one of the points lie on two lines. Of any five of those three are on one line.
bool are_on_two_lines(const std::vector<Vector3d>& points, double within) {
  const std::size_t n = points.size();
  if (n < 6) return true;
  const auto few = [&](std::size_t i) { return points[i * (n - 1) / 5]; };
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i + 1; j < 6; ++j)
      for (std::size_t k = j + 1; k < 6; ++k) {
        if (!is_on(few(k), few(i), few(j), within)) continue;
        const std::vector<Vector3d> off = off_line(points, few(i), few(j), within);
        if (off.size() < 3) return true;
        const auto far =
            std::max_element(off.begin(), off.end(), [&](const auto& a, const auto& b) {
              return (a - off[0]).norm() < (b - off[0]).norm();
            });
        if (off_line(off, off[0], *far, within).size() < 2) return true;
      }
  return false;
}

/// How many times as much as its own vertices those next to them leave the surface that fits a free
/// form best, where n lines of them are fitted: a polynomial of degree 4 that is at most 1 at all
/// of them comes to this at the next.
double next_to_own(const RecognisedPatch& local, const FacetPatch& patch) {
  const bool by_lines = local.form == Form::Cylinder || local.form == Form::Cone;
  const auto are_at_least = [&](int n) {
    return by_lines ? has_lines(local, patch, n) : patch.points.rows() >= n * n;
  };
  for (const auto& [lines, times] : {std::pair(13, 5.0), {9, 8.0}, {7, 12.0}})
    if (are_at_least(lines)) return times;
  return 24.0;
}

double angle_between_normals(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

FaceGrowth::FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance)
    : design_(design),
      tolerance_(tolerance),
      across_(neighbours(design.triangles)),
      normals_(design.triangles.rows(), 3),
      height_(design.triangles.rows()),
      face_(open.size(), closed),
      flat_(open.size(), none),
      stamp_(open.size(), 0),
      vertex_stamp_(std::size_t(design.vertices.rows()), 0) {
  for (Index t = 0; t < design.triangles.rows(); ++t) {
    if (open[std::size_t(t)]) face_[std::size_t(t)] = none;
    const auto corner = [&](int k) { return vertex(design.triangles(t, k)); };
    const Vector3d cross = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    double longest = 0.0;
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (corner((k + 1) % 3) - corner(k)).norm());
    normals_.row(t) = cross.normalized();
    height_[t] = longest > 0.0 ? cross.norm() / longest : 0.0;
  }
  find_flats(open);
}

int FaceGrowth::open_across(int t, int side) const {
  const int other = across_[std::size_t(t)][std::size_t(side)];
  return other >= 0 && is_open(other) ? other : -1;
}

void FaceGrowth::stamp(const Region& region) {
  ++stamped_;
  for (const int t : region.triangles) stamp_[std::size_t(t)] = stamped_;
  for (const int v : region.vertices) vertex_stamp_[std::size_t(v)] = stamped_;
}

FaceGrowth::Region FaceGrowth::region(std::vector<int> triangles) {
  Region made{std::move(triangles), {}};
  ++stamped_;
  for (const int t : made.triangles)
    for (const int v : design_.triangles.row(t)) {
      int& last = vertex_stamp_[std::size_t(v)];
      if (last != stamped_) made.vertices.push_back(v);
      last = stamped_;
    }
  return made;
}

/// Whether a facet lies along the surface, on the side that the part is on. The normal of a sliver
/// says nothing.
bool FaceGrowth::lies_on(const RecognisedPatch& surface, int t, double reach) const {
  Vector3d centre = Vector3d::Zero();
  for (const int v : design_.triangles.row(t)) {
    if (!(std::abs(distance_of(surface, vertex(v))) <= reach)) return false;
    centre += vertex(v) / 3.0;
  }
  return height_[t] < sliver * tolerance_ ||
         surface.sign * outward(surface, centre).dot(normals_.row(t)) > least_lean;
}

/// The region with the triangles around it that lie on the surface and may be taken, up to as many
/// as it has.
FaceGrowth::Region FaceGrowth::spread(const RecognisedPatch& surface, Region region, double reach,
                                      const May& may) {
  constexpr std::size_t few = 16;
  stamp(region);
  const std::size_t most = region.triangles.size() + std::max(few, region.triangles.size());
  for (std::size_t i = 0; i < region.triangles.size() && region.triangles.size() < most; ++i)
    for (const int next : across_[std::size_t(region.triangles[i])]) {
      if (next < 0 || stamp_[std::size_t(next)] == stamped_ || !may(next) ||
          !lies_on(surface, next, reach))
        continue;
      stamp_[std::size_t(next)] = stamped_;
      region.triangles.push_back(next);
      for (const int v : design_.triangles.row(next)) {
        int& last = vertex_stamp_[std::size_t(v)];
        if (last != stamped_) region.vertices.push_back(v);
        last = stamped_;
      }
    }
  return region;
}

RecognisedPatch FaceGrowth::refitted(const RecognisedPatch& surface, const Region& region) const {
  const int rounds = surface.form == Form::Plane ? 3 : 8;
  const FacetPatch patch = facet_patch(design_, region.vertices, {});
  return scaled_from(patch, adjusted(scaled_to(patch, surface), patch, rounds));
}

void FaceGrowth::find_flats(const std::vector<char>& open) {
  constexpr std::size_t few = 8;  // triangles: the largest of them shows the plane well enough
  std::vector<int> order;
  for (int t = 0; t < int(open.size()); ++t)
    if (open[std::size_t(t)]) order.push_back(t);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return height_[a] > height_[b]; });
  const May may = [&](int t) { return is_open(t) && flat_[std::size_t(t)] == none; };
  for (const int seed : order) {
    if (flat_[std::size_t(seed)] != none) continue;
    RecognisedPatch plane;
    plane.frame.col(2) = normals_.row(seed);
    plane.frame.col(0) = plane.frame.col(2).unitOrthogonal();
    plane.frame.col(1) = plane.frame.col(2).cross(plane.frame.col(0));
    plane.origin = vertex(design_.triangles(seed, 0));
    Region flat = region({seed});
    for (std::size_t before = 0; before < flat.triangles.size();) {
      before = flat.triangles.size();
      flat = spread(plane, std::move(flat), tolerance_, may);
      if (flat.triangles.size() > few) plane = refitted(plane, flat);
    }
    for (const int t : flat.triangles) flat_[std::size_t(t)] = int(flats_.size());
    flats_.push_back(std::move(flat.triangles));
  }
}

/// The surface of least squares near one in the coordinates of a patch, in mm; none if a vertex is
/// off by more than the tolerance.
std::optional<RecognisedPatch> FaceGrowth::fitted(const FacetPatch& patch,
                                                  const RecognisedPatch& near) const {
  struct Stage {
    int rounds;
    double within;  // tolerances; else it is hopeless
  };
  RecognisedPatch local = near;
  for (const auto& [rounds, within] : {Stage{3, 30.0}, {3, 3.0}, {6, 1.0}}) {
    local = adjusted(local, patch, rounds);
    if (!(farthest(patch, local) <= within * tolerance_)) return std::nullopt;
  }
  RecognisedPatch surface = scaled_from(patch, local);
  const Vector3d centre = patch.middle + patch.size * patch.centres.row(0).transpose();
  surface.sign = outward(surface, centre).dot(patch.normals.row(0)) > 0.0 ? 1.0 : -1.0;
  return surface;
}

bool FaceGrowth::grows(std::span<const Form> forms, const Region& region) {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  std::optional<RecognisedPatch> axis;
  for (const Form form : forms) {
    const bool is_turned = form != Form::Plane && form != Form::Sphere;
    if (is_turned && !axis) axis = turned_about_normals(patch);
    const auto surface = fitted(patch, first_guess(form, patch, axis.value_or(RecognisedPatch{})));
    if (!surface) continue;
    Grown found = grown(*surface, region);
    if (!found.is_face) continue;
    take(std::move(found.face));
    return true;
  }
  return false;
}

FaceGrowth::Grown FaceGrowth::grown(RecognisedPatch surface, Region region) {
  const May may = [&](int t) { return is_open(t); };
  for (std::size_t before = 0; before < region.triangles.size();) {
    before = region.triangles.size();
    region = spread(surface, std::move(region), growing_reach * tolerance_, may);
    if (region.triangles.size() > before) surface = refitted(surface, region);
  }
  // what was taken while the surface was not well known may not lie on it
  const std::size_t all = region.triangles.size();
  std::erase_if(region.triangles, [&](int t) { return !lies_on(surface, t, tolerance_); });
  if (2 * region.triangles.size() < all) return {{surface, std::move(region.triangles)}, false};
  region = this->region(std::move(region.triangles));
  surface = with_sizes(refitted(surface, region), region);
  const bool found = is_face(surface, region);
  return {{surface, std::move(region.triangles)}, found};
}

/// The surface with the box of a region, and the vertex of it that is farthest off.
RecognisedPatch FaceGrowth::with_sizes(RecognisedPatch surface, const Region& region) const {
  surface.off = 0.0;
  for (const int v : region.vertices) {
    surface.box.extend(vertex(v));
    surface.off = std::max(surface.off, std::abs(distance_of(surface, vertex(v))));
  }
  return surface;
}

/// Whether facets of the region that was stamped last turn enough for their surface to matter.
bool FaceGrowth::bends(const Region& region) const {
  constexpr double least = 0.5 * std::numbers::pi / 180.0;
  for (const int t : region.triangles)
    for (const int next : across_[std::size_t(t)])
      if (next > t && stamp_[std::size_t(next)] == stamped_ &&
          std::min(height_[t], height_[next]) > sliver * tolerance_ &&
          angle_between_normals(normals_.row(t), normals_.row(next)) > least)
        return true;
  return false;
}

/// Whether a region that does not grow is a face.
bool FaceGrowth::is_face(const RecognisedPatch& surface, const Region& region) {
  if (!(surface.off <= tolerance_)) return false;
  for (const int t : region.triangles)
    if (!lies_on(surface, t, tolerance_)) return false;
  const std::vector<Border> around = borders(region);
  if (!bends(region)) return false;
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  const RecognisedPatch local = scaled_to(patch, surface);
  const int tangents = tangent_lines(surface, around);
  const Index enough = tangents > 0 ? 6 : 2 * numbers_of(surface.form);
  return patch.points.rows() >= enough && is_evident(local, patch, tangents) &&
         (surface.form != Form::Torus || has_lines(local, patch, 5)) &&
         ends_clearly(surface, patch, around) && !is_sector(surface, around);
}

std::vector<FaceGrowth::Border> FaceGrowth::borders(const Region& region) {
  stamp(region);
  std::vector<Border> all;
  for (const int t : region.triangles)
    for (int k = 0; k < 3; ++k) {
      const int outside = across_[std::size_t(t)][std::size_t(k)];
      if (outside < 0 || stamp_[std::size_t(outside)] == stamped_) continue;
      Border one{t, outside, design_.triangles(t, k), design_.triangles(t, (k + 1) % 3), -1, 0.0};
      for (const int v : design_.triangles.row(outside))
        if (v != one.a && v != one.b) one.beyond = v;
      const Vector3d side = vertex(one.b) - vertex(one.a);
      one.height = side.cross(vertex(one.beyond) - vertex(one.a)).norm() / side.norm();
      all.push_back(one);
    }
  return all;
}

/// Whether the facets around a region leave its surface as those of another do, at the borders
/// around its axis and at those along it. How a surface that curves otherwise by c leaves one after
/// a height h is c h^2 / 2, and about h when that is long.
bool FaceGrowth::ends_clearly(const RecognisedPatch& surface, const FacetPatch& patch,
                              const std::vector<Border>& borders) const {
  constexpr double share = 0.3, little = 1e-3, straight = 2.5;
  const bool is_turned = surface.form != Form::Sphere;
  const bool is_straight = surface.form == Form::Cylinder || surface.form == Form::Cone;
  const double bent = next_to_own(scaled_to(patch, surface), patch);
  const std::array<double, 2> times_own = {bent, is_straight ? straight : bent};
  std::array<Votes, 2> votes;
  for (const Border& one : borders) {
    if (!is_open(one.outside) || one.height < sliver * tolerance_) continue;
    const Vector3d middle = 0.5 * (vertex(one.a) + vertex(one.b));
    const Vector3d side = (vertex(one.b) - vertex(one.a)).normalized();
    const Vector3d n = outward(surface, middle);
    const Vector3d step = little * one.height * side.cross(n).normalized();
    const double curvature = (outward(surface, middle + step) - n).norm() / step.norm();
    const double leaves = std::abs(distance_of(surface, vertex(one.beyond)));
    const Vector3d around = surface.frame.col(2).cross(middle - surface.origin).normalized();
    const bool is_around = is_turned && std::abs(side.dot(around)) > std::sqrt(0.5);
    votes[is_around].add(
        leaves > std::max({tolerance_, times_own[is_around] * surface.off,
                           0.5 * share * std::min(1.0, curvature * one.height) * one.height}));
  }
  return votes[0].nearly_all() && votes[1].nearly_all();
}

/// Whether the facet across a border runs into the surface without an edge, as a plane does.
bool FaceGrowth::is_tangent(const RecognisedPatch& surface, const Border& border) const {
  const double unsure = tolerance_ / height_[border.outside];
  if (unsure > tangent_angle) return false;
  for (const int end : {border.a, border.b}) {
    const Vector3d n = surface.sign * outward(surface, vertex(end));
    if (angle_between_normals(n, normals_.row(border.outside)) > tangent_angle + unsure)
      return false;
  }
  return true;
}

/// How many lines a cylinder or cone shares with planes that go on from there.
int FaceGrowth::tangent_lines(const RecognisedPatch& surface,
                              const std::vector<Border>& borders) const {
  if (surface.form != Form::Cylinder && surface.form != Form::Cone) return 0;
  constexpr double apart = 1e-3;
  std::vector<Vector3d> lines;
  for (const Border& one : borders) {
    if (!is_tangent(surface, one)) continue;
    const Vector3d n = outward(surface, vertex(one.a));
    if (std::none_of(lines.begin(), lines.end(),
                     [&](const Vector3d& line) { return (line - n).norm() < apart; }))
      lines.push_back(n);
  }
  return std::min(int(lines.size()), 2);
}

/// The largest angle by which the flat beyond a border turns to those after it, across sides that
/// run as the border does: of its triangles, or, where it is the half of a quadrangle, of the
/// other.
double FaceGrowth::turn_beyond(const Border& border) const {
  constexpr std::size_t most = 64;
  constexpr double along = 0.8;
  const Vector3d side = vertex(border.b) - vertex(border.a);
  double turn = 0.0;
  const auto look = [&](int t, int k, bool is_last) {
    const int next = open_across(t, k);
    if (next < 0 || stamp_[std::size_t(next)] == stamped_) return -1;
    const Vector3d other =
        vertex(design_.triangles(t, (k + 1) % 3)) - vertex(design_.triangles(t, k));
    const bool runs_so = std::abs(side.dot(other)) > along * side.norm() * other.norm();
    if (runs_so && height_[next] > sliver * tolerance_)
      turn =
          std::max(turn, angle_between_normals(normals_.row(border.outside), normals_.row(next)));
    return is_last || runs_so ? -1 : next;
  };
  const std::vector<int>& flat = flats_[std::size_t(flat_of(border.outside))];
  for (std::size_t i = 0; i < std::min(flat.size(), most); ++i)
    for (int k = 0; k < 3; ++k)
      if (const int half = look(flat[i], k, flat.size() > 1); half >= 0)
        for (int m = 0; m < 3; ++m) look(half, m, true);
  return turn;
}

/// Whether a cylinder or cone ends at edges by which the next facets turn on as they go on turning:
/// a strip of a tube. Where a tube begins they turn by half of that, at a chamfer not again.
bool FaceGrowth::is_sector(const RecognisedPatch& surface,
                           const std::vector<Border>& borders) const {
  if (surface.form != Form::Cylinder && surface.form != Form::Cone) return false;
  constexpr double along = 0.9, half = 0.75, little = 0.1;
  int ends = 0, turned = 0;
  for (const Border& one : borders) {
    const Vector3d side = (vertex(one.b) - vertex(one.a)).normalized();
    const bool is_end = std::abs(side.dot(surface.frame.col(2))) < along;
    if (!is_end || !is_open(one.outside) || height_[one.outside] < sliver * tolerance_) continue;
    const Vector3d middle = 0.5 * (vertex(one.a) + vertex(one.b));
    const double turn =
        angle_between_normals(surface.sign * outward(surface, middle), normals_.row(one.outside));
    ++ends;
    const double beyond = turn_beyond(one);
    const double unsure = tolerance_ / height_[one.outside];
    turned += turn > unsure && turn > half * beyond && beyond > little * turn;
  }
  return 2 * turned > ends;
}

void FaceGrowth::take(GrownFace face) {
  for (const int t : face.triangles) face_[std::size_t(t)] = int(faces_.size());
  faces_.push_back(std::move(face));
}

std::optional<RecognisedPatch> FaceGrowth::plane_of_flat(const Region& region) const {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  const std::optional<RecognisedPatch> plane = fitted(patch, first_guess(Form::Plane, patch));
  if (!plane) return std::nullopt;
  for (const int t : region.triangles)
    if (!lies_on(*plane, t, tolerance_)) return std::nullopt;
  return with_sizes(*plane, region);
}

/// Whether the facets around a plane turn away from it.
bool FaceGrowth::turns_away(const RecognisedPatch& plane,
                            const std::vector<Border>& borders) const {
  constexpr double least = std::numbers::pi / 180.0;
  Votes votes;
  for (const Border& one : borders) {
    if (!is_open(one.outside) || one.height < sliver * tolerance_) continue;
    const double leaves = std::abs(distance_of(plane, vertex(one.beyond)));
    votes.add(leaves > std::max(tolerance_, std::sin(least) * one.height));
  }
  return votes.nearly_all();
}

std::optional<GrownFace> FaceGrowth::evident_plane(int flat) {
  constexpr std::size_t halves = 4;  // of a few quadrangles
  const std::vector<int>& triangles = flats_[std::size_t(flat)];
  if (triangles.size() <= halves || !is_open(triangles.front())) return std::nullopt;
  const Region all = region(triangles);
  std::vector<Vector3d> points;
  for (const int v : all.vertices) points.push_back(vertex(v));
  if (are_on_two_lines(points, sliver * tolerance_)) return std::nullopt;
  const std::optional<RecognisedPatch> plane = plane_of_flat(all);
  if (!plane || !turns_away(*plane, borders(all))) return std::nullopt;
  return GrownFace{*plane, triangles};
}

std::optional<GrownFace> FaceGrowth::tangent_plane(int flat) {
  std::vector<int> left = flats_[std::size_t(flat)];
  std::erase_if(left, [&](int t) { return !is_open(t); });
  if (left.size() != flats_[std::size_t(flat)].size()) return std::nullopt;
  const Region all = region(std::move(left));
  Votes votes;
  for (const Border& one : borders(all)) {
    const int there = face_[std::size_t(one.outside)];
    if (there < 0 || faces_[std::size_t(there)].surface.form == Form::Plane) continue;
    const Border back{one.outside, one.inside, one.a, one.b, -1, 0.0};
    votes.add(is_tangent(faces_[std::size_t(there)].surface, back));
  }
  if (votes.all == 0 || !votes.nearly_all()) return std::nullopt;
  const std::optional<RecognisedPatch> plane = plane_of_flat(all);
  if (!plane) return std::nullopt;
  return GrownFace{*plane, all.triangles};
}

}  // namespace abbe::cutting
