#pragma once

#include <set>
#include <string>

#include "sim/scene/fields.h"
#include "sim/study/study.h"

/// The keys of a study file.
namespace abbe::sim::study {

inline constexpr std::int64_t max_cases = 10'000'000;  ///< their answers are kept in memory
inline constexpr std::size_t max_inputs = 2000;
inline constexpr std::size_t max_sweeps = 1000;

/// `engine`, `seed`, `proofs`
const Fields<Study>& engine_fields();
/// How an input varies; centre and spread of what is left out are those of the start.
const Fields<Distribution>& distribution_fields();
/// `of` and `limits`, `responses` before them
const Fields<Study>& response_fields();
/// `[one_at_a_time]` to `[histories]`; they ask for the inputs of the study.
const Fields<Study>& question_fields();

/// Every key of a study.
std::vector<Key> study_keys();

std::set<std::string> input_names(const std::vector<Input>& inputs);
/// Index of the input that a key names; a name that no input has is refused.
int input_named(TableReader& reader, const std::string& key, const std::vector<Input>& inputs);
/// A name that is not known, with the one that may be meant.
std::string with_suggestion(const std::string& name, const std::set<std::string>& known);

}  // namespace abbe::sim::study
