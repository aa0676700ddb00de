#pragma once

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"

/// The areal Gaussian filter that separates form from texture.
namespace abbe::cutting {

/// Returns the variance, in one direction, of the weights of the filter for a cut-off (mm), mm^2.
double gaussian_variance(double cutoff);

/// Returns the effective number of values in a filtered value if values of equal weight lie
/// everywhere around it with `density` (1/mm^2): (sum of weights)^2 / sum of squared weights.
double filter_values(double cutoff, double density);

/// Smallest effective number of values for which a slope is fitted; with fewer the form is their
/// weighted mean.
inline constexpr double min_filter_values = 10.0;

/// Returns true if one value in each triangle of a design suffices for the slope to be fitted.
bool resolves_form(const Design& design, double cutoff);

/// Returns (n) the form: the residual after an areal Gaussian filter on the surface (ISO 16610-61),
/// mm; NaN where not cut. A wave whose length is the cut-off is transmitted by half, one of half
/// that length by 6.25 %, one of twice that length by 84 %.
/// The weight of a vertex, and of a sample within a triangle if the map has them, is its area
/// (`weights`) times exp(-pi (d / (alpha cutoff))^2), alpha^2 = ln 2 / pi, where d is the straight
/// distance (shorter than the distance along an arc of radius R by d^2 / 24 R^2 of d), up to 0.65
/// cut-offs at least. Only vertices of the same smooth patch count whose normals do not oppose.
/// A plane is fitted with these weights (Gaussian regression of first order, ISO/TS 16610-28), so
/// that a slope is transmitted completely at a rim too. If the effective number of values is below
/// `min_filter_values`, or if all lie to one side by three of their spreads, the form is the
/// weighted mean (order zero). It is never outside the range of the values within reach.
/// Vertices are combined in cells of a twelfth of the cut-off: the transmission is within 0.5 % of
/// the exact one for waves longer than half the cut-off.
/// @param cutoff  mm, > 0
/// @throws std::invalid_argument if sizes differ or the cut-off is not positive and finite
Eigen::VectorXd gaussian_form(const Design& design, const Surface& surface, double cutoff);

}  // namespace abbe::cutting
