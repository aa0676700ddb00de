#include "sim/report/line_trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "kinematics/require.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using EdgeOfMesh = std::pair<int, int>;  // vertices, the lower first

/// Where a plane crosses an edge.
struct TraceNode {
  Vector3d point;
  double residual;
};

/// A plane square to x or y.
struct CrossPlane {
  int across;
  double level;

  bool below(const cutting::Design& design, int vertex) const {
    return design.vertices(vertex, across) < level;
  }
};

/// A section: its nodes, which of them a triangle joins, and the triangles.
struct MeshSection {
  std::map<EdgeOfMesh, TraceNode> nodes;
  std::map<EdgeOfMesh, std::vector<EdgeOfMesh>> joined;
  std::vector<Index> triangles;
};

CrossPlane plane_of(const cutting::Design& design, TracedLine line) {
  if (line == TracedLine::Radius) return {1, 0.0};
  const int across = line == TracedLine::X ? 1 : 0;
  const auto column = design.vertices.col(across);
  return {across, 0.5 * (column.minCoeff() + column.maxCoeff())};
}

TraceNode node_on(const TracedMap& map, const CrossPlane& plane, const EdgeOfMesh& edge) {
  const auto& [a, b] = edge;
  const auto& vertices = map.design.vertices;
  const double p = vertices(a, plane.across) - plane.level;
  const double q = vertices(b, plane.across) - plane.level;
  const double u = p / (p - q);
  return {(1.0 - u) * vertices.row(a) + u * vertices.row(b),
          (1.0 - u) * map.residual[a] + u * map.residual[b]};
}

MeshSection section_of(const TracedMap& map, const CrossPlane& plane) {
  MeshSection section;
  for (Index t = 0; t < map.design.triangles.rows(); ++t) {
    std::vector<EdgeOfMesh> ends;
    for (int k = 0; k < 3; ++k) {
      const int a = map.design.triangles(t, k), b = map.design.triangles(t, (k + 1) % 3);
      if (plane.below(map.design, a) != plane.below(map.design, b))
        ends.emplace_back(std::min(a, b), std::max(a, b));
    }
    if (ends.size() != 2) continue;
    const std::array<TraceNode, 2> nodes = {node_on(map, plane, ends[0]),
                                            node_on(map, plane, ends[1])};
    if (!std::isfinite(nodes[0].residual) || !std::isfinite(nodes[1].residual)) continue;
    for (std::size_t k = 0; k < 2; ++k) {
      section.nodes.emplace(ends[k], nodes[k]);
      section.joined[ends[k]].push_back(ends[1 - k]);
    }
    section.triangles.push_back(t);
  }
  return section;
}

using NodeChain = std::vector<TraceNode>;

/// Walks from an edge along edges that were not walked over.
NodeChain walked(MeshSection& section, EdgeOfMesh at) {
  NodeChain chain{section.nodes.at(at)};
  while (true) {
    std::vector<EdgeOfMesh>& ways = section.joined.at(at);
    if (ways.empty()) return chain;
    const EdgeOfMesh next = ways.back();
    ways.pop_back();
    std::vector<EdgeOfMesh>& back = section.joined.at(next);
    back.erase(std::find(back.begin(), back.end(), at));
    at = next;
    chain.push_back(section.nodes.at(at));
  }
}

/// @param axis  along which a closed one begins lowest
std::vector<NodeChain> chains_of(MeshSection section, int axis) {
  std::vector<NodeChain> chains;
  for (const auto& [edge, node] : section.nodes)
    if (section.joined.at(edge).size() == 1) chains.push_back(walked(section, edge));
  for (const auto& [edge, node] : section.nodes) {
    if (section.joined.at(edge).empty()) continue;
    NodeChain ring = walked(section, edge);
    ring.pop_back();  // it comes back to where it began
    std::rotate(ring.begin(),
                std::min_element(ring.begin(), ring.end(),
                                 [&](const TraceNode& a, const TraceNode& b) {
                                   return a.point[axis] < b.point[axis];
                                 }),
                ring.end());
    ring.push_back(ring.front());
    chains.push_back(std::move(ring));
  }
  return chains;
}

/// The parts of a chain on the side of x >= 0.
std::vector<NodeChain> outwards(const NodeChain& chain) {
  std::vector<NodeChain> parts(1);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (i > 0 && (chain[i - 1].point.x() < 0.0) != (chain[i].point.x() < 0.0)) {
      const double p = chain[i - 1].point.x(), q = chain[i].point.x(), u = p / (p - q);
      const TraceNode axis{(1.0 - u) * chain[i - 1].point + u * chain[i].point,
                           std::lerp(chain[i - 1].residual, chain[i].residual, u)};
      parts.back().push_back(axis);
      if (q < 0.0) parts.emplace_back();
    }
    if (chain[i].point.x() >= 0.0) parts.back().push_back(chain[i]);
  }
  return parts;
}

