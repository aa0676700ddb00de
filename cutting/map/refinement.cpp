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

/// The iteration of `refined`: rounds in which edges are probed, flipped and split.
class Refinement {
 public:
  Refinement(const Design& design, const SurfaceInterpolator& on_surface,
             const SurfaceProber& prober, const RefineOptions& options);
  RefinementResult run();

 private:
  /// An edge with too large an error that is to be split, with its ends when it was probed.
  struct PendingEdge {
    int edge;
    std::array<int, 2> ends;
    EdgeProbe probe;
    std::array<int, 2> tried_diagonal = {-1, -1};  ///< corners that a flip already tried joins
  };
  /// A point of an edge that is to be probed.
  struct ProbePosition {
    std::size_t edge;
    double u;
    bool is_crest = false;  ///< crossing of two passes, the best point for a split
  };

  /// A point of a face that is to be probed.
  struct FaceProbe {
    int face = -1;
    Contact contact;
    double linear_residual = 0.0;  ///< mm, residual by linear interpolation
    bool is_doubtful = false;      ///< the slopes at the corners do not exclude an error
  };
  /// Result of probing faces.
  struct FaceSplits {
    std::vector<int> new_edges;
    double inaccurate_fraction = 0.0;  ///< of the faces with too large an error, split or not
  };

  std::vector<Knot> probe_points(const std::vector<Contact>& contacts,
                                 std::vector<std::uint8_t> judged = {});
  void probe(const std::vector<int>& edges, const std::vector<ProbePosition>& positions,
             std::vector<EdgeProbe>& probes);
  std::vector<EdgeProbe> probe_edges(const std::vector<int>& edges);
  std::vector<int> edges_to_probe(const std::vector<int>& edges, bool include_all) const;
  void add_pending(const std::vector<int>& edges, std::vector<EdgeProbe> probes);
  void require_split(std::vector<int> edges);
  std::vector<int> longer_edges(const PendingEdge& pending, double level) const;
  std::vector<char> select_ready_edges(double level);
  std::vector<int> split_edges(double level, Eigen::Index max_vertices);
  void flip_edges(double level);
  std::optional<EdgeProbe> flipped_probe(const PendingEdge& pending, std::span<Knot> results) const;
  void mark_changed(const std::vector<int>& edges);
  std::vector<int> take_changed_faces();
  bool is_near_parabola(const std::array<int, 3>& corners) const;
  FaceProbe face_probe(int face, int face_scan) const;
  FaceSplits split_faces(Eigen::Index max_vertices, int face_scan);
  double next_level(double level) const;
  Design design() const;
  Surface surface() const;

  bool is_open(int edge) const;
  bool is_doubtful(int edge, double level) const;
  bool is_exceeded_near(int edge, const Knot& sample, double level) const;
  bool is_surely_accurate(int edge) const;
  bool crosses_passes(const Knot& a, const Knot& b) const;
  bool can_flip(int edge) const;
  double jitter(int edge) const;
  double probe_fraction(int edge) const;
  std::array<int, 2> opposite_corners(int edge) const;
  Span span(int edge) const;
  double length(const std::array<int, 2>& ends) const;
  double tolerance() const;
  const Knot& knot(int i) const { return knots_[std::size_t(i)]; }

  const Design& source_;
  const SurfaceInterpolator& on_surface_;
  const SurfaceProber& prober_;
  const RefineOptions& options_;
  TriangleMesh mesh_;
  std::vector<Knot> knots_;
  std::vector<PendingEdge> pending_;
  // (edges) temporary index into pending_ while the ready edges are determined; -1: not pending
  std::vector<int> pending_index_;
  std::vector<int> changed_;     // faces changed since they were probed; with duplicates
  bool are_all_changed_ = true;  // true at the beginning of every scan of the faces
  Eigen::Index probed_ = 0;
};

namespace {

using Eigen::Index;
using Eigen::Vector3d;

// A round with at most one new edge per 200 vertices ends its level.
constexpr std::size_t round_divisor = 200;
// A round with at most one new edge per 2000 vertices ends a scan of the faces.
constexpr std::size_t scan_divisor = 2000;
constexpr int max_face_scans = 4;  // maximum number of points at which a face is probed
// No other scan follows one with a smaller fraction of inaccurate faces.
constexpr double min_inaccurate_fraction = 1e-3;
constexpr int max_final_rounds = 60;  // rounds at the tolerance; remaining errors are reported
// Fraction of the bound that is permitted at probed points, as a reserve for the points in between.
constexpr double probed_fraction_of_bound = 0.7;

}  // namespace

