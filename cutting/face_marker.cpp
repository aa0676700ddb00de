#include "cutting/face_marker.h"

#include <algorithm>

#include <fmt/format.h>

namespace abbe::cutting {

int FaceMarker::set_of(const std::vector<std::string>& names) {
  const auto [place, is_new] = sets_.emplace(names, int(marks_.names.size()));
  if (!is_new) return place->second;
  names_ += names.size();
  if (names_ > max_names)
    source_.refuse(fmt::format("at most {} names of groups", max_names), "more");
  marks_.names.push_back(names);
  return place->second;
}

void FaceMarker::mark(std::size_t count, const FaceMark& mark) {
  std::vector<int>& of_face = marks_.of_face;
  if (!of_face.empty() && marks_.marks[std::size_t(of_face.back())] == mark) {
    of_face.resize(count, of_face.back());  // faces of one mark stand together
    return;
  }
  const auto [place, is_new] = numbers_.emplace(mark, int(marks_.marks.size()));
  if (is_new) marks_.marks.push_back(mark);
  of_face.resize(count, place->second);
}

std::optional<FaceColour> colour_of_corners(const std::vector<std::optional<FaceColour>>& colours,
                                            const std::vector<int>& corners) {
  if (colours.empty()) return std::nullopt;
  const auto of = [&](int corner) { return colours[std::size_t(corner)]; };
  const bool agree =
      std::ranges::all_of(corners, [&](int corner) { return of(corner) == of(corners[0]); });
  return agree ? of(corners[0]) : std::nullopt;
}

}  // namespace abbe::cutting
