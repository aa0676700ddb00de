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

namespace abbe::cutting {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (n x 3)
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (m x 3)

struct Segment {
  Eigen::Vector3d a, b;
};

/// mm from a point to the nearest one of a segment.
double distance(const Eigen::Vector3d& p, const Segment& s);

/// Segments by the cells of a cubic grid that they pass, so that only near ones are tried.
class SegmentGrid {
 public:
  /// @param cell  mm, > 0; radii that are asked for must not exceed it
  SegmentGrid(std::vector<Segment> segments, double cell);

  /// Whether a segment comes nearer to the point than `radius`.
  bool is_within(const Eigen::Vector3d& p, double radius) const;

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& c) const;
  };
  Cell cell_of(const Eigen::Vector3d& p) const;

  std::vector<Segment> segments_;
  double cell_;
  std::unordered_map<Cell, std::vector<std::size_t>, Hash> cells_;
};

/// The design surface that carries the residual: where, along which normal, for how much area.
struct Design {
  Points vertices;       ///< (n x 3) mm
  Points normals;        ///< (n x 3) unit, outward
  Triangles triangles;   ///< (m x 3) counter-clockwise seen from outside
  Eigen::VectorXd area;  ///< (n) mm^2, a third of the triangles around (the weight of a vertex)
  Eigen::VectorXd facet_error;  ///< (n) mm, estimated sag between mesh and smooth surface; 0 for
                                ///< surfaces that are known, declared or recognised
  std::vector<std::uint8_t> judged;  ///< (n) 0 where the scene leaves the vertex out (status 2)
  std::vector<int> face;             ///< (n) the recognised face of each, -1: none; empty: no faces
  std::vector<int> group;  ///< (n) the group of all triangles at the vertex; empty: no groups
  /// Vertices at one place, within the tolerance of recognition, that a border between groups or
  /// between faces of a smooth patch parts: no edge of the part.
  std::vector<std::array<int, 2>> seams;
};

/// The design moved: vertices and normals by T.
Design transformed(const Design& design, const Eigen::Isometry3d& T);

/// (n) mm^2, a third of the triangles around each vertex.
Eigen::VectorXd vertex_area(const Points& vertices, const Triangles& triangles);

/// (n x 3) unit: the normals of the triangles around each vertex, weighted by the angle at it. Zero
/// where no triangle with an area touches the vertex.
Points vertex_normals(const Points& vertices, const Triangles& triangles);

/// (n) mm, estimated sag of the edges at each vertex below the smooth surface through the vertices:
/// the largest L theta / 8 over its edges, L the length, theta the angle between the normals at the
/// two ends (an arc of radius L / theta). On a sphere meshed by equal triangles the middle of a
/// triangle sags 4/3 of that. At a sharp edge of the part it says how much a rounding would take
/// away.
Eigen::VectorXd facet_error(const Points& vertices, const Points& normals,
                            const Triangles& triangles);

/// How well the triangles of a design follow its surface where it is judged. An edge of the part is
/// no fault of theirs: triangles that leave a vertex normal by more than 30 degrees are left out;
/// on a recognised face the surface is known between the vertices too.
struct Coarseness {
  double facet_error = 0.0;  ///< mm, the largest L theta / 8 between judged vertices
  int judged = 0;            ///< vertices
  int sharp = 0;             ///< judged vertices at a triangle left out
};
Coarseness coarseness(const Design& design);

/// What of a closed body is judged: the region that looks up.
struct JudgeTopOptions {
  double min_normal_z = 0.5;  ///< a triangle is of the top if its normal's z is at least this
  double margin = 0.0;        ///< mm, vertices nearer than this to the edge of the top are left out
  /// The edge of the top, where it is known from before the design was parted and subdivided.
  std::optional<std::vector<Segment>> rim = {};
};

/// The edge of the top: sides that a triangle of the top shares with none other. Borders between
/// groups or faces are no edge, unless vertices were added on them.
std::vector<Segment> top_rim(const Design& design, double min_normal_z);

/// The same design with `judged` = 0 at every vertex that is not inside the top: one that touches a
/// triangle which is not of the top (so the rim itself is out) or lies within the margin of the
/// rim. Vertices that were not judged before stay so.
/// @throws std::invalid_argument if an option is not finite or the margin is negative
Design judge_top(const Design& design, const JudgeTopOptions& options = {});

/// The side of a triangle from one of its corners to the next.
struct TriangleSide {
  int low, high;  ///< vertices
  int triangle, corner;
  bool same_edge(const TriangleSide& other) const { return low == other.low && high == other.high; }
};

/// All sides, those of an edge next to each other: by `low`, `high`, then `triangle`. Each lower
/// vertex has a bucket first, which takes a third of the time of a sort.
/// @param triangles  (m x 3)
std::vector<TriangleSide> sides_of(const Triangles& triangles);

/// (n) mm, about how far what facets and normals show between the vertices (`smooth_facet_point`)
/// may be off the surface that they stand for, at each vertex on no recognised face; 0 elsewhere.
/// Where the curvature is k on one side of a vertex and k' on the other, over edges L and L', the
/// middle of an edge lies off by about |k - k'| L L' / 8: facets of a fillet beside a plane, those
/// next to a rim, where normals are of one side only, or of a curve that is coarse for how it
/// bends. Within a factor of 2 of the largest error on fillets of 5 to 22.5 degrees a facet and on
/// ellipsoids (tested).
Eigen::VectorXd facet_uncertainty(const Design& design);

/// Red, green and blue, 0 .. 255.
using Rgb = std::array<int, 3>;

/// A colour as a mesh file has it.
struct FaceColour {
  /// What a channel is written with.
  enum class Digits {
    EightBits,  ///< 0 .. 255
    FiveBits,   ///< 0 .. 31
    Fraction,   ///< 0 .. 1 with any number of digits; here it is rounded to 255ths
  };
  Rgb channels = {0, 0, 0};
  Digits digits = Digits::EightBits;
  auto operator<=>(const FaceColour&) const = default;
};

/// Whether a colour may have been written so. Eight bits are equal; five bits are those to which
/// the eight are cut (v / 8) or rounded (31 v / 255), since writers do either; a fraction is within
/// 1 / 255, since two digits are off by as much.
bool can_denote(const FaceColour& written, const Rgb& colour);

/// The colour on a scale of 0 .. 255: five bits are spread over it.
Rgb spread(const FaceColour& written);

/// "#rrggbb"
std::string hex_text(const Rgb& colour);
/// The colour that "#rrggbb" means, in small or large letters; none if it is another text.
std::optional<Rgb> colour_of(const std::string& hex_text);

/// What a mesh file says of a face.
struct FaceMark {
  std::vector<int> names;  ///< sets of names, of `FaceMarks`
  std::optional<FaceColour> colour;
  auto operator<=>(const FaceMark&) const = default;
};

/// What a mesh file says of its faces besides where they are.
struct FaceMarks {
  std::vector<std::vector<std::string>> names;  ///< each set once
  std::vector<FaceMark> marks;                  ///< each once
  std::vector<int> of_face;  ///< (triangles) the mark of each; empty if nobody asked
};

/// Which marks are asked for.
struct MarkSelection {
  bool groups = false;
  bool colours = false;
  bool any() const { return groups || colours; }
};

}  // namespace abbe::cutting
