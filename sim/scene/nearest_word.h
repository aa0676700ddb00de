#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace abbe::sim {

/// The candidate with the least edit distance, if it is near enough to be meant.
std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates);

/// Letters to insert, delete or replace to make one word of the other (Levenshtein 1966).
int edit_distance(std::string_view a, std::string_view b);

}  // namespace abbe::sim
