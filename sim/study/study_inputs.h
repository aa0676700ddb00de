#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/element.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Standard deviations of coefficients that a belief does not contain, from `unidentified` of
/// `[[inputs]]`. The k-th order or harmonic of an element has 1/k of its value.
struct Priors {
  bool typical = false;                  ///< true: each coefficient has its `typical_deviation`
  std::map<std::string, double> spread;  ///< by element, such as "EY0A"; um or urad
};

/// Inputs of a study that represent a belief: the coefficients that it contains, with its
/// covariance, and the others, with their priors.
struct BeliefInputs {
  std::vector<Input> inputs;
  Eigen::MatrixXd covariance;  ///< (inputs x inputs) um, urad; a coefficient with a prior
                               ///< correlates with those that hide it
  std::vector<UnidentifiedCoefficient> unidentified;
  std::vector<errors::Element> completion;  ///< elements at zero that the scene lacks
};

/// Returns the inputs of a belief. The coefficients that it does not contain are those that its
/// file lists as unidentified, and orders 1 and 2 of the curves that an identification of this
/// machine can find and the belief lacks (the k-th order with 1/k of the spread). Coefficients that
/// only place the workpiece are excluded.
/// @param scene  scene whose errors are the belief
/// @throws std::invalid_argument if the priors name an element that the belief contains
BeliefInputs belief_inputs(const Scene& scene, const Priors& priors);

/// An input whose centre neither the study nor the scene states.
struct MissingCentre {
  int input;
  std::string path;
  std::optional<double> nominal;  ///< in the unit of the path, for a key below `actual`
};

/// Inputs of a study as its file declares them.
struct DeclaredInputs {
  std::vector<Input> inputs;
  std::vector<SourcePosition> locations;  ///< (inputs) locations in the file
  std::vector<MissingCentre> missing_centres;
  std::vector<Correlation> correlations;
  std::vector<UnidentifiedCoefficient> unidentified;
  std::vector<errors::Element> completion;  ///< as in Study
};

/// Reads `[[input]]`, `[[inputs]]` and `[[correlation]]`.
/// @param scenes  of the configurations, of which the first one states centres; empty if they have
/// input errors
DeclaredInputs read_inputs(TableReader& reader, const std::vector<Scene>& scenes);

/// Returns the number that a scene states at a --set path, in the unit of the path's key; empty if
/// it states no number there.
std::optional<double> scene_number(const Scene& scene, const std::string& path);

/// Return the keys of one `[[input]]`, of `[[inputs]]` and of `[[correlation]]`.
std::vector<Key> single_input_keys();
std::vector<Key> input_group_keys();
std::vector<Key> correlation_keys();

}  // namespace abbe::sim::study
