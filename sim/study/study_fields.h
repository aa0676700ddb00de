#pragma once

#include <set>
#include <string>

#include "sim/scene/fields.h"
#include "sim/study/study.h"

/// Keys of a study file.
namespace abbe::sim::study {

inline constexpr std::int64_t max_cases = 10'000'000;  ///< all responses are held in memory
inline constexpr std::size_t max_inputs = 2000;
inline constexpr std::size_t max_sweeps = 1000;

/// Returns the keys `engine`, `seed` and `proofs`.
const Fields<Study>& engine_fields();
/// Returns the keys of a distribution; a missing centre or spread keeps its initial value.
const Fields<Distribution>& distribution_fields();
/// Returns the keys `responses`, `of` and `limits`.
const Fields<Study>& response_fields();
/// Returns the keys of the tables of analyses, `[one_at_a_time]` to `[histories]`. The inputs of
/// the study must have been read.
const Fields<Study>& analysis_fields();

/// Returns all keys of a study, for the schema and `abbe explain`.
std::vector<Key> study_keys();

std::set<std::string> input_names(const std::vector<Input>& inputs);
/// Returns the index of the input that a key names; an unknown name is an input error.
int read_input_index(TableReader& reader, const std::string& key, const std::vector<Input>& inputs);
/// Returns an unknown name in quotes, with the nearest known name as a suggestion.
std::string with_suggestion(const std::string& name, const std::set<std::string>& known_names);

}  // namespace abbe::sim::study
