#include "cutting/map/refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "cutting/map/interpolation.h"
#include "cutting/part/index_sets.h"
#include "cutting/part/remeshing.h"
#include "kinematics/bad_input.h"
#include "kinematics/hash.h"

namespace abbe::cutting {

/// The state of `refined`: rounds in which edges are probed, flipped and split.
class Refinement {
 public:
  Refinement(const Design& design, const SurfaceInterpolator& on_surface,
             const SurfaceProber& sound, const RefineOptions& options);
  RefinementResult run();

 private:
  /// An edge with too large an error, and its ends when it was probed.
  struct Waiting {
    int edge;
    std::array<int, 2> ends;
    EdgeProbe probe;
    std::array<int, 2> across = {-1, -1};  ///< corners between which a flip was tried
  };
  /// A point of an edge to be probed.
  struct ProbePlace {
    std::size_t edge;
    double u;
    bool is_crest = false;  ///< crossing of two passes, the best point for a split
  };

  /// A point of a face to be probed.
  struct Within {
    int face = -1;
    Contact place;
    double plane = 0.0;        ///< mm, of the face at that point
    bool is_doubtful = false;  ///< the slopes at its corners do not rule out an error
  };
  /// Result of probing faces.
  struct SplitFaces {
    std::vector<int> made;  ///< new edges
    double missed = 0.0;    ///< fraction of the faces with too large an error, split or not
  };

  std::vector<Knot> sounded(const std::vector<Contact>& places,
                            std::vector<std::uint8_t> judged = {});
  void probe(const std::vector<int>& edges, const std::vector<ProbePlace>& at,
             std::vector<EdgeProbe>& probes);
  std::vector<EdgeProbe> probed(const std::vector<int>& open);
  std::vector<int> doubtful(const std::vector<int>& edges, bool all) const;
  void defer(const std::vector<int>& edges, std::vector<EdgeProbe> probes);
  void demand_split(std::vector<int> edges);
  std::vector<int> edges_split_first(const Waiting& one, double level) const;
  std::vector<char> ready(double level);
  std::vector<int> split(double level, Eigen::Index most);
  void flip_edges(double level);
  std::optional<EdgeProbe> across_probe(const Waiting& one, std::span<Knot> found) const;
  void note_change(const std::vector<int>& edges);
  std::vector<int> faces_to_probe();
  bool is_followed(const std::array<int, 3>& corners) const;
  Within within(int face, int turn) const;
  SplitFaces split_faces(Eigen::Index most, int turn);
  double lower(double level) const;
  Design design() const;
  Surface surface() const;

  bool is_open(int edge) const;
  bool is_doubtful(int edge, double level) const;
  bool is_missed_beside(int edge, const Knot& place, double level) const;
  bool is_surely_met(int edge) const;
  bool crosses_passes(const Knot& a, const Knot& b) const;
  bool can_flip(int edge) const;
  double jitter(int edge) const;
  double share_of(int edge) const;
  std::array<int, 2> across(int edge) const;
  Span span(int edge) const;
  double length(const std::array<int, 2>& ends) const;
  double tolerance() const;
  const Knot& knot(int i) const { return knots_[std::size_t(i)]; }

