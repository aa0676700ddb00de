#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

/// The design surface as a mesh: vertices with normals, weights, groups and faces, the selection of
/// the judged region, and the marks of faces in a mesh file.
namespace abbe::cutting {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (n x 3)
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (m x 3)

/// A straight segment between two points, mm.
struct Segment {
  Eigen::Vector3d a, b;
};

/// Returns the distance from a point to the nearest point of a segment, mm.
double distance(const Eigen::Vector3d& point, const Segment& segment);

/// Segments sorted into the cells of a cubic grid, so that a query tests only nearby segments.
class SegmentGrid {
 public:
  /// @param cell  mm, > 0; an upper limit for the radii of queries
  SegmentGrid(std::vector<Segment> segments, double cell);

  /// Returns true if a segment is nearer to the point than `radius`.
  bool is_within(const Eigen::Vector3d& point, double radius) const;

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& c) const;
  };
  Cell cell_of(const Eigen::Vector3d& point) const;

  std::vector<Segment> segments_;
  double cell_;
  std::unordered_map<Cell, std::vector<std::size_t>, Hash> cells_;
};

/// The design surface that carries the residual: points, their normals and the areas they
/// represent.
struct Design {
  Points vertices;              ///< (n x 3) mm
  Points normals;               ///< (n x 3) unit, outward
  Triangles triangles;          ///< (m x 3) counter-clockwise seen from outside
  Eigen::VectorXd area;         ///< (n) mm^2, a third of the area around a vertex; its weight
  Eigen::VectorXd facet_error;  ///< (n) mm, estimated sag between mesh and smooth surface; 0 where
                                ///< the surface is known, i.e. declared or recognised
  std::vector<std::uint8_t> judged;  ///< (n) 0 if the scene excludes the vertex (status 2)
  std::vector<int> face;   ///< (n) recognised face of each vertex, -1: none; empty: no faces
  std::vector<int> group;  ///< (n) group of all triangles at the vertex; empty: no groups
  /// Pairs of vertices at the same point, within the tolerance of recognition, that are separated
  /// by a border between groups or between faces of a smooth patch. Such a border is not an edge of
  /// the part.
  std::vector<std::array<int, 2>> seams;
};

/// Returns the design with vertices and normals transformed by T.
Design transformed(const Design& design, const Eigen::Isometry3d& T);

/// Returns the cross product of two sides of a triangle: its outward normal times twice its area.
Eigen::Vector3d triangle_cross_product(const Points& vertices, const Triangles& triangles,
                                       Eigen::Index t);

/// Returns (n) a third of the area of the triangles around each vertex, mm^2.
Eigen::VectorXd vertex_area(const Points& vertices, const Triangles& triangles);

/// Returns (n x 3) unit normals: the mean of the normals of the triangles around each vertex,
/// weighted by their angles there. Zero if all triangles at the vertex have zero area.
Points vertex_normals(const Points& vertices, const Triangles& triangles);

/// Returns (n) the estimated sag of the edges at each vertex below the smooth surface through the
/// vertices, mm: the maximum of L theta / 8 over its edges, where L is the length and theta the
/// angle between the normals at the two ends (an arc of radius L / theta). On a sphere meshed with
/// equal triangles the sag at the middle of a triangle is 4/3 of that. At a sharp edge of the part
/// it is the amount that a rounding would remove.
Eigen::VectorXd facet_error(const Points& vertices, const Points& normals,
                            const Triangles& triangles);

/// Deviation of the triangles of a design from its surface in the judged region. Triangles that
/// deviate from a vertex normal by more than 30 degrees are excluded, because an edge of the part
/// is not an error of the mesh. Triangles of a recognised face are excluded, because its surface is
/// also known between the vertices.
struct Coarseness {
  double max_facet_error = 0.0;     ///< mm, maximum of L theta / 8 between judged vertices
  int judged_vertices = 0;          ///< number of judged vertices
  int vertices_at_sharp_edges = 0;  ///< number of judged vertices at an excluded triangle
};
/// Returns the coarseness of a design.
Coarseness coarseness(const Design& design);