Refinement::Refinement(const Design& design, const SurfaceInterpolator& on_surface,
                       const SurfaceProber& prober, const RefineOptions& options)
    : source_(design),
      on_surface_(on_surface),
      prober_(prober),
      options_(options),
      mesh_(design.triangles, design.vertices.rows()) {}

double Refinement::tolerance() const { return probed_fraction_of_bound * options_.resolution; }

double Refinement::length(const std::array<int, 2>& ends) const {
  return (knot(ends[0]).point - knot(ends[1]).point).norm();
}

Span Refinement::span(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return edge_span(on_surface_, knot(a), knot(b));
}

bool Refinement::is_open(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return knot(a).is_cut && knot(b).is_cut && length({a, b}) > 2.0 * options_.floor;
}

/// Returns a number -0.5 .. 0.5 that depends on the edge alone, so that no feed is commensurable
/// with the points.
double Refinement::jitter(int edge) const {
  const auto [a, b] = mesh_.ends(edge);
  return split_mix::unit(split_mix::mixed(std::uint64_t(a) << 32 | std::uint64_t(b))) - 0.5;
}

/// Returns the fraction of an edge at which it is probed and split: at the corner between two
/// blocks of the program, otherwise such that the expected number of segments become equally long.
double Refinement::probe_fraction(int edge) const {
  constexpr int max_segments = 7;
  // The tangents of a smooth pass meet near the middle; if they do not, the edge has a corner.
  constexpr double middle_range = 0.1;
  const Span span = this->span(edge);
  const double displacement = 0.2 * jitter(edge);
  if (!span.has_one_pass || !(span.middle_deviation() > tolerance())) return 0.5 + displacement;
  const double crossing = span.tangent_crossing();
  if (std::abs(crossing - 0.5) > middle_range && crossing > 0.1 && crossing < 0.9) return crossing;
  // The error of linear interpolation is proportional to the square of the length.
  const int segments = int(
      std::min<double>(max_segments, std::ceil(std::sqrt(span.middle_deviation() / tolerance()))));
  const int segments_before = displacement > 0.0 ? (segments + 1) / 2 : segments / 2;
  return double(segments_before) / segments + 0.2 * displacement;
}

std::vector<Knot> Refinement::probe_points(const std::vector<Contact>& contacts,
                                           std::vector<std::uint8_t> judged) {
  Design design = design_from_points(contacts);
  design.judged = std::move(judged);
  probed_ += design.vertices.rows();
  const SurfaceProbe result = prober_(design);
  std::vector<Knot> knots(contacts.size());
  tbb::parallel_for(std::size_t(0), contacts.size(), [&](std::size_t i) {
    const auto v = Index(i);
    const auto& [surface, gradients] = result;
    const bool is_cut = surface.status[i] == VertexStatus::Cut;
    knots[i] = {contacts[i].point,     contacts[i].normal,  gradients.gradient.row(v),
                surface.residual[v],   gradients.travel[v], is_cut,
                surface.cut_time_s[v], surface.cut_line[i], surface.status[i],
                contacts[i].face};
  });
  return knots;
}

/// Probes edges at the given positions.
void Refinement::probe(const std::vector<int>& edges, const std::vector<ProbePosition>& positions,
                       std::vector<EdgeProbe>& probes) {
  std::vector<Contact> contacts(positions.size());
  tbb::parallel_for(std::size_t(0), positions.size(), [&](std::size_t k) {
    const auto [a, b] = mesh_.ends(edges[positions[k].edge]);
    contacts[k] = point_between(on_surface_, knot(a), knot(b), positions[k].u);
  });
  std::vector<Knot> results = probe_points(contacts);
  for (std::size_t k = 0; k < positions.size(); ++k) {
    const auto [a, b] = mesh_.ends(edges[positions[k].edge]);
    const double u = positions[k].u;
    const double error =
        results[k].is_cut
            ? std::abs(results[k].residual - interpolate_linearly(knot(a), knot(b), u))
            : std::numeric_limits<double>::infinity();
    EdgeProbe& probe_result = probes[positions[k].edge];
    const bool is_better_crest = positions[k].is_crest && results[k].is_cut && error > tolerance();
    if (is_better_crest || probe_result.u == 0.0 || error > probe_result.error)
      probe_result = {u, std::move(results[k]), std::max(error, probe_result.error)};
  }
}