  const Design& given_;
  const SurfaceInterpolator& on_surface_;
  const SurfaceProber& sound_;
  const RefineOptions& options_;
  TriangleMesh mesh_;
  std::vector<Knot> knots_;
  std::vector<Waiting> waiting_;
  // (edges) temporary index into waiting_ while the ready ones are determined; or -1
  std::vector<int> place_;
  std::vector<int> changed_;  // faces changed since they were probed; with duplicates
  bool all_changed_ = true;   // as at the beginning of every turn
  Eigen::Index probed_ = 0;
};

namespace {

using Eigen::Index;
using Eigen::Vector3d;

// a round that adds fewer than 1/200 of the vertices ends its level
constexpr std::size_t few_share = 200;
// a round that adds fewer than 1/2000 of the vertices ends a turn
constexpr std::size_t hardly_share = 2000;
constexpr int turns = 4;                // largest number of points at which a face is probed
constexpr double hardly_missed = 1e-3;  // of the faces in a turn: below it no other turn follows
constexpr int last_rounds = 60;         // rounds at the bound itself; remaining errors are reported
// fraction of the bound that is permitted at probed points, as a reserve for points between
constexpr double inner = 0.7;

}  // namespace

Refinement::Refinement(const Design& design, const SurfaceInterpolator& on_surface,
                       const SurfaceProber& sound, const RefineOptions& options)
    : given_(design),
      on_surface_(on_surface),
      sound_(sound),
      options_(options),
      mesh_(design.triangles, design.vertices.rows()) {}

double Refinement::tolerance() const { return inner * options_.resolution; }

double Refinement::length(const std::array<int, 2>& ends) const {
  return (knot(ends[0]).point - knot(ends[1]).point).norm();
}

Span Refinement::span(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return span_of(on_surface_, knot(a), knot(b));
}

bool Refinement::is_open(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return knot(a).cut && knot(b).cut && length({a, b}) > 2.0 * options_.floor;
}

/// Returns a number -0.5 .. 0.5 that depends on the edge alone, so that no feed is commensurable
/// with the points.
double Refinement::jitter(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return split_mix::unit(split_mix::mixed(std::uint64_t(a) << 32 | std::uint64_t(b))) - 0.5;
}

/// Returns the fraction at which an edge is probed and split: at the corner between two blocks of
/// the program, otherwise so that the pieces it is expected to need have equal lengths.
double Refinement::share_of(int edge) const {
  constexpr int max_pieces = 7;
  // tangents of a smooth pass meet near the middle; farther from it the edge has a corner
  constexpr double even = 0.1;
  const Span span = this->span(edge);
  const double off = 0.2 * jitter(edge);
  if (!span.one_pass || !(span.bend() > tolerance())) return 0.5 + off;
  const double meet = span.tangents_meet();
  if (std::abs(meet - 0.5) > even && meet > 0.1 && meet < 0.9) return meet;
  // the error of linear interpolation is proportional to the square of the length
  const int pieces =
      int(std::min<double>(max_pieces, std::ceil(std::sqrt(span.bend() / tolerance()))));
  const int before = off > 0.0 ? (pieces + 1) / 2 : pieces / 2;
  return double(before) / pieces + 0.2 * off;
}

std::vector<Knot> Refinement::sounded(const std::vector<Contact>& places,
                                      std::vector<std::uint8_t> judged) {
  Design at = design_from_points(places);
  at.judged = std::move(judged);
  probed_ += at.vertices.rows();
  const SurfaceProbe found = sound_(at);
  std::vector<Knot> knots(places.size());
  tbb::parallel_for(std::size_t(0), places.size(), [&](std::size_t i) {
    const auto v = Index(i);
    const VertexStatus status = found.surface.status[i];
    knots[i] = {places[i].point,
                places[i].normal,
                found.contacts.gradient.row(v),
                found.surface.residual[v],
                found.contacts.travel[v],
                status == VertexStatus::Cut,
                found.surface.cut_time_s[v],
                found.surface.cut_line[i],
                status,
                places[i].face};
  });
  return knots;
}

/// Probes the edges, each at the fraction `u` stated for it.
void Refinement::probe(const std::vector<int>& edges, const std::vector<ProbePlace>& at,
                       std::vector<EdgeProbe>& probes) {
  std::vector<Contact> places(at.size());
  tbb::parallel_for(std::size_t(0), at.size(), [&](std::size_t k) {
    const auto [a, b] = mesh_.ends(edges[at[k].edge]);
    places[k] = between(on_surface_, knot(a), knot(b), at[k].u);
  });
  std::vector<Knot> found = sounded(places);
  for (std::size_t k = 0; k < at.size(); ++k) {
    const auto [a, b] = mesh_.ends(edges[at[k].edge]);
    const double u = at[k].u;
    const double error = found[k].cut ? std::abs(found[k].residual - on_line(knot(a), knot(b), u))
                                      : std::numeric_limits<double>::infinity();
    EdgeProbe& known = probes[at[k].edge];
    const bool crest = at[k].is_crest && found[k].cut && error > tolerance();
    if (crest || known.u == 0.0 || error > known.error)
      known = {u, std::move(found[k]), std::max(error, known.error)};
  }
}

/// Returns true if another pass begins between two points and matters at this tolerance.
bool Refinement::crosses_passes(const Knot& a, const Knot& b) const {
  const Span span = span_of(on_surface_, a, b);
  return !span.one_pass && span.most() > 0.5 * tolerance();
}

/// Returns true if the slopes at the ends of an edge indicate more than the few points at which it
/// was probed.
bool Refinement::is_doubtful(int edge, double level) const {
  const Span span = this->span(edge);
  return span.most() > (span.one_pass ? level : 0.5 * tolerance());
}

/// Returns the errors of the edges: probed near their middle; where that shows no error, but the
/// slopes at the ends or the passes leave a doubt, near their quarters; and where two passes cross.
std::vector<EdgeProbe> Refinement::probed(const std::vector<int>& open) {
  std::vector<EdgeProbe> all(open.size());
  std::vector<ProbePlace> middles, quarters, crests;
  for (std::size_t i = 0; i < open.size(); ++i) middles.push_back({i, share_of(open[i])});
  probe(open, middles, all);
  std::vector<std::optional<double>> crest(open.size());
  std::vector<char> doubtful(open.size(), 0), many(open.size(), 0);
  tbb::parallel_for(std::size_t(0), open.size(), [&](std::size_t i) {
    const auto [a, b] = mesh_.ends(open[i]);
    const Span span = this->span(open[i]);
    if (!span.one_pass) crest[i] = crest_of(on_surface_, knot(a), knot(b), all[i]);
    many[i] = !span.one_pass && all[i].knot.cut && crosses_passes(knot(a), all[i].knot) &&
              crosses_passes(all[i].knot, knot(b));
    doubtful[i] = all[i].error <= tolerance() && !crest[i] &&
                  (!span.one_pass || !(span.most() < tolerance()));
  });
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (crest[i]) crests.push_back({i, *crest[i], true});
    if (doubtful[i])
      for (const double u : {0.26, 0.74}) quarters.push_back({i, u + 0.1 * jitter(open[i])});
  }
  probe(open, quarters, all);
  probe(open, crests, all);
  // Over several passes a few points show that there is texture but not how large it is.
  for (std::size_t i = 0; i < open.size(); ++i)
    if (many[i]) all[i].error = std::numeric_limits<double>::infinity();
  return all;
}

