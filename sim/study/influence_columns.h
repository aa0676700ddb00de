#pragma once

#include <vector>

#include "errors/geometric.h"
#include "sim/study/base_run.h"
#include "sim/study/influence.h"

/// What inputs do to the rivals of a base run: columns of slope and shift of its influence map.
namespace abbe::sim::study {

/// Of some inputs, lying as in the map.
struct Columns {
  Eigen::MatrixXd slope;  ///< (inputs x rivals) mm per unit of the input
  Eigen::MatrixXd shift;  ///< (inputs x rivals) the same, across the pass
};

/// What a unit of an input adds to the deviations of the joints: a difference of two models that
/// hold nothing but the elements that it touches. Curves are linear in their numbers, so it is
/// exact for those.
struct GeometricInput {
  Eigen::Index input = 0;
  errors::GeometricModel with;
  errors::GeometricModel without;
  double per_unit = 1.0;
};

/// An input that acts through elements of the geometric errors only, on axes that are commanded the
/// same whatever it is; none of any other kind.
/// @param scenes  scenes_around it
std::optional<GeometricInput> geometric_input(const BaseRun& run, Eigen::Index input,
                                              const std::array<Scene, 2>& scenes);

/// The columns of all geometric inputs at once, by the Jacobian of the chain.
Columns geometric_columns(const BaseRun& run, const std::vector<GeometricInput>& inputs);

/// The column of any other input: the difference of the machines at `scenes_around`, the one's tool
/// against the other's where rivals need it, and how far the one's tool is larger than the other's.
/// With compliance, each is cut for its own forces.
/// @throws BadInput where a machine cannot cut the program, or its samples are not those of others
Columns difference_columns(const BaseRun& run, Eigen::Index input,
                           const std::array<Scene, 2>& scenes);

/// Whether two cutters leave the same surface on the same way.
bool same_shape(const cutting::Cutter& a, const cutting::Cutter& b);

}  // namespace abbe::sim::study