/// Definition of the judged region of a closed body: its upward-facing top.
struct JudgeTopOptions {
  double min_normal_z = 0.5;  ///< minimum z component of the normal of a triangle of the top
  double margin = 0.0;        ///< mm; vertices nearer to the edge of the top are excluded
  /// The edge of the top, if it was determined before the design was split or subdivided.
  std::optional<std::vector<Segment>> rim = {};
};

/// Returns the edge of the top: sides of triangles of the top that no other triangle of the top
/// shares. Borders between groups or faces are not included, unless vertices were added on them.
std::vector<Segment> top_rim(const Design& design, double min_normal_z);

/// Returns the design with `judged` = 0 at every vertex that is not inside the top: vertices that
/// touch a triangle outside the top (hence the rim itself) or lie within the margin of the rim.
/// Vertices that were not judged before remain excluded.
/// @throws std::invalid_argument if an option is not finite or the margin is negative
Design judge_top(const Design& design, const JudgeTopOptions& options = {});

/// The side of a triangle from one of its corners to the next.
struct TriangleSide {
  int low, high;  ///< vertices
  int triangle, corner;
  bool same_edge(const TriangleSide& other) const { return low == other.low && high == other.high; }
};

/// Returns all sides, sorted by `low`, `high`, then `triangle`, so that sides of the same edge are
/// adjacent. A first pass sorts them into a bucket for each lower vertex, which takes a third of
/// the time of a full sort.
/// @param triangles  (m x 3)
std::vector<TriangleSide> triangle_sides(const Triangles& triangles);

/// Returns (n) the estimated deviation of the interpolation between vertices (`smooth_facet_point`)
/// from the true surface, mm, at each vertex that lies on no recognised face; 0 at the others. If
/// the curvature is k on one side of a vertex and k' on the other, over edges L and L', the error
/// at the middle of an edge is about |k - k'| L L' / 8. It is large for facets of a fillet next to
/// a plane, for facets at a rim, whose normals come from one side only, and for a curved surface
/// with a coarse mesh. In tests on fillets of 5 to 22.5 degrees per facet and on ellipsoids, the
/// estimate is within a factor of 2 of the largest error.
Eigen::VectorXd facet_uncertainty(const Design& design);

/// Red, green and blue, 0 .. 255.
using Rgb = std::array<int, 3>;

/// A colour as written in a mesh file.
struct FaceColour {
  /// The number format of a channel.
  enum class ChannelFormat {
    EightBits,  ///< 0 .. 255
    FiveBits,   ///< 0 .. 31
    Fraction,   ///< 0 .. 1 with any number of digits; stored rounded to 255ths
  };
  Rgb channels = {0, 0, 0};
  ChannelFormat channel_format = ChannelFormat::EightBits;
  auto operator<=>(const FaceColour&) const = default;
};

/// Returns true if the colour may have been written in this form. Eight-bit channels must match
/// exactly. A five-bit channel must be the eight-bit value v either truncated (v / 8) or rounded
/// (31 v / 255), since writers use both. A fraction must be within 1 / 255, which is the error of
/// two digits.
bool can_denote(const FaceColour& written, const Rgb& colour);

/// Returns the colour on a scale of 0 .. 255; five bits are scaled to the whole range.
Rgb to_eight_bits(const FaceColour& written);

/// Returns "#rrggbb".
std::string hex_text(const Rgb& colour);
/// Returns the colour of "#rrggbb", in upper or lower case; empty for any other text.
std::optional<Rgb> parse_hex_colour(const std::string& hex_text);

/// The marks of a face in a mesh file.
struct FaceMark {
  std::vector<int> name_set_indices;  ///< indices of the sets of names in `FaceMarks`
  std::optional<FaceColour> colour;
  auto operator<=>(const FaceMark&) const = default;
};

/// The marks of all faces of a mesh file.
struct FaceMarks {
  std::vector<std::vector<std::string>> name_sets;  ///< distinct sets of names
  std::vector<FaceMark> marks;                      ///< distinct marks
  std::vector<int> mark_of_face;  ///< (triangles) index of the mark of each; empty if no marks were
                                  ///< requested
};

/// The requested kinds of marks.
struct MarkSelection {
  bool groups = false;
  bool colours = false;
  bool any() const { return groups || colours; }
};

}  // namespace abbe::cutting