/// Adds the edges whose error exceeds the tolerance to those that wait.
void Refinement::defer(const std::vector<int>& edges, std::vector<EdgeProbe> probes) {
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (probes[i].error > tolerance())
      waiting_.push_back({edges[i], mesh_.ends(edges[i]), std::move(probes[i]), {-1, -1}});
}

/// Returns the edges that must be probed: open ones, except those whose end slopes leave no doubt,
/// unless all are requested.
std::vector<int> Refinement::doubtful(const std::vector<int>& edges, bool all) const {
  std::vector<char> is_asked(edges.size());
  tbb::parallel_for(std::size_t(0), edges.size(), [&](std::size_t i) {
    is_asked[i] = is_open(edges[i]) && (all || !is_surely_met(edges[i]));
  });
  std::vector<int> asked;
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (is_asked[i]) asked.push_back(edges[i]);
  return asked;
}

bool Refinement::is_surely_met(int edge) const {
  const Span span = this->span(edge);
  return span.one_pass && span.most() < 0.5 * tolerance();
}

/// Makes edges wait whatever their error.
void Refinement::demand_split(std::vector<int> edges) {
  edges = sorted_unique(std::move(edges));
  std::vector<EdgeProbe> probes = probed(edges);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    probes[i].error = std::numeric_limits<double>::infinity();
    // Marked as tried, since a flipped edge would be requested again.
    waiting_.push_back({edges[i], mesh_.ends(edges[i]), std::move(probes[i]), across(edges[i])});
  }
}

Design Refinement::design() const {
  std::vector<Contact> places;
  for (const Knot& one : knots_) places.push_back(one.place());
  std::vector<std::uint8_t> judged = given_.judged;
  judged.resize(places.size(), 1);  // added between judged vertices
  return resampled_design(given_, places, mesh_.triangles(), std::move(judged));
}

Surface Refinement::surface() const {
  const auto n = Index(knots_.size());
  Surface surface{Eigen::VectorXd(n), Eigen::VectorXd(n), {}, {}};
  for (Index i = 0; i < n; ++i) {
    const Knot& one = knots_[std::size_t(i)];
    surface.residual[i] = one.residual;
    surface.cut_time_s[i] = one.cut_time_s;
    surface.cut_line.push_back(one.cut_line);
    surface.status.push_back(one.status);
  }
  return surface;
}

/// Returns the error level to which all edges are reduced next: half of the last level or of the
/// largest error that waits.
double Refinement::lower(double level) const {
  double most = 0.0;
  for (const Waiting& one : waiting_)
    if (std::isfinite(one.probe.error)) most = std::max(most, one.probe.error);
  return std::max(tolerance(), 0.5 * std::min(level, most));
}

