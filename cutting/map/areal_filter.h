#pragma once

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"

/// The areal Gaussian filter that separates form from texture.
namespace abbe::cutting {

/// Returns the effective number of values that contribute to a filtered value, for values of equal
/// weight with a uniform `density` (1/mm^2): (sum of weights)^2 / sum of squared weights.
double effective_value_count(double cutoff, double density);

/// Minimum effective number of values for which a slope is fitted; with fewer values the form is
/// their weighted mean.
inline constexpr double min_filter_values = 10.0;

/// Returns true if one value in each triangle of a design suffices to fit a slope.
bool resolves_form(const Design& design, double cutoff);

/// Returns (n) the form: the residual after an areal Gaussian filter on the surface (ISO 16610-61),
/// mm; NaN where not cut. The transmission of a wave is 50 % at the cut-off, 6.25 % at half of that
/// wavelength and 84 % at twice that wavelength.
/// The weight of a vertex, or of a sample within a triangle if the map has such samples, is its
/// area (`weights`) times exp(-pi (d / (alpha cutoff))^2), alpha^2 = ln 2 / pi. d is the straight
/// distance, which is shorter than that along an arc of radius R by the fraction d^2 / 24 R^2.
/// Values up to a distance of at least 0.65 cut-offs contribute if they belong to the same smooth
/// patch and the mean normals of their cells (see below) enclose less than 90 degrees. A plane is
/// fitted with these weights (Gaussian regression of first order, ISO/TS 16610-28), so that a slope
/// is transmitted completely, also at a rim. If the effective number of values is below
/// `min_filter_values`, or if the point is more than three standard deviations from the mean
/// position of the contributing values, the form is the weighted mean (order zero). The form is
/// always within the range of the contributing values. Values are combined in cells of a twelfth of
/// the cut-off; the transmission is within 0.5 % of the exact one for waves longer than half of the
/// cut-off.
/// @param cutoff  mm, > 0
/// @throws std::invalid_argument if sizes differ or the cut-off is not positive and finite
Eigen::VectorXd gaussian_form(const Design& design, const Surface& surface, double cutoff);

}  // namespace abbe::cutting