/// Without places that coincide.
NodeChain distinct_nodes(const NodeChain& chain) {
  constexpr double same = 1e-9;  // mm
  NodeChain kept;
  for (const TraceNode& node : chain)
    if (kept.empty() || (node.point - kept.back().point).norm() > same) kept.push_back(node);
  return kept;
}

double chain_length(const NodeChain& chain) {
  double length = 0.0;
  for (std::size_t i = 1; i < chain.size(); ++i)
    length += (chain[i].point - chain[i - 1].point).norm();
  return length;
}

std::optional<LineTrace::Between> between_of(const TracedMap& map,
                                             const std::vector<Index>& triangles) {
  LineTrace::Between found;
  double squares = 0.0;
  for (const Index t : triangles) {
    if (map.within.size() == 0 || !std::isfinite(map.within[t])) continue;
    const std::array<double, 3> share = cutting::place_within(map.looked_within, t);
    double linear = 0.0;
    for (int k = 0; k < 3; ++k)
      linear += share[std::size_t(k)] * map.residual[map.design.triangles(t, k)];
    const double off = map.within[t] - linear;
    if (!std::isfinite(off)) continue;
    ++found.places;
    squares += off * off;
    found.worst = std::max(found.worst, std::abs(off));
  }
  if (found.places == 0) return std::nullopt;
  found.rms = std::sqrt(squares / found.places);
  return found;
}

LineTrace trace_of(const NodeChain& chain, TracedLine line) {
  const auto n = Index(chain.size());
  LineTrace trace;
  trace.s = trace.along = trace.residual = Eigen::VectorXd(n);
  trace.points.resize(n, 3);
  for (Index i = 0; i < n; ++i) {
    const TraceNode& node = chain[std::size_t(i)];
    const double step = i > 0 ? (node.point - chain[std::size_t(i) - 1].point).norm() : 0.0;
    trace.s[i] = i > 0 ? trace.s[i - 1] + step : 0.0;
    trace.points.row(i) = node.point;
    trace.along[i] = line == TracedLine::Y        ? node.point.y()
                     : line == TracedLine::Radius ? node.point.head<2>().norm()
                                                  : node.point.x();
    trace.residual[i] = node.residual;
    trace.widest_spacing = std::max(trace.widest_spacing, step);
  }
  trace.mean_spacing = trace.s[n - 1] / double(n - 1);
  return trace;
}

}  // namespace

TracedLine traced_line(const std::string& word) {
  if (word == "x") return TracedLine::X;
  if (word == "y") return TracedLine::Y;
  require(word == "radius", "traced_line: expected x, y or radius");
  return TracedLine::Radius;
}

std::optional<LineTrace> line_trace(const TracedMap& map, TracedLine line) {
  require(map.residual.size() == map.design.vertices.rows() &&
              (map.within.size() == 0 || map.within.size() == map.design.triangles.rows()),
          "line_trace: sizes differ");
  const CrossPlane plane = plane_of(map.design, line);
  const int axis = line == TracedLine::Y ? 1 : 0;
  const MeshSection section = section_of(map, plane);
  std::vector<NodeChain> chains;
  for (const NodeChain& whole : chains_of(section, axis)) {
    const std::vector<NodeChain> parts =
        line == TracedLine::Radius ? outwards(whole) : std::vector<NodeChain>{whole};
    for (const NodeChain& part : parts)
      if (NodeChain chain = distinct_nodes(part); chain.size() >= 2)
        chains.push_back(std::move(chain));
  }
  if (chains.empty()) return std::nullopt;
  double all = 0.0;
  for (const NodeChain& chain : chains) all += chain_length(chain);
  const auto longest = std::max_element(
      chains.begin(), chains.end(),
      [](const NodeChain& a, const NodeChain& b) { return chain_length(a) < chain_length(b); });
  const double length = chain_length(*longest);
  if (longest->front().point[axis] > longest->back().point[axis])
    std::reverse(longest->begin(), longest->end());
  LineTrace trace = trace_of(*longest, line);
  trace.stretches = int(chains.size());
  trace.left_out = std::max(0.0, all - length);
  trace.between = between_of(map, section.triangles);
  return trace;
}

}  // namespace abbe::sim
