#include "cutting/face_growth.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/smooth_patches.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double least_lean = 0.866;  // cos 30 degrees, of a facet along its surface
constexpr double least_waste = 1e6, waste_a_triangle = 30.0, fit_work = 50.0;  // triangles
constexpr double growing_reach = 3.0;  // tolerances, while a surface is fitted to few facets yet

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
      vertex_stamp_(std::size_t(design.vertices.rows()), 0),
      waste_(least_waste + waste_a_triangle * double(open.size())) {
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

/// Those corners of a triangle that the region, which was stamped last, does not have.
void FaceGrowth::add_corners(Region& region, int t) {
  for (const int v : design_.triangles.row(t)) {
    int& last = vertex_stamp_[std::size_t(v)];
    if (last != stamped_) region.vertices.push_back(v);
    last = stamped_;
  }
}

FaceGrowth::Region FaceGrowth::region(std::vector<int> triangles) {
  Region made{std::move(triangles), {}};
  ++stamped_;
  for (const int t : made.triangles) add_corners(made, t);
  return made;
}

/// Whether a facet lies along the surface, on the side that the part is on: where the normals of
/// the surface do not turn between its corners it lies in a plane that touches the surface there,
/// as a floor does the torus around it. The normal of a sliver says nothing.
bool FaceGrowth::lies_on(const RecognisedPatch& surface, int t, double reach) const {
  constexpr double times = 2.0;  // the turn: obtuse triangles lean by more than their share
  Vector3d centre = Vector3d::Zero();
  for (const int v : design_.triangles.row(t)) {
    if (!(std::abs(distance_of(surface, vertex(v))) <= reach)) return false;
    centre += vertex(v) / 3.0;
  }
  if (height_[t] < sliver * tolerance_) return true;
  const double cosine = surface.sign * outward(surface, centre).dot(normals_.row(t));
  if (!(cosine > least_lean)) return false;
  double most = 2.0 * reach / height_[t];
  if (cosine > 1.0 - 0.5 * most * most) return true;
  const Vector3d first = outward(surface, vertex(design_.triangles(t, 0)));
  for (const int k : {1, 2})
    most = std::max(most,
                    2.0 * reach / height_[t] +
                        times * (outward(surface, vertex(design_.triangles(t, k))) - first).norm());
  return cosine > 1.0 - 0.5 * most * most;
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
      add_corners(region, next);
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

FaceGrowth::Tried FaceGrowth::grow(std::span<const Form> forms, const Region& region) {
  const FacetPatch patch = facet_patch(design_, region.vertices, region.triangles);
  std::optional<RecognisedPatch> axis;
  Tried tried;
  for (const Form form : forms) {
    const bool is_turned = form != Form::Plane && form != Form::Sphere;
    if (is_turned && !axis) axis = turned_about_normals(patch);
    const auto surface = fitted(patch, first_guess(form, patch, axis.value_or(RecognisedPatch{})));
    if (!surface) continue;
    Grown found = grown(*surface, region);
    if (found.is_face) {
      take(std::move(found.face));
      return {true, {}};
    }
    if (found.reached.size() > tried.reached.size()) tried.reached = std::move(found.reached);
  }
  return tried;
}

FaceGrowth::Grown FaceGrowth::grown(RecognisedPatch surface, Region region) {
  const May may = [&](int t) { return is_open(t); };
  double work = 0.0;
  for (std::size_t before = 0; before < region.triangles.size();) {
    before = region.triangles.size();
    region = spread(surface, std::move(region), growing_reach * tolerance_, may);
    if (region.triangles.size() > before) surface = refitted(surface, region);
    work += fit_work + double(region.triangles.size() + region.vertices.size());
  }
  // what was taken while the surface was not well known may not lie on it
  std::vector<int> reached = region.triangles;
  std::erase_if(region.triangles, [&](int t) { return !lies_on(surface, t, tolerance_); });
  bool found = 2 * region.triangles.size() >= reached.size();
  if (found) {
    region = this->region(std::move(region.triangles));
    surface = with_sizes(refitted(surface, region), region);
    found = is_face(surface, region);
  }
  if (!found) wasted_ += work;
  return {{surface, std::move(region.triangles)}, found, std::move(reached)};
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

/// The vertex of a triangle that is not on one of its sides.
int FaceGrowth::beyond(int t, int a, int b) const {
  int found = none;
  for (const int v : design_.triangles.row(t))
    if (v != a && v != b) found = v;
  return found;
}

/// mm, of a vertex from the line through two others.
double FaceGrowth::height_over(int a, int b, int beyond) const {
  const Vector3d side = vertex(b) - vertex(a);
  return side.cross(vertex(beyond) - vertex(a)).norm() / side.norm();
}

std::vector<FaceGrowth::Border> FaceGrowth::borders(const Region& region) {
  stamp(region);
  std::vector<Border> all;
  for (const int t : region.triangles)
    for (int k = 0; k < 3; ++k) {
      const int outside = across_[std::size_t(t)][std::size_t(k)];
      if (outside < 0 || stamp_[std::size_t(outside)] == stamped_) continue;
      Border one{t, outside, design_.triangles(t, k), design_.triangles(t, (k + 1) % 3), -1, 0.0};
      one.beyond = beyond(outside, one.a, one.b);
      one.height = height_over(one.a, one.b, one.beyond);
      all.push_back(one);
    }
  return all;
}

void FaceGrowth::take(GrownFace face) {
  for (const int t : face.triangles) face_[std::size_t(t)] = int(faces_.size());
  faces_.push_back(std::move(face));
}

}  // namespace abbe::cutting