RefinementResult Refinement::run() {
  knots_ = sounded(places_of(given_), given_.judged);
  std::vector<int> open(std::size_t(mesh_.edges()));
  std::iota(open.begin(), open.end(), 0);
  const Index most = std::max(options_.points, given_.vertices.rows());
  double level = std::numeric_limits<double>::max();
  int rounds_left = last_rounds, turn = 0;
  double missed = 1.0;  // fraction of the faces when all of them were last probed
  bool first = true;    // the given edges may be longer than slopes can describe
  while (true) {
    open = doubtful(open, std::exchange(first, false));
    defer(open, probed(open));
    if (rounds_left == 0 || Index(knots_.size()) >= most) break;
    if (options_.can_flip_edges) flip_edges(level);
    std::vector<int> made = split(level, most);
    const bool few = few_share * made.size() <= knots_.size();
    if (level > tolerance()) {
      if (few) level = lower(level);
    } else {
      --rounds_left;
      if (few) {
        const bool of_all = all_changed_;
        const SplitFaces faces = split_faces(most, turn);
        made.insert(made.end(), faces.made.begin(), faces.made.end());
        if (of_all) missed = faces.missed;
      }
      if (waiting_.empty() && hardly_share * made.size() <= knots_.size()) {
        if (++turn == turns || (turn > 1 && missed < hardly_missed)) break;
        all_changed_ = true;
      }
    }
    open = sorted_unique(std::move(made));
    if (options_.progress) options_.progress(std::min(1.0, double(knots_.size()) / double(most)));
  }
  double reached = options_.resolution;
  Index left = 0;
  for (const Waiting& one : waiting_) {
    reached = std::max(reached, one.probe.error);
    if (one.probe.error > options_.resolution) ++left;
  }
  return {design(), surface(), reached, probed_, left};
}

double default_resolution(double pv) {
  constexpr double share = 0.1, least = 5e-5;
  return std::max(least, share * pv);
}

RefinementResult refined(const Design& design, const SurfaceInterpolator& on_surface,
                         const SurfaceProber& sound, const RefineOptions& options) {
  require(std::isfinite(options.resolution) && options.resolution > 0 && options.floor > 0,
          "refined: resolution and floor must be positive");
  require(design.normals.rows() == design.vertices.rows(), "refined: one normal a vertex");
  return Refinement(design, on_surface, sound, options).run();
}