/// Returns true if another pass begins between two points and is relevant at the tolerance.
bool Refinement::crosses_passes(const Knot& a, const Knot& b) const {
  const Span span = edge_span(on_surface_, a, b);
  return !span.has_one_pass && span.max_deviation() > 0.5 * tolerance();
}

/// Returns true if the slopes at the ends of an edge indicate an error above the level or, across
/// passes, above half of the tolerance.
bool Refinement::is_doubtful(int edge, double level) const {
  const Span span = this->span(edge);
  return span.max_deviation() > (span.has_one_pass ? level : 0.5 * tolerance());
}

/// Returns the errors of the edges. They are probed near their middle; near their quarters, if the
/// middle shows no error but the slopes at the ends or the passes leave a doubt; and where two
/// passes cross.
std::vector<EdgeProbe> Refinement::probe_edges(const std::vector<int>& edges) {
  std::vector<EdgeProbe> probes(edges.size());
  std::vector<ProbePosition> middles, quarters, crests;
  for (std::size_t i = 0; i < edges.size(); ++i) middles.push_back({i, probe_fraction(edges[i])});
  probe(edges, middles, probes);
  std::vector<std::optional<double>> crests_of_edges(edges.size());
  std::vector<char> is_doubtful_edge(edges.size(), 0), has_many_passes(edges.size(), 0);
  tbb::parallel_for(std::size_t(0), edges.size(), [&](std::size_t i) {
    const auto [a, b] = mesh_.ends(edges[i]);
    const Span span = this->span(edges[i]);
    if (!span.has_one_pass)
      crests_of_edges[i] = crest_fraction(on_surface_, knot(a), knot(b), probes[i]);
    has_many_passes[i] = !span.has_one_pass && probes[i].knot.is_cut &&
                         crosses_passes(knot(a), probes[i].knot) &&
                         crosses_passes(probes[i].knot, knot(b));
    is_doubtful_edge[i] = probes[i].error <= tolerance() && !crests_of_edges[i] &&
                          (!span.has_one_pass || !(span.max_deviation() < tolerance()));
  });
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (crests_of_edges[i]) crests.push_back({i, *crests_of_edges[i], true});
    if (is_doubtful_edge[i])
      for (const double u : {0.26, 0.74}) quarters.push_back({i, u + 0.1 * jitter(edges[i])});
  }
  probe(edges, quarters, probes);
  probe(edges, crests, probes);
  // Across several passes a few points show that there is texture but not its height.
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (has_many_passes[i]) probes[i].error = std::numeric_limits<double>::infinity();
  return probes;
}

/// Adds the edges whose error exceeds the tolerance to the pending ones.
void Refinement::add_pending(const std::vector<int>& edges, std::vector<EdgeProbe> probes) {
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (probes[i].error > tolerance())
      pending_.push_back({edges[i], mesh_.ends(edges[i]), std::move(probes[i]), {-1, -1}});
}

/// Returns the edges that must be probed: all open ones or, unless `include_all`, only those whose
/// slopes at the ends leave a doubt.
std::vector<int> Refinement::edges_to_probe(const std::vector<int>& edges, bool include_all) const {
  std::vector<char> is_selected(edges.size());
  tbb::parallel_for(std::size_t(0), edges.size(), [&](std::size_t i) {
    is_selected[i] = is_open(edges[i]) && (include_all || !is_surely_accurate(edges[i]));
  });
  std::vector<int> result;
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (is_selected[i]) result.push_back(edges[i]);
  return result;
}

bool Refinement::is_surely_accurate(int edge) const {
  const Span span = this->span(edge);
  return span.has_one_pass && span.max_deviation() < 0.5 * tolerance();
}

