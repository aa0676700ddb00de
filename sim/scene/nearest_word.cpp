#include "sim/scene/nearest_word.h"

#include <algorithm>
#include <system_error>
#include <vector>

namespace abbe::sim {

int edit_distance(std::string_view a, std::string_view b) {
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = int(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = int(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row.back();
}

std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates) {
  if (word.size() > 80) return std::nullopt;
  constexpr std::size_t abbreviation = 2;
  if (word.size() >= abbreviation)
    for (const std::string& candidate : candidates)
      if (candidate.starts_with(word)) return candidate;
  std::optional<std::string> best;
  int best_distance = std::max(2, int(word.size()) / 2) + 1;
  for (const std::string& candidate : candidates) {
    const int distance = edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::string no_file(const std::filesystem::path& file) {
  constexpr std::size_t most_compared = 1000;
  namespace fs = std::filesystem;
  std::set<std::string> names;
  std::error_code failure;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator at(folder, failure), end; !failure && at != end;
       at.increment(failure)) {
    if (at->is_regular_file(failure)) names.insert(at->path().filename().string());
    if (names.size() == most_compared) break;
  }
  const auto meant = nearest(file.filename().string(), names);
  return "no file " + file.string() + (meant ? " (nearest: \"" + *meant + "\")" : "");
}

}  // namespace abbe::sim
