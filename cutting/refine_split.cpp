#include "cutting/refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "cutting/each_once.h"
#include "kinematics/hash.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr std::array<double, 2> turned_at = {0.31, 0.67};  // of an edge that is tried across
constexpr double much_longer = 1.5;  // than an edge to be split, which then waits
constexpr double beside = 0.05;      // of the length of an edge: what lies nearer speaks for it
constexpr double followed = 0.8;     // of the bound that a parabola may be off its triangle
constexpr double middle_of_three = 4.0 / 9.0;  // of a parabola with three equal bends, of each
constexpr double thinnest = 0.05;  // triangle that a turned edge may make: height by length

/// Where a face is probed in its turns: near the middle, then towards each side.
std::array<double, 3> place_in(const std::array<int, 3>& corners, int turn) {
  const std::uint64_t bits = split_mix::mixed(std::uint64_t(corners[0]) << 32 | corners[1]);
  const double first = split_mix::unit(bits), second = split_mix::unit(split_mix::mixed(bits));
  if (turn == 0) {
    const double a = 0.3 + 0.1 * first, b = 0.3 + 0.1 * second;
    return {a, b, 1.0 - a - b};
  }
  std::array<double, 3> weights{};
  const double off = 0.02 + 0.16 * first, along = (1.0 - off) * (0.2 + 0.6 * second);
  weights[std::size_t(turn) % 3] = off;
  weights[std::size_t(turn + 1) % 3] = along;
  weights[std::size_t(turn + 2) % 3] = 1.0 - off - along;
  return weights;
}

}  // namespace

/// The longer edges of the triangles at a waiting one that miss a level too.
std::vector<int> Refinement::split_first(const Waiting& one, double level) const {
  std::vector<int> found;
  const double own = length(one.ends);
  for (const int edge : mesh_.sides(one.edge)) {
    const double long_by = length(mesh_.ends(edge)) / own;
    if (!is_open(edge) || !(long_by > 1.0)) continue;
    if (is_missed_beside(edge, one.probe.knot, level) ||
        (long_by > much_longer && is_doubtful(edge, level)))
      found.push_back(edge);
  }
  return found;
}

/// The waiting edges that miss by more than a level, and with each of them the longer ones of its
/// triangles: left whole, a long edge would get ever thinner triangles at its sides. A longer edge
/// that seemed to be met, but crosses passes, waits from now on, and the shorter one with it.
std::vector<char> Refinement::ready(double level) {
  std::vector<std::vector<int>> first(waiting_.size());
  tbb::parallel_for(std::size_t(0), waiting_.size(), [&](std::size_t i) {
    if (waiting_[i].probe.error > level) first[i] = split_first(waiting_[i], level);
  });
  place_.resize(mesh_.edges(), -1);
  std::vector<int> open;
  std::vector<char> is_ready(waiting_.size(), 0);
  std::vector<int> longer;
  for (int i = 0; i < int(waiting_.size()); ++i) {
    place_[std::size_t(waiting_[std::size_t(i)].edge)] = i;
    if (!(waiting_[std::size_t(i)].probe.error > level)) continue;
    is_ready[std::size_t(i)] = 1;
    open.push_back(i);
  }
  while (!open.empty()) {
    const int i = open.back();
    open.pop_back();
    for (const int edge : first[std::size_t(i)]) {
      const int k = place_[std::size_t(edge)];
      if (k >= 0 && is_ready[std::size_t(k)]) continue;
      if (k >= 0) {
        is_ready[std::size_t(k)] = 1;
        first[std::size_t(k)] = split_first(waiting_[std::size_t(k)], level);
        open.push_back(k);
      } else {
        longer.push_back(edge);
        is_ready[std::size_t(i)] = 0;
      }
    }
  }
  for (const Waiting& one : waiting_) place_[std::size_t(one.edge)] = -1;
  demand_split(std::move(longer));
  is_ready.resize(waiting_.size(), 1);
  return is_ready;
}