/// Adds edges to the pending ones regardless of their error.
void Refinement::require_split(std::vector<int> edges) {
  edges = sorted_unique(std::move(edges));
  std::vector<EdgeProbe> probes = probe_edges(edges);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    probes[i].error = std::numeric_limits<double>::infinity();
    // Marked as already tried, because a flipped edge would be required again.
    pending_.push_back(
        {edges[i], mesh_.ends(edges[i]), std::move(probes[i]), opposite_corners(edges[i])});
  }
}

Design Refinement::design() const {
  std::vector<Contact> contacts;
  for (const Knot& knot : knots_) contacts.push_back(knot.contact());
  std::vector<std::uint8_t> judged = source_.judged;
  judged.resize(contacts.size(), 1);  // vertices are added only between judged vertices
  return resampled_design(source_, contacts, mesh_.triangles(), std::move(judged));
}

Surface Refinement::surface() const {
  const auto count = Index(knots_.size());
  Surface surface{Eigen::VectorXd(count), Eigen::VectorXd(count), {}, {}};
  for (Index i = 0; i < count; ++i) {
    const Knot& knot = knots_[std::size_t(i)];
    surface.residual[i] = knot.residual;
    surface.cut_time_s[i] = knot.cut_time_s;
    surface.cut_line.push_back(knot.cut_line);
    surface.status.push_back(knot.status);
  }
  return surface;
}

/// Returns the error level to which all edges are reduced next: half of the last level or of the
/// largest pending error.
double Refinement::next_level(double level) const {
  double max_error = 0.0;
  for (const PendingEdge& pending : pending_)
    if (std::isfinite(pending.probe.error)) max_error = std::max(max_error, pending.probe.error);
  return std::max(tolerance(), 0.5 * std::min(level, max_error));
}

RefinementResult Refinement::run() {
  knots_ = probe_points(vertex_contacts(source_), source_.judged);
  std::vector<int> open_edges(std::size_t(mesh_.edges()));
  std::iota(open_edges.begin(), open_edges.end(), 0);
  const Index max_vertices = std::max(options_.points, source_.vertices.rows());
  double level = std::numeric_limits<double>::max();
  int rounds_left = max_final_rounds, face_scan = 0;
  double inaccurate_fraction = 1.0;  // of the faces when all of them were last probed
  bool is_first = true;              // the original edges may be too long to judge by their slopes
  while (true) {
    open_edges = edges_to_probe(open_edges, std::exchange(is_first, false));
    add_pending(open_edges, probe_edges(open_edges));
    if (rounds_left == 0 || Index(knots_.size()) >= max_vertices) break;
    if (options_.can_flip_edges) flip_edges(level);
    std::vector<int> new_edges = split_edges(level, max_vertices);
    const bool is_small_round = round_divisor * new_edges.size() <= knots_.size();
    // The level falls in steps to the tolerance; only there are faces probed, in rounds.
    if (level > tolerance()) {
      if (is_small_round) level = next_level(level);
    } else {
      --rounds_left;
      if (is_small_round) {
        const bool includes_all = are_all_changed_;
        const FaceSplits faces = split_faces(max_vertices, face_scan);
        new_edges.insert(new_edges.end(), faces.new_edges.begin(), faces.new_edges.end());
        if (includes_all) inaccurate_fraction = faces.inaccurate_fraction;
      }
      if (pending_.empty() && scan_divisor * new_edges.size() <= knots_.size()) {
        // The scan of the faces is complete.
        if (++face_scan == max_face_scans ||
            (face_scan > 1 && inaccurate_fraction < min_inaccurate_fraction))
          break;
        are_all_changed_ = true;
      }
    }
    open_edges = sorted_unique(std::move(new_edges));
    if (options_.progress)
      options_.progress(std::min(1.0, double(knots_.size()) / double(max_vertices)));
  }
  double reached = options_.resolution;
  Index unmet_edges = 0;
  for (const PendingEdge& pending : pending_) {
    reached = std::max(reached, pending.probe.error);
    if (pending.probe.error > options_.resolution) ++unmet_edges;
  }
  return {design(), surface(), reached, probed_, unmet_edges};
}

double default_resolution(double pv) {
  constexpr double fraction = 0.1, min_resolution = 5e-5;
  return std::max(min_resolution, fraction * pv);
}

