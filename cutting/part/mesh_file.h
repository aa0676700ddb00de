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

/// Common parts of the mesh readers: the file in memory, its tokens, the marks of its faces, and
/// the triangles of the file.
namespace abbe::cutting {

/// A mesh file in memory and its limits. Input errors name the file.
struct MeshSource {
  std::string name;
  std::string bytes;
  std::int64_t max_triangles;

  /// Throws BadInput with the line and column, which are 0 if the file is binary.
  [[noreturn]] void refuse(const std::string& expected, const std::string& seen, int line = 0,
                           int column = 0) const;
  /// @throws BadInput if the count exceeds `max_triangles`
  void check_triangles(std::int64_t count) const;
};

/// Reads a file into memory.
/// @throws BadInput if the file is not a regular file, empty, too long or unreadable
MeshSource load_mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                            std::int64_t max_triangles);

/// Returns the text with A .. Z in lower case.
std::string lower(std::string_view text);

/// A token of a text file and its location, counted from 1.
struct Token {
  std::string_view text;  ///< empty at the end of the file
  int line = 1;
  int column = 1;
};

/// Reader of the tokens of a mesh file in text form. Comments, from the character `comment` (zero:
/// no comments) to the end of the line, are skipped. Input errors state the location.
class TokenReader {
 public:
  /// @param offset, line  position of the first byte to read, and the number of its line
  TokenReader(const MeshSource& source, char comment, std::size_t offset = 0, int line = 1);

  /// Returns the next token of the file.
  Token next();
  /// Returns the next token of this line; empty at its end.
  Token next_in_line();
  /// Returns the text from the next token of this line to its last one, including the blanks
  /// between them.
  Token remaining_line();
  void skip_line();
  bool at_end();
  std::size_t offset() const { return offset_; }
  int line() const { return line_; }
  std::size_t bytes_left() const { return text_.size() - offset_; }

  // The following functions throw BadInput if the token is not as expected.
  void expect(std::string_view keyword, const Token& token) const;  ///< in upper or lower case
  void expect(std::string_view keyword) { expect(keyword, next()); }
  double number(const Token& token) const;  ///< finite
  double number() { return number(next()); }
  Eigen::Vector3d point();  ///< the next three numbers
  std::int64_t integer(const Token& token, std::int64_t min, std::int64_t max,
                       const std::string& description) const;
  [[noreturn]] void refuse(const std::string& expected, const Token& token) const;

 private:
  void skip(bool across_lines);
  Token take_token();

  const MeshSource& source_;
  std::string_view text_;
  std::size_t offset_;
  std::size_t line_start_ = 0;
  int line_;
  char comment_;
};

/// Collector of the marks of faces while a file is read.
class FaceMarkCollector {
 public:
  static constexpr std::size_t max_names = 1'000'000;

  /// @param source  must outlive the collector
  explicit FaceMarkCollector(const MeshSource& source) : source_(source) {}

  /// Returns the index of a set of names in the marks, adding it if necessary.
  /// @throws BadInput if the sets have more than `max_names` in total
  int name_set_index(const std::vector<std::string>& names);
  /// Assigns a mark to all faces that have none yet, up to a total of `count` faces.
  void mark(std::size_t count, const FaceMark& mark);
  const FaceMarks& marks() const { return marks_; }

 private:
  const MeshSource& source_;
  FaceMarks marks_;
  std::size_t name_count_ = 0;
  std::map<std::vector<std::string>, int> sets_;
  std::map<FaceMark, int> numbers_;
};

/// Returns the colour of the corners of a face if all of them agree; else empty.
/// @param colours  of the vertices; empty: no vertex has a colour
std::optional<FaceColour> common_corner_colour(
    const std::vector<std::optional<FaceColour>>& colours, const std::vector<int>& corners);

/// Returns triangles on the corners of a polygon in space, with its orientation. Corners are cut
/// off one by one, seen along the polygon's mean normal: of the convex corners whose triangle
/// contains no other corner, always the one with the shortest cut. Hence a quadrilateral is split
/// along its shorter diagonal that lies inside. The polygon need be neither convex nor flat. Empty
/// if the outline crosses itself or has no area.
/// @param corners  (n >= 3)
std::vector<std::array<int, 3>> triangulate(const std::vector<Eigen::Vector3d>& corners);

/// The triangles of a file. Operations on a soup keep the order of the triangles, so that its
/// marks, which `merge_equal_points` and `drop_unused_points` do not copy, remain valid.
struct TriangleSoup {
  using Face = std::array<int, 3>;
  std::vector<Eigen::Vector3d> points;
  std::vector<Face> faces;
  std::vector<int> line;  ///< (faces) line of each; empty if the file is binary
  FaceMarks marks;        ///< the requested ones
};

/// A face of a file: its corners, and its line (0 in a binary file).
struct Polygon {
  std::vector<int> corners;
  int line = 0;
};
inline constexpr int max_corners = 1000;  ///< per face

/// Returns the soup with a polygon added as triangles; a triangle is added unchanged.
/// @throws BadInput if the polygon has no area, its outline crosses itself, or the limit of
///         triangles is exceeded
TriangleSoup append_face(TriangleSoup soup, Polygon polygon, const MeshSource& source);

/// Returns the soup with corners at equal points merged to one vertex, in the order of first use.
TriangleSoup merge_equal_points(const TriangleSoup& soup);

/// Returns the soup with only the points that a face uses, in their order.
TriangleSoup drop_unused_points(const TriangleSoup& soup);

/// Returns "(x, y, z)" with six digits.
std::string coordinates_text(const Eigen::Vector3d& p);

}  // namespace abbe::cutting
