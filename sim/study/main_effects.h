#pragma once

#include <Eigen/Core>

namespace abbe::sim::study {

/// Share of the variance of answers that each input makes alone, as far as a line and a parabola of
/// the input follow them: a main effect, the first-order index of Sobol for answers of that shape.
/// Answers that are even in an input, as the PV of a map often is, have no correlation with it, and
/// their parabola shows. What chance gives on the average is taken off.
/// Source: Saltelli et al. 2008, section 1.2 (first-order effects), Ezekiel 1930 (adjustment of
/// R^2).
/// @param inputs   (inputs x cases)
/// @param answers  (cases) finite
/// @return (inputs) within 0 .. 1; zero for fewer than 10 cases, where answers or an input do not
///         vary
Eigen::VectorXd main_effects(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& answers);

/// The largest main effect that chance alone gives any of so many inputs in 95 % of all studies,
/// exact for normal answers.
double chance_effect(Eigen::Index cases, Eigen::Index inputs);

}  // namespace abbe::sim::study
