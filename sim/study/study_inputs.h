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

/// Standard deviations of what a belief does not hold, as `unidentified` of `[[inputs]]` states
/// them; of the k-th order or harmonic of an element a k-th.
struct Priors {
  bool typical = false;                  ///< every number has its `typical_deviation`
  std::map<std::string, double> spread;  ///< "EY0A" -> um or urad
};

/// A belief as inputs of a study: what it holds by its covariance, what it does not by its priors.
struct BeliefInputs {
  std::vector<Input> inputs;
  Eigen::MatrixXd covariance;  ///< (inputs x inputs) um, urad; a number that others hide moves them
  std::vector<Unidentified> unidentified;
  std::vector<errors::Element> completion;  ///< elements that the scene lacks, at zero
};

/// What the belief does not hold is what its file names as unidentified, and every element that an
/// identification of this machine may find and the belief lacks: of a curve orders 1 and 2 (of the
/// k-th order a k-th of the spread). What only places the workpiece is none of it.
/// @param scene  whose errors are the belief
/// @throws std::invalid_argument naming an element of the priors that the belief holds
BeliefInputs belief_inputs(const Scene& scene, const Priors& priors);

/// An input of which neither study nor scene says where it is.
struct MissingCentre {
  int input;
  std::string path;
  std::optional<double> nominal;  ///< in the unit of the path, of a key below `actual`
};

/// The inputs of a study as its file states them.
struct DeclaredInputs {
  std::vector<Input> inputs;
  std::vector<Place> places;  ///< (inputs) where each stands
  std::vector<MissingCentre> missing_centres;
  std::vector<Correlation> correlations;
  std::vector<Unidentified> unidentified;
  std::vector<errors::Element> completion;  ///< as in Study
};

/// `[[input]]`, `[[inputs]]` and `[[correlation]]`.
/// @param scenes  of the arms; the first states centres. Empty where they were refused
DeclaredInputs read_inputs(TableReader& reader, const std::vector<Scene>& scenes);

/// Returns the number that a scene states at a path of --set, as it is written, in the unit of the
/// path's key; none if it states no number there.
std::optional<double> scene_number(const Scene& scene, const std::string& path);

/// Keys of one `[[input]]`, of `[[inputs]]`, of `[[correlation]]`.
std::vector<Key> one_input_keys();
std::vector<Key> many_inputs_keys();
std::vector<Key> correlation_keys();

}  // namespace abbe::sim::study
