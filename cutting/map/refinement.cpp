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

/// The work of `refined`: rounds in which edges are probed, turned and split.
class Refinement {
 public:
  Refinement(const Design& design, const SurfaceInterpolator& on_surface,
             const SurfaceProber& sound, const RefineOptions& options);
  RefinementResult run();

 private:
  /// An edge that misses too much to stay, with its ends when it was probed.
  struct Waiting {
    int edge;
    std::array<int, 2> ends;
    EdgeProbe probe;
    std::array<int, 2> across = {-1, -1};  ///< corners between which it was tried to turn it
  };
  /// A place of an edge to be probed.
  struct ProbePlace {
    std::size_t edge;
    double u;
    bool is_crest = false;  ///< of two passes: that is where it is best split
  };

  /// A place of a face to be probed.
  struct Within {
    int face = -1;
    Contact place;
    double plane = 0.0;        ///< mm, of the face there
    bool is_doubtful = false;  ///< the slopes at its corners do not rule out that it is missed
  };
  /// What came of a probe into faces.
  struct SplitFaces {
    std::vector<int> made;  ///< edges
    double missed = 0.0;    ///< share of the faces, split or not
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
  std::vector<int>
      place_;  // (edges) among those that wait while it is found which are ready; or -1
  std::vector<int> changed_;  // faces, since they were probed; with repeats
  bool all_changed_ = true;   // as at the beginning of every turn
  Eigen::Index probed_ = 0;
};

namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr std::size_t few_share =
    200;  // of the vertices: so few new ones are left to the next level
constexpr std::size_t hardly_share =
    2000;                               // of the vertices: so few, and faces are probed elsewhere
constexpr int turns = 4;                // in which a face is probed, at most
constexpr double hardly_missed = 1e-3;  // of the faces in a turn: no other follows
constexpr int last_rounds = 60;         // at the bound itself; what then misses it is reported
constexpr double inner = 0.7;  // of the bound is allowed where it is probed, for places between

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

/// -0.5 .. 0.5, of the edge alone.
double Refinement::jitter(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return split_mix::unit(split_mix::mixed(std::uint64_t(a) << 32 | std::uint64_t(b))) - 0.5;
}

/// Where an edge is probed, and split: at a corner between two blocks, else so that the pieces
/// that it is expected to need are of one length.
double Refinement::share_of(int edge) const {
  constexpr int max_pieces = 7;
  constexpr double even = 0.1;
  const Span span = this->span(edge);
  const double off = 0.2 * jitter(edge);
  if (!span.one_pass || !(span.bend() > tolerance())) return 0.5 + off;
  const double meet = span.tangents_meet();
  if (std::abs(meet - 0.5) > even && meet > 0.1 && meet < 0.9) return meet;
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

/// The edges probed, each at the share `u` of its length that is stated for it.
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

/// Whether another pass begins between two places, and is seen to.
bool Refinement::crosses_passes(const Knot& a, const Knot& b) const {
  const Span span = span_of(on_surface_, a, b);
  return !span.one_pass && span.most() > 0.5 * tolerance();
}

/// Whether slopes at the ends of an edge say more than the few places at which it was probed.
bool Refinement::is_doubtful(int edge, double level) const {
  const Span span = this->span(edge);
  return span.most() > (span.one_pass ? level : 0.5 * tolerance());
}

/// What the edges miss: near their middle; where that shows nothing, but the slopes at the ends or
/// the passes do, near their quarters; and where two passes cross.
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
  // over several passes a few places say that there is texture, and not how much
  for (std::size_t i = 0; i < open.size(); ++i)
    if (many[i]) all[i].error = std::numeric_limits<double>::infinity();
  return all;
}

/// Edges that miss by more than the tolerance go to those that wait.
void Refinement::defer(const std::vector<int>& edges, std::vector<EdgeProbe> probes) {
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (probes[i].error > tolerance())
      waiting_.push_back({edges[i], mesh_.ends(edges[i]), std::move(probes[i]), {-1, -1}});
}

/// Those of the edges that are to be probed: open, and not such that the slopes at their ends
/// leave no doubt, unless all are asked for.
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

/// Edges that wait whatever they miss.
void Refinement::demand_split(std::vector<int> edges) {
  edges = sorted_unique(std::move(edges));
  std::vector<EdgeProbe> probes = probed(edges);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    probes[i].error = std::numeric_limits<double>::infinity();
    // as if it had been tried: an edge that was turned would be asked for again
    waiting_.push_back({edges[i], mesh_.ends(edges[i]), std::move(probes[i]), across(edges[i])});
  }
}

Design Refinement::design() const {
  std::vector<Contact> places;
  for (const Knot& one : knots_) places.push_back(one.place());
  std::vector<std::uint8_t> judged = given_.judged;
  judged.resize(places.size(), 1);  // added between judged ones
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

/// The level down to which all edges are brought before the next: half the last one, or what the
/// edges that wait miss at most.
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
  double missed = 1.0;  // share of the faces, when all of them were probed last
  bool first = true;    // the edges given may be longer than anything that slopes speak for
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

/// The waiting edges that miss by more than a level, and with each of them the longer ones of its
/// triangles: left whole, a long edge would get ever thinner triangles at its sides. A longer edge
/// that seemed to be met, but crosses passes, waits from now on, and the shorter one with it.
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
bool Refinement::can_flip(int edge) const {
  if (!mesh_.can_flip(edge)) return false;
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

/// The faces at edges are to be probed.
void Refinement::note_change(const std::vector<int>& edges) {
  if (all_changed_) return;
  for (const int edge : edges)
    for (const int face : mesh_.faces_at(edge))
      if (face >= 0) changed_.push_back(face);
}

/// The faces that were not probed as they are, and are wide enough to be.
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

/// Whether one pass cut the corners of a face, and their slopes and values agree upon a parabola
/// that the face is near enough to.
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

/// Where a face is probed in one of its turns.
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
