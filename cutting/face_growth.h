#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cutting/grown_faces.h"

namespace abbe::cutting {

/// The work of `grown_faces`: which triangles are on which face, and how one grows.
class FaceGrowth {
 public:
  FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance);

  /// Triangles and their vertices.
  struct Region {
    std::vector<int> triangles, vertices;
  };
  Region region(std::vector<int> triangles);

  /// The first surface of these forms that fits a region and grows to a face from it is taken.
  struct Tried {
    bool is_taken = false;
    std::vector<int> reached;  ///< triangles, the most that a surface came to that is no face
  };
  Tried grow(std::span<const Form> forms, const Region& region);

  /// What a region covers when it has grown as far as its surface goes, and whether that is a face.
  struct Grown {
    GrownFace face;
    bool is_face = false;
    std::vector<int> reached;  ///< triangles, while the surface was not well known too
  };
  Grown grown(RecognisedPatch surface, Region region);
  /// Whether there is no more time to grow what is no face: on a surface that is nearly one, but
  /// not everywhere, from each of its places the same would grow again.
  bool is_tired() const { return wasted_ > waste_; }

  void take(GrownFace face);
  /// Whether the vertices of a flat that is still open show a plane by themselves.
  std::optional<GrownFace> evident_plane(int flat);
  /// Whether a curved face runs into a flat without an edge.
  std::optional<GrownFace> tangent_plane(int flat);

  bool is_open(int t) const { return face_[std::size_t(t)] == none; }
  int open_triangles() const { return int(std::count(face_.begin(), face_.end(), none)); }
  /// Triangles in planes: each with all around it that lie in its plane.
  const std::vector<std::vector<int>>& flats() const { return flats_; }
  int flat_of(int t) const { return flat_[std::size_t(t)]; }
  /// The triangle across a side, if it is open; -1.
  int open_across(int t, int side) const;
  Eigen::Vector3d normal(int t) const { return normals_.row(t); }
  double tolerance() const { return tolerance_; }
  const Design& design() const { return design_; }
  std::vector<GrownFace> faces() && { return std::move(faces_); }

 private:
  static constexpr int none = -1, closed = -2;  // of face_
  static constexpr double sliver = 10.0;  // tolerances: what is lower has no normal of its own

  /// A side of a region that the mesh crosses smoothly.
  struct Border {
    int inside, outside;  // triangles
    int a, b, beyond;     // vertices: of the side, and of the triangle outside
    double height;        // mm, of the triangle outside over the side
  };
  std::vector<Border> borders(const Region& region);
  int beyond(int t, int a, int b) const;
  double height_over(int a, int b, int beyond) const;

  using May = std::function<bool(int triangle)>;
  Region spread(const RecognisedPatch& surface, Region region, double reach, const May& may);
  bool lies_on(const RecognisedPatch& surface, int t, double reach) const;
  void find_flats(const std::vector<char>& open);
  void stamp(const Region& region);
  void add_corners(Region& region, int t);
  std::optional<RecognisedPatch> fitted(const FacetPatch& patch, const RecognisedPatch& near) const;
  RecognisedPatch refitted(const RecognisedPatch& surface, const Region& region) const;
  bool is_face(const RecognisedPatch& surface, const Region& region);
  RecognisedPatch with_sizes(RecognisedPatch surface, const Region& region) const;
  bool bends(const Region& region) const;
  bool ends_clearly(const RecognisedPatch& surface, const FacetPatch& patch,
                    const std::vector<Border>& borders) const;
  bool turns_away(const RecognisedPatch& plane, const Region& region,
                  const std::vector<Border>& borders) const;
  bool has_normals(const Region& region) const;
  bool is_tangent(const RecognisedPatch& surface, const Border& border) const;
  int tangent_lines(const RecognisedPatch& surface, const std::vector<Border>& borders) const;
  bool is_sector(const RecognisedPatch& surface, const Region& region,
                 const std::vector<Border>& borders) const;
  double width(const RecognisedPatch& surface, const Region& region) const;
  /// What follows the facet across a border: the angle to it, and how wide it is, in mm.
  struct Onward {
    double turn = 0.0, width = 0.0;
  };
  Onward onward(const Border& border) const;
  std::optional<RecognisedPatch> plane_of_flat(const Region& region) const;
  Eigen::Vector3d vertex(int v) const { return design_.vertices.row(v); }

  const Design& design_;
  double tolerance_;
  std::vector<std::array<int, 3>> across_;
  Points normals_;          // (triangles) unit
  Eigen::VectorXd height_;  // (triangles) mm, the least
  std::vector<int> face_;   // (triangles)
  std::vector<int> flat_;   // (triangles)
  std::vector<std::vector<int>> flats_;
  std::vector<GrownFace> faces_;
  std::vector<int> stamp_, vertex_stamp_;  // the last region that they were of
  int stamped_ = 0;
  double wasted_ = 0.0, waste_;  // triangles and vertices gone over in growing what is no face
};

}  // namespace abbe::cutting