namespace {

// fractions of an edge at which the flipped edge is probed
constexpr std::array<double, 2> turned_at = {0.31, 0.67};
constexpr double much_longer = 1.5;  // than an edge to be split, which then waits
constexpr double beside = 0.05;      // of the length of an edge: points nearer to it test the edge
// of the bound, permitted deviation of a parabola from its triangle
constexpr double followed = 0.8;
// deviation at the middle of a parabola with three equal bends, for each of them
constexpr double middle_of_three = 4.0 / 9.0;
constexpr double thinnest = 0.05;  // smallest height by length of a triangle that a flip may make

/// Returns the weights of the point at which a face is probed in a turn: near the middle, then
/// towards each side.
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

/// Returns the longer edges of the triangles at a waiting edge whose error also exceeds the level.
std::vector<int> Refinement::edges_split_first(const Waiting& one, double level) const {
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

/// Returns the waiting edges whose error exceeds a level, each with the longer edges of its
/// triangles: a long edge left whole would get ever thinner triangles at its sides. A longer edge
/// that seemed accurate, but crosses passes, waits from now on, and the shorter one with it.
std::vector<char> Refinement::ready(double level) {
  std::vector<std::vector<int>> first(waiting_.size());
  tbb::parallel_for(std::size_t(0), waiting_.size(), [&](std::size_t i) {
    if (waiting_[i].probe.error > level) first[i] = edges_split_first(waiting_[i], level);
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
        first[std::size_t(k)] = edges_split_first(waiting_[std::size_t(k)], level);
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

/// Splits the edges that are ready, as many as permitted, the longest first. @return the new edges
std::vector<int> Refinement::split(double level, Index most) {
  // An edge that was flipped since has other ends, and is probed again.
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
  // One edge of a triangle at a time: the others may be flipped instead and then need no split.
  std::vector<char> taken(options_.can_flip_edges ? mesh_.faces() : 0, 0);
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

/// Returns true if a point close to an edge shows that its error exceeds a level, although the
/// points at which it was probed did not.
bool Refinement::is_missed_beside(int edge, const Knot& place, double level) const {
  if (!place.cut) return false;
  const auto [a, b] = mesh_.ends(edge);
  const Vector3d along = knot(b).point - knot(a).point, from = place.point - knot(a).point;
  const double u = along.dot(from) / along.squaredNorm();
  if ((from - u * along).norm() > beside * along.norm()) return false;
  return u > 0.0 && u < 1.0 && std::abs(place.residual - on_line(knot(a), knot(b), u)) > level;
}

/// Returns the corners of the two triangles at an edge that are not its ends; -1 at a rim.
std::array<int, 2> Refinement::across(int edge) const {
  const std::array<int, 4> quad = mesh_.quad(edge);
  return {quad[2], quad[3]};
}

/// Returns true if the edge can be flipped without a thin or inverted triangle.
bool Refinement::can_flip(int edge) const {
  if (!mesh_.can_flip(edge)) return false;
  const auto [a, b, c, d] = mesh_.quad(edge);
  for (const int v : {a, b, c, d})
    if (!knot(v).cut) return false;
  const Vector3d normal = (knot(a).normal + knot(b).normal + knot(c).normal + knot(d).normal);
  const auto thickness = [&](int p, int q, int r) {  // signed height divided by the longest side
    const Vector3d pq = knot(q).point - knot(p).point, pr = knot(r).point - knot(p).point;
    return pq.cross(pr).dot(normal.normalized()) /
           std::max({pq.squaredNorm(), pr.squaredNorm(), (pq - pr).squaredNorm()});
  };
  return thickness(c, d, b) > thinnest && thickness(d, c, a) > thinnest;
}

/// Returns the error of the other diagonal of a waiting edge at two points; nothing if it is longer
/// and leaves its pass, because two points are then too few.
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

/// Flips waiting edges whose error exceeds a level if the other diagonal has less than half of it,
/// so that triangles extend along the feed. The error halves with each flip, so the flips end.
void Refinement::flip_edges(double level) {
  std::vector<std::size_t> tried;
  std::vector<Contact> places;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    Waiting& one = waiting_[i];
    if (!(one.probe.error > level) || one.ends != mesh_.ends(one.edge)) continue;
    const std::array<int, 2> corners = across(one.edge);
    if (corners == one.across) continue;
    one.across = corners;
    if (!can_flip(one.edge)) continue;
    tried.push_back(i);
    for (const double u : turned_at)
      places.push_back(between(on_surface_, knot(corners[0]), knot(corners[1]), u));
  }
  std::vector<Knot> found = sounded(places);
  for (std::size_t k = 0; k < tried.size(); ++k) {
    Waiting& one = waiting_[tried[k]];
    if (across(one.edge) != one.across || !can_flip(one.edge)) continue;
    std::optional<EdgeProbe> turned = across_probe(one, std::span(found).subspan(2 * k, 2));
    if (!turned || !(turned->error < 0.5 * one.probe.error)) continue;
    mesh_.turn(one.edge);
    note_change({one.edge});
    one = {one.edge, mesh_.ends(one.edge), std::move(*turned), across(one.edge)};
  }
  std::erase_if(waiting_, [&](const Waiting& one) { return !(one.probe.error > tolerance()); });
}

/// Marks the faces at edges for probing.
void Refinement::note_change(const std::vector<int>& edges) {
  if (all_changed_) return;
  for (const int edge : edges)
    for (const int face : mesh_.faces_at(edge))
      if (face >= 0) changed_.push_back(face);
}

/// Returns the faces that changed since they were probed and are large enough.
std::vector<int> Refinement::faces_to_probe() {
  std::vector<int> changed = sorted_unique(std::exchange(changed_, {}));
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

/// Returns true if one pass cut the corners of a face, and if their slopes and values agree with a
/// parabola to which the face is close enough.
bool Refinement::is_followed(const std::array<int, 3>& corners) const {
  double off = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Knot &a = knot(corners[k]), &b = knot(corners[(k + 1) % 3]);
    const Vector3d chord = b.point - a.point;
    if (!is_one_pass(a, b, chord.norm())) return false;
    const Span span{a.residual, b.residual, -a.gradient.dot(chord), -b.gradient.dot(chord), true};
    off += middle_of_three * span.bend() + span.max_beside_bend();
  }
  return off < followed * tolerance();
}

/// Returns the point at which a face is probed in a turn.
Refinement::Within Refinement::within(int face, int turn) const {
  const std::array<int, 3> corners = mesh_.corners(face);
  if (!options_.probe_all_triangles && is_followed(corners)) return {};
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

/// Splits faces with too large an error inside at the probed point; if that would lie on a side
/// with the same error, the side waits instead.
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
