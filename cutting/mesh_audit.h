#pragma once

#include <vector>

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// A triangle's edge from `from` to `to`; `across` is its third corner.
struct HalfEdge {
  int from, to, across;
};

/// All of a soup, in the order of `from`, then `to`.
std::vector<HalfEdge> half_edges(const Soup& soup);

/// Whether every edge has one triangle on either side.
bool is_closed(const std::vector<HalfEdge>& edges);

/// Refuses what is no surface: degenerate triangles, more than two at an edge or more than one fan
/// at a vertex, triangles turned both ways, a rim unless `open`, a closed body turned inside out.
/// OpenMesh must agree. Every point must be used.
/// @param edges  those of `soup`
/// @throws BadInput with the place
void audit(const MeshSource& source, const Soup& soup, const std::vector<HalfEdge>& edges,
           bool open);

}  // namespace abbe::cutting