RefinementResult refined(const Design& design, const SurfaceInterpolator& on_surface,
                         const SurfaceProber& prober, const RefineOptions& options) {
  require(std::isfinite(options.resolution) && options.resolution > 0 && options.floor > 0,
          "refined: resolution and floor must be positive");
  require(design.normals.rows() == design.vertices.rows(),
          "refined: expected one normal per vertex");
  return Refinement(design, on_surface, prober, options).run();
}

namespace {

// Fractions of an edge at which the flipped edge is probed.
constexpr std::array<double, 2> flip_probe_fractions = {0.31, 0.67};
// A doubtful longer edge is split first if it is more than this many times as long as the edge.
constexpr double min_length_ratio = 1.5;
// A point nearer to an edge than this fraction of its length also tests the edge.
constexpr double near_edge_fraction = 0.05;
// Permitted deviation of a parabola from its triangle, as a fraction of the tolerance.
constexpr double max_parabola_fraction = 0.8;
// Deviation of a parabola at the centroid, per sum of its deviations at the middles of the edges.
constexpr double centroid_factor = 4.0 / 9.0;
constexpr double min_thickness = 0.05;  // of a triangle after a flip: height per longest side

/// Returns the weights of the point at which a face is probed in a scan: near the middle in the
/// first, then towards each side.
std::array<double, 3> probe_weights(const std::array<int, 3>& corners, int face_scan) {
  const std::uint64_t bits = split_mix::mixed(std::uint64_t(corners[0]) << 32 | corners[1]);
  const double first = split_mix::unit(bits), second = split_mix::unit(split_mix::mixed(bits));
  if (face_scan == 0) {
    const double a = 0.3 + 0.1 * first, b = 0.3 + 0.1 * second;
    return {a, b, 1.0 - a - b};
  }
  std::array<double, 3> weights{};
  const double first_weight = 0.02 + 0.16 * first,
               second_weight = (1.0 - first_weight) * (0.2 + 0.6 * second);
  weights[std::size_t(face_scan) % 3] = first_weight;
  weights[std::size_t(face_scan + 1) % 3] = second_weight;
  weights[std::size_t(face_scan + 2) % 3] = 1.0 - first_weight - second_weight;
  return weights;
}

}  // namespace

/// Returns the longer edges of the triangles at a pending edge whose error also exceeds the level.
std::vector<int> Refinement::longer_edges(const PendingEdge& pending, double level) const {
  std::vector<int> result;
  const double own_length = length(pending.ends);
  for (const int edge : mesh_.adjacent_edges(pending.edge)) {
    const double length_ratio = length(mesh_.ends(edge)) / own_length;
    if (!is_open(edge) || !(length_ratio > 1.0)) continue;
    if (is_exceeded_near(edge, pending.probe.knot, level) ||
        (length_ratio > min_length_ratio && is_doubtful(edge, level)))
      result.push_back(edge);
  }
  return result;
}

/// Returns for each pending edge whether it can be split: its error exceeds the level, or it is a
/// longer edge in a triangle of such an edge, because the triangles at an unsplit long edge would
/// become thinner and thinner. A longer edge that seemed accurate but crosses passes is added to
/// the pending ones, and the shorter one is split later.
std::vector<char> Refinement::select_ready_edges(double level) {
  std::vector<std::vector<int>> edges_before(pending_.size());
  tbb::parallel_for(std::size_t(0), pending_.size(), [&](std::size_t i) {
    if (pending_[i].probe.error > level) edges_before[i] = longer_edges(pending_[i], level);
  });
  pending_index_.resize(mesh_.edges(), -1);
  std::vector<int> stack;
  std::vector<char> is_ready(pending_.size(), 0);
  std::vector<int> required_edges;
  for (int i = 0; i < int(pending_.size()); ++i) {
    pending_index_[std::size_t(pending_[std::size_t(i)].edge)] = i;
    if (!(pending_[std::size_t(i)].probe.error > level)) continue;
    is_ready[std::size_t(i)] = 1;
    stack.push_back(i);
  }
  while (!stack.empty()) {
    const int i = stack.back();
    stack.pop_back();
    for (const int edge : edges_before[std::size_t(i)]) {
      const int k = pending_index_[std::size_t(edge)];
      if (k >= 0 && is_ready[std::size_t(k)]) continue;
      if (k >= 0) {
        is_ready[std::size_t(k)] = 1;
        edges_before[std::size_t(k)] = longer_edges(pending_[std::size_t(k)], level);
        stack.push_back(k);
      } else {
        required_edges.push_back(edge);
        is_ready[std::size_t(i)] = 0;
      }
    }
  }
  for (const PendingEdge& pending : pending_) pending_index_[std::size_t(pending.edge)] = -1;
  require_split(std::move(required_edges));
  is_ready.resize(pending_.size(), 1);
  return is_ready;
}