/// Splits the edges that are ready, as many as may be, the longest first. @return the
/// edges that came of it
std::vector<int> Refinement::split(double level, Index most) {
  // an edge that was turned since has other ends, and is probed again
  std::erase_if(waiting_, [&](const Waiting& one) { return one.ends != mesh_.ends(one.edge); });
  const std::vector<char> is_ready = ready(level);
  struct Next {
    double length;
    std::size_t waiting;
  };
  std::vector<Next> order;
  for (std::size_t i = 0; i < waiting_.size(); ++i)
    if (is_ready[i]) order.push_back({length(waiting_[i].ends), i});
  tbb::parallel_sort(order.begin(), order.end(), [](const Next& a, const Next& b) {
    return a.length != b.length ? a.length > b.length : a.waiting < b.waiting;
  });
  const Index room = std::max<Index>(0, most - Index(knots_.size()));
  if (Index(order.size()) > room) order.resize(std::size_t(room));
  std::vector<int> made;
  // one edge of a triangle at a time: its others may be turned out of the way, and need none
  std::vector<char> taken(options_.may_flip ? mesh_.faces() : 0, 0);
  const auto takes = [&](int edge) {
    if (taken.empty()) return true;
    const std::array<int, 2> faces = mesh_.faces_at(edge);
    for (const int face : faces)
      if (face >= 0 && face < int(taken.size()) && taken[std::size_t(face)]) return false;
    for (const int face : faces)
      if (face >= 0 && face < int(taken.size())) taken[std::size_t(face)] = 1;
    return true;
  };
  for (const auto& [length, i] : order) {
    if (waiting_[i].ends != mesh_.ends(waiting_[i].edge)) continue;  // it waited twice
    if (!takes(waiting_[i].edge)) continue;
    knots_.push_back(std::move(waiting_[i].probe.knot));
    const std::vector<int> around = mesh_.split_edge(waiting_[i].edge);
    note_change(around);
    made.insert(made.end(), around.begin(), around.end());
    waiting_[i].ends = {-1, -1};
  }
  std::erase_if(waiting_, [](const Waiting& one) { return one.ends[0] < 0; });
  return made;
}

/// Whether a place close to an edge shows that the edge misses more than a level, although the
/// places at which it was probed did not.
bool Refinement::is_missed_beside(int edge, const Knot& place, double level) const {
  if (!place.cut) return false;
  const auto [a, b] = mesh_.ends(edge);
  const Vector3d along = knot(b).point - knot(a).point, from = place.point - knot(a).point;
  const double u = along.dot(from) / along.squaredNorm();
  if ((from - u * along).norm() > beside * along.norm()) return false;
  return u > 0.0 && u < 1.0 && std::abs(place.residual - on_line(knot(a), knot(b), u)) > level;
}

/// The corners of the two triangles at an edge that are not its ends; -1 at a rim.
std::array<int, 2> Refinement::across(int edge) const {
  const std::array<int, 4> quad = mesh_.quad(edge);
  return {quad[2], quad[3]};
}

/// Whether the edge across the two triangles at this one can take its place.
bool Refinement::may_turn(int edge) const {
  if (!mesh_.may_turn(edge)) return false;
  const auto [a, b, c, d] = mesh_.quad(edge);
  for (const int v : {a, b, c, d})
    if (!knot(v).cut) return false;
  const Vector3d normal = (knot(a).normal + knot(b).normal + knot(c).normal + knot(d).normal);
  const auto thickness = [&](int p, int q, int r) {  // signed height by the longest side
    const Vector3d pq = knot(q).point - knot(p).point, pr = knot(r).point - knot(p).point;
    return pq.cross(pr).dot(normal.normalized()) /
           std::max({pq.squaredNorm(), pr.squaredNorm(), (pq - pr).squaredNorm()});
  };
  return thickness(c, d, b) > thinnest && thickness(d, c, a) > thinnest;
}

/// What the edge across a waiting one misses at two places; none where it is longer and leaves its
/// pass, so that two places say too little.
std::optional<EdgeProbe> Refinement::across_probe(const Waiting& one, std::span<Knot> found) const {
  const Knot &c = knot(one.across[0]), &d = knot(one.across[1]);
  const double length = this->length(one.across);
  bool one_pass = true;
  EdgeProbe worst;
  for (std::size_t k = 0; k < turned_at.size(); ++k) {
    const double u = turned_at[k];
    if (!found[k].cut) return std::nullopt;
    for (const Knot* end : {&c, &d}) one_pass = one_pass && is_one_pass(*end, found[k], length);
    const double error = std::abs(found[k].residual - on_line(c, d, u));
    if (worst.u == 0.0 || error > worst.error) worst = {u, found[k], error};
  }
  if (!one_pass && !(length < this->length(one.ends))) return std::nullopt;
  return worst;
}

/// Waiting edges that miss by more than a level give way to the edge across where that misses by
/// less than half as much, so that triangles stretch along the feed. What is missed halves each
/// time, so that it ends.
void Refinement::turn_edges(double level) {
  std::vector<std::size_t> tried;
  std::vector<Contact> places;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    Waiting& one = waiting_[i];
    if (!(one.probe.error > level) || one.ends != mesh_.ends(one.edge)) continue;
    const std::array<int, 2> corners = across(one.edge);
    if (corners == one.across) continue;
    one.across = corners;
    if (!may_turn(one.edge)) continue;
    tried.push_back(i);
    for (const double u : turned_at)
      places.push_back(between(on_surface_, knot(corners[0]), knot(corners[1]), u));
  }
  std::vector<Knot> found = sounded(places);
  for (std::size_t k = 0; k < tried.size(); ++k) {
    Waiting& one = waiting_[tried[k]];
    if (across(one.edge) != one.across || !may_turn(one.edge)) continue;
    std::optional<EdgeProbe> turned = across_probe(one, std::span(found).subspan(2 * k, 2));
    if (!turned || !(turned->error < 0.5 * one.probe.error)) continue;
    mesh_.turn(one.edge);
    note_change({one.edge});
    one = {one.edge, mesh_.ends(one.edge), std::move(*turned), across(one.edge)};
  }
  std::erase_if(waiting_, [&](const Waiting& one) { return !(one.probe.error > tolerance()); });
}

