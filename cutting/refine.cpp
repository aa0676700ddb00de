#include "cutting/refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <tbb/parallel_for.h>

#include "cutting/each_once.h"
#include "kinematics/hash.h"
#include "kinematics/require.h"

namespace abbe::cutting {
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

Refinement::Refinement(const Design& design, const OnSurface& on_surface, const Sound& sound,
                       const RefineOptions& options)
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
  constexpr int most_pieces = 7;
  constexpr double even = 0.1;
  const Span span = this->span(edge);
  const double off = 0.2 * jitter(edge);
  if (!span.one_pass || !(span.bend() > tolerance())) return 0.5 + off;
  const double meet = span.tangents_meet();
  if (std::abs(meet - 0.5) > even && meet > 0.1 && meet < 0.9) return meet;
  const int pieces =
      int(std::min<double>(most_pieces, std::ceil(std::sqrt(span.bend() / tolerance()))));
  const int before = off > 0.0 ? (pieces + 1) / 2 : pieces / 2;
  return double(before) / pieces + 0.2 * off;
}

std::vector<Knot> Refinement::sounded(const std::vector<Contact>& places,
                                      std::vector<std::uint8_t> judged) {
  Design at = design_of_places(places);
  at.judged = std::move(judged);
  probed_ += at.vertices.rows();
  const Sounding found = sound_(at);
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
  edges = each_once(std::move(edges));
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
  return design_on(given_, places, mesh_.triangles(), std::move(judged));
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

Refined Refinement::run() {
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
    if (options_.may_flip) turn_edges(level);
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
    open = each_once(std::move(made));
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

double usual_resolution(double pv) {
  constexpr double share = 0.1, least = 5e-5;
  return std::max(least, share * pv);
}

Refined refined(const Design& design, const OnSurface& on_surface, const Sound& sound,
                const RefineOptions& options) {
  require(std::isfinite(options.resolution) && options.resolution > 0 && options.floor > 0,
          "refined: resolution and floor must be positive");
  require(design.normals.rows() == design.vertices.rows(), "refined: one normal a vertex");
  return Refinement(design, on_surface, sound, options).run();
}

}  // namespace abbe::cutting
