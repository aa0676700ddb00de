#pragma once

#include <vector>

#include "cutting/mesh.h"
#include "cutting/rivals.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

/// What the functions that find the machined surface at vertices are given.
namespace abbe::cutting {

/// @throws std::invalid_argument as milled_surface
void check_milled(const Design& design, const Cutter& cutter, const CutterMotion& motion,
                  double band);

/// The design alone.
/// @throws std::invalid_argument as milled_surface
void check_design(const Design& design);

/// The design and the band only: nose and motion are checked where they are taken up.
/// @throws std::invalid_argument as turned_surface
void check_turned(const Design& design, double band);

/// @throws std::invalid_argument as milled_rivals
void check_rivals(const RivalOptions& options);

bool is_judged(const Design& design, Eigen::Index vertex);

/// The judged vertices along a space-filling curve, so that neighbours in the order have
/// neighbouring removals.
std::vector<Eigen::Index> judged_in_order(const Design& design);

}  // namespace abbe::cutting
