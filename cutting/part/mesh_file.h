#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::cutting {

/// A mesh file in memory, and how much it may hold. Refusals name it.
struct MeshSource {
  std::string name;
  std::string bytes;
  std::int64_t max_triangles;

  /// @throws BadInput at this line and column, 0 where the file is binary
  [[noreturn]] void refuse(const std::string& expected, const std::string& seen, int line = 0,
                           int column = 0) const;
  /// @throws BadInput if there are more than `max_triangles`
  void check_triangles(std::int64_t count) const;
};

/// @throws BadInput if there is no such regular file, or it is empty, too long or unreadable
MeshSource mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                       std::int64_t max_triangles);

/// The same text with A .. Z made small.
std::string lower(std::string_view text);

/// A word of a text file and where it stands, from 1.
struct Word {
  std::string_view text;  ///< empty at the end of the file
  int line = 1;
  int column = 1;
};

/// The words of a mesh file that is text, one after another; from `comment` (none if it is zero) to
/// the end of the line is passed over. Refusals name the place.
class Words {
 public:
  /// @param offset, line  where to begin, and the number of that line
  Words(const MeshSource& source, char comment, std::size_t offset = 0, int line = 1);

  /// The next word of the file.
  Word next();
  /// The next word of this line; empty at its end.
  Word next_in_line();
  /// From the next word of this line to its last, with the blanks between them.
  Word rest_of_line();
  void skip_line();
  bool at_end();
  std::size_t offset() const { return at_; }
  int line() const { return line_; }
  std::size_t bytes_left() const { return text_.size() - at_; }

  // All that follow throw BadInput where the word is another one.
  void expect(std::string_view keyword, const Word& seen) const;  ///< in small or large letters
  void expect(std::string_view keyword) { expect(keyword, next()); }
  double number(const Word& word) const;  ///< finite
  double number() { return number(next()); }
  Eigen::Vector3d point();  ///< the next three numbers
  std::int64_t integer(const Word& word, std::int64_t least, std::int64_t most,
                       const std::string& what) const;
  [[noreturn]] void refuse(const std::string& expected, const Word& seen) const;

 private:
  void skip(bool over_lines);
  Word take();

  const MeshSource& source_;
  std::string_view text_;
  std::size_t at_;
  std::size_t line_start_ = 0;
  int line_;
  char comment_;
};

/// Collects the marks of faces while a file is read.
class FaceMarkCollector {
 public:
  static constexpr std::size_t max_names = 1'000'000;

  /// @param source  must outlive the marker
  explicit FaceMarkCollector(const MeshSource& source) : source_(source) {}

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
std::optional<FaceColour> common_corner_colour(
    const std::vector<std::optional<FaceColour>>& colours, const std::vector<int>& corners);

/// A polygon in space as triangles on its corners, turned as it is turned. Corner after corner is
/// cut off, always the one whose cut is shortest of those that bulge and hold no other corner, seen
/// along the polygon's mean normal: so a quadrilateral is split along its shorter diagonal that
/// lies inside. It need be neither convex nor flat. Empty if its outline crosses itself or has no
/// area.
/// @param corners  (n >= 3)
std::vector<std::array<int, 3>> triangulated(const std::vector<Eigen::Vector3d>& corners);

/// Triangles as a file has them. What is done to a soup keeps their order, so that its marks, which
/// `merged` and `drop_unused_points` leave behind, stand for theirs.
struct TriangleSoup {
  using Face = std::array<int, 3>;
  std::vector<Eigen::Vector3d> points;
  std::vector<Face> faces;
  std::vector<int> line;  ///< of every face, empty if the file is binary
  FaceMarks marks;        ///< those that were asked for
};

/// A face of a file: its corners, and the line on which it stands, 0 in a binary file.
struct Polygon {
  std::vector<int> corners;
  int line = 0;
};
inline constexpr int max_corners = 1000;  ///< of a face

/// Adds a face as triangles; a triangle is taken as it is.
/// @throws BadInput if the face has no area, its outline crosses itself, or it is one too many
TriangleSoup with_face(TriangleSoup soup, Polygon face, const MeshSource& source);

/// Corners at equal points made one vertex, in the order of their first use.
TriangleSoup merged(const TriangleSoup& soup);

/// Only the points that a face uses, in their order.
TriangleSoup drop_unused_points(const TriangleSoup& soup);

/// "(x, y, z)" in six digits.
std::string place_text(const Eigen::Vector3d& p);

}  // namespace abbe::cutting
