#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/scene/key.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// An input of which neither study nor scene says where it is.
struct WithoutCentre {
  int input;
  std::string path;
  std::optional<double> nominal;  ///< in the unit of the path, of a key below `actual`
};

/// The inputs of a study as its file states them.
struct StatedInputs {
  std::vector<Input> inputs;
  std::vector<Place> places;  ///< (inputs) where each stands
  std::vector<WithoutCentre> without_centre;
  std::vector<Correlation> correlations;
  std::vector<Unidentified> unidentified;
  std::vector<errors::Element> completion;  ///< as in Study
};

/// `[[input]]`, `[[inputs]]` and `[[correlation]]`.
/// @param scenes  of the arms; the first states centres. Empty where they were refused
StatedInputs read_inputs(TableReader& reader, const std::vector<Scene>& scenes);

/// Returns the number that a scene states at a path of --set, as it is written, in the unit of the
/// path's key; none if it states no number there.
std::optional<double> stated_number(const Scene& scene, const std::string& path);

/// Keys of one `[[input]]`, of `[[inputs]]`, of `[[correlation]]`.
std::vector<Key> one_input_keys();
std::vector<Key> many_inputs_keys();
std::vector<Key> correlation_keys();

}  // namespace abbe::sim::study