/// The faces at edges are to be probed.
void Refinement::note_change(const std::vector<int>& edges) {
  if (all_changed_) return;
  for (const int edge : edges)
    for (const int face : mesh_.faces_at(edge))
      if (face >= 0) changed_.push_back(face);
}

/// The faces that were not probed as they are, and are wide enough to be.
std::vector<int> Refinement::faces_to_probe() {
  std::vector<int> changed = each_once(std::exchange(changed_, {}));
  if (std::exchange(all_changed_, false)) {
    changed.resize(std::size_t(mesh_.faces()));
    std::iota(changed.begin(), changed.end(), 0);
  }
  std::vector<char> is_asked(changed.size());
  tbb::parallel_for(std::size_t(0), changed.size(), [&](std::size_t i) {
    const std::array<int, 3> corners = mesh_.corners(changed[i]);
    is_asked[i] = 1;
    for (std::size_t k = 0; k < 3; ++k)
      if (!knot(corners[k]).cut ||
          !(length({corners[k], corners[(k + 1) % 3]}) > 2.0 * options_.floor))
        is_asked[i] = 0;
  });
  std::vector<int> faces;
  for (std::size_t i = 0; i < changed.size(); ++i)
    if (is_asked[i]) faces.push_back(changed[i]);
  return faces;
}

/// Whether one pass cut the corners of a face, and their slopes and values agree upon a parabola
/// that the face is near enough to.
bool Refinement::is_followed(const std::array<int, 3>& corners) const {
  double off = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Knot &a = knot(corners[k]), &b = knot(corners[(k + 1) % 3]);
    const Vector3d chord = b.point - a.point;
    if (!is_one_pass(a, b, chord.norm())) return false;
    const Span span{a.residual, b.residual, -a.gradient.dot(chord), -b.gradient.dot(chord), true};
    off += middle_of_three * span.bend() + span.most_beside_bend();
  }
  return off < followed * tolerance();
}

/// Where a face is probed in one of its turns.
Refinement::Within Refinement::within(int face, int turn) const {
  const std::array<int, 3> corners = mesh_.corners(face);
  if (!options_.look_into_all && is_followed(corners)) return {};
  const std::array<double, 3> weights = place_in(corners, turn);
  std::array<Contact, 3> at;
  for (std::size_t k = 0; k < 3; ++k) at[k] = knot(corners[k]).place();
  Within found{face, on_surface_(at, weights)};
  for (std::size_t k = 0; k < 3; ++k) found.plane += weights[k] * knot(corners[k]).residual;
  for (const int corner : corners) {
    const double tangent =
        knot(corner).residual - knot(corner).gradient.dot(found.place.point - knot(corner).point);
    const bool is_met = std::abs(tangent - found.plane) < tolerance();
    found.is_doubtful = found.is_doubtful || !is_met;
  }
  return found;
}

/// Faces that miss too much within get a vertex there; where it would lie on a side that misses as
/// much, the side waits instead.
Refinement::SplitFaces Refinement::split_faces(Index most, int turn) {
  const std::vector<int> faces = faces_to_probe();
  std::vector<Within> probes(faces.size());
  tbb::parallel_for(std::size_t(0), faces.size(),
                    [&](std::size_t i) { probes[i] = within(faces[i], turn); });
  std::erase_if(probes, [](const Within& one) { return !one.is_doubtful; });
  std::vector<Contact> places;
  for (const Within& one : probes) places.push_back(one.place);
  std::vector<Knot> found = sounded(places);
  SplitFaces split;
  std::vector<int> missed;
  std::size_t count = 0;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    if (!found[i].cut || !(std::abs(found[i].residual - probes[i].plane) > tolerance())) continue;
    ++count;
    if (Index(knots_.size()) >= most) break;
    const std::array<int, 3> sides = mesh_.sides_of(probes[i].face);
    const auto side = std::find_if(sides.begin(), sides.end(), [&](int edge) {
      return is_open(edge) && is_missed_beside(edge, found[i], tolerance());
    });
    if (side != sides.end()) {
      missed.push_back(*side);
      continue;
    }
    knots_.push_back(std::move(found[i]));
    const std::vector<int> around = mesh_.split_face(probes[i].face);
    note_change(around);
    split.made.insert(split.made.end(), around.begin(), around.end());
  }
  demand_split(std::move(missed));
  split.missed = double(count) / std::max<double>(1.0, double(faces.size()));
  return split;
}

}  // namespace abbe::cutting
