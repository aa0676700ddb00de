#pragma once

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"

namespace abbe::cutting {

/// mm^2: variance, in one direction, of the weights of the filter of a cut-off.
double gaussian_variance(double cutoff);

/// Values that carry a filtered one, if `density` (1/mm^2) of equal weight lie everywhere around
/// it: (sum of weights)^2 / sum of squared weights.
double filter_values(double cutoff, double density);

/// A form that fewer values carry has no slope: with them it is their weighted mean.
inline constexpr double min_filter_values = 10.0;

/// Returns true if one value in each triangle of a design suffices for that.
bool resolves_form(const Design& design, double cutoff);

/// (n) mm: the residual through an areal Gaussian filter on the surface (ISO 16610-61), its form;
/// NaN where not cut. A wave of the length of the cut-off passes by half, one of half that length
/// by 6.25 %, one of twice by 84 %. The weight of a vertex, and of a place
/// within a triangle where the map has them, is its area (`weights`) times exp(-pi (d / (alpha
/// cutoff))^2), alpha^2 = ln 2 / pi, d the straight distance (over an arc of radius R short of the
/// way along it by d^2 / 24 R^2 of d), to 0.65 cut-offs at least. Only vertices of the same smooth
/// patch whose normals do not oppose count. A plane is fitted with these weights (Gaussian
/// regression of first order, ISO/TS 16610-28), so a slope passes whole at a rim too; where fewer
/// than `min_filter_values` carry the value, or all lie to one side of it by three of their
/// spreads, it is the weighted mean (order zero). Never outside the range of the values within
/// reach. Vertices are put together in cells of a twelfth of the cut-off: transmission is within
/// 0.5 % of the exact one for waves longer than half the cut-off.
/// @param cutoff  mm, > 0
/// @throws std::invalid_argument if sizes differ or the cut-off is not positive and finite
Eigen::VectorXd gaussian_form(const Design& design, const Surface& surface, double cutoff);

}  // namespace abbe::cutting
