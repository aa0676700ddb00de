#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cutting/gouge.h"
#include "cutting/sweep_tree.h"

/// Removals as what is reported of them: a place, an instant and a line of the program.
namespace abbe::cutting {

inline constexpr std::size_t first_cut_block = 512;  ///< vertices that share their hints

FirstCut cut_of(const Removal& removal, const CutterMotion& motion);

/// The moves of each convex part of a cutter. @param motion  outlives them
std::vector<SweepTree> sweep_trees(const Cutter& cutter, const CutterMotion& motion);

/// First cut of one ray alone, whatever was asked before, by any of the parts: of equal ones the
/// earliest.
std::optional<FirstCut> first_cut(std::span<const SweepTree> trees, const CutterMotion& motion,
                                  const Ray& ray);

/// First cuts along the normals, from -band on. @param vertices  beside each other: as
/// `judged_in_order`. @return (vertices)
std::vector<std::optional<FirstCut>> first_cuts(std::span<const SweepTree> trees,
                                                const CutterMotion& motion, const Design& design,
                                                std::span<const Eigen::Index> vertices,
                                                double band);

/// A surface before anything is cut of it. @param judged  its vertices; the others are Outside
Surface nothing_cut(const Design& design, std::span<const Eigen::Index> judged);

/// Keeps the cut of a vertex that is Cut or Uncut so far if it comes before what is known; one at
/// -band makes it Gouged.
void keep_first(Surface& surface, Eigen::Index vertex, const FirstCut& cut, double band);

}  // namespace abbe::cutting