/// Splits the edges that are ready, the longest first, up to a number of vertices.
/// @return the new edges
std::vector<int> Refinement::split_edges(double level, Index max_vertices) {
  // An edge that was flipped in the meantime has other ends and is probed again.
  std::erase_if(pending_, [&](const PendingEdge& pending) {
    return pending.ends != mesh_.ends(pending.edge);
  });
  const std::vector<char> is_ready = select_ready_edges(level);
  struct Candidate {
    double length;
    std::size_t pending_index;
  };
  std::vector<Candidate> order;
  for (std::size_t i = 0; i < pending_.size(); ++i)
    if (is_ready[i]) order.push_back({length(pending_[i].ends), i});
  tbb::parallel_sort(order.begin(), order.end(), [](const Candidate& a, const Candidate& b) {
    return a.length != b.length ? a.length > b.length : a.pending_index < b.pending_index;
  });
  const Index remaining_vertices = std::max<Index>(0, max_vertices - Index(knots_.size()));
  if (Index(order.size()) > remaining_vertices) order.resize(std::size_t(remaining_vertices));
  std::vector<int> new_edges;
  // Only one edge of a triangle per round, because the others may be flipped instead of split.
  std::vector<char> is_used(options_.can_flip_edges ? mesh_.faces() : 0, 0);
  const auto use_faces = [&](int edge) {
    if (is_used.empty()) return true;
    const std::array<int, 2> faces = mesh_.faces_at(edge);
    for (const int face : faces)
      if (face >= 0 && face < int(is_used.size()) && is_used[std::size_t(face)]) return false;
    for (const int face : faces)
      if (face >= 0 && face < int(is_used.size())) is_used[std::size_t(face)] = 1;
    return true;
  };
  for (const auto& [length, i] : order) {
    if (pending_[i].ends != mesh_.ends(pending_[i].edge)) continue;  // it was pending twice
    if (!use_faces(pending_[i].edge)) continue;
    knots_.push_back(std::move(pending_[i].probe.knot));
    const std::vector<int> edges_at_vertex = mesh_.split_edge(pending_[i].edge);
    mark_changed(edges_at_vertex);
    new_edges.insert(new_edges.end(), edges_at_vertex.begin(), edges_at_vertex.end());
    pending_[i].ends = {-1, -1};
  }
  std::erase_if(pending_, [](const PendingEdge& pending) { return pending.ends[0] < 0; });
  return new_edges;
}

/// Returns true if the residual at a point near an edge shows that the error of the edge exceeds a
/// level, although the points at which the edge was probed do not.
bool Refinement::is_exceeded_near(int edge, const Knot& sample, double level) const {
  if (!sample.is_cut) return false;
  const auto [a, b] = mesh_.ends(edge);
  const Vector3d direction = knot(b).point - knot(a).point, offset = sample.point - knot(a).point;
  const double u = direction.dot(offset) / direction.squaredNorm();
  if ((offset - u * direction).norm() > near_edge_fraction * direction.norm()) return false;
  return u > 0.0 && u < 1.0 &&
         std::abs(sample.residual - interpolate_linearly(knot(a), knot(b), u)) > level;
}

/// Returns the corners of the two triangles at an edge that are not its ends; -1 at a rim.
std::array<int, 2> Refinement::opposite_corners(int edge) const {
  const std::array<int, 4> quad = mesh_.quad(edge);
  return {quad[2], quad[3]};
}

