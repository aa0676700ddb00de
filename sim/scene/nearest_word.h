#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace abbe::sim {

/// The candidate that begins with the word, else that with the least edit distance, if it is near
/// enough to be meant.
std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates);

/// Letters to insert, delete or replace to make one word of the other (Levenshtein 1966).
int edit_distance(std::string_view a, std::string_view b);

/// "no file a/b.stl (nearest: \"c.stl\")", of the files in its folder.
std::string no_file(const std::filesystem::path& file);

}  // namespace abbe::sim
