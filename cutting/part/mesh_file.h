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

/// The common parts of the mesh readers: the file in memory, its tokens, the marks of its faces,
/// and the triangles as they are written.
namespace abbe::cutting {

/// A mesh file in memory, and its limits. Errors name it.
struct MeshSource {
  std::string name;
  std::string bytes;
  std::int64_t max_triangles;

  /// Throws an input error.
  /// @throws BadInput at this line and column; 0 if the file is binary
  [[noreturn]] void refuse(const std::string& expected, const std::string& seen, int line = 0,
                           int column = 0) const;
  /// @throws BadInput if the count exceeds `max_triangles`
  void check_triangles(std::int64_t count) const;
};

/// Reads a file into memory.
/// @throws BadInput if it is not a regular file, is empty, too long or unreadable
MeshSource mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                       std::int64_t max_triangles);

/// Returns the text with A .. Z in lower case.
std::string lower(std::string_view text);

/// A token of a text file and its location, counted from 1.
struct Word {
  std::string_view text;  ///< empty at the end of the file
  int line = 1;
  int column = 1;
};

/// The tokens of a mesh file in text form, in order; a comment from `comment` (none if zero) to the
/// end of the line is skipped. Errors name the location.
class Words {
 public:
  /// @param offset, line  where to begin, and the number of that line
  Words(const MeshSource& source, char comment, std::size_t offset = 0, int line = 1);

  /// Returns the next token of the file.
  Word next();
  /// Returns the next token of this line; empty at its end.
  Word next_in_line();
  /// Returns the text from the next token of this line to its last, including the blanks between.
  Word rest_of_line();
  void skip_line();
  bool at_end();
  std::size_t offset() const { return at_; }
  int line() const { return line_; }
  std::size_t bytes_left() const { return text_.size() - at_; }

  // All following functions throw BadInput if the token is not as expected.
  void expect(std::string_view keyword, const Word& seen) const;  ///< in upper or lower case
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

  /// @param source  must outlive the collector
  explicit FaceMarkCollector(const MeshSource& source) : source_(source) {}

  /// Returns the number of a set of names.
  /// @throws BadInput if the sets have more than `max_names` in total
  int set_of(const std::vector<std::string>& names);
  /// Marks the faces after the last marked one up to the `count`th.
  void mark(std::size_t count, const FaceMark& mark);
  const FaceMarks& marks() const { return marks_; }

 private:
  const MeshSource& source_;
  FaceMarks marks_;
  std::size_t names_ = 0;
  std::map<std::vector<std::string>, int> sets_;
  std::map<FaceMark, int> numbers_;
};

/// Returns the colour of all corners of a face if they agree.
/// @param colours  of the vertices; empty: no vertex has one
std::optional<FaceColour> common_corner_colour(
    const std::vector<std::optional<FaceColour>>& colours, const std::vector<int>& corners);

/// Returns a polygon in space as triangles on its corners, with the same orientation. Corners are
/// cut off one by one, always the one with the shortest cut among those that are convex and contain
/// no other corner, seen along the polygon's mean normal; hence a quadrilateral is split along its
/// shorter diagonal that lies inside. The polygon need be neither convex nor flat. Returns nothing
/// if the outline crosses itself or has no area.
/// @param corners  (n >= 3)
std::vector<std::array<int, 3>> triangulated(const std::vector<Eigen::Vector3d>& corners);

/// Triangles as they are in a file. Operations on a soup keep the order of the triangles, so that
/// its marks, which `merged` and `drop_unused_points` do not copy, remain valid.
struct TriangleSoup {
  using Face = std::array<int, 3>;
  std::vector<Eigen::Vector3d> points;
  std::vector<Face> faces;
  std::vector<int> line;  ///< (faces) line of each; empty if the file is binary
  FaceMarks marks;        ///< the requested ones
};

/// A face of a file: its corners and its line, 0 in a binary file.
struct Polygon {
  std::vector<int> corners;
  int line = 0;
};
inline constexpr int max_corners = 1000;  ///< per face

/// Adds a face as triangles; a triangle is added as it is.
/// @throws BadInput if the face has no area, its outline crosses itself, or the limit of triangles
///         is exceeded
TriangleSoup with_face(TriangleSoup soup, Polygon face, const MeshSource& source);

/// Returns the soup with corners at equal points merged to one vertex, in the order of first use.
TriangleSoup merged(const TriangleSoup& soup);

/// Returns the soup with only the points that a face uses, in their order.
TriangleSoup drop_unused_points(const TriangleSoup& soup);

/// Returns "(x, y, z)" with six digits.
std::string place_text(const Eigen::Vector3d& p);

}  // namespace abbe::cutting
