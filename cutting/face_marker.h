#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cutting/face_marks.h"
#include "cutting/mesh_source.h"

namespace abbe::cutting {

/// Collects the marks of faces while a file is read.
class FaceMarker {
 public:
  static constexpr std::size_t max_names = 1'000'000;

  /// @param source  must outlive the marker
  explicit FaceMarker(const MeshSource& source) : source_(source) {}

  /// Number of a set of names. @throws BadInput if the sets have more than `max_names`
  int set_of(const std::vector<std::string>& names);
  /// Marks the faces from the last that has a mark up to the `count`th.
  void mark(std::size_t count, const FaceMark& mark);
  const FaceMarks& marks() const { return marks_; }

 private:
  const MeshSource& source_;
  FaceMarks marks_;
  std::size_t names_ = 0;
  std::map<std::vector<std::string>, int> sets_;
  std::map<FaceMark, int> numbers_;
};

/// The colour of all corners of a face, if they agree.
/// @param colours  of the vertices; none at all: no vertex has one
std::optional<FaceColour> colour_of_corners(const std::vector<std::optional<FaceColour>>& colours,
                                            const std::vector<int>& corners);

}  // namespace abbe::cutting