/// Returns true if the edge can be flipped without a thin or inverted triangle.
bool Refinement::can_flip(int edge) const {
  if (!mesh_.can_flip(edge)) return false;
  const auto [a, b, c, d] = mesh_.quad(edge);
  for (const int v : {a, b, c, d})
    if (!knot(v).is_cut) return false;
  const Vector3d normal = knot(a).normal + knot(b).normal + knot(c).normal + knot(d).normal;
  // Signed height of a triangle divided by its longest side.
  const auto thickness = [&](int p, int q, int r) {
    const Vector3d pq = knot(q).point - knot(p).point, pr = knot(r).point - knot(p).point;
    return pq.cross(pr).dot(normal.normalized()) /
           std::max({pq.squaredNorm(), pr.squaredNorm(), (pq - pr).squaredNorm()});
  };
  return thickness(c, d, b) > min_thickness && thickness(d, c, a) > min_thickness;
}

/// Returns the error of the other diagonal of a pending edge at two points; empty if the diagonal
/// is longer and leaves its pass, because then two points do not suffice.
std::optional<EdgeProbe> Refinement::flipped_probe(const PendingEdge& pending,
                                                   std::span<Knot> results) const {
  const Knot &c = knot(pending.tried_diagonal[0]), &d = knot(pending.tried_diagonal[1]);
  const double length = this->length(pending.tried_diagonal);
  bool has_one_pass = true;
  EdgeProbe worst;
  for (std::size_t k = 0; k < flip_probe_fractions.size(); ++k) {
    const double u = flip_probe_fractions[k];
    if (!results[k].is_cut) return std::nullopt;
    for (const Knot* end : {&c, &d})
      has_one_pass = has_one_pass && are_on_one_pass(*end, results[k], length);
    const double error = std::abs(results[k].residual - interpolate_linearly(c, d, u));
    if (worst.u == 0.0 || error > worst.error) worst = {u, results[k], error};
  }
  if (!has_one_pass && !(length < this->length(pending.ends))) return std::nullopt;
  return worst;
}

/// Flips pending edges whose error exceeds a level if the error of the other diagonal is less than
/// half of it, so that triangles extend along the feed. Each flip halves the error, so the flips
/// end.
void Refinement::flip_edges(double level) {
  std::vector<std::size_t> candidates;
  std::vector<Contact> contacts;
  for (std::size_t i = 0; i < pending_.size(); ++i) {
    PendingEdge& pending = pending_[i];
    if (!(pending.probe.error > level) || pending.ends != mesh_.ends(pending.edge)) continue;
    const std::array<int, 2> corners = opposite_corners(pending.edge);
    if (corners == pending.tried_diagonal) continue;
    pending.tried_diagonal = corners;
    if (!can_flip(pending.edge)) continue;
    candidates.push_back(i);
    for (const double u : flip_probe_fractions)
      contacts.push_back(point_between(on_surface_, knot(corners[0]), knot(corners[1]), u));
  }
  std::vector<Knot> results = probe_points(contacts);
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    PendingEdge& pending = pending_[candidates[k]];
    if (opposite_corners(pending.edge) != pending.tried_diagonal || !can_flip(pending.edge))
      continue;
    std::optional<EdgeProbe> flipped = flipped_probe(pending, std::span(results).subspan(2 * k, 2));
    if (!flipped || !(flipped->error < 0.5 * pending.probe.error)) continue;
    mesh_.flip(pending.edge);
    mark_changed({pending.edge});
    pending = {pending.edge, mesh_.ends(pending.edge), std::move(*flipped),
               opposite_corners(pending.edge)};
  }
  std::erase_if(pending_,
                [&](const PendingEdge& pending) { return !(pending.probe.error > tolerance()); });
}

/// Marks the faces at edges for probing.
void Refinement::mark_changed(const std::vector<int>& edges) {
  if (are_all_changed_) return;
  for (const int edge : edges)
    for (const int face : mesh_.faces_at(edge))
      if (face >= 0) changed_.push_back(face);
}

/// Returns the changed faces that are large enough, and clears the list of changes.
std::vector<int> Refinement::take_changed_faces() {
  std::vector<int> changed = sorted_unique(std::exchange(changed_, {}));
  if (std::exchange(are_all_changed_, false)) {
    changed.resize(std::size_t(mesh_.faces()));
    std::iota(changed.begin(), changed.end(), 0);
  }
  std::vector<char> is_selected(changed.size());
  tbb::parallel_for(std::size_t(0), changed.size(), [&](std::size_t i) {
    const std::array<int, 3> corners = mesh_.corners(changed[i]);
    is_selected[i] = 1;
    for (std::size_t k = 0; k < 3; ++k)
      if (!knot(corners[k]).is_cut ||
          !(length({corners[k], corners[(k + 1) % 3]}) > 2.0 * options_.floor))
        is_selected[i] = 0;
  });
  std::vector<int> faces;
  for (std::size_t i = 0; i < changed.size(); ++i)
    if (is_selected[i]) faces.push_back(changed[i]);
  return faces;
}

/// Returns true if one tool pass has cut the corners of a face and their slopes and values agree
/// with a parabola that is near enough to the face.
bool Refinement::is_near_parabola(const std::array<int, 3>& corners) const {
  double deviation = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Knot &a = knot(corners[k]), &b = knot(corners[(k + 1) % 3]);
    const Vector3d chord = b.point - a.point;
    if (!are_on_one_pass(a, b, chord.norm())) return false;
    const Span span{a.residual, b.residual, -a.gradient.dot(chord), -b.gradient.dot(chord), true};
    deviation += centroid_factor * span.middle_deviation() + span.max_parabola_deviation();
  }
  return deviation < max_parabola_fraction * tolerance();
}

/// Returns the point at which a face is probed in a scan; not doubtful if no probe is needed.
Refinement::FaceProbe Refinement::face_probe(int face, int face_scan) const {
  const std::array<int, 3> corners = mesh_.corners(face);
  if (!options_.probe_all_triangles && is_near_parabola(corners)) return {};
  const std::array<double, 3> weights = probe_weights(corners, face_scan);
  std::array<Contact, 3> corner_contacts;
  for (std::size_t k = 0; k < 3; ++k) corner_contacts[k] = knot(corners[k]).contact();
  FaceProbe result{face, on_surface_(corner_contacts, weights)};
  for (std::size_t k = 0; k < 3; ++k)
    result.linear_residual += weights[k] * knot(corners[k]).residual;
  for (const int corner : corners) {
    const Vector3d offset = result.contact.point - knot(corner).point;
    const double tangent_residual = knot(corner).residual - knot(corner).gradient.dot(offset);
    const bool is_close = std::abs(tangent_residual - result.linear_residual) < tolerance();
    result.is_doubtful = result.is_doubtful || !is_close;
  }
  return result;
}

/// Splits faces with too large an error at the probed point; if the point is near a side with the
/// same error, the side is split instead.
Refinement::FaceSplits Refinement::split_faces(Index max_vertices, int face_scan) {
  const std::vector<int> faces = take_changed_faces();
  std::vector<FaceProbe> probes(faces.size());
  tbb::parallel_for(std::size_t(0), faces.size(),
                    [&](std::size_t i) { probes[i] = face_probe(faces[i], face_scan); });
  std::erase_if(probes, [](const FaceProbe& probe) { return !probe.is_doubtful; });
  std::vector<Contact> contacts;
  for (const FaceProbe& probe : probes) contacts.push_back(probe.contact);
  std::vector<Knot> results = probe_points(contacts);
  FaceSplits result;
  std::vector<int> inaccurate_sides;
  std::size_t exceeded_count = 0;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const double error = std::abs(results[i].residual - probes[i].linear_residual);
    if (!results[i].is_cut || !(error > tolerance())) continue;
    ++exceeded_count;
    if (Index(knots_.size()) >= max_vertices) break;
    const std::array<int, 3> sides = mesh_.face_edges(probes[i].face);
    const auto side = std::find_if(sides.begin(), sides.end(), [&](int edge) {
      return is_open(edge) && is_exceeded_near(edge, results[i], tolerance());
    });
    if (side != sides.end()) {
      inaccurate_sides.push_back(*side);
      continue;
    }
    knots_.push_back(std::move(results[i]));
    const std::vector<int> edges_at_vertex = mesh_.split_face(probes[i].face);
    mark_changed(edges_at_vertex);
    result.new_edges.insert(result.new_edges.end(), edges_at_vertex.begin(), edges_at_vertex.end());
  }
  require_split(std::move(inaccurate_sides));
  result.inaccurate_fraction = double(exceeded_count) / std::max<double>(1.0, double(faces.size()));
  return result;
}

}  // namespace abbe::cutting
